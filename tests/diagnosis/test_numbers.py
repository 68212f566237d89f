"""What is reported of a finding and how sure it is: what these logs do not tell has no finite deviation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from pipelines.diagnosis.trained import parameters, told
from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Motion
from pipelines.effects.angle import Cogging
from pipelines.effects.base import Effect
from pipelines.effects.bodies import GravityTilt, Payload, TransmissionCoupling
from pipelines.effects.friction import TorqueOffset
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact, Named
from pipelines.estimation.model_fit import Refined, _by_slopes, acting, refine
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.preparation import Logs, prepare
from pipelines.io.log import Array
from tests.diagnosis.arms import hidden

INERTIA, VISCOUS, COULOMB, SHARPNESS = 0.004, 0.03, 0.2, 90.0


def _shared(one: int, other: int, motion: Motion) -> Array:
    """Coupled transmission."""
    out = np.zeros_like(motion.q)
    speed = motion.dq[:, one] + motion.dq[:, other]
    load = INERTIA * (motion.ddq[:, one] + motion.ddq[:, other]) + VISCOUS * speed + COULOMB * np.tanh(SHARPNESS * speed)
    out[:, one] = out[:, other] = load
    return out


def _fitted(joint: int) -> Refined:
    prepared = prepare(Logs((hidden(1, lambda motion: _shared(joint - 2, joint - 1, motion)),)), Recipe())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    start = TransmissionCoupling(joint=joint, sharpness=SHARPNESS)
    model = Exact.start(columns, fit).with_effect(start, np.array([0.0, 0.0, 0.1]), held=("sharpness",))
    return refine(model, prepared.data, fit.weight)


@pytest.mark.parametrize(("joint", "told"), [(3, False), (2, True)])
def test_an_inertia_that_is_a_part_of_the_links_is_not_known(joint: int, told: bool) -> None:
    """Joints 2 and 3 are parallel: what turns with both has the columns of link 3's own inertia. Joint 1 stands across."""
    done = _fitted(joint)
    found = parameters(done, 0)
    assert np.isfinite(found["inertia"].std) is np.bool_(told)
    of_model = {parameter.name: parameter.std for parameter in acting(done, 0, finite=True).parameters}
    assert (of_model["inertia"] is not None) is told
    for name, true in (("viscous", VISCOUS), ("coulomb", COULOMB), *((("inertia", INERTIA),) if told else ())):
        assert found[name].value == pytest.approx(true, abs=max(4.0 * found[name].std, 0.02 * true))
        assert 0.0 < found[name].std < 0.2 * true


def of_amplitudes(effect: Effect, amplitudes: Array, covariance: Array, revolute: Sequence[bool]) -> Acting:
    """`effect` by amplitudes and their covariance, on an arm of such joints; amplitudes of no variance were not seen."""
    std = np.sqrt(np.diag(covariance))
    steps = 1e-4 * np.maximum(np.abs(amplitudes), std)
    steps[steps == 0.0] = 1e-4
    moved = [effect.values(amplitudes + step) for step in np.diag(steps)]
    found = _by_slopes(Named(effect, tuple(amplitudes)), moved, steps, covariance, std == 0.0)
    known = {name: x for name, x in found.items() if np.isfinite(x)}
    return Acting.of(effect, effect.values(amplitudes), known, revolute=effect.joint is None or revolute[effect.joint - 1])


def spread(effect: Effect, amplitudes: Array, covariance: Array, name: str) -> float:
    """The deviation that is told of a number."""
    std = told(of_amplitudes(effect, amplitudes, covariance, (True,) * 3))[name].std
    assert isinstance(std, float)
    return std


@pytest.mark.parametrize(("x", "y", "std"), [(-0.1, -1e-4, 1e-3), (-0.1, 1e-4, 1e-3), (0.02, -0.02, 1e-3), (1e-3, 0.0, 2e-4)])
def test_a_tilt_is_as_sure_as_its_two_components(x: float, y: float, std: float) -> None:
    """Each known to σ: the angle to σ and the direction to σ over the angle, on either side of half a turn, whatever the weight of
    the first link is."""
    amplitudes, covariance = np.array([x, y, 8.0, -3.0]), np.diag([std**2, std**2, 0.01, 0.01])
    assert spread(GravityTilt(), amplitudes, covariance, "angle") == pytest.approx(std, rel=0.01)
    assert spread(GravityTilt(), amplitudes, covariance, "direction") == pytest.approx(std / np.hypot(x, y), rel=0.01)


@pytest.mark.parametrize("together", [-0.99, 0.0, 0.99])
def test_errors_that_go_together_add_up_as_they_do(together: float) -> None:
    """Sine and cosine part of a wave a and a, each known to σ, correlated by r: its amplitude is known to σ √(1 + r), its phase to
    σ √(1 - r)/(a √2)."""
    a, std = 0.3, 0.01
    covariance = std**2 * np.array([[1.0, together], [together, 1.0]])
    wave, amplitudes = Cogging(2, harmonics=1), np.array([a, a])
    assert spread(wave, amplitudes, covariance, "amplitude") == pytest.approx(std * np.sqrt(1.0 + together), rel=1e-3)
    turned = std * np.sqrt(1.0 - together) / (a * np.sqrt(2.0))
    assert spread(wave, amplitudes, covariance, "phase") == pytest.approx(turned, rel=1e-3)


def test_what_was_not_fitted_or_not_seen_has_no_deviation() -> None:
    """A wave's order is that of its shape; of harmonics that it lacks, and of amplitudes of no variance, nobody knows anything."""
    found = told(of_amplitudes(Cogging(2, harmonics=1), np.array([0.3, 0.1]), 1e-4 * np.eye(2), (True,) * 3))
    assert {name for name, one in found.items() if one.std is not None} == {"amplitude", "phase"}
    found = told(of_amplitudes(GravityTilt(), np.array([0.02, 0.01, 0.0, 0.0]), np.diag([1e-6, 1e-6, 0.0, 0.0]), (True,) * 3))
    assert {name for name, one in found.items() if one.std is not None} == {"angle", "direction"}
    load = told(of_amplitudes(Payload(), np.arange(1.0, 11.0), np.diag([0.01, 0.04, 0.0, 0.09, *[1.0] * 6]), (True,) * 3))
    assert load["first_moment"].value == (2.0, 3.0, 4.0)
    assert load["first_moment"].std == pytest.approx((0.2, np.inf, 0.3))


def test_an_offset_at_a_slide_is_a_force() -> None:
    arms = {kind: told(of_amplitudes(TorqueOffset(2), np.array([0.5]), np.array([[1e-4]]), (True, kind, True)))["offset"]
            for kind in (True, False)}
    assert {kind: one.unit for kind, one in arms.items()} == {True: "N m", False: "N"}
    assert arms[False].std == pytest.approx(0.01)

"""What is reported of a finding and how sure it is: what these logs do not tell has no finite deviation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from pipelines.diagnosis.trained import parameters, told
from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Motion
from pipelines.effects.base import Effect
from pipelines.effects.bodies import GravityTilt, TransmissionCoupling
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

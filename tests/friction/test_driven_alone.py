"""One law of one joint in one call: the curve, inertia and gravity of a machine simulated here, and slopes by complex step."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.errors import InputRejected
from pipelines.friction.fit import LawFit
from pipelines.friction.laws import OneJoint, law_named
from pipelines.friction.refine import fit_driven_alone
from pipelines.io.log import Array
from tests.friction.one_joint import (
    COSINE,
    ENCODER,
    INERTIA,
    JOINT,
    SINE,
    TRUTHS,
    driven_speeds,
    recorded,
    relative,
)
from tests.seeds import rarely


def fitted(name: str, seed: int, missing: slice = slice(0), samples: int | None = None) -> LawFit:
    log, law = recorded(name, seed), law_named(name)
    assert law is not None
    q: Array = log.q[:samples, JOINT - 1].copy()
    q[missing] = np.nan
    return fit_driven_alone(log.t[:samples], q, log.tau[:samples, JOINT - 1], OneJoint.of(log.robot, JOINT), law, ENCODER)


def curve_error(name: str, seed: int, fit: LawFit) -> float:
    speed = driven_speeds(recorded(name, seed))
    return relative(fit.curve(speed), TRUTHS[name].curve(speed))


def test_the_curve_and_the_joint_of_three_seeds() -> None:
    """Curve: median below 0.4 %, worst below 1.2 %. Inertia and gravity within 1 %."""
    fits = {seed: fitted("three_sigmoid", seed) for seed in range(3)}
    errors = [curve_error("three_sigmoid", seed, fit) for seed, fit in fits.items()]
    assert np.median(errors) <= 0.004, errors
    assert max(errors) <= 0.012, errors
    for fit in fits.values():
        apart = np.abs(np.array([fit.inertia, *fit.gravity]) - np.array([INERTIA, SINE, COSINE]))
        assert np.all(apart <= 0.01 * np.array([INERTIA, SINE, SINE])), apart


@pytest.mark.parametrize("name", [
    "stribeck", "asymmetric_friction", *rarely("coulomb+viscous", "concave_friction", "quadratic_drag")])
def test_other_laws(name: str) -> None:
    """Each true law is followed to 1.2 %."""
    assert curve_error(name, 1, fitted(name, 1)) <= 0.012


def test_samples_that_are_missing() -> None:
    """A tenth of a second without an encoder: no row uses it, and the curve is as good."""
    assert curve_error("three_sigmoid", 0, fitted("three_sigmoid", 0, slice(7000, 7100))) <= 0.012


def test_a_log_that_is_too_short() -> None:
    """A quarter of a second is refused with what to do."""
    with pytest.raises(InputRejected) as caught:
        fitted("three_sigmoid", 0, samples=250)
    assert caught.value.code == "RRID-T08"
    assert caught.value.remedy


def test_slopes_by_complex_step() -> None:
    """∂τ/∂ln w of eq. (10), by a step along the imaginary axis."""
    law = law_named("three_sigmoid")
    assert law is not None
    v = np.linspace(-3.0, 3.0, 201)
    still = np.zeros((len(v), 1))
    w, f = np.array([120.0, 60.0, 12.0]), np.array([0.4, 1.2, -0.4])
    found = law.slopes(Motion(still[:, 0], still, v[:, None], still), np.log(w), np.append(f, 0.12))
    assert found is not None
    for k in range(3):
        ahead = w.astype(complex)
        ahead[k] *= np.exp(1e-30j)
        slope = np.imag(np.tanh(np.multiply.outer(v, ahead)) @ f) / 1e-30
        np.testing.assert_allclose(found[:, k], slope, rtol=1e-9, atol=1e-12)

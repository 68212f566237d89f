"""Nobody knows by which curve the dry friction of a real joint changes its sign: no cause is found in that."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.io.log import Array, ExperimentLog
from tests.diagnose.sessions import but
from tests.diagnosis.arms import hidden
from tests.diagnosis.asking import causes, diagnosed, effects
from tests.estimation.experiments import COULOMB
from tests.healthy import begun

FEW = ("stribeck", "concave_friction")

Curve = Callable[[Array], Array]  # of speed over the width of the change of sign


def root(x: Array) -> Array:
    """Return v/√(v² + ε²)."""
    return x / np.sqrt(1.0 + x**2)


def arc_tangent(x: Array) -> Array:
    return 2.0 / np.pi * np.arctan(x)


def exponential(x: Array) -> Array:
    return np.sign(x) * (1.0 - np.exp(-np.abs(x)))


def changing_by(curve: Curve) -> Callable[[Motion], Array]:
    """Return what friction that changes its sign by `curve` has more than that of the logs."""
    return lambda motion: np.array(COULOMB) * (
        curve(100.0 * motion.dq) - np.tanh(100.0 * motion.dq)
    )


def session(curve: Curve) -> tuple[ExperimentLog, ...]:
    """Logs of an arm all of whose joints change the sign of their friction by a curve."""
    roles = ((1, "identify"), (2, "identify"), (3, "validate"))
    return tuple(hidden(seed, changing_by(curve), role) for seed, role in roles)


@pytest.mark.parametrize(
    "curve",
    [
        pytest.param(root, marks=pytest.mark.slow),
        arc_tangent,
        pytest.param(exponential, marks=pytest.mark.slow),
    ],
)
def test_an_arm_whose_friction_changes_its_sign_by_another_curve_has_no_fault(
    curve: Curve,
) -> None:
    """v/√(v² + ε²), an arc tangent and an exponential: about as steep as tanh at rest, and the same at speed."""
    found = diagnosed(*(begun(log, 4000) for log in session(curve)[1:]), exclude=but(*FEW))
    assert (found.decision.verdict, causes(found)) == ("no-fault-found", [])


@pytest.mark.slow
def test_concave_friction_is_still_found_beside_it() -> None:
    """A fifth of the dry friction levels off over 0.3 rad/s, thirty times the speed over which the rest changes its sign; how fast
    is told to two fifths, for a gradual change of sign passes for a part of it."""
    found = diagnosed(*session(lambda x: 0.8 * root(x) + 0.2 * np.tanh(x / 30.0)))
    assert causes(found)[0][0] == "concave_friction"
    assert effects(found)[0].values["speed"] == pytest.approx(0.3, rel=0.4)

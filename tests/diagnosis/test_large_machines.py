"""A gantry rubs with more newtons than a small arm's motor can give: how large a cause may be, the logs tell.

A slide of 95.1 kg with viscous friction of 203.5 N s/m and dry friction of 20.4 N, as Janot, Gautier and Brunot 2019 identified
theirs, moved exactly along sums of sines; nothing of its controller is known. Its torque is written here, apart from the library.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipelines.effects.friction import QuadraticDrag
from pipelines.estimation.candidate_columns import Wanted
from pipelines.estimation.preparation import Logs
from pipelines.io.log import Array, ExperimentLog, Signal
from tests.diagnosis.asking import answered, extended
from tests.diagnosis.slides import SLIDE

_RATE, _SECONDS = 500.0, 20.0

Load = Callable[[Array, Array], Array]  # [N] by position [m] and speed [m/s]


def slide(seed: int, role: str, load: Load) -> ExperimentLog:
    """One log, with a force noise of 1 N and steps of 1 µm."""
    rng, t = np.random.default_rng([11, seed]), np.arange(_RATE * _SECONDS) / _RATE
    w = 2.0 * np.pi * 0.1 * np.arange(1, 9)
    phases, size = rng.uniform(0.0, 2.0 * np.pi, 8), 0.14 / np.arange(1, 9)
    turn = np.outer(t, w) + phases
    q, dq, ddq = np.sin(turn) @ size, np.cos(turn) @ (size * w), -np.sin(turn) @ (size * w**2)
    tau = 95.1 * ddq + 203.5 * dq + 20.4 * np.tanh(dq / 1e-3) + load(q, dq) + rng.standard_normal(len(t))
    signals = {"t": Signal(t, "s", "time"), "q": Signal(np.round(q / 1e-6)[:, None] * 1e-6, "m", "position"),
               "tau": Signal(tau[:, None], "N", "force")}
    return ExperimentLog(f"slide-{seed}", "free", role, "measured", "slide", 1.0 / _RATE, SLIDE, signals, torque="measured")


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "number", "size", "load"), [
    ("torque_offset", "offset", -32.0, lambda q, v: np.full_like(q, -32.0)),
    ("asymmetric_friction", "coulomb_difference", 50.0, lambda q, v: 25.0 * np.abs(np.tanh(v / 1e-3))),
    ("quadratic_drag", "coefficient", 140.0, lambda q, v: 140.0 * v * np.abs(v)),
    ("cogging", "amplitude", 60.0, lambda q, v: 60.0 * np.sin(2.0 * np.pi * q / 0.02)),
    ("stribeck", "amplitude", 40.0, lambda q, v: 40.0 * np.exp(-(v / 0.06)**2) * np.tanh(v / 1e-3))])
def test_what_is_large_on_a_small_arm_has_its_name_on_a_large_one(cause: str, number: str, size: float, load: Load) -> None:
    """Not that of a cause which imitates it: an offset of 32 N passed for a base that leans by two degrees."""
    found = answered(Logs((slide(1, "identify", load), slide(2, "identify", load)), (slide(3, "validate", load),)))
    assert [one.cause for one in found.findings] == [cause]
    told = found.findings[0].parameters[number]
    assert told.std is not None
    assert told.value == pytest.approx(size, abs=max(4.0 * told.std, 0.05 * abs(size)))


def test_a_cause_that_would_have_to_push_is_refused_for_that() -> None:
    """Friction that grows less than its speed is no drag: fitted, that takes nearly all off the held-out error, with a coefficient
    below zero."""
    def less(q: Array, v: Array) -> Array:
        return -100.0 * v * np.abs(v)

    found = extended(Logs((slide(1, "identify", less),), (slide(3, "validate", less),)), Wanted(QuadraticDrag(joint=1)))
    (rejected,) = found.rejected
    assert rejected.reason.startswith("fitted exactly, its numbers are impossible: coefficient = -")
    assert rejected.reason.endswith(" N s^2/m^2")

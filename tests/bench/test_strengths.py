"""At the strength of causes.md a fault shows in the held-out torque of a fitted healthy model, or a
table says why it does not.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pytest

from bench import experiments
from bench.draw import draw_machine
from bench.faults import fault_names, find_fault, make
from bench.machine import Fault, Machine
from bench.plant import peak_torque, record
from pipelines.errors import InputRejected
from pipelines.estimation.estimate import Recipe, fit_logs, judge, motions_of
from pipelines.estimation.nominal import nominal_columns
from pipelines.estimation.observers import Reconstruction
from pipelines.io.log import ExperimentLog

DURATION = 10.0  # [s]
CHANGE = 3.0  # times the healthy residual

# Where the change stays below that on the machine and motion of this file, and why: 10 s, up to
# 4.7, 1.6 and 5.0 rad/s. The healthy residual is 29, 13 and 11 mN m rms; in brackets the change
# that was measured, in these.
INVISIBLE: dict[tuple[str, int | None], str] = {
    (
        "payload",
        None,
    ): "one session's base parameters absorb it: compare with a reference log (0.1)",
    ("rotor_inertia", 1): "a base parameter absorbs it (0.0)",
    ("rotor_inertia", 2): "a base parameter absorbs it (0.0)",
    (
        "rotor_inertia",
        3,
    ): "23 mN m rms before base parameters absorb a part of it: faster acceleration (1.6)",
    (
        "link_length",
        None,
    ): "12 mm of 200 mm, in part absorbed by base parameters: more postures (0.7)",
    (
        "encoder_eccentricity",
        1,
    ): "31 mN m rms, as much as a healthy machine leaves: faster motion (1.3)",
    (
        "encoder_eccentricity",
        2,
    ): "39 mN m rms before base parameters absorb a part of it: faster motion (1.8)",
    ("encoder_eccentricity", 3): "5 mN m rms: faster motion (0.3)",
    (
        "joint_elasticity",
        3,
    ): "grows with the fourth power of frequency, and the motion ends at 10 Hz: an FRF (1.5)",
    (
        "quadratic_drag",
        2,
    ): "37 mN m rms, and at no more than 1.6 rad/s viscous friction absorbs most (0.2)",
    ("quadratic_drag", 3): "76 mN m rms before viscous friction absorbs most: faster motion (2.3)",
    (
        "viscous_drift",
        1,
    ): "63 mN m rms about its mean, which is absorbed; 40 s of log are enough (2.6)",
    (
        "viscous_drift",
        2,
    ): "17 mN m rms about its mean, which is absorbed; 40 s of log are not enough (0.7)",
    (
        "viscous_drift",
        3,
    ): "15 mN m rms about its mean, which is absorbed; 40 s of log are not enough (0.7)",
}


@lru_cache
def machine() -> Machine:
    return draw_machine(5, "fault")


def logs(*faults: Fault) -> list[ExperimentLog]:
    """One excitation to fit, another to judge by."""
    plans = [
        experiments.excitation(machine(), 1, periods=1),
        experiments.excitation(machine(), 2, periods=1).judging(),
    ]
    return record(machine(), faults, plans, seed=3)


def held_out(
    recorded: list[ExperimentLog], cutoff_hz: float | None
) -> tuple[np.ndarray, float | None]:
    """Residual torque (3,) [N m] of base parameters, Coulomb and viscous friction, and the low-pass
    that was used.
    """
    how = Reconstruction()
    fitted = fit_logs(
        motions_of(recorded[:1], how),
        nominal_columns(machine().described, offset=False),
        Recipe(how, cutoff_hz),
    )
    return np.array(judge(fitted, motions_of(recorded[1:], how), 10).errors.rms), fitted.cutoff_hz


@lru_cache
def healthy() -> tuple[np.ndarray, float | None, tuple[float, ...]]:
    recorded = logs()
    return *held_out(recorded, None), peak_torque(recorded)


def change(name: str, joint: int | None) -> float:
    """By how many healthy residuals the residual grows, at the joint where it grows most; without
    end where the log is refused.

    A shoulder whose drive clips at 55 % of the peak cannot hold its own weight: its command stays
    at the limit.
    """
    floor, cutoff, peak = healthy()
    fault = make(name, machine(), joint, seed=4, peak_torque=peak, duration=DURATION)
    try:
        return float(np.max(held_out(logs(fault), cutoff)[0] / floor - 1.0))
    except InputRejected as refused:
        if refused.code != "RRID-D05":
            raise
        return math.inf


PLACES = [
    (name, joint)
    for name in fault_names()
    for joint in ((1, 2, 3) if find_fault(name).scope == "joint" else (None,))
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "joint"), PLACES)
def test_a_fault_shows_or_is_listed(name: str, joint: int | None) -> None:
    """Three times the healthy residual, or a reason."""
    assert (change(name, joint) >= CHANGE) == ((name, joint) not in INVISIBLE)


def test_the_table_lists_faults_that_there_are() -> None:
    assert set(INVISIBLE) <= set(PLACES)

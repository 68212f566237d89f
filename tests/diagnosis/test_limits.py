"""What is said to be detectable is: above its limit a cause that the MuJoCo plant hides is found, well below it is not."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import pytest

from bench import experiments
from bench.draw import draw_machine
from bench.faults import make
from bench.machine import Fault, Machine
from bench.plant import record
from pipelines.diagnosis.result import DetectionLimit, Diagnosis
from pipelines.effects import effect_names
from pipelines.estimation.preparation import Logs
from pipelines.io.log import ExperimentLog
from tests.diagnose.sessions import but
from tests.diagnosis.asking import answered, causes, diagnosed

FEW = but("cogging", "torque_offset", "quadratic_drag", "torque_gain")
SECONDS, NUMBER = 3.0, 7


@lru_cache(maxsize=1)
def machine() -> Machine:
    return draw_machine(NUMBER, "fault")


@lru_cache(maxsize=4)
def recorded(first: int, role: str, *faults: Fault) -> tuple[ExperimentLog, ...]:
    """Two excitations."""
    plans = [
        replace(
            experiments.excitation(machine(), first + k, SECONDS, 1),
            name=f"excitation-{first + k}",
            role=role,
        )
        for k in range(2)
    ]
    return tuple(record(machine(), faults, plans, first))


@lru_cache(maxsize=2)
def healthy(exclude: tuple[str, ...]) -> Diagnosis:
    """Return the diagnosis of an arm as it was."""
    logs = (*recorded(11, "reference"), *recorded(1, "identify"))
    return answered(Logs.by_role(logs), exclude=exclude, whole=True)


def limit(cause: str, joint: int, exclude: tuple[str, ...] = FEW) -> DetectionLimit:
    (found,) = [
        one for one in healthy(exclude).detection_limits if (one.cause, one.joint) == (cause, joint)
    ]
    return found


def named(cause: str, joint: int, part: float, exclude: tuple[str, ...] = FEW) -> bool:
    """Whether the cause is found at `part` of its limit."""
    there = limit(cause, joint, exclude)
    full = make(cause, machine(), joint, 1)
    size = full.parameters()[there.parameter]
    assert isinstance(size, float)
    assert isinstance(there.minimum.value, float)
    fault = full.scaled(part * there.minimum.value / abs(size))
    logs = (*recorded(11, "reference"), *recorded(1, "identify", fault))
    return (cause, joint) in causes(diagnosed(*logs, exclude=exclude))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "joint", "part"),
    [
        ("torque_offset", 3, 2.0),
        ("torque_offset", 3, -2.0),
        ("cogging", 2, 2.0),
        ("cogging", 2, -2.0),
    ],
)
def test_above_its_limit_a_cause_is_found(cause: str, joint: int, part: float) -> None:
    """At twice the limit, with and against what the healthy arm leaves."""
    assert named(cause, joint, part)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "joint"),
    [
        ("cogging", 1),
        ("cogging", 3),
        ("torque_offset", 2),
        ("quadratic_drag", 1),
        ("asymmetric_friction", 2),
        ("torque_gain", 3),
        ("encoder_eccentricity", 1),
    ],
)
def test_limits_hold_with_the_whole_library(cause: str, joint: int) -> None:
    assert named(cause, joint, 2.0, ())
    assert not named(cause, joint, 0.3, ())


def test_nothing_of_the_library_goes_unsaid() -> None:
    """Of each cause there is a finding, a smallest size, a record that would show it, or what was seen of it."""
    found = healthy(FEW)
    lists = (found.findings, found.baseline_effects, found.detection_limits, found.not_identifiable)
    every = {one.cause for some in (*lists, found.without_limit) for one in some}
    assert every == set(effect_names()) - set(FEW) - {"two_sigmoid"}

"""Does the torque fit the motion: logs of the virtual test bench, whose machines are in order, and the same mixed up."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from bench import experiments
from bench.draw import draw_machine
from bench.plant import record
from pipelines.estimation.checks.boundary import boundary_findings, torque_boundary
from pipelines.estimation.checks.plausibility import plausibility
from pipelines.io.log import ExperimentLog
from pipelines.quality.checks import Subject
from tests.healthy import with_signal
from tests.seeds import seeds


def alarms(log: ExperimentLog) -> list[str]:
    return [f"{c.code} {c.message}" for c in plausibility(Subject(log)) if c.level != "ok"]


@lru_cache
def reversing(seed: int, joint: int) -> ExperimentLog:
    """One joint to and fro, the others held: they sway by some thousandths of a radian."""
    machine = draw_machine(seed, "fault" if seed % 2 else "paper")
    return record(machine, [], [experiments.reversal(machine, joint, duration=3.0)], seed=10 * seed + joint)[0]


@lru_cache
def sweeping(seed: int) -> ExperimentLog:
    machine = draw_machine(seed, "paper")
    return record(machine, [], [experiments.free(machine, seed, duration=8.0)], seed=seed)[0]


@pytest.mark.parametrize("seed", seeds(10))
@pytest.mark.parametrize("joint", [pytest.param(1, marks=pytest.mark.slow), 2, pytest.param(3, marks=pytest.mark.slow)])
def test_a_joint_that_reverses_alone_is_plausible(seed: int, joint: int) -> None:
    """30 logs of 10 machines, whose held joints' torque their neighbour's motion explains better than their own."""
    assert alarms(reversing(seed, joint)) == []


@pytest.mark.parametrize("seed", seeds(3))
def test_sweeps_are_plausible(seed: int) -> None:
    assert alarms(sweeping(seed)) == []


@pytest.mark.parametrize("seed", seeds(3))
@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_swapped_torques_of_sweeps_are_named(seed: int, pair: tuple[int, int]) -> None:
    log, order = sweeping(seed), [0, 1, 2]
    order[pair[0]], order[pair[1]] = pair[1], pair[0]
    (found,) = boundary_findings(torque_boundary([with_signal(log, tau=log.tau[:, order])]), "log")
    assert found.message.startswith(f"tau: columns {pair[0] + 1},{pair[1] + 1} fit swapped")


@pytest.mark.parametrize("joint", [pytest.param(1, marks=pytest.mark.slow), 2, pytest.param(3, marks=pytest.mark.slow)])
def test_the_flipped_torque_of_a_joint_that_moves_alone_is_named(joint: int) -> None:
    log = reversing(2, joint)
    found = alarms(with_signal(log, tau=log.tau * np.where(np.arange(1, 4) == joint, -1.0, 1.0)))
    assert [one for one in found if one.startswith(f"RRID-S14 the torque of joint {joint} looks flipped")]

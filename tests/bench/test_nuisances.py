"""The imperfections of a healthy machine are small against its own noise, at every joint."""

from __future__ import annotations

import numpy as np
import pytest

from bench.draw import draw_machine, machine_of
from bench.faults.drive import Cogging, GainRipple
from bench.machine import Machine
from benchmarks.hidden_effects.robots import ROBOTS


def of_kind(machine: Machine, kind: type) -> list:
    return [fault for fault in machine.standing if isinstance(fault, kind)]


def test_the_arm_of_causes_md_has_one_millinewtonmetre_of_cogging_at_each_joint() -> None:
    assert [
        fault.amplitude for fault in of_kind(draw_machine(3, "fault"), Cogging)
    ] == pytest.approx([1e-3] * 3)


@pytest.mark.parametrize("robot", ROBOTS)
def test_no_joint_of_another_arm_cogs_beyond_a_fifth_of_its_noise(robot: str) -> None:
    machine = machine_of(ROBOTS[robot], 5)
    found = np.array([fault.amplitude for fault in of_kind(machine, Cogging)])
    assert len(found) == machine.n
    assert (found <= 0.2 * np.array(machine.amplifier_noise) + 1e-15).all()


def test_ripple_along_a_slide_turns_over_within_its_travel() -> None:
    """8 rad/m would be no ripple but a straight line over the 0.3 m that it moves."""
    machine = machine_of(ROBOTS["scara"], 5)
    travel = float(np.ptp(ROBOTS["scara"].joints[2].position))
    waves = [
        fault.order * travel / (2.0 * np.pi)
        for fault in (*of_kind(machine, GainRipple), *of_kind(machine, Cogging))
        if fault.joint == 3
    ]
    assert len(waves) == 2
    assert min(waves) > 2.0

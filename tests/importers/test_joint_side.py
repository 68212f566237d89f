"""Columns are found, and their numbers become SI on the joint side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.importers.raw import RawTable, expand
from pipelines.importers.recipe import Recipe, parse_recipe
from pipelines.importers.repair import Recording
from pipelines.importers.units import drive_of, joint_side
from pipelines.io.robot_files import load_robot
from tests.importers.good import RECIPE, Array, recording


def columns(*names: str) -> RawTable:
    return RawTable("run.csv", {name: np.zeros(20) for name in names}, np.arange(20))


def test_s01_a_missing_column_is_named_with_its_neighbour() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S01 run.csv: no column 'Joint_2', did you mean 'Joint2'\?.*--map q_2='Joint2'"):
        expand(columns("Joint_1", "Joint2", "Joint_3"), "Joint_{j}", 3, "q")


def recipe(edit: Callable[[str], str] = lambda text: text, more: str = "") -> Recipe:
    return parse_recipe(edit(RECIPE) + more)


def convert(part: Recording, made: Recipe, units: dict[str, str] | None = None) -> dict[str, Array]:
    robot = load_robot("rrr")
    said = units or {name: str(spec.unit) for name, spec in made.signals.items()}
    each = {name: (unit,) * robot.n_joints for name, unit in said.items()}
    converted = joint_side(part, made, each, robot, drive_of(made.drive, robot, ""))
    return {name: signal.values for name, signal in converted.signals.items()}


def test_joint_power_equals_motor_power_sample_by_sample() -> None:
    """With q_motor = N q_joint and tau_joint = Nᵀ tau_motor, no transmission makes or loses power, coupled or not."""
    made = recipe(more="[drive]\ntransmission = [[32.0, 0, 0], [0, -48.0, 0], [5.0, 32.0, 45.0]]\n")
    part = recording()
    joint = convert(part, made)
    motor_power = (np.gradient(part.signals["q"], part.t, axis=0) * part.signals["tau"]).sum(axis=1)
    joint_power = (np.gradient(joint["q"], part.t, axis=0) * joint["tau"]).sum(axis=1)
    assert np.abs(joint_power - motor_power).max() < 1e-12 * np.abs(motor_power).max()


@pytest.mark.row("S10")
def test_current_becomes_torque_and_is_kept() -> None:
    joint = convert(recording(), recipe(lambda s: s.replace('"N m"', '"mA"'), "[drive]\ntorque_constant = [0.1, 0.2, 0.3]\n"))
    assert np.allclose(joint["current"], 1e-3 * recording().signals["tau"], rtol=1e-15, atol=0)
    assert np.allclose(joint["tau"], joint["current"] * [0.1, 0.2, 0.3], rtol=1e-15, atol=0)


@pytest.mark.parametrize(("wrong", "right"), [("V", "N m"), ("deg", "N m")])
def test_s05_a_unit_of_something_else_is_refused(wrong: str, right: str) -> None:
    with pytest.raises(InputRejected, match=f"RRID-S05.*needs one of .*{right}"):
        convert(recording(), recipe(lambda s: s.replace('"N m"', f'"{wrong}"')))


def test_s05_a_length_for_a_turning_joint_is_refused() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S05.*'mm' for joint 1.*revolute.*rad"):
        convert(recording(), recipe(lambda s: s.replace('"rad"', '"mm"')))


def test_s06_degrees_are_converted() -> None:
    joint = convert(recording(), recipe(lambda s: s.replace('"rad"', '"deg"')))
    assert np.allclose(joint["q"], np.deg2rad(recording().signals["q"]), rtol=1e-15, atol=0)


def test_d07_a_rollover_is_followed_through() -> None:
    """D07: a counter of 8192 that starts again four times gives the motion it came from, to the last count."""
    counts = np.round(np.linspace(100, 100 + 4.3 * 8192, 1200))
    wrapped = replace(recording(), signals={**recording().signals, "q": np.column_stack([np.mod(counts, 8192)] * 3)})
    made = recipe(lambda s: s.replace('unit = "rad"', 'unit = "counts", counts_per_rev = 8192, wrap = 8192'))
    converted = joint_side(wrapped, made, {"q": ("counts",) * 3, "tau": ("N m",) * 3}, load_robot("rrr"), None)
    assert np.allclose(converted.signals["q"].values[:, 0], counts * 2 * np.pi / 8192, rtol=1e-14)
    assert {(c.code, c.level) for c in converted.checks} == {("RRID-D07", "warn")}
    assert "4 rollovers of 8192" in converted.altered[0]


def test_sign_scale_and_offset_act_in_this_order() -> None:
    joint = convert(recording(),
                    recipe(lambda s: s.replace('unit = "rad"', 'unit = "deg", sign = -1, scale = 2.0, offset = [0.5, 0.0, 0.0]')))
    expected = np.deg2rad(-2.0 * recording().signals["q"]) + np.array([0.5, 0.0, 0.0])
    assert np.allclose(joint["q"], expected, rtol=1e-14, atol=1e-16)

"""Recordings from the field: the draft takes the right columns, the import the right values, or a question is asked."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.import_log import STAGE, Result, Settings, draft_recipe
from pipelines.importers.guess import Draft
from pipelines.io.files import open_log
from pipelines.stage import Outcome, Request, run_stage
from tests.seeds import rarely, usually

SIX = range(6)
UR = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]


def case(shared: Path, number: str) -> Path:
    return next((shared / "cases").glob(f"{number}-*"))


def draft_of(shared: Path, number: str) -> tuple[Draft, dict[str, Any]]:
    draft = draft_recipe(next(case(shared, number).glob("run.*")))
    return draft, tomllib.loads(draft.text)


def imported(recipe: Path, source: Path, out: Path) -> Outcome[Result]:
    return run_stage(STAGE, Request((), out, no_report=True), Settings(recipe=str(recipe), source=source))


@pytest.mark.parametrize(
    ("number", "q", "tau"),
    [
        ("01", [f"q[{j}]" for j in SIX], [f"tau[{j}]" for j in SIX]),
        *rarely(("04", [f"actual_q_{j}" for j in SIX], [f"actual_current_{j}" for j in SIX])),
        ("06", "q_{j}", "tau_{j}"),
        *rarely(("07", "q_meas_{j}", "tau_meas_{j}")),
        ("08", [f"{n}_joint_position" for n in UR], [f"{n}_joint_effort" for n in UR]),
        *rarely(("10", [f"field.position{j}" for j in SIX], [f"field.effort{j}" for j in SIX])),
        *rarely(("12", "q_{j}", "tau_{j}"), ("14", "q{j}", "tau{j}")),
        ("17", [f"column_{j}" for j in range(2, 8)], [f"column_{j}" for j in range(14, 20)]),
    ],
)
def test_the_draft_takes_the_right_columns(
    shared: Path, number: str, q: str | list[str], tau: str | list[str]
) -> None:
    _, recipe = draft_of(shared, number)
    assert recipe["robot"]["use"] == "arm.urdf"
    assert recipe["signals"]["q"]["columns"] == q
    assert recipe["signals"]["q"]["unit"] == "rad"
    assert recipe["signals"]["tau"]["columns"] == tau


def test_motor_currents_are_taken_and_model_torques_offered(shared: Path) -> None:
    draft, recipe = draft_of(shared, "04")
    assert recipe["signals"]["tau"]["columns"] == [f"actual_current_{j}" for j in SIX]
    assert draft.blanks == ("signals.tau.unit", "drive.torque_constant")
    assert "target_moment_0" in draft.text.split("also there:")[1]


def test_a_measured_torque_is_drafted_as_measured(shared: Path) -> None:
    assert draft_of(shared, "07")[1]["log"]["torque"] == "measured"


def test_the_unit_of_a_torque_that_nothing_names_is_left_open(shared: Path) -> None:
    draft, recipe = draft_of(shared, "17")
    assert draft.blanks == ("signals.tau.unit",)
    assert recipe["signals"]["dq"]["columns"] == [f"column_{j}" for j in range(8, 14)]


@pytest.mark.parametrize("number", usually(("01", "06", "07", "08", "10", "12", "14"), "01", "08"))
def test_a_complete_draft_imports_the_same_samples(shared: Path, number: str, tmp_path: Path) -> None:
    """All these recordings hold the same motion, in different layouts."""
    draft, _ = draft_of(shared, number)
    assert draft.blanks == ()
    (tmp_path / "recipe.toml").write_text(draft.text)
    outcome = imported(tmp_path / "recipe.toml", case(shared, number), tmp_path / "out")
    log = open_log(outcome.folder / "logs" / "run.h5").log
    true = np.loadtxt(case(shared, "01") / "run.csv", delimiter=",", skiprows=1)
    digits = 1e-6 if number == "14" else 1e-12
    assert np.abs(log.q - true[:, 1:7]).max() <= digits
    assert np.abs(log.tau - true[:, 7:]).max() <= digits
    assert np.abs(log.t - log.t[0] - true[:, 0]).max() < 1e-6


def test_an_arm_that_turns_and_slides_is_imported(shared: Path, tmp_path: Path) -> None:
    folder = case(shared, "30")
    outcome = imported(folder / "r.toml", folder, tmp_path / "out")
    true = np.loadtxt(folder / "run1.csv", delimiter=",", skiprows=1)
    assert np.array_equal(open_log(outcome.folder / "logs" / "run1.h5").log.q, true[:, 1:5])
    assert any("taken as SI, m for joint 3 'j3'" in check.message for check in outcome.checks)


@pytest.mark.parametrize(("unit", "scale"), [('["rad", "rad", "mm", "rad"]', 1e-3), ('["deg", "rad", "m", "rad"]', 1.0)])
def test_each_joint_may_have_its_own_unit(shared: Path, tmp_path: Path, unit: str, scale: float) -> None:
    folder = case(shared, "30")
    text = (folder / "r.toml").read_text().replace('columns = "q_{j}", unit = "rad"', f'columns = "q_{{j}}", unit = {unit}')
    (tmp_path / "r.toml").write_text(text)
    (tmp_path / "data").mkdir()
    for name in ("arm.urdf", "run1.csv"):
        (tmp_path / "data" / name).write_bytes((folder / name).read_bytes())
    outcome = imported(tmp_path / "r.toml", tmp_path / "data", tmp_path / "out")
    log = open_log(outcome.folder / "logs" / "run1.h5").log
    true = np.loadtxt(folder / "run1.csv", delimiter=",", skiprows=1)
    assert np.allclose(log.q[:, 2], scale * true[:, 3], rtol=1e-14)
    assert np.allclose(log.q[:, 0], true[:, 1] * (np.pi / 180.0 if "deg" in unit else 1.0), rtol=1e-14)


def test_an_excitation_in_newton_metres_needs_its_controller(shared: Path, tmp_path: Path) -> None:
    folder = case(shared, "43")
    with pytest.raises(InputRejected, match=r"RRID-S05.*signal v: 'N m' is a unit of torque.*law = \"pd\""):
        imported(folder / "r.toml", folder, tmp_path / "out")
    remedied = (folder / "r.toml").read_text() + '\n[controller]\nlaw = "pd"\nkp = [100.0]\nkd = [10.0]\n'
    (tmp_path / "r.toml").write_text(remedied)
    outcome = imported(tmp_path / "r.toml", folder, tmp_path / "out")
    assert open_log(outcome.folder / "logs" / "run1.h5").log.signals["v"].units == "N m"


def test_the_tip_of_a_robot_that_branches_is_named_beside_its_file(shared: Path, tmp_path: Path) -> None:
    folder = case(shared, "46")
    outcome = imported(folder / "r2.toml", folder, tmp_path / "out")
    log = open_log(outcome.folder / "logs" / "run1.h5").log
    assert [joint.name for joint in log.robot.joints] == [f"panda_joint{j}" for j in range(1, 8)]


def test_the_draft_for_a_robot_that_branches_asks_for_its_tip(shared: Path) -> None:
    draft = draft_recipe(case(shared, "46") / "run1.csv")
    assert draft.blanks == ("robot.tip_link", "signals.q.unit", "signals.tau.unit")  # no links that prove a unit

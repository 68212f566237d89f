"""What the command leaves: files that agree, the table of a controller, the report, wrong usage."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.design_excitation import Result
from pipelines.errors import InputRejected, UsageError
from pipelines.inspect import STAGE as DOCTOR
from pipelines.io.files import open_log
from pipelines.stage import Outcome, Request, run_stage
from tests.cli.commands import rrrid
from tests.design_excitation.short import QUICK, designed

RECIPE = """
[robot]
use = "rrr"

[log]
match = "controller.csv"

[time]
column = "t"
unit = "s"
rate = 500

[signals]
q = { columns = ["m2", "m1", "m3"], unit = "deg", scale = [1.0, 2.0, 1.0], sign = [1, -1, 1], offset = [0.1, 0.0, -0.2] }
tau = { columns = ["m2", "m1", "m3"], unit = "N m" }

[drive]
transmission = [[10.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 5.0, 30.0]]
"""


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Outcome[Result]:
    return designed(tmp_path_factory.mktemp("plain") / "out")


def test_what_the_result_says(plain: Outcome[Result]) -> None:
    """Every key of the contract; limits kept; the certificate beside the value."""
    done = plain.json
    for key in ("condition_number", "lower_bound", "criterion", "predicted_relative_std", "limits", "evaluations"):
        assert done[key] is not None
    assert done["evaluations"] == 150
    assert done["lower_bound"] == pytest.approx(1.5**0.5)
    assert done["condition_number"] > done["lower_bound"]
    assert {(one["joint"], one["quantity"]) for one in done["limits"]} == {
        (j, quantity) for j in (1, 2, 3) for quantity in ("speed", "acceleration", "torque")}
    assert all(abs(one["peak"]) <= abs(one["limit"]) for one in done["limits"])
    assert done["limits"][-1]["limit"] in (-13.5, 13.5)  # nine tenths of 15 N m


def test_the_files_agree(plain: Outcome[Result], tmp_path: Path) -> None:
    """The log, the coefficients by eq. (22), and the table for a controller are one motion; the doctor finds the log in order."""
    out = plain.folder
    log = open_log(out / "trajectory.h5").log
    assert (log.origin, log.experiment, log.role, log.period) == ("planned", "excitation", "identify", 10.0)
    assert "q" not in log
    assert "tau" not in log
    told = json.loads((out / "coefficients.json").read_text())
    for j, joint in enumerate(told["joints"]):
        w = 2 * np.pi * np.array(joint["harmonics"]) / told["period"]
        a, b = np.array(joint["a"]), np.array(joint["b"])
        q = joint["q0"] + np.sin(np.outer(log.t, w)) @ (a / w) - np.cos(np.outer(log.t, w)) @ (b / w)
        np.testing.assert_allclose(log["q_ref"][:, j], q, atol=1e-9)
        np.testing.assert_allclose(log["dq_ref"][:, j], np.cos(np.outer(log.t, w)) @ a + np.sin(np.outer(log.t, w)) @ b, atol=1e-9)
    table = np.loadtxt(out / "controller.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table, np.column_stack([log.t, log["q_ref"]]), atol=1e-12)
    assert (out / "controller.csv").read_text().startswith("t,q_1,q_2,q_3\n")
    examined = run_stage(DOCTOR, Request((out,), out=tmp_path / "examined", no_report=True), DOCTOR.settings()).result
    assert len(examined.logs) == 1
    assert [check for check in examined.checks if check.level in ("reject", "repair")] == []


def test_the_first_run_is_the_same_path_at_half_the_speed(plain: Outcome[Result]) -> None:
    """q(t/2): half the speed, a quarter of the acceleration, twice the time; as a log and as a table."""
    whole, gentle = (open_log(plain.folder / f"{name}.h5").log for name in ("trajectory", "gentle-trajectory"))
    assert gentle.t[-1] == pytest.approx(2.0 * whole.t[-1])
    for name, share in (("q_ref", 1.0), ("dq_ref", 0.5), ("ddq_ref", 0.25)):
        np.testing.assert_allclose(gentle[name][::2], share * whole[name], atol=1e-9)
    table = np.loadtxt(plain.folder / "gentle-controller.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table, np.column_stack([gentle.t, gentle["q_ref"]]), atol=1e-12)


def test_a_joint_that_turns_right_round_is_warned_of(tmp_path: Path) -> None:
    """Joints of the shipped arm have no position limits: at a tenth of the frequency they wind up their cables."""
    slow = designed(tmp_path / "slow", replace(QUICK, frequency=0.02))
    wound = [joint for joint, q in enumerate(open_log(slow.folder / "trajectory.h5").log["q_ref"].T, 1) if np.ptp(q) > 2 * np.pi]
    assert wound
    assert [check.message.split()[1] for check in slow.checks if "whole turn" in check.message] == [str(j) for j in wound]


def test_the_table_comes_back_through_its_recipe(tmp_path: Path) -> None:
    """Motor side, coupled, in degrees, of other order, sign and scale, at another rate: importing it gives the motion."""
    from pipelines.import_log import STAGE as IMPORT

    (tmp_path / "recipe.toml").write_text(RECIPE)
    out = designed(tmp_path / "out", replace(QUICK, recipe=str(tmp_path / "recipe.toml"))).folder
    table = np.loadtxt(out / "controller.csv", delimiter=",", skiprows=1)
    assert np.diff(table[:, 0]) == pytest.approx(np.full(len(table) - 1, 0.002))
    data = tmp_path / "data"
    data.mkdir()
    (data / "controller.csv").write_bytes((out / "controller.csv").read_bytes())
    settings = replace(IMPORT.settings(), recipe=str(tmp_path / "recipe.toml"), source=data, trust_units=True)
    back = run_stage(IMPORT, Request((), out=tmp_path / "back", no_report=True), settings)
    imported = open_log(next(back.folder.rglob("*.h5"))).log
    planned = open_log(out / "trajectory.h5").log
    np.testing.assert_allclose(imported.q, planned["q_ref"][::2], atol=1e-9)


@pytest.mark.parametrize(("changes", "code"), [
    ({"experiment": "writing"}, "RRID-C02"), ({"stop_band": (6.0, 4.0)}, "RRID-C02"),
    ({"robot": "nobody"}, "RRID-C04"),
    ({"criterion": "C"}, "RRID-C02"), ({"time_limit": float("nan")}, "RRID-C02"), ({"home": (0.0, 0.0)}, "RRID-C02"), ({"model": "nothing"}, "RRID-C04"),
])
def test_wrong_usage_is_said(changes: dict[str, Any], code: str, tmp_path: Path) -> None:
    with pytest.raises((UsageError, InputRejected)) as told:
        designed(tmp_path / "out", replace(QUICK, **changes))
    assert told.value.code == code


def test_the_command_line(tmp_path: Path) -> None:
    """ROBOT defaults to the shipped rrr; options reach the stage; an unknown criterion ends in exit 2."""
    done = rrrid("design-excitation", "--evaluations", "120", "--harmonics", "12", "--out", tmp_path / "out", "--json", "-q",
                 "--no-report", "--symmetric", "--seed", "7", cwd=tmp_path)
    assert done.returncode == 0
    told = json.loads(done.stdout)
    assert (told["robot"], told["evaluations"], told["seed"], len(told["parameters"])) == ("rrr-tue", 120, 7, 13)
    assert rrrid("design-excitation", "--criterion", "best", "--out", tmp_path / "other", cwd=tmp_path).returncode == 2

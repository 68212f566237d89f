"""The command: files it leaves, what they say, earlier logs and modes, the controller's table, the other experiments."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.design_excitation import STAGE, Settings
from pipelines.errors import InputRejected, UsageError
from pipelines.inspect import STAGE as DOCTOR
from pipelines.log.files import open_log
from pipelines.log.robot_files import load_robot
from pipelines.model.arm import Arm
from pipelines.model.rigid.base import BaseArm
from pipelines.stage import Outcome, Request, run_stage
from tests.cli.commands import rrrid

QUICK = replace(Settings(), robot="rrr", evaluations=150, harmonics=(15,), rehearse=False)

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


def _design(out: Path, settings: Settings = QUICK, paths: tuple[Path, ...] = (), **request: Any) -> Outcome[Any]:
    return run_stage(STAGE, Request(paths, out=out, no_report=True, **request), settings)


def test_what_the_result_says(tmp_path: Path) -> None:
    """Every key of the contract; limits kept; the certificate beside the value."""
    done = _design(tmp_path / "out").json
    for key in ("condition_number", "lower_bound", "criterion", "predicted_relative_std", "limits", "evaluations"):
        assert done[key] is not None
    assert done["evaluations"] == 150
    assert done["lower_bound"] == pytest.approx(1.5**0.5)
    assert done["condition_number"] > done["lower_bound"]
    assert {(one["joint"], one["quantity"]) for one in done["limits"]} == {
        (j, quantity) for j in (1, 2, 3) for quantity in ("speed", "acceleration", "torque")}
    assert all(abs(one["peak"]) <= abs(one["limit"]) for one in done["limits"])
    assert done["limits"][-1]["limit"] in (-13.5, 13.5)  # nine tenths of 15 N m


def test_the_files_agree(tmp_path: Path) -> None:
    """The log, the coefficients by eq. (22), and the table for a controller are one motion; the doctor finds the log in order."""
    out = _design(tmp_path / "out").folder
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


def test_the_table_comes_back_through_its_recipe(tmp_path: Path) -> None:
    """Motor side, coupled, in degrees, of other order, sign and scale, at another rate: importing it gives the motion."""
    from pipelines.import_log import STAGE as IMPORT

    (tmp_path / "recipe.toml").write_text(RECIPE)
    out = _design(tmp_path / "out", replace(QUICK, recipe=str(tmp_path / "recipe.toml"))).folder
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


def test_the_top_harmonic_stays_below_a_mode(tmp_path: Path) -> None:
    """A mode at 4.5 Hz that `frf` has found: no harmonic above 1.5 Hz."""
    found = {"command": "frf", "responses": [{"joint": 1, "modes": [{"frequency": {"value": 9.0}}, {"frequency": {"value": 4.5}}]}]}
    (tmp_path / "frf").mkdir()
    (tmp_path / "frf" / "result.json").write_text(json.dumps(found))
    out = _design(tmp_path / "out", replace(QUICK, harmonics=None), (tmp_path / "frf",)).folder
    told = json.loads((out / "coefficients.json").read_text())
    assert max(max(joint["harmonics"]) for joint in told["joints"]) / told["period"] == pytest.approx(1.5)


@pytest.mark.parametrize(("responses", "code"), [
    (None, "RRID-C02"), ([{"modes": [{"frequency": 5}]}], "RRID-C02"), ([{"modes": [{"frequency": {"value": -5.0}}]}], "RRID-C02"),
    ([{"modes": [{"frequency": {"value": 0.3}}]}], "RRID-C08"),
])
def test_a_mode_that_cannot_be_kept_below_is_said(responses: object, code: str, tmp_path: Path) -> None:
    """Nothing that `frf` writes; a mode so low that no motion is left."""
    (tmp_path / "frf").mkdir()
    (tmp_path / "frf" / "result.json").write_text(json.dumps({"command": "frf", "responses": responses}))
    with pytest.raises(UsageError) as told:
        _design(tmp_path / "out", QUICK, (tmp_path / "frf",))
    assert told.value.code == code


def test_earlier_logs_count(tmp_path: Path, samples: Path) -> None:
    """After a log of excitation every parameter is predicted to be known better than by the new experiment alone."""
    after = _design(tmp_path / "after", QUICK, (samples / "rrr-closed-form/excitation-1.h5",)).result
    assert len(after.after) == 1
    alone = _design(tmp_path / "alone").result
    assert after.predicted_relative_std < alone.predicted_relative_std
    assert after.lower_bound is None  # the certificate is one motion's


def test_fundamentals_of_their_own(tmp_path: Path) -> None:
    """0.1, 0.2 and 0.3 Hz: each joint moves at multiples of its own alone."""
    out = _design(tmp_path / "out", replace(QUICK, frequency=(0.1, 0.2, 0.3), harmonics=(12, 8, 5))).folder
    told = json.loads((out / "coefficients.json").read_text())
    assert told["period"] == pytest.approx(10.0)
    assert [joint["harmonics"] for joint in told["joints"]] == [list(range(1, 13)), list(range(2, 17, 2)), list(range(3, 16, 3))]


def test_a_rehearsal_before_the_robot_moves(tmp_path: Path) -> None:
    """The simulated arm follows a modest plan to a few hundredths of a radian, without saturation."""
    done = _design(tmp_path / "out", replace(QUICK, rehearse=True)).result
    assert done.rehearsal is not None
    assert done.rehearsal.safe
    assert max(done.rehearsal.position_max) < 0.1
    assert all(peak < limit for peak, limit in zip(done.rehearsal.torque_peak, done.rehearsal.torque_limit, strict=True))


def test_without_links_torque_is_not_claimed_to_be_checked(tmp_path: Path) -> None:
    robot = load_robot("rrr")
    from pipelines.log.robot import format_robot

    text = format_robot(replace(robot, joints=tuple(replace(joint, link=None) for joint in robot.joints)))
    (tmp_path / "robot.toml").write_text(text)
    outcome = _design(tmp_path / "out", replace(QUICK, robot=str(tmp_path / "robot.toml")))
    assert not outcome.result.torque_checked
    assert "torque limits could not be checked" in outcome.report.verdict
    assert all(one.quantity != "torque" for one in outcome.result.limits)


def test_bounds_on_the_parameters_limit_the_torque(tmp_path: Path) -> None:
    """No parameters between the bounds ask for more than the limit, on 0.1 ms; the corner that asks most comes near to it."""
    body = Arm.from_links(load_robot("rrr")).body
    p = body.known_parameters()
    assert p is not None
    middle, half = p, 0.2 * np.abs(p) + 0.01
    lines = (f"{known.name} = [{m - h}, {m + h}]" for known, m, h in zip(body.parameters, middle, half, strict=True))
    (tmp_path / "bounds.toml").write_text("\n".join(lines))
    bare = _without_links(tmp_path)
    done = _design(tmp_path / "out", replace(QUICK, robot=bare, bounds=str(tmp_path / "bounds.toml")))
    series = done.result
    told = json.loads((done.folder / "coefficients.json").read_text())
    t = np.arange(0.0, told["period"], 1e-4)
    q, dq, ddq = np.zeros((3, 3, len(t)))
    for j, joint in enumerate(told["joints"]):
        w = 2 * np.pi * np.array(joint["harmonics"])[:, None] / told["period"]
        a, b = np.array(joint["a"]), np.array(joint["b"])
        sine, cosine = np.sin(w * t), np.cos(w * t)
        q[j], dq[j] = joint["q0"] + a / w[:, 0] @ sine - b / w[:, 0] @ cosine, a @ cosine + b @ sine
        ddq[j] = (b * w[:, 0]) @ cosine - (a * w[:, 0]) @ sine
    limit, rng, most = 0.9 * np.array([60.0, 30.0, 15.0]), np.random.default_rng(3), np.zeros(3)
    regressor = body.regressor(q.T, dq.T, ddq.T)
    for draw in range(20):
        beta = middle + half * rng.choice([-1.0, 1.0], 15)
        most = np.maximum(most, np.abs(regressor[draw % 5::5] @ beta).max(axis=0))
    worst = (np.abs(regressor @ middle) + np.abs(regressor) @ half).max(axis=0)
    assert (most <= limit).all()
    assert (worst <= limit).all()
    peaks = {one.joint: abs(one.peak) for one in series.limits if one.quantity == "torque"}
    np.testing.assert_allclose([peaks[1], peaks[2], peaks[3]], worst, rtol=5e-3)
    assert series.torque_checked
    assert series.rehearsal is None
    assert (worst / limit).max() > 0.5


@pytest.mark.parametrize("text", ["p1 = [", "p1 = [0.0, 1.0]", "p1 = [1.0, 0.0]", "p99 = [0.0, 1.0]"])
def test_bounds_that_make_no_sense_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "bounds.toml").write_text(text)
    with pytest.raises(UsageError) as told:
        _design(tmp_path / "out", replace(QUICK, robot=_without_links(tmp_path), bounds=str(tmp_path / "bounds.toml")))
    assert told.value.code == "RRID-C02"


def _without_links(folder: Path) -> str:
    from pipelines.log.robot import format_robot

    robot = load_robot("rrr")
    text = format_robot(replace(robot, joints=tuple(replace(joint, link=None) for joint in robot.joints)))
    (folder / "robot.toml").write_text(text)
    return str(folder / "robot.toml")


@pytest.mark.parametrize("purpose", ["friction", "frf"])
def test_plans_keep_the_tip_speed_and_the_torque(purpose: str, tmp_path: Path) -> None:
    """A slow tip makes plans slower: its speed from its places by differences; the torque of the excitation included."""
    out = _design(tmp_path / "out", replace(QUICK, purpose=purpose, tip_speed=0.8)).folder
    robot = load_robot("rrr")
    arm = BaseArm(robot)
    p = arm.known_parameters()
    assert p is not None
    for path in sorted((out / "logs").glob("*.h5")):
        log = open_log(path).log
        tip = arm.tip(log["q_ref"])
        assert np.linalg.norm(np.diff(tip, axis=0), axis=1).max() / log.sample_time <= 0.8
        ddq = log["ddq_ref"] + log["v"] if purpose == "frf" else log["ddq_ref"]
        tau = arm.torque(log["q_ref"], log["dq_ref"], ddq, p)
        assert (np.abs(tau).max(axis=0) <= 0.9 * np.array([60.0, 30.0, 15.0])).all()


def test_held_postures_stay_in_the_box(tmp_path: Path) -> None:
    box = (-0.4, 0.4, -0.4, 0.4, 0.4, 1.0)
    out = _design(tmp_path / "out", replace(QUICK, purpose="hold", tip_box=box)).folder
    postures = np.array([open_log(path).log.posture for path in (out / "logs").glob("*.h5")])
    tip = BaseArm(load_robot("rrr")).tip(postures)
    assert len(tip) == 8
    assert ((tip >= np.array(box[::2])) & (tip <= np.array(box[1::2]))).all()


def test_a_plan_that_no_limit_allows_names_the_limit(tmp_path: Path) -> None:
    """Home lies outside the box: every friction plan leaves it."""
    with pytest.raises(UsageError) as told:
        _design(tmp_path / "out", replace(QUICK, purpose="friction", tip_box=(5.0, 6.0, -1.0, 1.0, 0.0, 2.0)))
    assert told.value.code == "RRID-C08"
    assert "tip x" in told.value.message


def test_plans_are_rehearsed(tmp_path: Path) -> None:
    """The simulated arm holds each posture, and no drive saturates."""
    done = _design(tmp_path / "out", replace(QUICK, purpose="hold", rehearse=True)).result
    assert len(done.rehearsals) == 8
    for _, found in done.rehearsals:
        assert found.safe
        assert max(found.position_max) < 0.05


def test_the_report_warns_in_bold(tmp_path: Path) -> None:
    outcome = run_stage(STAGE, Request((), out=tmp_path / "out"), QUICK)
    page = (outcome.folder / "report.html").read_text()
    assert "<strong>Self-collision is not checked" in page
    assert "√(3/2)" in page


@pytest.mark.parametrize(("purpose", "count"), [("friction", 3), ("frf", 3), ("hold", 8)])
def test_the_other_experiments(purpose: str, count: int, tmp_path: Path) -> None:
    """One log an experiment, each within the limits, its speed and acceleration the derivatives of its position."""
    out = _design(tmp_path / "out", replace(QUICK, purpose=purpose)).folder
    robot = load_robot("rrr")
    paths = sorted((out / "logs").glob("*.h5"))
    assert len(paths) == count
    for path in paths:
        log = open_log(path).log
        assert (log.experiment, log.origin) == (purpose, "planned")
        q, dq, ddq = (log[name] for name in ("q_ref", "dq_ref", "ddq_ref"))
        np.testing.assert_allclose(np.diff(q, axis=0), 0.5e-3 * (dq[1:] + dq[:-1]), atol=2e-6)
        np.testing.assert_allclose(dq[[0, -1]], 0.0, atol=1e-9)
        for j, joint in enumerate(robot.joints):
            assert np.abs(dq[:, j]).max() <= joint.velocity
            assert np.abs(ddq[:, j]).max() <= joint.acceleration
    examined = run_stage(DOCTOR, Request((out,), out=tmp_path / "examined", no_report=True), DOCTOR.settings()).result
    assert [check for check in examined.checks if check.level in ("reject", "repair")] == []


def test_friction_speeds_span_two_decades(tmp_path: Path) -> None:
    """Both directions, each of nine speeds held constant, the slowest a hundredth of the fastest; the others stay."""
    out = _design(tmp_path / "out", replace(QUICK, purpose="friction")).folder
    log = open_log(out / "logs/friction-2.h5").log
    assert log.joint == 2
    assert not np.ptp(log["q_ref"][:, [0, 2]], axis=0).any()
    speed, still = log["dq_ref"][:, 1], np.abs(log["ddq_ref"][:, 1]) < 1e-9
    held = np.unique(np.round(speed[still & (np.abs(speed) > 1e-6)], 6))
    assert len(held) == 18
    np.testing.assert_allclose(held, -held[::-1])
    assert held[-1] / held[9] == pytest.approx(100.0, rel=1e-3)


def test_held_postures_show_gravity(tmp_path: Path) -> None:
    """Together the postures determine all four parameters of gravity (rank 4, verified.md, section 3)."""
    out = _design(tmp_path / "out", replace(QUICK, purpose="hold")).folder
    postures = np.array([open_log(path).log.posture for path in sorted((out / "logs").glob("*.h5"))])
    body = Arm.from_links(load_robot("rrr")).body
    still = np.zeros_like(postures)
    values = np.linalg.svd(body.regressor(postures, still, still).reshape(-1, 15), compute_uv=False)
    assert (values > 1e-6 * values[0]).sum() == 4
    assert values[3] > 0.1 * values[0]
    p = BaseArm(body.robot).known_parameters()
    assert p is not None
    tau = BaseArm(body.robot).torque(postures, still, still, p)
    assert (np.abs(tau) <= 0.9 * np.array([60.0, 30.0, 15.0])).all()


@pytest.mark.parametrize(("changes", "code"), [
    ({"purpose": "writing"}, "RRID-C02"), ({"keep_out": (1.0,)}, "RRID-C02"), ({"robot": "nobody"}, "RRID-C04"),
    ({"criterion": "C"}, "RRID-C02"), ({"periods": 0}, "RRID-C02"), ({"evaluations": 0}, "RRID-C02"),
    ({"seconds": float("nan")}, "RRID-C02"), ({"seed": -1}, "RRID-C02"), ({"tip_speed": 0.0}, "RRID-C02"),
    ({"noise": (1.0, -1.0, 1.0)}, "RRID-C02"), ({"torque_share": 1.5}, "RRID-C02"), ({"bounds": "nothing"}, "RRID-C02"),
    ({"home": (0.0, 0.0)}, "RRID-C02"), ({"model": "nothing"}, "RRID-C04"),
])
def test_wrong_usage_is_said(changes: dict[str, Any], code: str, tmp_path: Path) -> None:
    with pytest.raises((UsageError, InputRejected)) as told:
        _design(tmp_path / "out", replace(QUICK, **changes))
    assert told.value.code == code


def test_the_command_line(tmp_path: Path) -> None:
    """ROBOT defaults to the shipped rrr; options reach the stage; an unknown criterion ends in exit 2."""
    done = rrrid("design-excitation", "--evaluations", "120", "--harmonics", "12", "--out", tmp_path / "out", "--json", "-q",
                 "--no-report", "--symmetric", "--set", "design-excitation.rehearse=false", "--seed", "7", cwd=tmp_path)
    assert done.returncode == 0
    told = json.loads(done.stdout)
    assert (told["robot"], told["evaluations"], told["seed"], len(told["parameters"])) == ("rrr-tue", 120, 7, 13)
    assert rrrid("design-excitation", "--criterion", "best", "--out", tmp_path / "other", cwd=tmp_path).returncode == 2

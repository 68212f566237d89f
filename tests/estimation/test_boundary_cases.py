"""The torque boundary on field cases and recorded robots: what is wrong is named with its repair,
what is right is left alone.
"""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import diagnose, estimate_bps, import_log, inspect
from pipelines.errors import InputRejected
from pipelines.estimation.checks.boundary import Boundary, boundary_findings, torque_boundary
from pipelines.estimation.checks.gravity_fit import GravityModel
from pipelines.io.files import find_logs, open_log
from pipelines.io.log import ExperimentLog, Signal
from pipelines.io.robot import format_robot
from pipelines.io.robot_files import load_robot
from pipelines.report.sections import boundary_card
from pipelines.stage import Request, run_stage

RECIPE = """
[robot]
use = "arm.urdf"
[log]
match = "run*.csv"
experiment = "excitation"
role = "identify"
torque = "measured"
[time]
column = "{time}"
unit = "s"
[signals]
q = {{ columns = {q}, unit = "rad" }}
tau = {{ columns = {tau}, unit = "N m" }}
"""


def imported(case: Path, out: Path) -> Path:
    """The recorded columns of a field case, in the order that its file has them."""
    header = (
        (case / next(iter(sorted(case.glob("run*.csv")))).name)
        .read_text()
        .splitlines()[0]
        .split(",")
    )
    q = [name for name in header if name.endswith("_position") or name.startswith("q_")]
    tau = [name for name in header if name.endswith("_effort") or name.startswith("tau_")]
    recipe = out / "recipe.toml"
    out.mkdir()
    text = RECIPE.format(time=header[0], q=json.dumps(q), tau=json.dumps(tau))
    recipe.write_text(text.replace("arm.urdf", str(case / "arm.urdf")))
    run_stage(
        import_log.STAGE,
        Request((), out / "logs", no_report=True),
        import_log.Settings(recipe=str(recipe), source=case),
    )
    return out / "logs"


def boundary_of(folder: Path) -> Boundary:
    paths, _ = find_logs([folder])
    found = torque_boundary([open_log(path).log for path in paths])
    assert found is not None
    return found


PANDA = "cases/46-panda-tip-link-remedy/r2.toml"
CASES = {
    "08-alphabetical-joints": ("RRID-S13", "columns 1,3 fit swapped"),
    "32-wall-mounted": ("RRID-S24", "gravity = [9.81"),
    "34-gravity-compensated-torque": ("RRID-S23", "holds no gravity: compensated?"),
}


@pytest.mark.parametrize(
    "case", [pytest.param(name, marks=() if name == "34-gravity-compensated-torque" else pytest.mark.slow) for name in CASES]
)
def test_a_field_case_is_named_and_refused_with_its_repair(
    case: str, shared: Path, tmp_path: Path
) -> None:
    """Reported by `inspect`, by `estimate-bps` and `diagnose` refused, with one and the same code."""
    logs = imported(shared / "cases" / case, tmp_path / case)
    code, words = CASES[case]
    told = run_stage(
        inspect.STAGE,
        Request((logs,), tmp_path / "inspect", no_report=True, check=True),
        inspect.Settings(),
    )
    assert [check.code for check in told.result.checks if check.gate] == [code]
    assert words in next(check.message for check in told.result.checks if check.gate)
    assert told.exit_code == 1
    for stage, settings in (
        (estimate_bps.STAGE, estimate_bps.Settings()),
        (diagnose.STAGE, diagnose.Settings()),
    ):
        with pytest.raises(InputRejected) as refused:
            # type: ignore[arg-type]
            run_stage(stage, Request((logs,), tmp_path / stage.name, no_report=True), settings)
        assert refused.value.code == code
        assert "--skip-sanity-checks" in refused.value.remedy


def test_the_remedy_for_a_wall_mounted_arm_is_the_gravity_that_it_feels(
    shared: Path, tmp_path: Path
) -> None:
    found = boundary_of(imported(shared / "cases" / "32-wall-mounted", tmp_path / "wall"))
    assert found.direction.vector is not None
    assert found.direction.vector == pytest.approx((9.81, 0.0, 0.0), abs=0.2)
    assert found.gravity.share == pytest.approx(1.0, abs=0.05)


def test_a_compensated_torque_may_be_fitted_by_an_arm_that_is_described_without_gravity(
    shared: Path, tmp_path: Path
) -> None:
    """The remedy works: with gravity = [0, 0, 0] no gate closes."""
    folder = imported(shared / "cases" / "34-gravity-compensated-torque", tmp_path / "compensated")
    paths, _ = find_logs([folder])
    logs = [open_log(path).log for path in paths]
    described = format_robot(replace(logs[0].robot, gravity=(0.0, 0.0, 0.0)))
    found = torque_boundary([replace(log, robot_text=described) for log in logs])
    assert found is not None
    assert found.gravity.present is False
    assert boundary_findings(found, "log") == ()


def unsigned(shared: Path, motion: str) -> ExperimentLog:
    """A motion of the servo arm whose effort has no sign."""
    folder = shared / "real" / "sage"
    rows = list(csv.DictReader((folder / motion / "state_motor.csv").read_text().splitlines()))
    t = 1e-6 * np.array([float(row["timestamp"]) for row in rows])
    q, tau = (
        np.array([json.loads(row[name]) for row in rows]) for name in ("positions", "torques")
    )
    keep = np.concatenate([[True], np.diff(t) > 0.0])
    signals = {
        "t": Signal(t[keep], "s", "time"),
        "q": Signal(q[keep], "rad", "position"),
        "tau": Signal(tau[keep], "N m", "effort"),
    }
    robot = load_robot(folder / "so101.urdf")
    return ExperimentLog(
        motion,
        "free",
        "identify",
        "measured",
        robot.name,
        float(np.median(np.diff(t))),
        format_robot(robot),
        signals,
        torque="measured",
    )


@pytest.mark.parametrize(
    "motion", ["multisine", "chirp_sweep", "custom_motion", "friction_gravity"]
)
def test_unsigned_effort_is_told_as_magnitudes(motion: str, shared: Path) -> None:
    """Of servos that report how hard they work, and not which way."""
    found = torque_boundary([unsigned(shared, motion)])
    assert found is not None
    assert found.sign == "magnitude"
    assert found.gravity.share is None
    assert [check.code for check in boundary_findings(found, motion)] == ["RRID-S25"]


def test_a_load_that_pushes_one_way_is_no_magnitude(shared: Path) -> None:
    """A torque that a spring or a load holds above zero is the same as its magnitude, also where it
    comes as near to zero as a lift whose friction balances its load on the way down.
    """
    log = unsigned(shared, "multisine")
    loaded = replace(log, signals={**log.signals, "tau": Signal(log.tau + 3.0, "N m", "effort")})
    t = log.t
    lift = np.where(np.sin(2.0 * np.pi * t / 4.0) > 0.0, 2.0, 0.02) + 0.015 * np.sin(9.0 * t)
    lowered = replace(
        log,
        signals={
            "t": log.signals["t"],
            "q": Signal(
                np.outer(-np.cos(2.0 * np.pi * t / 4.0), np.ones(log.n_joints)), "rad", "q"
            ),
            "tau": Signal(np.outer(lift, np.ones(log.n_joints)), "N m", "torque"),
        },
    )
    for one in (loaded, lowered):
        found = torque_boundary([one])
        assert found is None or found.sign != "magnitude"


def test_a_fit_that_fails_costs_its_answers_and_not_the_run(
    shared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(GravityModel, "search", broken)
    paths, _ = find_logs([shared / "real" / "kr300" / "logs"])
    found = torque_boundary([open_log(path).log for path in paths])
    assert found is not None
    assert (found.sign, found.gravity.share, found.order.columns) == ("signed", None, None)
    assert "the fit failed: Singular matrix" in found.gravity.reason
    (card,) = boundary_card(found)
    assert card.text[0].startswith("These logs do not determine gravity, ")


@pytest.mark.parametrize("robot", ["panda", pytest.param("kr300", marks=pytest.mark.slow)])
def test_a_recorded_arm_has_a_boundary_without_a_finding(robot: str, shared: Path) -> None:
    """Link-side sensors and uneven stamps; a base whose z axis points down and three short logs."""
    found = boundary_of(shared / "real" / robot / "logs")
    assert boundary_findings(found, robot) == ()
    assert found.sign == "signed"
    assert found.order.columns == tuple(range(1, len(found.order.columns or ()) + 1))
    share, std = found.gravity.share, found.gravity.std
    assert share is None or (std is not None and abs(share - 1.0) < 2.0 * std < 0.2)


@pytest.mark.parametrize(
    "number", [pytest.param(k, marks=pytest.mark.slow if k % 8 else ()) for k in range(1, 17)]
)
def test_a_fault_of_another_plant_is_no_mistake_of_its_description(
    number: int, shared: Path
) -> None:
    """Of sixteen arms, most of them faulty, each holds its whole gravity, straight down."""
    paths, _ = find_logs([shared / "plant-b" / f"arm-{number:02d}"])
    found = torque_boundary(
        [open_log(path).log for path in paths if path.name.startswith("identify")]
    )
    assert found is not None
    assert boundary_findings(found, "arm") == ()
    assert (found.side, found.sign, found.order.columns) == ("motor", "signed", (1, 2, 3))
    assert found.gravity.share is not None
    assert found.gravity.std is not None
    assert abs(found.gravity.share - 1.0) < 3.0 * found.gravity.std
    assert found.direction.vector is not None
    assert found.direction.angle is not None
    assert found.direction.angle < np.radians(3.0)


def imported_by(recipe: Path, out: Path) -> Path:
    settings = import_log.Settings(recipe=str(recipe), source=recipe.parent)
    run_stage(import_log.STAGE, Request((), out / "logs", no_report=True), settings)
    return out / "logs"


def test_two_seconds_of_seven_joints_do_not_tell_their_order(shared: Path, tmp_path: Path) -> None:
    """Case 46: another order, whose parameters take up the noise of a torque, is no finding."""
    found = boundary_of(imported_by(shared / PANDA, tmp_path))
    assert boundary_findings(found, "panda") == ()
    assert found.order.columns == (1, 2, 3, 4, 5, 6, 7)
    assert "not identifiable" in found.order.reason


def test_gravity_that_explains_no_more_than_a_model_errs_has_no_share(
    shared: Path, tmp_path: Path
) -> None:
    """Case 46: 0.73 % of the torque is left with gravity, and 0.74 % without."""
    found = boundary_of(imported_by(shared / PANDA, tmp_path))
    assert (found.gravity.present, found.gravity.share) == (None, None)
    assert "not identifiable" in found.gravity.reason


def test_the_card_tells_what_a_share_of_friction_is_a_share_of(shared: Path) -> None:
    """Half of the torque is friction: that is not half of the friction."""
    (card,) = boundary_card(boundary_of(shared / "real" / "panda" / "logs"))
    (words,) = (row for table in card.tables for row in table.rows if row[0].startswith("friction"))
    assert words[0] == "friction, share of the torque"
    assert "not missing friction" in str(words[2])

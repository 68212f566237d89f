"""The log doctor as a stage: exit codes, fields, report; and on data recorded from a real arm."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines import import_log, inspect
from pipelines.io.files import find_logs, open_log, write_log
from pipelines.io.log import ExperimentLog
from pipelines.stage import Outcome, Request, run_stage
from tests.fault_table import FAULTS
from tests.healthy import good_log, make_log, rest, with_signal
from tests.seeds import rarely

MAKE = {fault.row: fault.make for fault in FAULTS}


def doctor(folder: Path, *logs: ExperimentLog, check: bool = False, strict: bool = False,
           no_report: bool = True) -> Outcome[inspect.Result]:
    paths = [folder / f"log-{k}.h5" for k in range(len(logs))]
    for path, log in zip(paths, logs, strict=True):
        write_log(path, log)
    return run_stage(inspect.STAGE, Request(tuple(paths), out=folder / "out", check=check, strict=strict,
                                            no_report=no_report), inspect.Settings())


@pytest.mark.parametrize(("row", "plain", "checked"), [
    ("", 0, 0),  # nothing wrong
    *rarely(("T03", 0, 0)),  # a warning alone is not a failed check
    ("T01", 0, 1),  # repaired
    ("S14", 0, 1),  # a gate
    ("S09", 3, 3),  # not usable
])
def test_exit_codes(row: str, plain: int, checked: int, tmp_path: Path) -> None:
    log = MAKE[row](good_log()) if row else good_log()
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    assert doctor(tmp_path / "a", log).exit_code == plain
    assert doctor(tmp_path / "b", log, check=True).exit_code == checked


@pytest.mark.parametrize("check", [False, True])
def test_a_file_that_cannot_be_opened_is_a_finding(check: bool, tmp_path: Path) -> None:
    """The doctor examines the healthy log all the same; what is rejected is exit 3, with --check as well (bad-inputs.md, F02)."""
    write_log(tmp_path / "whole.h5", good_log())
    (tmp_path / "cut.h5").write_bytes((tmp_path / "whole.h5").read_bytes()[:5000])
    (tmp_path / "empty.h5").write_bytes(b"")
    request = Request((tmp_path,), out=tmp_path.parent / "out", check=check, no_report=True)
    outcome = run_stage(inspect.STAGE, request, inspect.Settings())
    assert outcome.exit_code == 3
    rejected = [c for c in outcome.json["checks"] if c["level"] == "reject"]
    assert {c["code"] for c in rejected} >= {"RRID-F01"}
    assert len(rejected) == len(outcome.result.rejected) == 2
    assert [log.verdict for log in outcome.result.logs] == ["ok"]


def test_the_result_holds_what_the_contract_says(tmp_path: Path) -> None:
    outcome = doctor(tmp_path, MAKE["D06 q"](good_log()))
    stored = json.loads((tmp_path / "out" / "result.json").read_text())
    for check in stored["checks"]:
        assert {"code", "level", "where", "message", "remedy"} <= check.keys()
        assert check["level"] in ("ok", "warn", "repair", "reject")
    (log,) = stored["logs"]
    assert log["samples"] == 6000
    assert log["usable_samples"] == 6000 - 12
    assert log["duration"] == pytest.approx(5.999)
    assert log["encoder_step"] == pytest.approx([1e-5] * 3)
    assert log["torque_step"] == pytest.approx([60 / 4096, 30 / 4096, 15 / 4096])
    assert len(log["sha256"]) == 64
    assert {r["signal"] for r in log["ranges"]} == {"q", "tau", "q_ref"}
    assert outcome.exit_code == 0


@pytest.mark.parametrize("row", ["T04", "T08 none", *rarely(
    "D02 channel", "T01", "T08", "S08 neither", "D05 flat top", "D11 power")])
def test_the_report_of_a_broken_log_is_drawn(row: str, tmp_path: Path) -> None:
    """One page, without script, that names the finding, within 200 kB."""
    outcome = doctor(tmp_path, MAKE[row](good_log()), no_report=False)
    page = (tmp_path / "out" / "report.html").read_text()
    assert f"RRID-{row[:3]}" in page
    assert "<script" not in page
    assert len(page) < 200_000
    assert outcome.report.tone in ("bad", "attention")


def test_another_robot_must_have_as_many_joints(tmp_path: Path) -> None:
    one = tmp_path / "one.toml"
    one.write_text('name = "one"\ngravity = [0.0, 0.0, -9.81]\n[kinematics]\nconvention = "dh"\n[[joint]]\nname = '
                   '"a"\ntype = "revolute"\na = 0.0\nalpha = 0.0\n'
                   'd = 0.0\noffset = 0.0\n')
    write_log(tmp_path / "log.h5", good_log())
    request = Request((tmp_path / "log.h5",), out=tmp_path / "out", robot=str(one), no_report=True)
    outcome = run_stage(inspect.STAGE, request, inspect.Settings())
    assert [(c.code, c.level) for c in outcome.result.checks] == [("RRID-S02", "reject")]


@pytest.mark.parametrize("session", ["rrr-closed-form", *(pytest.param(name, marks=pytest.mark.slow) for name in (
    "rrr-healthy", "rrr-changed"))])
def test_sample_logs_are_in_order(session: str, samples: Path, tmp_path: Path) -> None:
    request = Request((samples / session,), out=tmp_path / "out", check=True, no_report=True)
    outcome = run_stage(inspect.STAGE, request, inspect.Settings())
    assert [c for c in outcome.result.checks if c.level != "ok"] == []
    assert outcome.exit_code == 0
    assert "in order" in outcome.report.verdict


@pytest.fixture(scope="session")
def tx40(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> ExperimentLog:
    """The recorded six-joint arm, imported."""
    out = tmp_path_factory.mktemp("tx40") / "out"
    request = Request((Path("tx40"),), out=out, no_report=True)
    run_stage(import_log.STAGE, request, import_log.Settings(recipe="tx40", source=shared / "real" / "tx40"))
    (path,), _ = find_logs([out])
    return open_log(path).log


def _codes(log: ExperimentLog, tmp_path: Path) -> list[tuple[str, str]]:
    return [(c.code, c.message) for c in doctor(tmp_path, log).result.checks if c.level != "ok"]


def test_a_recorded_arm_is_in_order(tx40: ExperimentLog, tmp_path: Path) -> None:
    """Six joints, wrist friction no model explains, 1.5 s of rest at the end, links described wrongly: no false alarm."""
    assert _codes(tx40, tmp_path) == []


@pytest.mark.slow
def test_swapped_torques_of_a_recorded_arm_are_named(tx40: ExperimentLog, tmp_path: Path) -> None:
    """Columns 1 and 4."""
    swapped = _codes(with_signal(tx40, tau=tx40.tau[:, [3, 1, 2, 0, 4, 5]]), tmp_path)
    assert [code for code, _ in swapped] == ["RRID-S13"]
    assert "tau: columns 1,4 fit swapped" in swapped[0][1]


@pytest.mark.slow
def test_a_flipped_torque_of_a_recorded_arm_is_named(tx40: ExperimentLog, tmp_path: Path) -> None:
    flipped = _codes(with_signal(tx40, tau=tx40.tau * [1, 1, -1, 1, 1, 1]), tmp_path)
    assert [code for code, _ in flipped] == ["RRID-S14"]
    assert "joint 3" in flipped[0][1]


def test_the_recorded_motor_is_in_order(shared: Path, tmp_path: Path) -> None:
    """One axis, slow, cogging as large as friction, resampled from uneven time."""
    request = Request((Path("odrive"),), out=tmp_path / "logs", no_report=True)
    run_stage(import_log.STAGE, request, import_log.Settings(recipe="odrive", source=shared / "real" / "odrive"))
    outcome = run_stage(inspect.STAGE, Request((tmp_path / "logs",), out=tmp_path / "out", no_report=True, check=True),
                        inspect.Settings())
    assert [c for c in outcome.result.checks if c.level != "ok"] == []
    assert len(outcome.result.logs) == 6


def test_a_folder_is_judged_as_a_whole(tmp_path: Path) -> None:
    """The verdict counts, and names the worst first."""
    logs = [good_log(), replace(make_log(rest, "hold", duration=2.0), name="hold"), replace(MAKE["T03"](good_log(2)), name="lossy"),
            replace(MAKE["S09"](good_log(3)), name="rate")]
    outcome = doctor(tmp_path, *logs)
    assert outcome.report.verdict.startswith("Of 4 logs 1 cannot be used, 1 should be looked at. First of all: sample_time is 1000")
    assert outcome.report.tone == "bad"
    assert outcome.exit_code == 3

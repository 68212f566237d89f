"""The whole workflow: every stage on what the ones before it leave, and nothing mixed."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps, fit_friction, run, validate_writing
from pipelines.io.files import open_log, write_log
from pipelines.io.log import Signal
from pipelines.io.sessions import apart
from pipelines.stage import Outcome, Request, read_logs, run_stage
from tests.diagnose.sessions import written
from tests.healthy import begun

# What is dear and has tests of its own is left out: diagnosis, the choice of a law of friction, simulated writing.
WITHOUT = run.Settings({"fit-friction": fit_friction.Settings(law="three_sigmoid"),
                        "validate-writing": validate_writing.Settings(simulate=False)}, ("diagnose", "extend"))
ESTIMATE = run.Settings({"estimate-bps": estimate_bps.Settings()},
                        ("fit-friction", "reconstruct", "validate-writing", "frf", *WITHOUT.skip))


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> Path:
    """Six seconds of each sample log; every joint was driven alone in one of them."""
    opened = (open_log(path).log for path in sorted((samples / "rrr-closed-form").glob("*.h5")))
    return written(tmp_path_factory.mktemp("logs") / "logs", [begun(log, 6000) for log in opened])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, logs: Path) -> Outcome[run.Result]:
    """`rrrid run` on them."""
    request = Request((logs,), out=tmp_path_factory.mktemp("run") / "out", no_report=True)
    return run_stage(run.STAGE, request, WITHOUT)


def test_every_stage_is_there_in_the_order_of_the_data(whole: Outcome[run.Result]) -> None:
    """inspect, fit-friction, reconstruct, estimate-bps, validate-writing; each with its result and folder; no frf logs."""
    stages = json.loads((whole.folder / "result.json").read_text())["stages"]
    assert [(stage["name"], stage["exit"]) for stage in stages] == [
        ("inspect", 0), ("fit-friction", 0), ("reconstruct", 0), ("estimate-bps", 0),
        ("validate-writing", 0), ("frf", 5)]
    assert {p.name for p in (whole.folder / "reconstruct/logs").iterdir()} == {p.name for p in (
        whole.folder / "estimate-bps/logs").iterdir()} | {f"{n}.h5" for n in ("friction-1", "friction-2", "friction-3", "hold-1")}
    assert (whole.folder / "estimate-bps/model.json").is_file()
    table = next(section for section in whole.report.sections if section.title == "Stages").tables[0]
    assert "The model holds on the held-out log" in str(table.rows[4][1])  # in order: the headline has what is not
    assert table.tones[4] == "good"
    assert stages[4]["result"]["model"].startswith("estimate-bps")


def test_the_workflow_gives_what_its_stages_give(whole: Outcome[run.Result], logs: Path, tmp_path: Path) -> None:
    """estimate-bps inside `run`, on derived logs, is estimate-bps on the recordings with the friction that fit-friction found."""
    settings = estimate_bps.Settings(model=str(whole.folder / "fit-friction/model.json"))
    alone = run_stage(estimate_bps.STAGE, Request((logs,), out=tmp_path / "out", no_report=True), settings)
    inside = json.loads((whole.folder / "result.json").read_text())["stages"][3]["result"]
    assert inside["parameters"] == alone.json["parameters"]
    assert inside["relative_error"] == alone.json["relative_error"]
    assert (whole.folder / "estimate-bps/model.json").read_bytes() == (alone.folder / "model.json").read_bytes()


def test_what_a_folder_lacks_is_passed_over_with_a_word(samples: Path, tmp_path: Path) -> None:
    """Only friction logs: no rigid body is estimated, the reason is said, and that is no failure."""
    for number in (1, 2):
        (tmp_path / "logs").mkdir(exist_ok=True)
        shutil.copy(samples / f"rrr-closed-form/friction-{number}.h5", tmp_path / "logs")
    outcome = run_stage(run.STAGE, Request((tmp_path / "logs",), out=tmp_path / "out", check=True, no_report=True), ESTIMATE)
    last = outcome.result.stages[-1]
    assert (last.name, last.exit, last.result, outcome.exit_code) == ("estimate-bps", 5, None, 0)
    assert "no excitation or free log" in last.report.verdict
    assert "ecord an excitation" in last.report.verdict


def test_a_bad_log_costs_itself_alone(logs: Path, tmp_path: Path) -> None:
    """One damaged file and one log that stands still beside good ones: exit 3, and the rest is estimated as without them."""
    (tmp_path / "logs").mkdir()
    for name in ("excitation-1", "excitation-2"):
        shutil.copy(logs / f"{name}.h5", tmp_path / "logs")
    good = run_stage(run.STAGE, Request((tmp_path / "logs",), out=tmp_path / "good", no_report=True), ESTIMATE)
    (tmp_path / "logs/cut.h5").write_bytes((tmp_path / "logs/excitation-1.h5").read_bytes()[:9000])
    log = open_log(tmp_path / "logs/excitation-1.h5").log
    still = {**log.signals, "t": Signal(np.zeros(log.n_samples), "s", "time")}
    write_log(tmp_path / "logs/still.h5", replace(log, name="still", signals=still))
    outcome = run_stage(run.STAGE, Request((tmp_path / "logs",), out=tmp_path / "out", no_report=True), ESTIMATE)
    assert outcome.exit_code == 3
    assert {c.code for c in outcome.checks if c.level == "reject"} == {"RRID-F02", "RRID-T02"}
    assert outcome.json["stages"][1]["result"]["parameters"] == good.json["stages"][1]["result"]["parameters"]


def sessions(tmp_path: Path, samples: Path, **logs: tuple[str, str | None]) -> dict[str, set[str]]:
    """Which logs (name -> role and time of recording) go together, by the name of their session."""
    log = open_log(samples / "rrr-closed-form/hold-1.h5").log
    for name, (role, recorded) in logs.items():
        write_log(tmp_path / f"{name}.h5", replace(log, name=name, role=role, recorded=recorded))
    inputs = read_logs(Request((tmp_path,)), run.Settings())
    return {part.name: {opened.log.name for opened in part.logs} for part in apart(inputs.logs)}


def test_the_sample_logs_are_three_sessions(samples: Path) -> None:
    """The arm in closed form; the arm of the bench in order; the same one later, with its commissioning."""
    inputs = read_logs(Request((samples,)), run.Settings())
    parts = [sorted({opened.path.parent.name for opened in part.logs}) for part in apart(inputs.logs)]
    assert sorted(parts) == [["rrr-changed"], ["rrr-closed-form"], ["rrr-healthy"]]
    assert sum(len(part.logs) for part in apart(inputs.logs)) == len(inputs.logs)

"""The anatomy every stage shares: what is written, in what order, and what is never touched."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from pipelines import convert, inspect, run
from pipelines.errors import Check, InputRejected, UsageError
from pipelines.io.files import write_log
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, read_logs, run_stage, tilde
from tests.io.logs import small_log


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A folder with one good log."""
    folder = tmp_path / "logs"
    folder.mkdir()
    write_log(folder / "a.h5", small_log())
    return folder


def _request(logs: Path, **more: object) -> Request:
    return Request((logs,), out=logs.parent / "out", **more)  # type: ignore[arg-type]


def _contents(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()}


def test_provenance_names_every_input_and_output_by_hash(logs: Path) -> None:
    """Anyone can check what was made of what: every file of the folder, provenance.json apart, and every input."""
    outcome = run_stage(convert.STAGE, _request(logs), convert.Settings())
    about = json.loads((outcome.folder / "provenance.json").read_text())
    there = _contents(outcome.folder)
    there.pop("provenance.json")
    assert about["outputs"] == there
    assert about["inputs"] == {tilde(str(logs / "a.h5")): hashlib.sha256((logs / "a.h5").read_bytes()).hexdigest()}
    assert about["settings"] == {"to": ""}
    assert {"logs/a.parquet", "result.json", "report.html"} <= set(there)


def test_equal_inputs_give_equal_bytes(logs: Path) -> None:
    """Run twice, everything but provenance.json is the same to the byte: durations stand there alone."""
    first = _contents(run_stage(convert.STAGE, _request(logs), convert.Settings()).folder)
    second = _contents(run_stage(convert.STAGE, _request(logs), convert.Settings()).folder)
    assert first.pop("provenance.json") != second.pop("provenance.json")
    assert first == second


def test_own_output_is_replaced_and_foreign_files_are_refused(logs: Path) -> None:
    """C05: rrrid's earlier output goes, another's files never do, and nothing is written inside an input."""
    request = _request(logs)
    run_stage(convert.STAGE, request, convert.Settings("csv"))
    run_stage(convert.STAGE, request, convert.Settings("parquet"))
    assert not (logs.parent / "out/csv").exists()
    (logs.parent / "out/thesis.tex").write_text("years of work")
    with pytest.raises(UsageError, match=r"RRID-C05 .*thesis\.tex"):
        run_stage(convert.STAGE, request, convert.Settings())
    assert (logs.parent / "out/thesis.tex").read_text() == "years of work"
    for out in (logs, logs / "deep/er"):
        with pytest.raises(UsageError, match="RRID-C05 .*inside the input"):
            run_stage(convert.STAGE, Request((logs,), out=out), convert.Settings())


def _mine(folder: Path) -> dict[str, str]:
    return {name: value for name, value in _contents(folder).items() if name != "provenance.json"}


@pytest.mark.parametrize("given", ["logs/a.parquet", "logs", "link.parquet"])
def test_an_output_never_replaces_its_own_input(logs: Path, given: str) -> None:
    """C05: --out names the folder the input lies in, rrrid's own output at that; neither it nor anything else is lost."""
    out = run_stage(convert.STAGE, _request(logs), convert.Settings()).folder
    before = _contents(out)
    (logs.parent / "link.parquet").symlink_to(out / "logs/a.parquet")
    path = logs.parent / given if given.startswith("link") else out / given
    with pytest.raises(UsageError, match=r"RRID-C05 .*(would be replaced with it|holds the input)"):
        run_stage(convert.STAGE, Request((path,), out=out, force=True), convert.Settings("csv"))
    assert _contents(out) == before


def test_an_edited_output_wants_force(logs: Path) -> None:
    """C05: a result that somebody worked on since is not rrrid's any more; --force says that it may go."""
    out = run_stage(convert.STAGE, _request(logs), convert.Settings()).folder
    before = _mine(out)
    (out / "result.json").write_text("my notes")
    with pytest.raises(UsageError, match=r"RRID-C05 .*changed since rrrid wrote them: result\.json.*--force"):
        run_stage(convert.STAGE, _request(logs), convert.Settings())
    assert (out / "result.json").read_text() == "my notes"
    (out / "added.txt").write_text("more")
    run_stage(convert.STAGE, _request(logs, force=True), convert.Settings())
    assert _mine(out) == before


def test_a_result_does_not_depend_on_where_its_inputs_lie(tmp_path: Path) -> None:
    """The same folder at two places, one broken log in it: the same bytes of result and report, of every stage that reads logs."""
    few = run.Settings(skip=("fit-friction", "estimate-bps", "validate-writing", "frf", "diagnose", "extend"))
    contents = []
    for place in ("here", "over there/deep"):
        folder = tmp_path / place / "logs"
        write_log(folder / "a.h5", small_log())
        (folder / "b.parquet").write_bytes(b"PAR1 broken")
        for stage, settings in ((inspect.STAGE, inspect.Settings()), (run.STAGE, few)):
            out = run_stage(stage, Request((folder,), out=tmp_path / place / stage.name), settings).folder  # type: ignore[arg-type]
            assert str(tmp_path) not in (out / "result.json").read_text() + (out / "report.html").read_text()
            assert "b.parquet" in (out / "result.json").read_text()
        contents.append({p.parent.name + p.name: p.read_bytes() for p in (tmp_path / place).rglob("*.*")
                         if p.is_file() and p.name != "provenance.json"})
    assert contents[0] == contents[1]


@dataclass(frozen=True)
class _Nothing:
    pass


def _stage(compute: object, **more: object) -> Stage[_Nothing, _Nothing]:
    return Stage("convert", "A stage to test with", _Nothing, compute, lambda result: Report("Test", "done"), read_logs,  # type: ignore[arg-type]
                 **more)


def test_an_input_that_changes_meanwhile_is_refused(logs: Path) -> None:
    """F14: the log is written over while the stage computes; nothing is left, not even a draft."""

    def meddle(inputs: Inputs, settings: _Nothing) -> _Nothing:
        write_log(logs / "a.h5", small_log(name="other"))
        return _Nothing()

    with pytest.raises(InputRejected, match=r"RRID-F14 .*a\.h5: was modified while it was processed"):
        run_stage(_stage(meddle), _request(logs), _Nothing())
    assert [p.name for p in logs.parent.iterdir()] == ["logs"]


def test_an_input_that_changes_after_it_was_read_is_refused(logs: Path) -> None:
    """F14: the hash that is kept is that of the bytes that were read, not of what lies there afterwards."""

    def read(request: Request, settings: object) -> Inputs:
        inputs = read_logs(request, settings)
        write_log(logs / "a.h5", small_log(name="other"))
        return inputs

    with pytest.raises(InputRejected, match="RRID-F14"):
        run_stage(replace(_stage(lambda inputs, settings: _Nothing()), read=read), _request(logs), _Nothing())


def test_strict_turns_a_repair_into_an_error(logs: Path) -> None:
    """--strict: what would be mended with a word is refused, with the same code."""
    mended = Check.of("T02", "repair", "2 samples dropped", where="a")
    repaired = _stage(lambda inputs, settings: _Nothing(), checks=lambda result: (mended,))
    assert run_stage(repaired, _request(logs), _Nothing()).exit_code == 0
    with pytest.raises(InputRejected, match="RRID-T02 a: 2 samples dropped"):
        run_stage(repaired, _request(logs, strict=True), _Nothing())


def test_a_failed_stage_leaves_the_earlier_result(logs: Path) -> None:
    """Whatever goes wrong while writing, the old folder stands and no draft lies about."""
    run_stage(convert.STAGE, _request(logs), convert.Settings())
    before = _contents(logs.parent / "out")

    def fail(result: _Nothing, folder: Path, request: Request) -> None:
        (folder / "half").write_text("written")
        raise InputRejected("T08", "one sample")

    with pytest.raises(InputRejected):
        run_stage(_stage(lambda inputs, settings: _Nothing(), write=fail), _request(logs), _Nothing())
    assert _contents(logs.parent / "out") == before
    assert sorted(p.name for p in logs.parent.iterdir()) == ["logs", "out"]


@pytest.mark.row("P01")
def test_a_killed_stage_leaves_the_old_folder_or_the_new_one(logs: Path) -> None:
    """P01: SIGKILL at ten points of a run that replaces its own output: a folder whose every file fits its provenance."""
    request, kinds = _request(logs, no_report=True), set()
    run_stage(convert.STAGE, request, convert.Settings("parquet"))
    began = time.monotonic()
    run_stage(convert.STAGE, request, convert.Settings("csv"))
    lasted = time.monotonic() - began
    for kill in range(0, 40, 4):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            while True:
                run_stage(convert.STAGE, request, convert.Settings("parquet"))
                run_stage(convert.STAGE, request, convert.Settings("csv"))
        time.sleep(max(0.01, 0.1 * lasted) * kill)  # up to four such runs, however busy the machine is
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        there = _contents(logs.parent / "out")
        about = json.loads((logs.parent / "out/provenance.json").read_text())
        there.pop("provenance.json")
        assert about["outputs"] == there
        kinds.add(about["settings"]["to"])
    assert kinds == {"csv", "parquet"}
    run_stage(convert.STAGE, request, convert.Settings("csv"))
    assert sorted(p.name for p in logs.parent.iterdir()) == ["logs", "out"]

"""The anatomy every stage shares: what is written, in what order, and what is never touched."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipelines import convert, inspect
from pipelines.errors import Check, InputRejected, UsageError
from pipelines.io.files import write_log
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, footer_of, read_logs, run_stage, tilde
from tests.folders import contents
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


def test_provenance_names_every_input_and_output_by_hash(logs: Path) -> None:
    """Anyone can check what was made of what: every file of the folder, provenance.json apart, and every input."""
    outcome = run_stage(convert.STAGE, _request(logs), convert.Settings())
    about = json.loads((outcome.folder / "provenance.json").read_text())
    there = {name: hashlib.sha256(x).hexdigest() for name, x in contents(outcome.folder, "provenance.json").items()}
    assert about["outputs"] == there
    assert about["inputs"] == {tilde(str(logs / "a.h5")): hashlib.sha256((logs / "a.h5").read_bytes()).hexdigest()}
    assert about["settings"] == {"to": ""}
    assert {"logs/a.parquet", "result.json", "report.html"} <= set(there)


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


@pytest.mark.parametrize("given", ["logs/a.parquet", "logs", "link.parquet"])
def test_an_output_never_replaces_its_own_input(logs: Path, given: str) -> None:
    """C05: --out names the folder the input lies in, rrrid's own output at that; neither it nor anything else is lost."""
    out = run_stage(convert.STAGE, _request(logs), convert.Settings()).folder
    before = contents(out)
    (logs.parent / "link.parquet").symlink_to(out / "logs/a.parquet")
    path = logs.parent / given if given.startswith("link") else out / given
    with pytest.raises(UsageError, match=r"RRID-C05 .*(would be replaced with it|holds the input)"):
        run_stage(convert.STAGE, Request((path,), out=out, force=True), convert.Settings("csv"))
    assert contents(out) == before


def test_an_edited_output_wants_force(logs: Path) -> None:
    """C05: a result that somebody worked on since is not rrrid's any more; --force says that it may go."""
    out = run_stage(convert.STAGE, _request(logs), convert.Settings()).folder
    before = contents(out, "provenance.json")
    (out / "result.json").write_text("my notes")
    with pytest.raises(UsageError, match=r"RRID-C05 .*changed since rrrid wrote them: result\.json.*--force"):
        run_stage(convert.STAGE, _request(logs), convert.Settings())
    assert (out / "result.json").read_text() == "my notes"
    (out / "added.txt").write_text("more")
    run_stage(convert.STAGE, _request(logs, force=True), convert.Settings())
    assert contents(out, "provenance.json") == before


def test_a_result_does_not_depend_on_where_its_inputs_lie(tmp_path: Path) -> None:
    """The same folder at two places, one broken log in it: the same bytes of result and report."""
    found = []
    for place in ("here", "over there/deep"):
        folder = tmp_path / place / "logs"
        write_log(folder / "a.h5", small_log())
        (folder / "b.parquet").write_bytes(b"PAR1 broken")
        out = run_stage(inspect.STAGE, Request((folder,), out=tmp_path / place / "out"), inspect.Settings()).folder
        assert str(tmp_path) not in (out / "result.json").read_text() + (out / "report.html").read_text()
        assert "b.parquet" in (out / "result.json").read_text()
        found.append(contents(out, "provenance.json"))
    assert found[0] == found[1]


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
    before = contents(logs.parent / "out")

    def fail(result: _Nothing, folder: Path, request: Request) -> None:
        (folder / "half").write_text("written")
        raise InputRejected("T08", "one sample")

    with pytest.raises(InputRejected):
        run_stage(_stage(lambda inputs, settings: _Nothing(), write=fail), _request(logs), _Nothing())
    assert contents(logs.parent / "out") == before
    assert sorted(p.name for p in logs.parent.iterdir()) == ["logs", "out"]


def test_the_foot_of_a_report_names_every_input() -> None:
    """Inputs alike in their last parts have as many folders before them as make them differ."""
    places = ("/data/mon/arm/logs/raw/a.h5", "/data/tue/arm/logs/raw/a.h5", "/data/tue/arm/logs/raw/b.h5")
    foot = footer_of("run", dict.fromkeys(places, "0" * 64))
    assert [name.removeprefix("input ") for name in foot if name.startswith("input ")] == [
        "mon/arm/logs/raw/a.h5", "tue/arm/logs/raw/a.h5", "b.h5"]

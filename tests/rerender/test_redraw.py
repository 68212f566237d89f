"""A report drawn again is the report: nothing is computed, and what cannot be drawn honestly is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from pipelines import inspect, run
from pipelines.errors import InputRejected, RrridError, UsageError
from pipelines.io.files import write_log
from pipelines.rerender import rerender
from pipelines.stage import Request, run_stage
from tests.cli.commands import rrrid
from tests.controlled import controlled_log
from tests.folders import contents
from tests.seeds import rarely


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `inspect` and `run` leave of one log, with their reports."""
    folder = tmp_path_factory.mktemp("results")
    write_log(folder / "logs/a.h5", controlled_log(400))
    skipped = tuple(m.replace("_", "-") for m in run.STEPS if m not in ("inspect", "reconstruct", "frf"))
    for stage, settings in ((inspect.STAGE, inspect.Settings()), (run.STAGE, run.Settings(skip=skipped))):
        run_stage(stage, Request((folder / "logs",), out=folder / stage.name), settings)  # type: ignore[arg-type, type-var]
    return folder


@pytest.mark.parametrize("command", ["inspect", *rarely("run")])
def test_a_lost_report_comes_back(results: Path, tmp_path: Path, command: str) -> None:
    """Report and figures deleted, then drawn again: every byte is as it was, in its place and elsewhere."""
    shutil.copytree(results / command, tmp_path / "here")
    before = contents(results / command)
    (tmp_path / "here/report.html").unlink()
    shutil.rmtree(tmp_path / "here/figures")
    rerender(tmp_path / "here")
    assert contents(tmp_path / "here") == before
    rerender(tmp_path / "here", tmp_path / "there")
    drawn = {name: content for name, content in contents(tmp_path / "there").items() if name != "provenance.json"}
    assert drawn == {name: content for name, content in before.items() if name == "report.html" or name.startswith("figures/")}
    assert contents(tmp_path / "here") == before


@pytest.mark.row("C05")
def test_no_result_is_lost_to_a_report(results: Path, tmp_path: Path) -> None:
    """C05: another command's result is not replaced without --force; a report that lies there is."""
    shutil.copytree(results / "inspect", tmp_path / "there")
    with pytest.raises(UsageError, match=r"C05.*result of inspect.*--force"):
        rerender(results / "run", tmp_path / "there")
    assert contents(tmp_path / "there") == contents(results / "inspect")
    rerender(results / "run", tmp_path / "new")
    rerender(results / "inspect", tmp_path / "new")
    assert contents(tmp_path / "new")["report.html"] == contents(results / "inspect")["report.html"]


def refused(folder: Path) -> RrridError:
    before = contents(folder)
    with pytest.raises(RrridError) as problem:
        rerender(folder)
    assert contents(folder) == before
    return problem.value


def test_without_its_series_no_figure_is_drawn(results: Path, tmp_path: Path) -> None:
    """S01 where result.h5 is missing, F05 where a byte of it is another, and of result.json too."""
    shutil.copytree(results / "inspect", tmp_path / "a")
    (tmp_path / "a/result.h5").unlink()
    assert (refused(tmp_path / "a").code, refused(tmp_path / "a").exit_code) == ("RRID-S01", 3)
    shutil.copytree(results / "inspect", tmp_path / "b")
    (tmp_path / "b/result.json").write_bytes((tmp_path / "b/result.json").read_bytes() + b" ")
    assert refused(tmp_path / "b").code == "RRID-F05"
    shutil.copytree(results / "run", tmp_path / "c")
    shutil.rmtree(tmp_path / "c/.cache/inspect")
    assert refused(tmp_path / "c").code == "RRID-F05"


def test_an_edited_report_is_kept(results: Path, tmp_path: Path) -> None:
    """C05: what somebody wrote into the report is not drawn over without --force."""
    shutil.copytree(results / "inspect", tmp_path / "a")
    (tmp_path / "a/report.html").write_text("my notes")
    assert refused(tmp_path / "a").code == "RRID-C05"
    rerender(tmp_path / "a", force=True)
    assert contents(tmp_path / "a") == contents(results / "inspect")


def test_another_versions_result_is_refused(tmp_path: Path) -> None:
    """An earlier schema, fields that this version does not know, and a command that has no report: exit 3, 3 and 2."""
    for name, told, kind in (("frf", {"schema_version": 1}, InputRejected),
                             ("inspect", {"schema_version": 2, "logs": 3}, InputRejected),
                             ("doctor", {"schema_version": 2}, UsageError)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "result.json").write_text(json.dumps({"command": name, **told}))
        with pytest.raises(kind):
            rerender(tmp_path / name, tmp_path / "out")


def test_on_the_command_line(results: Path, tmp_path: Path) -> None:
    """The verdict and where the report lies; a folder without a result is C04."""
    shutil.copytree(results / "inspect", tmp_path / "a")
    done = rrrid("report", "a", cwd=tmp_path)
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "→ a/report.html")
    done = rrrid("report", tmp_path, cwd=tmp_path)
    assert (done.returncode, "RRID-C04" in done.stderr) == (2, True)

"""No result is lost that nobody meant to replace (C05): another command's, or in a default folder that of other data."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from pipelines import convert, inspect
from pipelines.errors import UsageError
from pipelines.io.files import write_log
from pipelines.report.report import Report
from pipelines.stage import Inputs, Outcome, Request, Stage, read_logs, run_stage
from tests.cli.commands import rrrid
from tests.io.logs import ROBOT_TEXT, small_log


@pytest.fixture
def days(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folders of one name, "logs", of one robot: of monday, of tuesday, and of both."""
    for day, names in {"monday": ("a",), "tuesday": ("b",), "both": ("a", "b")}.items():
        for name in names:
            write_log(tmp_path / day / f"logs/{name}.h5", small_log(name=name))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _converted(day: str, **more: Any) -> Outcome[Any]:
    return run_stage(convert.STAGE, Request((Path(day) / "logs",), no_report=True, **more), convert.Settings())


def _inspected(day: str, **more: Any) -> Outcome[Any]:
    return run_stage(inspect.STAGE, Request((Path(day) / "logs",), no_report=True, **more), inspect.Settings())


def _contents(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()}


def _said(outcome: Outcome[Any]) -> list[str]:
    """What is said of the output folder; it is no part of the result, for equal inputs give equal bytes."""
    assert "C05" not in json.dumps(outcome.json) + (outcome.folder / "result.json").read_text()
    return [check.message for check in outcome.checks if check.code == "RRID-C05" and check.level == "warn"]


@pytest.mark.row("C05")
def test_a_result_of_another_command_is_kept(days: Path) -> None:
    """Whole, under a free name beside, whoever chose the folder, as often as it happens. The same command's is replaced."""
    out = Path("out")
    _converted("monday", out=out)
    before = _contents(out)
    (words,) = _said(_inspected("monday", out=out))
    assert words == "the earlier result of convert is kept: its whole output was moved to out-convert"
    assert (_contents(Path("out-convert")), (out / "logs").exists()) == (before, False)
    assert _said(_inspected("tuesday", out=out)) == []
    for name in ("out-inspect", "out-convert-2", "out-inspect-2"):
        again = _converted if name.startswith("out-inspect") else _inspected
        assert [words.endswith(f"moved to {name}") for words in _said(again("monday", out=out))] == [True]
    names = ["out", "out-convert", "out-convert-2", "out-inspect", "out-inspect-2"]
    assert sorted(path.name for path in days.glob("out*")) == names
    assert _contents(Path("out-convert")) == before


@pytest.mark.row("C05")
def test_force_keeps_nothing_and_says_so(days: Path) -> None:
    """In a folder that was named, and in the default one."""
    _converted("monday", out=Path("out"))
    (words,) = _said(_inspected("monday", out=Path("out"), force=True))
    assert words == "the earlier result of convert was replaced, as --force says"
    _converted("monday")
    (words,) = _said(_converted("tuesday", force=True))
    assert "of other data" in words
    assert words.endswith("was replaced, as --force says")
    assert not list(days.rglob("*-convert")) + list(days.rglob("convert-*"))


@pytest.mark.row("C05")
def test_a_default_folder_keeps_what_is_of_other_data(days: Path) -> None:
    """Two folders of one name: monday's result lies beside tuesday's. Of the same logs, or some of them, it is replaced without a
    word, and so it is in a folder that was named."""
    place = _converted("monday").folder
    before = _contents(place)
    assert _said(_converted("monday")) == []
    (words,) = _said(_converted("tuesday"))
    assert words == (f"the earlier result of convert, of other data ({days}/monday/logs/a.h5), is kept: its whole output was moved "
                     f"to {place}-2")
    assert _contents(place.with_name("convert-2")).keys() == before.keys()
    assert sorted(path.name for path in (place.with_name("convert-2") / "logs").iterdir()) == ["a.parquet"]
    assert [_said(_converted(day)) for day in ("both", "monday", "both", "tuesday")] == [[]] * 4
    assert len(_said(_converted("monday"))) == 1
    assert sorted(path.name for path in place.parent.iterdir()) == ["convert", "convert-2", "convert-3"]
    assert [_said(_converted(day, out=Path("out"))) for day in ("monday", "tuesday")] == [[], []]


def test_logs_made_anew_in_their_place_are_no_other_data(days: Path) -> None:
    """Imported again, say, with another recipe: every byte differs, and the result is of the same recordings."""
    place = _converted("monday").folder
    write_log(days / "monday/logs/a.h5", small_log(name="a", seed=1))
    assert _said(_converted("monday")) == []
    assert [path.name for path in place.parent.iterdir()] == ["convert"]


def test_a_description_is_no_data(days: Path) -> None:
    """The robot that both days are given does not make them one."""
    (days / "arm.toml").write_text(ROBOT_TEXT)
    assert _said(_converted("monday", robot="arm.toml")) == []
    assert len(_said(_converted("tuesday", robot="arm.toml"))) == 1


def test_reference_logs_that_two_days_share_are_not_the_data(days: Path) -> None:
    """What the arm was, and what judges, is the same; what is asked about is not."""
    write_log(days / "before/ref.h5", small_log(name="ref", role="reference"))
    roles = {"reference": ("before",)}
    assert _said(_converted("monday", roles=roles)) == []
    assert len(_said(_converted("tuesday", roles=roles))) == 1
    assert _said(_converted("tuesday", roles=roles)) == []


@dataclass(frozen=True)
class _Nothing:
    pass


def test_recordings_are_data_and_their_recipe_is_none(days: Path) -> None:
    """Of a command that reads no logs: two recordings of one recipe are two imports, one recording with a new recipe is one."""
    def read(request: Request, settings: object) -> Inputs:
        return Inputs(sources=request.paths, label="arm", robot_name="arm")

    stage = Stage("import", "A stage to test with", _Nothing, lambda inputs, settings: settings,
                  lambda result: Report("Test", "done"), read)
    for name in ("1.csv", "2.csv", "recipe.toml"):
        (days / name).write_text(name)
    said = []
    for recording, recipe in (("1.csv", "first"), ("1.csv", "second"), ("2.csv", "second")):
        (days / "recipe.toml").write_text(recipe)
        said.append(len(_said(run_stage(stage, Request((days / "recipe.toml", days / recording)), _Nothing()))))
    assert said == [0, 0, 1]


def test_results_that_are_compared_are_the_data_of_a_comparison(days: Path) -> None:
    """January against February, then March against April: two comparisons of one name."""
    def read(request: Request, settings: object) -> Inputs:
        return Inputs(sources=request.paths, label="results", robot_name="arm")

    stage = Stage("compare", "A stage to test with", _Nothing, lambda inputs, settings: settings,
                  lambda result: Report("Test", "done"), read)
    for month in ("jan", "feb", "mar", "apr"):
        (days / f"{month}.json").write_text(json.dumps({"of": month}))
    said = [len(_said(run_stage(stage, Request((days / f"{one}.json", days / f"{other}.json")), _Nothing())))
            for one, other in (("jan", "feb"), ("jan", "feb"), ("mar", "apr"))]
    assert said == [0, 0, 1]


@pytest.mark.parametrize(("lacks", "aside"), [("inputs", "convert-2"), ("command", "convert-earlier")])
def test_what_an_output_does_not_say_of_itself_costs_nobody_a_result(days: Path, lacks: str, aside: str) -> None:
    """An older provenance.json, or a damaged one: of what command, or of what data, is unknown."""
    place = _converted("monday").folder
    about = json.loads((place / "provenance.json").read_text())
    del about[lacks]
    (place / "provenance.json").write_text(json.dumps(about))
    assert len(_said(_converted("monday"))) == 1
    assert [(kept / "logs/a.parquet").is_file() for kept in place.parent.glob(aside)] == [True]


def test_a_stage_within_a_run_is_no_output_of_that_command(days: Path) -> None:
    """Its folder has the command's name and its result.json, and is a part of the run: neither replaced nor moved."""
    def write(result: _Nothing, folder: Path, request: Request) -> None:
        (folder / "inspect").mkdir()
        (folder / "inspect/result.json").write_text('{"command": "inspect"}')

    stage = Stage("run", "A stage to test with", _Nothing, lambda inputs, settings: settings,
                  lambda result: Report("Test", "done"), read_logs, write)
    for number in range(2):
        done = run_stage(stage, Request((Path("monday/logs"),), out=Path("all")), _Nothing())
        assert (number, _said(done)) == (number, [])
    before = _contents(Path("all"))
    with pytest.raises(UsageError, match=r"RRID-C05 all/inspect: .*result\.json"):
        _inspected("monday", out=Path("all/inspect"), force=True)
    assert _contents(Path("all")) == before
    (words,) = _said(_inspected("monday", out=Path("all")))
    assert words == "the earlier result of run is kept: its whole output was moved to all-run"
    assert _contents(Path("all-run")) == before


@pytest.mark.row("C05")
def test_the_terminal_says_where_it_lies(days: Path) -> None:
    """Before all other remarks; with --json on standard error, and the result alone on standard output."""
    assert rrrid("convert", "monday/logs", "--out", "out", "--no-report", cwd=days).returncode == 0
    done = rrrid("inspect", "monday/logs", "--out", "out", "--no-report", cwd=days)
    remarks = [line for line in done.stdout.splitlines() if "RRID-" in line]
    assert remarks[0] == ("  ! RRID-C05 out: the earlier result of convert is kept: its whole output was moved to out-convert "
                          "(look there for it, or choose folders with --out)")
    done = rrrid("convert", "monday/logs", "--out", "out", "--json", cwd=days)
    assert json.loads(done.stdout) == json.loads((days / "out/result.json").read_text())
    assert "moved to out-inspect" in done.stderr

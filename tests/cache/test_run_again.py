"""A run computes only what changed, and ends as if it had computed everything."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from pipelines import cache, estimate_bps, inspect, reconstruct, run, validate_writing
from pipelines.errors import EnvironmentFault, UsageError
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog
from pipelines.report import render
from pipelines.stage import Outcome, Request, run_stage
from tests.controlled import controlled_log
from tests.folders import contents
from tests.healthy import begun
from tests.seeds import rarely

SHORT = run.Settings(skip=tuple(m.replace("_", "-") for m in run.STEPS if m not in ("inspect", "reconstruct", "frf")))
LONG = run.Settings(skip=("diagnose", "extend"), stages={"estimate-bps": estimate_bps.Settings(),
                                                         "validate-writing": validate_writing.Settings(simulate=False)})


def go(folder: Path, settings: run.Settings = SHORT, **more: Any) -> tuple[Outcome[run.Result], list[str]]:
    """Run `folder`/logs into `folder`/out; the outcome, and which stages were computed."""
    said: list[str] = []
    outcome = run_stage(run.STAGE, Request((folder / "logs",), out=folder / "out", tell=said.append, **more), settings)
    stages = [module.replace("_", "-") for module in run.STEPS]
    return outcome, [line.partition(":")[0] for line in said
                     if line.partition(":")[0] in stages and not line.endswith(": unchanged")]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two short logs, run once."""
    folder = tmp_path_factory.mktemp("done")
    for seed in (1, 2):
        write_log(folder / f"logs/{seed}.h5", replace(controlled_log(400, seed), name=f"log {seed}"))
    assert go(folder, no_report=True)[1] == ["inspect", "reconstruct", "frf"]
    return folder


@pytest.fixture
def small(done: Path, tmp_path: Path) -> Path:
    """The same in a folder of its own: where it lies is nothing to a run."""
    return shutil.copytree(done, tmp_path / "small")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> Path:
    """A run of six stages."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "logs").mkdir()
    for name in ("excitation-1", "excitation-2"):
        write_log(folder / f"logs/{name}.h5", begun(open_log(samples / f"rrr-closed-form/{name}.h5").log, 4000))
    go(folder, LONG, no_report=True)
    return folder


def test_nothing_changed_nothing_computed(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All stages are taken back, figures too, and every byte is the same."""
    alone = replace(SHORT, skip=(*SHORT.skip, "reconstruct", "frf"))
    (small / "logs/2.h5").unlink()
    assert go(small, alone)[1] == ["inspect"]
    before = contents(small / "out", "provenance.json")
    assert len([name for name in before if name.endswith(".png")]) > 0
    with monkeypatch.context() as patched:
        patched.setattr(render, "_draw", lambda figure, salt: pytest.fail(f"{salt} is drawn again"))
        assert go(small, alone)[1] == []
    assert contents(small / "out", "provenance.json") == before
    figure = next((small / "out/figures").glob("*.png"))  # it may be somebody's (C05), unless --force says otherwise
    figure.write_bytes(figure.read_bytes()[:-7])
    with pytest.raises(UsageError, match="C05"):
        go(small, alone)
    assert go(small, alone, force=True)[1] == []
    assert contents(small / "out", "provenance.json") == before


def other_log(folder: Path) -> run.Settings:
    write_log(folder / "logs/2.h5", replace(controlled_log(400, 3), name="log 2"))
    return SHORT


def bad_file(folder: Path) -> run.Settings:
    (folder / "logs/cut.h5").write_bytes((folder / "logs/1.h5").read_bytes()[:3000])
    return SHORT


def another_name(folder: Path) -> run.Settings:
    (folder / "logs/2.h5").rename(folder / "logs/3.h5")
    return SHORT


def own_setting(folder: Path) -> run.Settings:
    return replace(SHORT, stages={"inspect": inspect.Settings(trust_units=True)})


def setting_of_all_logs(folder: Path) -> run.Settings:
    return replace(SHORT, stages={"reconstruct": reconstruct.Settings(order=3)})


@pytest.mark.parametrize(("change", "computed", "why"), [
    (other_log, ["inspect", "reconstruct"], "2.h5 has other content"),
    (bad_file, ["inspect"], "new unusable file cut.h5"),
    (another_name, ["inspect", "reconstruct"], "new log 3.h5; log gone: 2.h5"),
    (own_setting, ["inspect"], "trust_units was false, is true"),
    (setting_of_all_logs, ["reconstruct", "frf"], "order was 4, is 3"),
])
@pytest.mark.row("P09")
def test_exactly_what_is_affected(small: Path, change: Callable[[Path], run.Settings], computed: list[str], why: str) -> None:
    """P09: one thing changes; --dry-run says which stages that concerns and why, writes nothing, and is right."""
    settings = change(small)
    before = contents(small, "provenance.json")
    planned = run.plan(Request((small / "logs",), out=small / "out", no_report=True), settings)
    assert [one.stage for one in planned if one.computed] == computed
    assert next(one.why for one in planned if one.computed) == why
    assert contents(small, "provenance.json") == before
    assert go(small, settings, no_report=True)[1] == computed


@pytest.mark.row("P09")
def test_changed_code_and_libraries(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """P09: a module of one stage alone, and a library of all."""
    code = cache.code_of
    monkeypatch.setattr(cache, "code_of", lambda module, sources, *without: code(module, sources, *without) | (
        {"pipelines.estimation.motion_result": "other"} if module == "pipelines.reconstruct" else {}))
    planned = run.plan(Request((small / "logs",), out=small / "out"), SHORT)
    assert [(one.stage, one.why) for one in planned if one.computed] == [
        ("reconstruct", "code of estimation.motion_result"), ("frf", "reconstruct before it changed")]
    monkeypatch.setattr(cache, "code_of", code)
    monkeypatch.setattr(cache, "libraries", lambda *names: {"numpy": "0.1"})
    assert all(one.computed and "numpy" in one.why for one in run.plan(Request((small / "logs",), out=small / "out"), SHORT))


@pytest.mark.row("P10")
@pytest.mark.parametrize("file", [".cache/reconstruct/entry.json", "reconstruct/logs/1.h5"])
def test_a_damaged_store_is_computed_again(small: Path, file: str) -> None:
    """P10: one flipped byte is noticed, told, and mended by computing."""
    before = contents(small / "out", "provenance.json")
    content = bytearray((small / "out" / file).read_bytes())
    content[len(content) // 2] ^= 1
    (small / "out" / file).write_bytes(content)
    outcome, computed = go(small, no_report=True)
    assert computed == ["reconstruct"]
    assert [(c.code, c.level, c.where) for c in outcome.checks if c.code == "RRID-P10"] == [("RRID-P10", "warn", file)]
    assert contents(small / "out", "provenance.json") == before


class Shut(ExperimentLog):
    """A log that says what it is, and shows no sample."""

    def __getattribute__(self, name: str) -> Any:
        assert name not in ("signals", "t", "q", "tau", "n_samples"), f"{name} of a log that is not read"
        return super().__getattribute__(name)


def _shut(log: ExperimentLog) -> Shut:
    same = object.__new__(Shut)
    same.__dict__.update(log.__dict__)
    return same


@pytest.mark.parametrize("module", ["estimate_bps", "frf", *rarely("fit_friction", "validate_writing")])
def test_a_stage_reads_no_other_logs_than_it_says(module: str, samples: Path) -> None:
    """`Uses` is the truth: with every other log shut, the result is the same."""
    from pipelines.errors import NothingMatched
    from pipelines.stage import read_logs

    stage = import_module(f"pipelines.{module}").STAGE
    settings = stage.in_run or stage.settings()
    if module == "estimate_bps":
        settings = replace(settings)
    if module == "validate_writing":
        settings = replace(settings, simulate=False)
    names = ("friction-1", "hold-1", "excitation-1", "excitation-2", "free-1")
    whole = read_logs(Request(tuple(samples / f"rrr-closed-form/{name}.h5" for name in names)), settings)
    inputs = replace(whole, logs=tuple(replace(opened, log=begun(opened.log, 4000)) for opened in whole.logs))
    shut = tuple(opened if stage.uses.logs(opened.log, settings) else replace(opened, log=_shut(opened.log))
                 for opened in inputs.logs)
    assert any(isinstance(opened.log, Shut) for opened in shut) or module == "validate_writing"
    try:
        assert stage.compute(replace(inputs, logs=shut), settings) is not None
    except NothingMatched:
        assert module == "frf"


@pytest.mark.row("P08")
def test_of_two_runs_with_one_output_the_second_is_refused(small: Path) -> None:
    """P08: exit 6 while the first one runs; afterwards nothing is left of the lock."""
    first = cache.Store(small / "out")
    first.hold()
    with pytest.raises(EnvironmentFault, match="locked by process") as refused:
        go(small, no_report=True)
    assert (refused.value.code, refused.value.exit_code) == ("RRID-P08", 6)
    first.release()
    assert go(small, no_report=True)[1] == []
    assert sorted(path.name for path in small.iterdir()) == ["logs", "out"]

"""What is true of every stage, whatever it computes. A new stage inherits all of it."""

from __future__ import annotations

import ast
import inspect
import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from matplotlib.collections import Collection
from matplotlib.figure import Figure as Drawing

from pipelines.cache import digest_of_json
from pipelines.errors import Check
from pipelines.io.files import open_log, write_csv, write_log
from pipelines.io.hdf5 import read_series
from pipelines.io.output import PROVENANCE
from pipelines.io.results import decode, encode, result_schema
from pipelines.report import render
from pipelines.report.report import Figure
from pipelines.report.style import figure_style
from pipelines.stage import Outcome, Request, Stage, run_stage
from rrrid_cli.options import STAGES
from tests.controlled import controlled_log
from tests.diagnose.sessions import but, session, written
from tests.healthy import begun
from tests.importers.good import RECIPE
from tests.test_compare import written as written_result

REPO = Path(__file__).resolve().parents[1]
# What stages share, and what works on stages.
NO_STAGES = ("__init__", "stage", "errors", "cache", "executor", "batch", "rerender", "selfcheck")
MODULES = [path.stem for path in sorted((REPO / "pipelines").glob("*.py")) if path.stem not in NO_STAGES]
# The sample logs of whose first seconds a stage is run here: few of every kind it reads. Any other stage takes them all.
_FEW = ("excitation-1", "excitation-2", "hold-1")
LOGS = {"inspect": _FEW, "convert": ("excitation-1", "hold-1"), "reconstruct": ("excitation-1", "hold-1"), "estimate_bps": _FEW,
        "fit_friction": ("friction-3",), "run": ("excitation-1", "hold-1"), "validate_writing": ("excitation-1", "excitation-2")}
# Whose two runs are compared by name alone: an import, a fit, a search by chance, a simulation and `run` differ in kind.
RARELY_TWICE = ("compare", "convert", "demo", "diagnose", "extend", "fit_friction", "frf", "inspect", "reconstruct",
                "validate_writing")
FORBIDDEN = {"open", "print", "read_text", "write_text", "read_bytes", "write_bytes", "open_log", "write_log", "savefig"}


def _stage(module: str) -> Stage[Any, Any]:
    stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
    return stage


def _module(stage: Stage[Any, Any]) -> str:
    return stage.compute.__module__.removeprefix("pipelines.")


def _recording(folder: Path, samples: Path) -> Path:
    """A CSV recording and its recipe, for the stage that makes logs instead of reading them."""
    folder.mkdir(exist_ok=True)
    write_csv(folder / "run.csv", open_log(samples / "rrr-closed-form/excitation-1.h5").log)
    recipe = folder / "recipe.toml"
    recipe.write_text(RECIPE)
    return recipe


Ran = tuple[Stage[Any, Any], Outcome[Any]]


def _run(module: str, tmp_path: Path, samples: Path) -> Ran:
    stage = _stage(module)
    settings = stage.settings()
    paths: tuple[Path, ...] = (samples / "rrr-closed-form",)
    if module in LOGS:
        logs = (open_log(samples / f"rrr-closed-form/{name}.h5").log for name in LOGS[module])
        paths = (written(tmp_path / "few", [begun(log, 3000) for log in logs]),)
    if module == "import_log":
        recipe = _recording(tmp_path / "data", samples)
        settings, paths = replace(settings, recipe=str(recipe), source=recipe.parent), ()
    if module == "simulate":
        write_log(tmp_path / "waving.h5", controlled_log(400))
        settings, paths = replace(settings, model="rrr"), (tmp_path / "waving.h5",)
    if module == "export_model":
        settings, paths = replace(settings, model="rrr"), ()
    if module == "frf":
        settings, paths = replace(settings, high=60.0), (samples / "rrr-healthy/frf-1-1.h5",)
    if module == "run":
        settings = replace(settings, skip=("fit-friction", "validate-writing", "diagnose", "extend"))
    if module in ("diagnose", "extend"):
        paths = (written(tmp_path / "brief", session("cogging", 1, 2.0, 1)),)
        more: dict[str, Any] = {"exclude": but("cogging"), "max_causes": 1} if module == "diagnose" else {
            "causes": ("cogging:1",)}
        settings = replace(settings, **more)
    if module == "demo":
        paths = ()
    if module == "compare":
        paths = (written_result(tmp_path / "a", 1), written_result(tmp_path / "b", 2))
    if module == "design_excitation":
        settings, paths = replace(settings, evaluations=150, harmonics=(15,)), ()
    return stage, run_stage(stage, Request(paths, out=tmp_path / "out", no_report=True), settings)


@pytest.fixture(scope="module")
def ran(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, samples: Path) -> Ran:
    """One outcome of a stage for all that is asked of it: pytest asks it all before the next stage's turn."""
    return _run(request.param, tmp_path_factory.mktemp(request.param), samples)


def test_every_stage_is_a_command() -> None:
    """A file directly in pipelines/ is a stage and bears its command's name."""
    assert {_stage(module).name for module in MODULES} == set(STAGES)
    assert all(_stage(module).name.replace("-", "_") in (module, module.removesuffix("_log"), module.removesuffix("_model")) for module in MODULES)


@pytest.mark.parametrize("module", MODULES)
def test_a_stage_says_what_it_reads_and_writes(module: str) -> None:
    """Title in the first line, then Reads, Writes and Source, as design.md asks."""
    words = (import_module(f"pipelines.{module}").__doc__ or "").splitlines()
    assert words[0].endswith(".")
    for label in ("Reads ", "Writes ", "Source "):
        assert any(line.startswith(label) for line in words), f"{module} does not say what it {label.lower()}"


@pytest.mark.parametrize("module", MODULES)
def test_compute_opens_no_file_and_prints_nothing(module: str) -> None:
    """Compute, draw, write: three functions. The two first name nothing that touches the disk or the screen."""
    for function in (_stage(module).compute, _stage(module).report):
        for node in ast.walk(ast.parse(inspect.getsource(inspect.unwrap(function)))):
            if isinstance(node, ast.Call):
                name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
                assert name not in FORBIDDEN, f"{function.__qualname__} calls {name}"


def _outlined(figure: Figure, name: str) -> tuple[str, bytes]:
    """What a figure shows, as numbers: to put it on paper costs fifty times as much, and tests/rerender does that."""
    with figure_style(name):
        figure.draw(drawing := Drawing(figsize=figure.size))
        shown = [part for axes in drawing.axes for part in (*axes.lines, *axes.patches, *axes.collections)]
        paths = [path for part in shown for path in (part.get_paths() if isinstance(part, Collection) else [part.get_path()])]
        offsets = [part.get_offsets() for part in shown if isinstance(part, Collection)]
    return f"<svg>{digest_of_json([np.asarray(x).tolist() for x in (*(path.vertices for path in paths), *offsets)])}", b""


@pytest.mark.parametrize("ran", [m for m in MODULES if m != "run"], indirect=True)
def test_a_stored_result_redraws_its_report(ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    """result.json and result.h5 hold all that the report shows: what is read back draws the same page."""
    stage, outcome = ran
    stored = json.loads((outcome.folder / "result.json").read_text())
    jsonschema.validate(stored, result_schema(type(outcome.result), stage.name))
    assert (stored.pop("command"), stored.pop("schema_version")) == (stage.name, 2)
    series = read_series(outcome.folder / "result.h5") if (outcome.folder / "result.h5").exists() else {}
    again = decode(type(outcome.result), stored, series)
    assert encode(again)[0] == encode(outcome.result)[0]
    monkeypatch.setattr(render, "_draw", _outlined)
    drawn, redrawn = (render.render_report(report, {}) for report in (outcome.report, stage.report(again)))
    assert redrawn == drawn


@pytest.mark.parametrize("ran", [
    pytest.param(m, marks=pytest.mark.slow if m in RARELY_TWICE else ()) for m in MODULES], indirect=True)
def test_twice_is_the_same(ran: Ran, tmp_path: Path, samples: Path) -> None:
    """Equal inputs give equal bytes, provenance.json apart; that a report follows from its result is another test's."""
    contents = []
    for _, outcome in (ran, _run(_module(ran[0]), tmp_path, samples)):
        files = {p.relative_to(outcome.folder).as_posix(): p for p in outcome.folder.rglob("*") if p.is_file()}
        contents.append({name: path.read_bytes() for name, path in files.items() if path.name != PROVENANCE
                         and name != "report.html" and not name.startswith(("figures/", ".cache/"))})
    assert contents[0] == contents[1]
    assert "result.json" in contents[0]


def _examined(folder: Path, out: Path) -> tuple[int, list[Check]]:
    """How many logs lie in `folder`, and what the doctor would not have as it is."""
    from pipelines.inspect import STAGE as DOCTOR

    result = run_stage(DOCTOR, Request((folder,), out=out, no_report=True), DOCTOR.settings()).result
    return len(result.logs), [c for c in result.checks if c.level in ("reject", "repair")]


@pytest.mark.parametrize("ran", [m for m in MODULES if m not in ("inspect", "run", "frf", "diagnose", "compare", "export_model")], indirect=True)
def test_every_log_a_stage_writes_is_in_order(ran: Ran, tmp_path: Path) -> None:
    """`inspect` passes on every log that any stage writes; these stages write some."""
    logs, complaints = _examined(ran[1].folder, tmp_path / "examined")
    assert logs > 0
    assert complaints == []

"""`import rrrid` gives the results of the commands, as objects."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rrrid
from pipelines import run
from pipelines.errors import UsageError
from pipelines.io.files import open_log
from pipelines.stage import Request, run_stage
from tests.diagnose.sessions import written
from tests.healthy import begun

LOGS = Path(__file__).resolve().parents[2] / "sample_logs" / "rrr-closed-form"


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six seconds of two excitations and a hold."""
    kept = [open_log(LOGS / f"{name}.h5").log for name in ("excitation-1", "excitation-2", "hold-1")]
    return written(tmp_path_factory.mktemp("logs") / "logs", [begun(log, 6000) for log in kept])


@pytest.fixture(scope="module")
def loaded(logs: Path) -> rrrid.Answer:
    return rrrid.load(logs)


@pytest.fixture(scope="module")
def model(loaded: rrrid.Answer) -> rrrid.Answer:
    return rrrid.estimate(rrrid.reconstruct(loaded))


@pytest.fixture(scope="module")
def saved(model: rrrid.Answer, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return model.save(tmp_path_factory.mktemp("saved") / "out")


def test_import_loads_no_library_and_no_stage():
    told = "import sys, rrrid; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    there = set(done.stdout.split())
    assert not there & {"numpy", "scipy", "pandas", "h5py", "matplotlib", "pipelines.stage"}


def test_chain_of_functions_gives_what_a_run_gives(model: rrrid.Answer, logs: Path, tmp_path: Path):
    others = ("fit-friction", "validate-writing", "frf", "diagnose", "extend")
    request = Request((logs,), out=tmp_path / "run", no_report=True)
    whole = run_stage(run.STAGE, request, run.Settings(skip=others, no_cache=True))
    stored = next(one.result for one in whole.result.stages if one.name == "estimate-bps")
    assert model.result.relative_error == stored.relative_error
    for own, its in zip(model.result.parameters, stored.parameters, strict=True):
        assert (own.name, own.value, own.std) == (its.name, its.value, its.std)


def test_frame_has_a_row_a_parameter_with_its_std(model: rrrid.Answer):
    table = model.to_frame()
    assert list(table["name"]) == [one.name for one in model.result.parameters]
    assert np.all(table["std"] > 0.0)


def test_figures_are_drawn_by_name(model: rrrid.Answer):
    drawing = model.plot(model.figures[-1])
    assert any(axes.has_data() for axes in drawing.axes)
    with pytest.raises(UsageError, match=model.figures[0]):
        model.plot("nothing")


def test_notebook_shows_verdict_and_key_figures(model: rrrid.Answer):
    shown = model._repr_html_()
    assert "<table>" in shown
    assert model.summary[:40] in shown


def test_saved_folder_is_that_of_the_command(model: rrrid.Answer, saved: Path, tmp_path: Path):
    names = {path.name for path in saved.iterdir()}
    assert {"result.json", "model.json", "report.html", "figures", "provenance.json"} <= names
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(rrrid.RrridError):
        model.save(tmp_path / "mine")
    assert (tmp_path / "mine" / "notes.txt").read_text() == "mine"


def test_saved_model_is_simulated(saved: Path):
    hold = rrrid.load(LOGS / "hold-1.h5")
    simulated = rrrid.simulate(hold, saved / "model.json", windowed=True)
    assert list(simulated.to_frame()["name"]) == ["hold-1"]


def test_roles_are_given_where_logs_are_read(loaded: rrrid.Answer):
    with pytest.raises(UsageError, match="load"):
        rrrid.diagnose(loaded, reference=("before",))


def test_options_that_are_not_there_name_the_nearest(loaded: rrrid.Answer):
    with pytest.raises(UsageError, match="did you mean 'cutoff_hz'"):
        rrrid.estimate(loaded, cutoff_h=3.0)
    with pytest.raises(UsageError, match="criterion"):
        rrrid.design("rrr", criterium="A")


def test_value_that_an_option_cannot_have_is_refused(loaded: rrrid.Answer):
    with pytest.raises(UsageError, match="blocks"):
        rrrid.estimate(loaded, blocks="many")


def test_role_that_is_not_there_is_refused():
    with pytest.raises(UsageError, match="did you mean 'reference'"):
        rrrid.load(LOGS, roles={"referense": LOGS})


def test_logs_take_the_role_that_they_are_given():
    given = rrrid.load(LOGS / "hold-1.h5", roles={"reference": LOGS / "excitation-1.h5"})
    assert {one.name: one.role for one in given.logs}["excitation-1"] == "reference"


def test_description_that_was_given_is_among_the_hashed_inputs(tmp_path: Path):
    robot = LOGS.parent / "robots" / "rrr.toml"
    given = tmp_path / "robot.toml"
    given.write_text(robot.read_text())
    found = rrrid.load(LOGS / "hold-1.h5", robot=str(given)).found
    assert given in found.hashes


def test_what_is_no_answer_is_refused_with_what_to_do():
    with pytest.raises(UsageError, match="load"):
        rrrid.estimate("sample_logs/rrr-changed")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="no logs"):
        rrrid.load(3)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="tuple"):
        rrrid.extend(rrrid.load(LOGS / "hold-1.h5"), **{"causes": "cogging:2"})


def test_model_is_exported(saved: Path, tmp_path: Path):
    exported = rrrid.export(saved / "model.json", to="json").save(tmp_path / "exported")
    assert any(path.suffix == ".json" and path.name != "result.json" for path in exported.iterdir())

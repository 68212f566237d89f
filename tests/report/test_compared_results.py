"""Comparisons lie apart by what was compared; a stage within a run is a result, and what cannot be compared says what can."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.io.results import headed, read_any_result, read_result
from pipelines.report.compared_results import label_of, of_other_commands

MODEL = {"format": "rrrid-model", "base_parameters": [], "friction": [], "effects": [], "robot": ""}


def left(folder: Path, command: str, **more: Any) -> Path:
    """What a command leaves in `folder`."""
    folder.mkdir(parents=True)
    (folder / "result.json").write_text(json.dumps(headed(command, more)))
    (folder / "model.json").write_text(json.dumps(MODEL))
    (folder / "provenance.json").write_text(json.dumps({"tool": "rrrid", "command": command, "outputs": {}}))
    return folder


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """Two days of one robot, in the folders that nobody has to name, and one in a folder of the user's."""
    for day in ("monday", "friday"):
        left(tmp_path / f"runs/arm/{day}/estimate-bps", "estimate-bps")
        left(tmp_path / f"runs/arm/{day}/extend", "extend")
        stages = [{"name": "estimate-bps", "exit": 0, "result": {"parameters": [day]}}, {"name": "frf", "exit": 5, "result": None}]
        left(tmp_path / f"runs/arm/{day}/run", "run", stages=stages, runs=[])
        (tmp_path / f"runs/arm/{day}/run/estimate-bps").mkdir()
        (tmp_path / f"runs/arm/{day}/run/estimate-bps/model.json").write_text(json.dumps(MODEL))
    left(tmp_path / "runs/arm/monday/extend-cogging-2", "extend")
    left(tmp_path / "mine", "extend")
    return tmp_path / "runs/arm"


@pytest.mark.parametrize(("a", "b", "label"), [
    ("monday/extend", "friday/extend", "monday-and-friday-extend"),
    ("monday/extend/model.json", "friday/extend/model.json", "monday-and-friday-extend-model"),
    ("monday/extend-cogging-2", "monday/extend", "monday-extend-cogging-2-and-extend"),
    ("monday/estimate-bps/model.json", "friday/extend/model.json", "monday-estimate-bps-and-friday-extend-model"),
    ("monday/run/estimate-bps", "friday/estimate-bps", "monday-run-and-friday-estimate-bps"),
    ("monday/run/estimate-bps", "friday/run/estimate-bps", "monday-and-friday-run-estimate-bps"),
    ("monday/run/estimate-bps/model.json", "friday/run/estimate-bps/model.json", "monday-and-friday-run-estimate-bps-model"),
    ("monday/extend", "../../mine", "monday-extend-and-mine"),
    ("monday/extend", "monday/extend", "monday-extend")])
def test_a_comparison_is_called_by_both(runs: Path, a: str, b: str, label: str) -> None:
    assert label_of(*((read_any_result((runs / one).resolve())) for one in (a, b))) == label


def test_a_stage_of_a_run_is_a_result(runs: Path) -> None:
    """By its folder, though that has no result.json; also where it has no file and no folder."""
    found = read_any_result(runs / "monday/run/estimate-bps")
    assert (found.command, found.object, found.path) == (
        "estimate-bps", {"command": "estimate-bps", "parameters": ["monday"]}, runs / "monday/run/result.json")
    assert found.folder == runs / "monday/run/estimate-bps"
    with pytest.raises(UsageError, match=r"C04.*no result of frf: it was passed over"):
        read_any_result(runs / "monday/run/frf")
    for stranger in ("monday/run/diagnose", "monday/nowhere"):
        with pytest.raises(UsageError, match="C04"):
            read_any_result(runs / stranger)


def test_what_lies_beside_a_folder_that_is_not_there_is_none_of_its_faults(tmp_path: Path) -> None:
    """A run without stages; and a result.json of some other program."""
    (tmp_path / "run").mkdir()
    provenance = json.dumps({"tool": "rrrid", "command": "run", "outputs": {}})
    for text in (json.dumps(headed("run", {})), "[]", "{"):
        (tmp_path / "run/result.json").write_text(text)
        (tmp_path / "run/provenance.json").write_text(provenance)
        with pytest.raises(UsageError, match=f"C04.*{tmp_path}/run/frf"):
            read_any_result(tmp_path / "run/frf")


def test_what_can_be_compared_instead_is_named(runs: Path) -> None:
    """The models of both; the stage within the run; or that there is no model."""
    estimate, extend, run = (read_result(runs / "monday" / name) for name in ("estimate-bps", "extend", "run"))
    assert f"rrrid compare {runs}/monday/estimate-bps/model.json {runs}/monday/extend/model.json" in str(
        of_other_commands(estimate, extend))
    for pair in ((run, estimate), (estimate, run)):
        assert f"ame that stage of the run: {runs}/monday/run/estimate-bps" in str(of_other_commands(*pair))
    (runs / "friday/estimate-bps/model.json").unlink()
    assert "estimate-bps left none there" in str(of_other_commands(read_result(runs / "friday/estimate-bps"), extend))
    model = read_result(runs / "monday/extend/model.json")
    assert "with that of another result" in str(of_other_commands(extend, model))


@pytest.mark.parametrize("text", ["9" * 400, "9" * 5000, "[" * 200_000])
def test_a_result_of_numbers_that_no_float_holds_is_damaged(text: str, tmp_path: Path) -> None:
    """F02, not an overflow where the number is used."""
    (tmp_path / "result.json").write_text(f'{{"command": "inspect", "schema_version": 2, "joints": {text}}}')
    with pytest.raises(InputRejected, match="F02"):
        read_result(tmp_path)

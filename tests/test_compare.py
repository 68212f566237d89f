"""Two results of one arm agree, two of different arms do not; what only one has and what moved is named."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from pipelines import compare
from pipelines.errors import InputRejected, RrridError, UsageError
from pipelines.estimation.bootstrap import limit_of, standardised
from pipelines.io.output import hash_file
from pipelines.report.comparison_report import Comparison
from pipelines.stage import Outcome, Request, run_stage
from tests.cli.commands import rrrid

COUNT = 30  # figures of a result
STD = np.geomspace(1e-4, 10.0, COUNT)
TRUTH = np.linspace(-2.0, 5.0, COUNT)


def written(folder: Path, seed: int, moved: tuple[int, float] = (0, 0.0), **more: Any) -> Path:
    """A result of estimate-bps: `TRUTH` with an error of the stated size; figure moved[0] off by moved[1] std."""
    values = TRUTH + STD * np.random.default_rng(seed).standard_normal(COUNT)
    values[moved[0]] += moved[1] * STD[moved[0]]
    parameters = [{"name": f"p{i + 1}", "value": float(v), "std": float(s), "unit": "kg m^2", "visible": True}
                  for i, (v, s) in enumerate(zip(values, STD, strict=True))]
    result = {"command": "estimate-bps", "schema_version": 2, "robot": "arm", "parameters": parameters,
              "torque_rms": {"identify": [0.02, 0.01], "validate": [0.03, 0.01 * seed]}, **more}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").write_text(json.dumps(result))
    (folder / "provenance.json").write_text(json.dumps({"tool": "rrrid", "outputs": {
        "result.json": hash_file(folder / "result.json")}}))
    return folder


def go(tmp_path: Path, a: Path, b: Path, **settings: Any) -> Outcome[Comparison]:
    shutil.rmtree(tmp_path / "out", ignore_errors=True)
    return run_stage(compare.STAGE, Request((a, b), out=tmp_path / "out", no_report=True, check=True), compare.Settings(**settings))


def test_one_arm_twice_hardly_ever_differs() -> None:
    """400 pairs of results of one arm: with α = 0.05 as many are said to differ as a binomial distribution of 0.05 allows."""
    rng = np.random.default_rng(5)
    away = (rng.standard_normal((400, COUNT)) - rng.standard_normal((400, COUNT))) / math.sqrt(2.0)
    z = [[standardised(a, a + d * s * math.sqrt(2.0), s, s) for a, d, s in zip(TRUTH, row, STD, strict=True)] for row in away]
    differ = int(np.sum(np.max(np.abs(z), axis=1) > limit_of(COUNT, 0.05)))
    assert stats.binom.ppf(0.001, 400, 0.045) <= differ <= stats.binom.ppf(0.999, 400, 0.05)


def test_the_same_arm_agrees(tmp_path: Path) -> None:
    """Two fits of one arm; residuals that differ are shown, not judged."""
    outcome = go(tmp_path, written(tmp_path / "monday", 1), written(tmp_path / "friday", 2))
    assert (outcome.result.differ, outcome.exit_code) == (False, 0)
    assert "agree" in outcome.report.verdict
    assert [(one.name, one.a, one.b) for one in outcome.result.residuals if one.a != one.b] == [
        ("torque rms validate joint 2", 0.01, 0.02)]


def test_what_moved_is_named(tmp_path: Path) -> None:
    """One figure by ten std: it stands first, alone, with its z; the verdict names both results by their folders."""
    outcome = go(tmp_path, written(tmp_path / "monday", 1), written(tmp_path / "friday", 2, (11, 10.0 * math.sqrt(2.0))))
    first, *others = outcome.result.figures
    assert (first.name, first.beyond, outcome.exit_code) == ("p12", True, 1)
    assert abs(first.away - 10.0) < 3.0
    assert not any(one.beyond for one in others)
    assert outcome.report.verdict.startswith("monday and friday differ. 1 of 30 figures differ beyond their uncertainty: p12 by")


def test_findings_that_come_or_go(tmp_path: Path) -> None:
    """A verdict and its causes differ by what they say."""
    cogging = [{"cause": "cogging", "joint": 2}]
    a = written(tmp_path / "a", 1, verdict="no-fault-found", findings=[], baseline_effects=[])
    b = written(tmp_path / "b", 2, verdict="cause", findings=cogging, baseline_effects=[{"cause": "gravity_tilt", "joint": None}])
    outcome = go(tmp_path, a, b)
    assert [(one.what, one.a, one.b) for one in outcome.result.answers] == [
        ("verdict", "no-fault-found", "cause"), ("findings", "none", "cogging:2"), ("baseline_effects", "none", "gravity_tilt")]
    assert "verdict (nothing wrong in a, a cause is named in b)" in outcome.report.verdict
    assert outcome.exit_code == 1


def model(**effects: dict[str, tuple[float, float]]) -> dict[str, Any]:
    """A model file with Coulomb friction at joint 1, and at joint 2 these effects: parameter -> value, std."""
    told = [{"effect": name, "joint": 2, "parameters": {key: {"value": value, "std": std, "unit": "rad", "origin": "fitted"}
                                                        for key, (value, std) in values.items()}}
            for name, values in effects.items()]
    level = {"level": {"value": 1.0, "std": 0.1, "unit": "N m", "origin": "fitted"}}
    return {"format": "rrrid-model", "name": "arm-1", "robot": 'name = "arm"', "base_parameters": [], "effects": told,
            "friction": [{"effect": "coulomb", "joint": 1, "parameters": level}]}


def bad(folder: Path, text: str) -> Path:
    folder.mkdir()
    (folder / "result.json").write_text(text)
    return folder


@pytest.mark.parametrize(("text", "kind", "code"), [
    ('{"command": "frf"', InputRejected, "F02"), ('{"a": 1}', InputRejected, "S19"), ("[1]", InputRejected, "S19"),
    ('{"command": "frf", "schema_version": 2}', UsageError, "C02"),
    ('{"command": "estimate-bps", "schema_version": 2, "stages": [{"exit": 0}]}', InputRejected, "S20"),
    ('{"command": "estimate-bps", "schema_version": 2, "findings": ["cogging"]}', InputRejected, "S20"),
    ('{"command": "estimate-bps"}', InputRejected, "F17.*written by an earlier rrrid.*Run the command again"),
    ("[" * 100_000, InputRejected, "F02")])
def test_what_is_no_result_is_refused(tmp_path: Path, text: str, kind: type[RrridError], code: str) -> None:
    """Half a file, another file, another command."""
    with pytest.raises(kind, match=code):
        go(tmp_path, written(tmp_path / "a", 1), bad(tmp_path / "b", text))


def test_on_the_command_line(tmp_path: Path) -> None:
    """Exit 0, 1, 2, 3; a result that was edited is not believed."""
    a, b = written(tmp_path / "a", 1), written(tmp_path / "b", 2, (3, 30.0))
    assert rrrid("compare", "a", "b", "--no-report", cwd=tmp_path).returncode == 0
    assert (tmp_path / "runs/arm/a-and-b/compare/result.json").is_file()
    assert rrrid("compare", "a", "b", "--no-report", "--check", cwd=tmp_path).returncode == 1
    (tmp_path / "c").mkdir()
    written(tmp_path / "c", 1, command="extend")
    other = rrrid("compare", "a", "c", cwd=tmp_path)
    assert (other.returncode, "the model.json that both have left" in other.stderr) == (2, True)
    nowhere = rrrid("compare", a, "nowhere", cwd=tmp_path)
    assert (nowhere.returncode, "RRID-C04" in nowhere.stderr) == (2, True)
    (b / "result.json").write_text((b / "result.json").read_text().replace("p4", "p5"))
    edited = rrrid("compare", "a", "b", cwd=tmp_path)
    assert (edited.returncode, "RRID-F05" in edited.stderr) == (3, True)

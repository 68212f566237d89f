"""`rrrid run` ends in the diagnosis and the model that it offers; its result holds the fields of diagnose, and the stages."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines import diagnose, run
from pipelines.diagnosis.result import Rejected
from pipelines.io.model_file import read_model
from pipelines.report.run_report import stage_lines
from pipelines.stage import Request, run_stage
from tests.diagnose.sessions import but, healthy_again, session, written

OTHERS = ("fit-friction", "reconstruct", "estimate-bps", "validate-writing", "frf")
QUICK = diagnose.Settings(exclude=but("cogging"), max_causes=1)


def test_a_run_names_the_cause_and_writes_the_model(tmp_path: Path) -> None:
    folder = written(tmp_path / "logs", (*healthy_again(session()), *session("cogging", 2)))
    settings = run.Settings({"diagnose": QUICK}, OTHERS)
    outcome = run_stage(run.STAGE, Request((folder,), out=tmp_path / "out", no_report=True, check=True), settings)
    stored = json.loads((outcome.folder / "result.json").read_text())
    assert (stored["verdict"], [(one["cause"], one["joint"]) for one in stored["findings"]]) == ("cause", [("cogging", 2)])
    assert [(stage["name"], stage["exit"]) for stage in stored["stages"]] == [("inspect", 0), ("diagnose", 1), ("extend", 0)]
    assert stored["stages"][1]["result"]["findings"][0]["parameters"] == stored["findings"][0]["parameters"]
    assert outcome.exit_code == 1
    assert "Cogging at joint 2" in outcome.report.verdict
    titles = [section.title for section in outcome.report.sections]
    answer = next(k for k, title in enumerate(titles) if "Cogging at joint 2" in title)
    assert titles.index("extend") > titles.index("diagnose") > answer  # the answer before its sources
    nominal, found, extended = stage_lines(outcome.result.stages)
    gain = outcome.result.stages[1].result.findings[0].gain.validate_torque_rms
    assert nominal.rms == pytest.approx(gain.before)  # the line that the gain of the cause is counted from
    assert extended.rms == pytest.approx(found.rms, rel=1e-6)  # one model, fitted by both stages
    partly = tuple(replace(step, result=replace(step.result, accepted=False, rejected=(Rejected("spring", 1, "no gain"),)))
                   if step.name == "extend" else step for step in outcome.result.stages)
    assert stage_lines(partly)[-1] == extended  # what was accepted beside it stays
    assert (found.stage, extended.stage, found.sure) == ("diagnose", "extend", True)
    assert found.gain is not None
    assert found.gain > 20.0
    model = read_model(outcome.folder / "extend/model.json")
    assert [(one.effect, one.joint) for one in model.effects] == [("cogging", 2)]

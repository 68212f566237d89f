"""`rrrid run` ends in the diagnosis and the model that it offers; its result holds the fields of diagnose, and the stages."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
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
    sources = [k for k, title in enumerate(titles) if title.startswith("inspect")]
    assert "Stages" in titles[:answer]
    nominal, effect, extended = stage_lines(outcome.result.stages)
    gain = outcome.result.stages[1].result.findings[0].gain.validate_torque_rms
    assert nominal.rms == pytest.approx(gain.before)  # the line that the effect's gain is counted from
    shown = outcome.result.stages[1].result.after_rms.validate  # of the key figures
    assert extended.rms == pytest.approx(shown, rel=1e-6)  # one model, fitted by both stages
    partly = tuple(replace(step, result=replace(step.result, accepted=False, rejected=(Rejected("spring", 1, "no gain"),)))
                   if step.name == "extend" else step for step in outcome.result.stages)
    assert stage_lines(partly)[-1] == extended  # what was accepted beside it stays
    assert (effect.stage, extended.stage, effect.sure) == ("diagnose", "extend", True)
    assert effect.gain == pytest.approx(100.0 * (1.0 - np.linalg.norm(gain.after) / np.linalg.norm(gain.before)))
    assert effect.gain is not None
    assert effect.gain > 20.0
    assert all(answer < k for k in sources)  # the answer before its sources
    model = read_model(outcome.folder / "extend/model.json")
    assert [(one.effect, one.joint) for one in model.effects] == [("cogging", 2)]

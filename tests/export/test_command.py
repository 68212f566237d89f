"""`rrrid export`: files, card, replayed logs, and what is refused before anything is written."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps
from pipelines.errors import RrridError, UsageError
from pipelines.export_model import STAGE, Card, Settings
from pipelines.io.files import write_log
from pipelines.io.model_file import read_covariance, write_model
from pipelines.rerender import rerender
from pipelines.stage import Outcome, Request, run_stage
from sample_logs.make_model import synthetic_arm
from tests.controlled import controlled_log
from tests.export.exported import caused


def export(folder: Path, settings: Settings, *logs: Path) -> Outcome[Card]:
    return run_stage(STAGE, Request(logs, out=folder / "out"), settings)


def stored(folder: Path, *causes: tuple[str, int | None, dict[str, float]]) -> Path:
    """The model.json of the synthetic arm with further causes, and a std of a hundredth."""
    arm = synthetic_arm().extended(*(caused(name, joint, **values) for name, joint, values in causes))
    base = tuple(replace(p, std=0.01 * abs(p.value), origin="fitted") for p in arm.base)
    write_model(folder / "model.json", replace(arm, base=base).to_model())
    return folder / "model.json"


@pytest.mark.parametrize(("to", "files"), [("urdf", {"rrr-synthetic.urdf"}), ("mjcf", {"rrr-synthetic.xml"}),
                                           ("c", {"rrr_synthetic.c", "rrr_synthetic.h"}), ("json", {"rrr-synthetic.json"})])
def test_what_is_left(to: str, files: set[str], tmp_path: Path) -> None:
    """The files, the covariance of the links, the card as JSON and as a page."""
    outcome = export(tmp_path, Settings(str(stored(tmp_path)), to))
    left = {path.name for path in outcome.folder.iterdir()}
    assert files | {"covariance.json", "result.json", "report.html", "provenance.json"} <= left
    card = json.loads((outcome.folder / "result.json").read_text())
    assert card["proof"]["relative_error"] <= 1e-9
    assert card["proof"]["states"] == 1000
    assert set(card["files"]) == files
    names, covariance = read_covariance(outcome.folder / "covariance.json")
    assert names[:2] == ("m1", "mx1")
    assert covariance.shape == (30, 30)
    told = np.isfinite(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance[np.ix_(told, told)]).min() > -1e-12
    assert outcome.exit_code == 0
    assert rerender(outcome.folder, None).verdict == outcome.report.verdict


def test_the_card_names_every_cause_with_its_cost(tmp_path: Path) -> None:
    """Exactly, approximated, lost: in the result, on the page, and as a warning."""
    model = stored(tmp_path, ("cogging", 2, {"order": 12.0, "amplitude": 0.4}), ("payload", None, {"mass": 0.3}),
                   ("rotor_inertia", 1, {"inertia": 0.2}))
    outcome = export(tmp_path, Settings(str(model), "urdf"))
    causes = {cause.place: cause for cause in outcome.result.causes}
    assert {place: cause.carried for place, cause in causes.items()} == {
        "three_sigmoid:1": "approximated", "three_sigmoid:2": "approximated", "three_sigmoid:3": "approximated",
        "cogging:2": "lost", "payload": "exactly", "rotor_inertia:1": "exactly"}
    cost = causes["cogging:2"].cost
    assert cost is not None
    assert cost.max() == pytest.approx(0.28, rel=0.1)
    page = (outcome.folder / "report.html").read_text()
    assert all(place in page for place in causes)
    assert "carries 2 of 6 terms (friction, offsets, effects) exactly" in outcome.report.verdict
    assert "A cause" not in page
    assert any(check.message.startswith("cogging:2 is lost in urdf; torque error 0.2") for check in outcome.checks)


def test_a_log_is_replayed_under_both(tmp_path: Path) -> None:
    """C is as good as the model; a URDF loses what its two friction numbers cannot hold."""
    write_log(tmp_path / "waving.h5", controlled_log(1500))
    for to in ("c", "urdf"):
        result = export(tmp_path, Settings("rrr", to), tmp_path / "waving.h5").result
        (replay,) = result.replays
        assert result.motion == "the log waving"
        assert replay.export_error is not None
        if to == "c":
            assert replay.export_error == pytest.approx(replay.model_error, rel=1e-9)
        else:
            assert (replay.export_error >= 0.9 * replay.model_error).all()


@pytest.mark.slow
def test_mujoco_simulates_a_log_as_well_as_the_model(tmp_path: Path, samples: Path) -> None:
    """Windows of held-out writing of the test bench: within 5 % of the error of our own integrator."""
    logs = tuple(samples / f"rrr-healthy/{name}.h5" for name in ("excitation-1", "excitation-2", "free-1", "writing-6"))
    estimated = run_stage(estimate_bps.STAGE, Request(logs, out=tmp_path / "bps", no_report=True), estimate_bps.Settings())
    settings = Settings(str(estimated.folder / "model.json"), "mjcf")
    (replay,) = export(tmp_path, settings, samples / "rrr-healthy/writing-6.h5").result.replays
    assert replay.model_position_error is not None
    assert replay.export_position_error is not None
    assert (replay.export_position_error <= 1.05 * replay.model_position_error).all()


def test_without_the_target_the_file_is_written_and_the_proof_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No Pinocchio, no compiler: told, with what to install."""
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    for to in ("urdf", "c"):
        outcome = export(tmp_path, Settings("rrr", to))
        assert outcome.result.proof is None
        assert "not proved here" in outcome.report.verdict
        assert any("was not loaded again" in check.message and "install" in check.remedy for check in outcome.checks)


REFUSED: dict[str, tuple[Settings, type[RrridError], str]] = {
    "no model": (Settings(""), UsageError, "no model"),
    "no such file": (Settings("nowhere.json"), UsageError, "no such file"),
    "no such target": (Settings("rrr", "usd"), UsageError, "'usd' is no target"),
    "a target misspelt": (Settings("rrr", "urfd"), UsageError, "did you mean 'urdf'"),
}


@pytest.mark.parametrize(("settings", "kind", "words"), REFUSED.values(), ids=REFUSED)
def test_nothing_is_written_of_what_is_refused(settings: Settings, kind: type[RrridError], words: str, tmp_path: Path) -> None:
    """A clear sentence, a remedy, and no folder."""
    with pytest.raises(kind, match=words) as problem:
        export(tmp_path, settings)
    assert problem.value.remedy
    assert not (tmp_path / "out").exists()

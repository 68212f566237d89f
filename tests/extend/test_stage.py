"""`rrrid extend` on short sessions of the test bench: what is accepted, what is refused, and that the model simulates."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import extend
from pipelines.dynamics.arm import Arm
from pipelines.errors import UsageError
from pipelines.io.files import open_log
from pipelines.io.model_file import read_model
from pipelines.simulation import Experiment, simulate
from pipelines.stage import Outcome, Request, run_stage
from tests.diagnose.sessions import session, written
from tests.seeds import rarely


def extended(folder: Path, out: Path, *causes: str, model: Path | None = None) -> Outcome[extend.Extension]:
    settings = extend.Settings(causes=causes, model=None if model is None else str(model))
    return run_stage(extend.STAGE, Request((folder,), out=out, no_report=True, check=True), settings)


@pytest.fixture(scope="module")
def rippled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome[extend.Extension]]:
    """Cogging at joint 2; extended by that and by a drag that is not there."""
    place = tmp_path_factory.mktemp("extend")
    folder = written(place / "logs", session("cogging", 2, 2.0))
    return folder, extended(folder, place / "out", "cogging:2", "quadratic_drag:1")


def test_what_is_there_is_accepted_and_what_is_not_is_refused(rippled: tuple[Path, Outcome[extend.Extension]]) -> None:
    """With the reason, and exit 1 under --check."""
    _, outcome = rippled
    result = outcome.result
    assert [(one.cause, one.joint) for one in result.findings] == [("cogging", 2)]
    assert [(one.cause, one.joint) for one in result.rejected] == [("quadratic_drag", 1)]
    assert result.rejected[0].reason
    assert (result.accepted, outcome.exit_code) == (False, 1)
    assert "at joint 1" in outcome.report.verdict
    assert "Now: fitted without what it is extended by." in outcome.report.key_figures.caption


def test_the_gain_is_that_of_diagnose(rippled: tuple[Path, Outcome[extend.Extension]]) -> None:
    """The same keys; held-out torque beyond its bootstrap interval, and the simulated arm nearer."""
    stored = json.loads((rippled[1].folder / "result.json").read_text())
    gain = stored["gain"]
    assert set(gain) == {"validate_torque_rms", "simulated_position_rms", "simulation", "simulated_span", "tip_error_rms"}
    assert gain["simulated_span"] == [{"log": "excitation-2", "seconds": pytest.approx(2.0, abs=2e-3)}]  # all of it
    assert gain["validate_torque_rms"]["ci95"][1][1] < 0.0
    assert gain["simulated_position_rms"]["after"][1] < 0.5 * gain["simulated_position_rms"]["before"][1]


def test_the_model_is_refitted_and_simulates(rippled: tuple[Path, Outcome[extend.Extension]]) -> None:
    """model.json holds base parameters and friction with deviations, the effect, its logs; read back it predicts a held-out log's
    positions better than the same arm without the effect."""
    folder, outcome = rippled
    model = read_model(outcome.folder / "model.json")
    assert [(one.effect, one.joint) for one in model.effects] == [("cogging", 2)]
    assert all(p.std is not None and p.std > 0.0 for p in model.base_parameters if p.origin == "fitted")
    assert {source.role for source in model.sources} == {"identify", "validate"}
    assert model.validity is not None
    log = open_log(folder / "excitation-2.h5").log
    experiment = Experiment.of_log(log).part(0, 1000)
    arm = Arm.from_model(model)
    off = [np.abs(simulate(one, experiment).q[0] - log.q[:1000])[:, 1].max() for one in (arm, arm.nominal)]
    assert off[0] < 0.5 * off[1]


@pytest.mark.slow
def test_a_model_keeps_its_effects(rippled: tuple[Path, Outcome[extend.Extension]], tmp_path: Path) -> None:
    """Extended by something that is not there, a model with cogging still has it, fitted anew."""
    folder, outcome = rippled
    again = extended(folder, tmp_path / "out", "torque_offset:3", model=outcome.folder / "model.json").result
    assert [(one.cause, one.joint) for one in again.findings] == [("cogging", 2)]


@pytest.mark.slow
def test_a_refused_extension_leaves_no_model_where_one_was(
        rippled: tuple[Path, Outcome[extend.Extension]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the default folder: a result takes the place of the earlier one, and whoever asks it for a model gets none."""
    folder, earlier = rippled
    monkeypatch.chdir(tmp_path)
    place = Path("runs") / session(seconds=2.0)[0].robot_name / "logs/extend"
    shutil.copytree(earlier.folder, place)
    settings = extend.Settings(causes=("quadratic_drag:1",))
    refused = run_stage(extend.STAGE, Request((folder,), no_report=True, check=True), settings)
    assert (refused.result.findings, refused.result.model, refused.exit_code) == ((), None, 1)
    assert "no model was written" in refused.report.verdict
    assert (refused.folder, refused.result.accepted, (place / "model.json").exists()) == (place, False, False)
    with pytest.raises(UsageError, match="RRID-C04"):
        read_model(str(place / "model.json"))


@pytest.mark.parametrize(("causes", "words"), [
    ((), "no cause"), (("cogs:1",), "cogging"), (("cogging",), "takes a joint"), (("cogging:7",), "1 to 3"),
    (("coulomb:1",), "has it already"), (("payload",), "name reference logs"),
    *rarely((("contact",), "happens once"), (("three_sigmoid:2",), "law of friction")),
    (("transmission_coupling:1",), "write transmission_coupling:2 or transmission_coupling:3")])
def test_causes_that_no_model_takes_are_refused(causes: tuple[str, ...], words: str, tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extend, "examined", lambda *given: ((),))  # what is wrong with the logs is no matter here
    folder = written(tmp_path / "logs", [replace(session(seconds=1.0)[0], role="identify")])
    with pytest.raises(UsageError) as refused:
        extended(folder, tmp_path / "out", *causes)
    assert words in str(refused.value).lower()


@pytest.mark.parametrize(("settings", "words"), [
    ({"blocks": 0}, "--blocks"), ({"min_speed": (-1.0,)}, "--min-speed"), ({"min_speed": (0.1, 0.2)}, "2 values for 3 joints"),
    ({"decimate": 0}, "--decimate"), ({"cutoff_hz": -3.0}, "--cutoff-hz"), ({"cutoff_hz": 450.0}, "sampled at 1000 Hz")])
def test_settings_that_make_no_sense_are_refused(settings: dict[str, object], words: str, tmp_path: Path,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    """C02, by the option's name, before any log is examined."""
    monkeypatch.setattr(extend, "examined", lambda *given: pytest.fail("was not refused at once"))
    folder = written(tmp_path / "logs", session(seconds=2.0))
    with pytest.raises(UsageError) as refused:
        run_stage(extend.STAGE, Request((folder,), out=tmp_path / "out", no_report=True),
                  extend.Settings(causes=("cogging:2",), **settings))  # type: ignore[arg-type]
    assert words in str(refused.value)
    assert refused.value.code == "RRID-C02"

"""`rrrid extend` on short sessions of the test bench: what is accepted, what is refused, and that the model simulates."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import extend
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.named_cause import wanted_cause
from pipelines.errors import UsageError
from pipelines.io.files import open_log
from pipelines.io.model_file import read_model
from pipelines.simulation import Experiment, simulate
from pipelines.stage import Outcome, Request, run_stage
from tests.diagnose.sessions import healthy_again, session, written
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


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="accepted on logs of 2 s")
def test_a_hump_that_is_not_there_is_refused_beside_a_ripple(
    rippled: tuple[Path, Outcome[extend.Extension]], tmp_path: Path
) -> None:
    result = extended(rippled[0], tmp_path / "out", "cogging:2", "stribeck:2").result
    assert [(one.cause, one.joint) for one in result.findings] == [("cogging", 2)]
    assert [(one.cause, one.joint) for one in result.rejected] == [("stribeck", 2)]


@pytest.mark.slow
def test_an_order_of_which_only_a_harmonic_is_there_is_refused_with_what_was_fitted(
        rippled: tuple[Path, Outcome[extend.Extension]], tmp_path: Path) -> None:
    """Asked for a third of the waves that there are, the third harmonic takes all: the first wave would be a made-up one."""
    folder, outcome = rippled
    true = outcome.result.findings[0].parameters
    result = extended(folder, tmp_path / "out", f"cogging:2:order={true['order'].value / 3.0}").result
    assert not result.findings
    (rejected,) = result.rejected
    assert "its numbers are impossible: order = " in rejected.reason
    told = dict(re.findall(r"(\w+) = ([\d.]+)", rejected.reason))
    assert float(told["order_3"]) == pytest.approx(true["order"].value, rel=0.02)
    assert float(told["amplitude_3"]) == pytest.approx(true["amplitude"].value, rel=0.1)
    assert float(told["amplitude"]) < 0.1 * float(told["amplitude_3"])


def test_the_gain_is_that_of_diagnose(rippled: tuple[Path, Outcome[extend.Extension]]) -> None:
    """The same keys; held-out torque beyond its bootstrap interval, and the simulated arm nearer."""
    stored = json.loads((rippled[1].folder / "result.json").read_text())
    gain = stored["gain"]
    assert set(gain) == {"validate_torque_rms", "simulated_position_rms", "simulation", "simulated_span", "tip_error_rms"}
    assert gain["simulated_span"] == [{"log": "excitation-2", "seconds": pytest.approx(2.0, abs=2e-3)}]  # all of it
    assert "over the first 2 s of excitation-2" in rippled[1].report.verdict
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


def test_a_model_keeps_its_effects(rippled: tuple[Path, Outcome[extend.Extension]], tmp_path: Path) -> None:
    """Extended by something that is not there, a model with cogging still has it, fitted anew."""
    folder, outcome = rippled
    again = extended(folder, tmp_path / "out", "torque_offset:3", model=outcome.folder / "model.json").result
    assert [(one.cause, one.joint) for one in again.findings] == [("cogging", 2)]


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


def test_a_start_is_where_the_search_begins() -> None:
    """cogging:2:order=18 starts at 18; an amplitude is fitted, whatever it is said to be."""
    effect, start = wanted_cause("cogging:2:order=18", (True,) * 3)
    assert (effect.name, effect.joint, start) == ("cogging", 2, {"order": 18.0})
    assert wanted_cause("gravity_tilt", (True,) * 3)[0].joint is None
    with pytest.raises(UsageError, match="amplitude is fitted"):
        wanted_cause("cogging:2:amplitude=0.1", (True,) * 3)


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


@pytest.mark.slow
def test_a_load_that_the_reference_logs_do_not_show_is_refused_with_what_they_say(tmp_path: Path) -> None:
    """They were there to be asked: nobody is told to name some."""
    folder = written(tmp_path / "logs", (*session(seconds=2.0), *healthy_again(session(seconds=2.0, seed=5))))
    outcome = extended(folder, tmp_path / "out", "payload")
    ((cause, reason),) = [(one.cause, one.reason) for one in outcome.result.rejected]
    assert (cause, outcome.result.findings, outcome.exit_code) == ("payload", (), 1)
    assert "the base parameters have not moved" in reason


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

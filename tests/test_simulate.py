"""`rrrid simulate`: a model in the experiment of a log."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.errors import InputRejected, RrridError
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog, digest_of
from pipelines.simulate import STAGE, Settings
from pipelines.stage import Outcome, Request, run_stage
from tests.cli.commands import rrrid
from tests.controlled import TORQUE_NOISE, controlled_log

SAMPLES = 700


def simulated(log: ExperimentLog, tmp_path: Path, settings: Settings, format: str = "h5") -> Outcome:
    (tmp_path / "in").mkdir(exist_ok=True)
    write_log(tmp_path / "in" / "waving.h5", log)
    return run_stage(STAGE, Request((tmp_path / "in",), out=tmp_path / "out", format=format, no_report=True), settings)


def test_the_true_model_differs_by_noise_alone(tmp_path: Path) -> None:
    """Closed loop, same noise level: the bench's arm and ours are as far apart as two of ours."""
    outcome = simulated(controlled_log(SAMPLES), tmp_path, Settings(model="rrr", noise=TORQUE_NOISE, replicas=3))
    [found] = outcome.result.logs
    assert (found.simulation, found.replicas, len(found.logs)) == ("closed-loop", 3, 3)
    assert found.noise_rms is not None
    steps = 1e-5 / np.sqrt(6.0)  # of two encoders that count
    assert (found.position_rms <= 2.0 * np.hypot(found.noise_rms, steps)).all()
    assert outcome.exit_code == 0


def test_the_simulated_log_is_a_log(tmp_path: Path) -> None:
    """Derived from the log it imitates: origin, source, controller and reference; and it can be imitated again."""
    log = controlled_log(SAMPLES)
    outcome = simulated(log, tmp_path, Settings(model="rrr"), "parquet")
    written = open_log(outcome.folder / "logs" / "waving.parquet").log
    assert (written.origin, written.controller, written.robot_text) == ("simulated", log.controller, log.robot_text)
    assert written.derived is not None
    assert (written.derived.command, written.derived.source_sha256) == ("simulate", digest_of(log))
    assert json.loads(written.derived.settings)["settings"]["model"] == "rrr"
    np.testing.assert_array_equal(written["q_ref"], log["q_ref"])
    again = simulated(written, tmp_path, Settings(model="rrr")).result.logs[0]
    assert again.steps == outcome.result.logs[0].steps
    assert again.position_max.max() < 1e-12
    assert again.torque_rms.max() < 1e-12


def test_without_a_controller_it_is_windows(tmp_path: Path) -> None:
    """The log says nothing of its controller: short windows, no simulated log, and the reason as a check."""
    outcome = simulated(replace(controlled_log(SAMPLES), controller=None), tmp_path, Settings(model="rrr", window=0.05))
    [found] = outcome.result.logs
    assert (found.simulation, found.files, found.window, found.torque_rms) == ("windowed", (), 0.05, None)
    assert found.position_rms.max() < 5e-5
    heavy = simulated(replace(controlled_log(SAMPLES), controller=None), tmp_path,
                      Settings(model="rrr", fault=("rotor_inertia:3:inertia=0.02",), window=0.05)).result.logs[0]
    assert heavy.position_rms[2] > 10.0 * found.position_rms[2]
    assert any(check.code == "RRID-S22" and "windows" in check.message for check in outcome.checks)
    assert not (outcome.folder / "logs").exists()


def test_a_plan_is_simulated_and_compared_with_nothing(tmp_path: Path) -> None:
    """References and controller alone."""
    log = controlled_log(SAMPLES)
    plan = replace(log, origin="planned", signals={k: x for k, x in log.signals.items() if k not in ("q", "tau")})
    outcome = simulated(plan, tmp_path, Settings(model="rrr"))
    [found] = outcome.result.logs
    assert (found.position_rms, found.torque_rms) == (None, None)
    written = open_log(outcome.folder / "logs" / "waving.h5").log
    assert np.abs(written.q - log.q).max() < 1e-3
    with pytest.raises(InputRejected, match="controller") as refused:
        simulated(replace(plan, controller=None), tmp_path, Settings(model="rrr"))
    assert refused.value.code == "RRID-S22"


@pytest.mark.parametrize(("settings", "code"), [
    (Settings(), "C02"), (Settings(model="nobody"), "C04"), (Settings(model="rrr", fault=("coulom:1:level=1",)), "C01"),
    (Settings(model="rrr", noise=(1.0, 2.0)), "C02"), (Settings(model="rrr", replicas=2), "C02"), (Settings(model="rrr", window=0.0), "C02"),
])
def test_settings_that_do_not_fit_are_refused(settings: Settings, code: str, tmp_path: Path) -> None:
    """With a code and a remedy, and nothing is written."""
    with pytest.raises(RrridError) as refused:
        simulated(controlled_log(200), tmp_path, settings)
    assert refused.value.code == f"RRID-{code}"
    assert refused.value.remedy
    assert not (tmp_path / "out").exists()


def test_the_command(tmp_path: Path) -> None:
    """As the contract writes it."""
    write_log(tmp_path / "waving.h5", controlled_log(SAMPLES))
    done = rrrid("simulate", "rrr", "--replay", "waving.h5", "--fault", "quadratic_drag:2:coefficient=0.1",
                 "--noise", "0.02,0.01,0.005",
                 "--replicas", "2", "--seed", "7", "--json", "--no-report", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["faults"] == ["quadratic_drag:2:coefficient=0.1"]
    assert [file for log in told["logs"] for file in log["files"]] == ["logs/waving", "logs/waving-2"]
    assert json.loads((tmp_path / "out/provenance.json").read_text())["seed"] == 7
    missing = rrrid("simulate", "rrr", cwd=tmp_path)
    assert (missing.returncode, "--replay" in missing.stderr) == (2, True)


def test_an_open_loop_log_is_compared_in_windows(tmp_path: Path) -> None:
    """Nothing corrects its moving joint: the report says why it is no closed loop."""
    log = controlled_log(SAMPLES)
    assert log.controller is not None
    friction = replace(log, experiment="friction", joint=3, controller=replace(log.controller, law="open-loop"))
    [found] = simulated(friction, tmp_path, Settings(model="rrr")).result.logs
    assert (found.simulation, found.law) == ("windowed", "open-loop")
    assert "open loop" in found.reason

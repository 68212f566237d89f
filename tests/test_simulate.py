"""`rrrid simulate`: a model in the experiment of a log."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.named_cause import acting_cause
from pipelines.errors import InputRejected, RrridError, UsageError
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog, digest_of
from pipelines.io.model_file import model_text, read_model
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
    outcome = simulated(controlled_log(SAMPLES), tmp_path, Settings("rrr", noise=TORQUE_NOISE, replicas=3))
    [found] = outcome.result.logs
    assert (found.simulation, found.replicas, len(found.logs)) == ("closed-loop", 3, 3)
    assert found.noise_rms is not None
    steps = 1e-5 / np.sqrt(6.0)  # of two encoders that count
    assert (found.position_rms <= 2.0 * np.hypot(found.noise_rms, steps)).all()
    assert outcome.exit_code == 0


def test_the_simulated_log_is_a_log(tmp_path: Path) -> None:
    """Derived from the log it imitates: origin, source, controller and reference; and it can be imitated again."""
    log = controlled_log(SAMPLES)
    outcome = simulated(log, tmp_path, Settings("rrr"), "parquet")
    written = open_log(outcome.folder / "logs" / "waving.parquet").log
    assert (written.origin, written.controller, written.robot_text) == ("simulated", log.controller, log.robot_text)
    assert written.derived is not None
    assert (written.derived.command, written.derived.source_sha256) == ("simulate", digest_of(log))
    assert json.loads(written.derived.settings)["settings"]["model"] == "rrr"
    np.testing.assert_array_equal(written["q_ref"], log["q_ref"])
    again = simulated(written, tmp_path, Settings("rrr")).result.logs[0]
    assert again.steps == outcome.result.logs[0].steps
    assert again.position_max.max() < 1e-12
    assert again.torque_rms.max() < 1e-12


def test_a_fault_moves_the_joint_it_is_at(tmp_path: Path) -> None:
    """Drag at joint 2: its position strays most, and by more the stronger it is, in proportion."""
    faults = [(f"quadratic_drag:2:coefficient={c}",) for c in (0.1, 0.2)]
    weak, strong = (simulated(controlled_log(SAMPLES), tmp_path, Settings("rrr", fault)).result.logs[0] for fault in faults)
    assert np.argmax(strong.position_rms) == 1
    assert strong.position_rms[1] / weak.position_rms[1] == pytest.approx(2.0, rel=0.1)
    assert strong.position_rms[1] > 1e-4


def test_several_faults_act_together(tmp_path: Path) -> None:
    """Equal and opposite offsets leave nothing."""
    both = Settings("rrr", ("torque_offset:1:offset=2", "torque_offset:1:offset=-2"))
    alone = simulated(controlled_log(SAMPLES), tmp_path, Settings("rrr", both.fault[:1])).result.logs[0]
    together = simulated(controlled_log(SAMPLES), tmp_path, both).result.logs[0]
    plain = simulated(controlled_log(SAMPLES), tmp_path, Settings("rrr")).result.logs[0]
    assert alone.position_rms[0] > 5e-4
    np.testing.assert_allclose(together.position_rms, plain.position_rms, rtol=0.2)


def test_the_tracking_error_stands_beside_the_difference(tmp_path: Path) -> None:
    """What feedback leaves of the reference: by it a reader sees whether a small difference says anything."""
    log = controlled_log(SAMPLES)
    outcome = simulated(log, tmp_path, Settings("rrr", ("quadratic_drag:2:coefficient=0.1",)))
    [tracking] = outcome.result.tracking_rms
    np.testing.assert_allclose(tracking, np.linalg.norm(log.q - log["q_ref"], axis=0) / np.sqrt(SAMPLES))
    assert "% of the tracking error" in outcome.report.verdict
    assert simulated(log, tmp_path, Settings("rrr", windowed=True)).result.tracking_rms == (None,)


def test_no_replica_takes_the_name_of_another_log(tmp_path: Path) -> None:
    """The second replica of "run" would be "run-2", and so is a log: all four stay."""
    for name in ("run", "run-2"):
        write_log(tmp_path / f"{name}.h5", replace(controlled_log(200), name=name))
    request = Request((tmp_path / "run.h5", tmp_path / "run-2.h5"), out=tmp_path / "out", no_report=True)
    found = run_stage(STAGE, request, Settings("rrr", replicas=2, noise=(0.02,), steps=1)).result.logs
    assert len({file for one in found for file in one.files}) == 4
    assert len(list((tmp_path / "out/logs").iterdir())) == 4


def test_the_verdict_tells_where_the_log_is_of_another_robot(tmp_path: Path) -> None:
    """As many joints, another name: nothing is refused, but the reader hears of it."""
    log = controlled_log(200)
    renamed = replace(log, robot_text=log.robot_text.replace(log.robot.name, "its-neighbour"), robot_name="its-neighbour")
    assert "its-neighbour" in simulated(renamed, tmp_path, Settings("rrr", steps=1)).report.verdict
    assert " in logs of " not in simulated(log, tmp_path, Settings("rrr", steps=1)).report.verdict


def test_a_model_of_friction_alone_is_refused(tmp_path: Path) -> None:
    """As fit-friction leaves it: the remedy names the command that makes a model with inertia."""
    known = read_model("rrr")
    bare = replace(known, base_parameters=tuple(replace(one, value=0.0, std=None) for one in known.base_parameters))
    (tmp_path / "friction.json").write_text(model_text(bare))
    with pytest.raises(UsageError, match="no inertia") as refused:
        simulated(controlled_log(200), tmp_path, Settings(str(tmp_path / "friction.json")))
    assert "estimate-bps" in refused.value.remedy


def test_the_fault_that_the_help_shows_is_one(tmp_path: Path) -> None:
    """Its example can be copied."""
    [example] = re.findall(r"[a-z_]+:\d:[a-z_]+=[\d.]*\d", rrrid("simulate", "--help", cwd=tmp_path).stdout)
    assert acting_cause(example, (True, True, True)).effect.joint == 2


def test_without_a_controller_it_is_windows(tmp_path: Path) -> None:
    """The log says nothing of its controller: short windows, no simulated log, and the reason as a check."""
    outcome = simulated(replace(controlled_log(SAMPLES), controller=None), tmp_path, Settings("rrr", window=0.05))
    [found] = outcome.result.logs
    assert (found.simulation, found.files, found.window, found.torque_rms) == ("windowed", (), 0.05, None)
    assert found.position_rms.max() < 5e-5
    heavy = simulated(replace(controlled_log(SAMPLES), controller=None), tmp_path,
                      Settings("rrr", ("rotor_inertia:3:inertia=0.02",), window=0.05)).result.logs[0]
    assert heavy.position_rms[2] > 10.0 * found.position_rms[2]
    assert any(check.code == "RRID-S22" and "windows" in check.message for check in outcome.checks)
    assert not (outcome.folder / "logs").exists()


def test_windows_can_be_asked_for(tmp_path: Path) -> None:
    """With a known controller too; then nothing is missing, and no check complains."""
    outcome = simulated(controlled_log(SAMPLES), tmp_path, Settings("rrr", windowed=True))
    assert outcome.result.logs[0].simulation == "windowed"
    assert not [check for check in outcome.checks if check.code == "RRID-S22"]


def test_a_plan_is_simulated_and_compared_with_nothing(tmp_path: Path) -> None:
    """References and controller alone."""
    log = controlled_log(SAMPLES)
    plan = replace(log, origin="planned", signals={k: x for k, x in log.signals.items() if k not in ("q", "tau")})
    outcome = simulated(plan, tmp_path, Settings("rrr"))
    [found] = outcome.result.logs
    assert (found.position_rms, found.torque_rms) == (None, None)
    written = open_log(outcome.folder / "logs" / "waving.h5").log
    assert np.abs(written.q - log.q).max() < 1e-3
    with pytest.raises(InputRejected, match="controller") as refused:
        simulated(replace(plan, controller=None), tmp_path, Settings("rrr"))
    assert refused.value.code == "RRID-S22"


@pytest.mark.parametrize(("settings", "code"), [
    (Settings(), "C02"), (Settings("nobody"), "C04"), (Settings("rrr", ("coulom:1:level=1",)), "C01"),
    (Settings("rrr", noise=(1.0, 2.0)), "C02"), (Settings("rrr", noise=(-1.0,)), "C02"), (Settings("rrr", replicas=2), "C02"),
    (Settings("rrr", replicas=0), "C02"), (Settings("rrr", steps=0), "C02"), (Settings("rrr", window=0.0), "C02"),
    (Settings("rrr", seed=-1), "C02"), (Settings("rrr", noise=(float("nan"),)), "C02"),
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


def test_an_open_loop_log_is_said_to_have_no_feedback(tmp_path: Path) -> None:
    """The moving joint follows the logged torque; the report says what that means."""
    log = controlled_log(SAMPLES)
    assert log.controller is not None
    friction = replace(log, experiment="friction", joint=3, controller=replace(log.controller, law="open-loop"))
    outcome = simulated(friction, tmp_path, Settings("rrr"))
    [found] = outcome.result.logs
    assert (found.simulation, found.law) == ("closed-loop", "open-loop")
    assert found.torque_rms[2] == 0.0
    assert "without feedback" in outcome.report.verdict


def test_the_verdict_is_that_of_the_logs_with_feedback(tmp_path: Path) -> None:
    """An open-loop log beside one in closed loop drifts further whatever the model, and is not what the verdict tells."""
    log = controlled_log(SAMPLES)
    assert log.controller is not None
    friction = replace(log, name="alone", experiment="friction", joint=3, controller=replace(log.controller, law="open-loop"))
    for name, one in (("waving", log), ("alone", friction)):
        write_log(tmp_path / f"{name}.h5", one)
    request = Request((tmp_path / "waving.h5", tmp_path / "alone.h5"), out=tmp_path / "out", no_report=True)
    outcome = run_stage(STAGE, request, Settings("rrr"))
    assert f"({log.name}, the only log in closed loop)" in outcome.report.verdict
    assert [row[-1] for row in outcome.report.key_figures.rows[::3]] == ["closed loop", "open loop"]

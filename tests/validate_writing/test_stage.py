"""`rrrid validate-writing`: does a model hold where it was not fitted?"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.kinematics import serial_chain, tip_position
from pipelines.errors import InputRejected, NothingMatched, RrridError, UsageError
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog, digest_of
from pipelines.io.model_file import Source, model_text, read_model, write_model
from pipelines.io.robot import format_robot
from pipelines.stage import Outcome, Request, run_stage
from pipelines.validate_writing import STAGE, Result, Settings
from tests.cli.commands import rrrid
from tests.dynamics.serial_arms import ARMS
from tests.healthy import rows, with_signal

SAMPLES = 1600  # of a writing log: most of its first letter


@pytest.fixture(scope="module")
def writing(samples: Path) -> ExperimentLog:
    """Case 1 as the bench recorded it."""
    return rows(open_log(samples / "rrr-healthy/writing-1.h5").log, slice(0, SAMPLES))


def validated(tmp_path: Path, logs: Mapping[str, ExperimentLog], settings: Settings, check: bool = False) -> Outcome[Result]:
    for name, log in logs.items():
        write_log(tmp_path / "in" / f"{name}.h5", log)
    return run_stage(STAGE, Request((tmp_path / "in",), out=tmp_path / "out", check=check, no_report=True), settings)


@pytest.fixture(scope="module")
def plain(writing: ExperimentLog, tmp_path_factory: pytest.TempPathFactory) -> Outcome[Result]:
    """The shipped model, which is of another arm of the kind, on one log of case 1."""
    return validated(tmp_path_factory.mktemp("plain"), {"w": writing}, Settings("rrr", torque_gate=0.5, draws=1))


def test_what_the_contract_promises(plain: Outcome[Result]) -> None:
    """torque, cases and simulation with their keys, and derived logs with the model's torque."""
    told = json.loads((plain.folder / "result.json").read_text())
    assert {"rms", "relative_error"} <= set(told["torque"])
    assert [case["case"] for case in told["cases"]] == [1, 2, 3, 4, 5, 6]
    assert {"case", "feedforward", "tip_error_std", "origin"} <= set(told["cases"][0])
    assert set(told["cases"][0]["tip_error_std"]) == {"x", "y", "z"}
    assert {"position_rms", "torque_rms"} <= set(told["simulation"])
    log = open_log(plain.folder / "logs/writing-1.h5").log
    assert log.derived is not None
    assert log.derived.command == "validate-writing"
    np.testing.assert_allclose(log["tau_residual"], log.tau - log["tau_model"], atol=1e-12)
    np.testing.assert_allclose(told["torque"]["rms"], np.sqrt(np.mean(log["tau_residual"]**2, axis=0)), rtol=1e-6)


def test_what_is_measured_and_what_is_simulated_is_said(plain: Outcome[Result]) -> None:
    """One log: case 1 is measured, the others are simulated on its controller."""
    assert [case.origin for case in plain.result.cases] == ["measured", *["simulated"] * 5]
    assert plain.result.simulation is not None
    assert plain.result.simulation.simulation == "closed-loop"
    assert (plain.folder / "logs/writing-1-simulated.h5").is_file()


def test_the_gates_decide_the_exit_code(writing: ExperimentLog, tmp_path: Path) -> None:
    """--check: 1 where a joint misses more than the gate, and the joint is named; 0 without --check, and with a wide gate."""
    plain = Settings("rrr", simulate=False)
    strict = validated(tmp_path, {"w": writing}, replace(plain, torque_gate=0.01), check=True)
    assert (strict.exit_code, strict.result.gates.torque) == (1, False)
    assert [check.code for check in strict.checks if check.gate] == ["RRID-D19"]
    assert "joint 1" in next(check.message for check in strict.checks if check.gate)
    assert validated(tmp_path, {"w": writing}, replace(plain, torque_gate=0.01)).exit_code == 0
    assert validated(tmp_path, {"w": writing}, replace(plain, torque_gate=0.9), check=True).exit_code == 0


def test_feed_forward_that_harms_fails_the_second_gate(writing: ExperimentLog, tmp_path: Path) -> None:
    """A log of case 6 that errs more than case 1 in z: the gate says so."""
    controller = writing.controller
    assert controller is not None
    ahead = replace(controller, law="pd+feedforward", feedforward=("friction", "inertia", "coriolis", "gravity"),
                    model=model_text(read_model("rrr")))
    q = writing["q_ref"] + 1.3 * (writing.q - writing["q_ref"])
    worse = with_signal(replace(writing, name="worse", controller=ahead), q=q)
    found = validated(tmp_path, {"a": writing, "b": worse}, Settings("rrr", torque_gate=10.0, simulate=False), check=True)
    assert (found.result.gates.cases, found.exit_code) == (False, 1)
    assert "RRID-D20" in [check.code for check in found.checks]


def test_an_unknown_controller_leaves_the_table_out(writing: ExperimentLog, tmp_path: Path) -> None:
    """With the reason, and the simulation goes in windows."""
    found = validated(tmp_path, {"w": replace(writing, controller=None)}, Settings("rrr", torque_gate=0.5)).result
    assert found.cases == ()
    assert "does not say how its controller works" in found.cases_left_out
    assert found.gates.cases is None
    assert found.simulation is not None
    assert found.simulation.simulation == "windowed"


def test_any_held_out_log_is_validated(writing: ExperimentLog, tmp_path: Path) -> None:
    """Random moves of role validate: the first validation alone; of role identify: nothing matches."""
    other = replace(writing, experiment="free")
    found = validated(tmp_path, {"w": other}, Settings("rrr", torque_gate=0.5, simulate=False)).result
    assert found.torque is not None
    assert (found.torque.of, found.cases) == ("validate", ())
    with pytest.raises(NothingMatched, match="role validate"):
        validated(tmp_path, {"w": replace(writing, role="identify")}, Settings("rrr"))


def test_a_model_is_not_judged_by_what_it_was_fitted_to(writing: ExperimentLog, tmp_path: Path) -> None:
    """D14: by the digest of the recording, whatever the file is called; and within a folder by its samples."""
    model = replace(read_model("rrr"), sources=(Source("excitation", digest_of(writing), "excitation", "identify"),))
    write_model(tmp_path / "model.json", model)
    with pytest.raises(InputRejected, match="leak") as refused:
        validated(tmp_path, {"w": writing}, Settings(str(tmp_path / "model.json")))
    assert refused.value.code == "RRID-D14"
    twin = replace(writing, name="twin", role="identify", experiment="excitation")
    with pytest.raises(InputRejected, match="leak"):
        validated(tmp_path, {"w": writing, "twin": twin}, Settings())


@pytest.mark.parametrize(("settings", "code"), [
    (Settings("rrr", torque_gate=0.0), "C02"), (Settings("nobody"), "C04"), (Settings(text="R", size=-1.0), "C02"),
    (Settings(text="#"), "C02"), (Settings(text="R" * 1000), "C02")])
def test_settings_that_make_no_sense_are_refused(settings: Settings, code: str, writing: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(RrridError) as refused:
        validated(tmp_path, {"w": writing}, settings)
    assert refused.value.code == f"RRID-{code}"
    assert refused.value.remedy
    assert not (tmp_path / "out").exists()


def designed(tmp_path: Path, settings: Settings, robot: str = "rrr") -> Outcome[Result]:
    return run_stage(STAGE, Request((), out=tmp_path / "out", robot=robot, no_report=True), settings)


def test_the_designed_task_is_a_plan_that_writes_the_text(tmp_path: Path) -> None:
    """trajectory.h5: planned, held out, its tip writes the text in the plane asked for; controller.csv is the same motion."""
    outcome = designed(tmp_path, Settings(text="RR 7", plane_y=-0.42, size=0.1, speed=0.4, elbow="down"))
    log = open_log(outcome.folder / "trajectory.h5").log
    assert (log.origin, log.experiment, log.role) == ("planned", "writing", "validate")
    tip = tip_position(serial_chain(log.robot), log["q_ref"])
    np.testing.assert_allclose(tip[:, 1], -0.42, atol=1e-12)
    assert np.ptp(tip[:, 2]) == pytest.approx(0.1, abs=1e-5)
    speed = np.linalg.norm(np.gradient(tip, log.sample_time, axis=0), axis=1)
    assert speed.max() == pytest.approx(0.4, rel=1e-3)
    table = np.loadtxt(outcome.folder / "controller.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:log.n_samples, 1:], log["q_ref"], atol=1e-12)


def test_a_text_for_another_arm_is_refused(shared: Path, tmp_path: Path) -> None:
    """Six joints have no closed form here; the remedy names what judges a model of theirs."""
    (tmp_path / "tx40.toml").write_text(format_robot(ARMS["tx40"](shared, tmp_path).robot))
    with pytest.raises(UsageError, match="RRR arm") as refused:
        designed(tmp_path, Settings(text="I"), str(tmp_path / "tx40.toml"))
    assert "validate" in refused.value.remedy


def test_the_command(writing: ExperimentLog, tmp_path: Path) -> None:
    """As the contract writes it: JSON alone on standard output, exit 1 under --check where a gate fails, 2 without logs or text."""
    write_log(tmp_path / "w.h5", writing)
    done = rrrid("validate-writing", "w.h5", "--model", "rrr", "--no-simulation", "--torque-gate", "0.01", "--check", "--json",
                 "--no-report", "--out", "out", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert json.loads(done.stdout)["gates"]["torque"] is False
    assert rrrid("validate-writing", cwd=tmp_path).returncode == 2

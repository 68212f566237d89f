"""`rrrid validate-writing`: does a model hold where it was not fitted?"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure as Drawing

from pipelines import validate_writing
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.kinematics import serial_chain, tip_position
from pipelines.dynamics.parameter import Uncertainty
from pipelines.errors import InputRejected, NothingMatched, RrridError, UsageError
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.result import torques
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog, digest_of, recording
from pipelines.io.model_file import Source, model_text, read_model, write_model
from pipelines.io.robot import format_robot
from pipelines.report.writing_figures import error_map_figure
from pipelines.stage import Outcome, Request, run_stage
from pipelines.validate_writing import STAGE, Result, Settings
from pipelines.writing.validation import torque_validation
from sample_logs.make_model import synthetic_arm
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


def test_the_ends_of_a_log_are_no_place_where_a_model_is_worst(plain: Outcome[Result]) -> None:
    """Within one period of the low-pass a filter sees one side: the largest sample there is told as one that says nothing."""
    first = replace(plain.result.logs[0], low_pass_hz=20.0)
    end = first.stretches[-1].end
    for t, says in ((end, False), (end - 0.04, False), (end - 0.06, True), (0.5 * end, True), (0.01, False)):
        logs = (replace(first, largest=tuple(replace(one, t=t) for one in first.largest)), *plain.result.logs[1:])
        sections = validate_writing.report(replace(plain.result, logs=logs)).sections
        said = next(section.text for section in sections if section.title == "Where the torque is missed")[1:]
        assert len(said) == 3
        assert all(("tip at" in line) is says and ("says nothing of the model" in line) is not says for line in said)


def test_the_map_shows_what_the_text_beside_it_says(plain: Outcome[Result]) -> None:
    """A hum of 150 Hz on the torque, above the low-pass: neither the largest sample in words nor the darkest colour has it."""
    log = open_log(plain.folder / "logs/writing-1.h5").log
    arm = Arm.from_model(read_model("rrr"))
    motion = reconstruct(recording(log), Reconstruction())
    parts = torques(arm, log, motion)
    hum = 3.0 * np.sin(2.0 * np.pi * 150.0 * log.t)[:, None]
    found = torque_validation(with_signal(log, tau=log.tau + hum), motion, arm, parts)
    figure = error_map_figure(found, plain.result.joints)
    assert figure is not None
    assert "after the low-pass" in figure.caption
    drawing = Drawing()
    figure.draw(drawing)
    paths = [next(one for one in axis.collections if isinstance(one, LineCollection)) for axis in drawing.axes[:3]]
    for worst, path in zip(found.largest, paths, strict=True):
        darkest = path.get_clim()[1]
        assert darkest == pytest.approx(path.get_array().max(), rel=1e-9)
        assert abs(worst.error) * 0.95 <= darkest < abs(worst.error) + 1.0


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


def test_that_nobody_wrote_is_no_remark(writing: ExperimentLog, tmp_path: Path) -> None:
    """A held-out log of another motion judges the torque alone: in order where that is, else without letters to look at."""
    moved, plain = replace(writing, name="moved", experiment="free"), Settings("rrr", simulate=False)
    wide = validated(tmp_path, {"m": moved}, replace(plain, torque_gate=0.9))
    assert (wide.result.gates.cases, wide.report.tone) == (None, "good")
    strict = validated(tmp_path, {"m": moved}, replace(plain, torque_gate=0.01))
    (missed,) = (check for check in strict.checks if check.code == "RRID-D19")
    assert (strict.report.tone, "stretches" in missed.remedy) == ("bad", False)
    (missed,) = (check for check in validated(tmp_path, {"w": writing}, replace(plain, torque_gate=0.01)).checks
                 if check.code == "RRID-D19")
    assert "stretches" in missed.remedy


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


def test_what_the_table_lacks_is_named(writing: ExperimentLog, tmp_path: Path) -> None:
    """A log that follows another reference is not compared; without ddq_ref no case with inertia ahead is simulated."""
    signals = {name: signal for name, signal in writing.signals.items() if name != "ddq_ref"}
    moved = with_signal(replace(writing, name="moved"), q_ref=writing["q_ref"] + 1e-3)
    outcome = validated(tmp_path, {"a": replace(writing, signals=signals), "b": moved}, Settings("rrr", torque_gate=0.5, draws=1))
    assert [case.case for case in outcome.result.cases] == [1, 2, 4, 5]
    assert outcome.result.gates.cases is None
    words = " ".join(next(part for part in outcome.report.sections if "Control cases" in part.title).text)
    assert "ddq_ref" in words
    assert "Not compared: moved" in words


def test_what_was_drawn_is_named() -> None:
    """A covariance with friction in it, one of base parameters and offsets alone, a model file, and no uncertainty at all."""
    arm = synthetic_arm()
    together = replace(arm, uncertainty=Uncertainty(("p1", f"{arm.friction[0].place}:b"), np.eye(2)))
    apart = replace(arm, uncertainty=Uncertainty(("p1", "torque_offset:1:offset"), np.eye(2)))
    told = replace(arm, base=tuple(replace(p, std=0.1) for p in arm.base))
    assert "friction held" not in validate_writing._drawn_from(together)
    assert "friction held" in validate_writing._drawn_from(apart)
    assert "model file" in validate_writing._drawn_from(told)
    assert validate_writing._drawn_from(replace(arm, base=tuple(replace(p, std=None) for p in arm.base))) == ""


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


def test_a_model_left_in_the_folder_is_taken(writing: ExperimentLog, tmp_path: Path) -> None:
    """The output of estimate-bps may be named with its logs; without any model and logs to fit one nothing matches."""
    with pytest.raises(NothingMatched, match="no model"):
        validated(tmp_path, {"w": writing}, Settings())
    write_model(tmp_path / "in/model.json", read_model("rrr"))
    assert validated(tmp_path, {"w": writing}, Settings(simulate=False)).result.model == "model.json of the folder"


@pytest.mark.parametrize(("settings", "code"), [
    (Settings("rrr", torque_gate=0.0), "C02"), (Settings("rrr", draws=0), "C02"), (Settings("rrr", seed=-1), "C02"),
    (Settings("nobody"), "C04"), (Settings(text="R", elbow="left"), "C02"), (Settings(text="R", sample_time=0.0), "C02"),
    (Settings(text="R", via_points=3), "C02"), (Settings(text="#"), "C02"), (Settings(text="R", size=-1.0), "C02"),
    (Settings(via_points=100_000), "C02"), (Settings(text="R" * 1000), "C02")])
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


def test_via_points_use_the_drives(tmp_path: Path) -> None:
    """A plan of free motion, held out; some joint is at 95 % of a limit."""
    outcome = designed(tmp_path, Settings(via_points=4, seed=3))
    log = open_log(outcome.folder / "trajectory.h5").log
    assert (log.origin, log.experiment, log.role) == ("planned", "free", "validate")
    assert outcome.result.design is not None
    assert max(one.share for one in outcome.result.design.limits) == pytest.approx(0.95, abs=0.01)


def test_a_task_beyond_a_limit_is_refused(tmp_path: Path) -> None:
    """The letter, the place and the limit are named, and nothing is written; the same for what is out of reach."""
    for settings, words in ((Settings(text="RRR", acceleration=60.0), ("acceleration", "its limit is 60 rad", "letter 3")),
                            (Settings(text="RID", x=0.42), ("letter 3, 'D'", "farther"))):
        with pytest.raises(UsageError) as refused:
            designed(tmp_path, settings)
        assert all(word in str(refused.value) for word in (*words, "tip at ("))
        assert not (tmp_path / "out").exists()


def test_any_serial_arm_writes(shared: Path, tmp_path: Path) -> None:
    """Six joints, by numerical inverse kinematics from a posture near the task."""
    robot, posture = ARMS["tx40"](shared, tmp_path).robot, (0.2, 0.4, 0.4, 0.1, 0.5, 0.0)
    (tmp_path / "tx40.toml").write_text(format_robot(robot))
    x, y, z = tip_position(serial_chain(robot), np.array([posture]))[0].tolist()
    outcome = designed(tmp_path, Settings(text="I", plane_y=y, x=x, z=z, size=0.05, speed=0.1, acceleration=1.0, posture=posture),
                       str(tmp_path / "tx40.toml"))
    log = open_log(outcome.folder / "trajectory.h5").log
    tip = tip_position(serial_chain(log.robot), log["q_ref"])
    assert np.ptp(tip[:, 2]) == pytest.approx(0.05, abs=1e-9)
    np.testing.assert_allclose(tip[:, :2], [[x, y]] * len(tip), atol=1e-12)


def test_the_command(writing: ExperimentLog, tmp_path: Path) -> None:
    """As the contract writes it: JSON alone on standard output, exit 1 under --check where a gate fails, 2 without logs or text."""
    write_log(tmp_path / "w.h5", writing)
    done = rrrid("validate-writing", "w.h5", "--model", "rrr", "--no-simulation", "--torque-gate", "0.01", "--check", "--json",
                 "--no-report", "--out", "out", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert json.loads(done.stdout)["gates"]["torque"] is False
    assert rrrid("validate-writing", cwd=tmp_path).returncode == 2

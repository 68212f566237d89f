"""`rrrid fit-friction`: the law of each joint from its logs, judged, written, drawn; bad input named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import fit_friction
from pipelines.dynamics.arm import Arm
from pipelines.errors import Check, NothingMatched, UsageError
from pipelines.fit_friction import Settings
from pipelines.friction.result import JointResult, Result
from pipelines.io.files import Opened, open_log, write_log
from pipelines.io.log import ExperimentLog, Signal
from pipelines.io.model_file import read_model
from pipelines.io.robot import format_robot
from pipelines.stage import Inputs, Outcome, Request, run_stage
from tests.cli.commands import rrrid
from tests.friction.one_joint import (
    COSINE,
    INERTIA,
    JOINT,
    SINE,
    STEP,
    TRUTHS,
    as_log,
    driven,
    recorded,
    relative,
)
from tests.healthy import begun

QUICK = Settings(law="coulomb+viscous")


def stage(folder: Path, *logs: ExperimentLog, settings: Settings = QUICK, check: bool = False,
          no_report: bool = True) -> Outcome[Result]:
    for log in logs:
        write_log(folder / f"logs/{log.name}.h5", log)
    request = Request((folder / "logs",), out=folder / "out", check=check, no_report=no_report)
    return run_stage(fit_friction.STAGE, request, settings)


def computed(*logs: ExperimentLog, settings: Settings = QUICK) -> Result:
    return fit_friction.compute(Inputs(tuple(Opened(Path(f"{log.name}.h5"), "", log, ()) for log in logs), label="logs"), settings)


def changed(log: ExperimentLog, **signals: np.ndarray) -> ExperimentLog:
    more = {name: Signal(values, log.signals[name].units, name) if name in log.signals else Signal(values, "A", name)
            for name, values in signals.items()}
    return replace(log, signals={**log.signals, **more})


def gates(result: Result) -> dict[str, Check]:
    return {check.code.removeprefix("RRID-"): check for check in result.checks if check.gate}


@pytest.fixture(scope="module")
def good() -> ExperimentLog:
    return recorded("coulomb+viscous", 4, duration=7.0)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome[Result]:
    logs = recorded("three_sigmoid", 4), recorded("three_sigmoid", 54, "validate", duration=10.0)
    return stage(tmp_path_factory.mktemp("friction"), *logs, settings=Settings(), no_report=False)


def test_the_fields_of_the_contract(outcome: Outcome[Result]) -> None:
    """joints: joint, law, parameters with value, std, unit; inertia, gravity; validation; ladder. cli-contract.md."""
    (joint,) = json.loads((outcome.folder / "result.json").read_text())["joints"]
    assert (joint["joint"], joint["law"]) == (JOINT, "three_sigmoid")
    assert set(joint["parameters"]) == {"f1", "f2", "f3", "w1", "w2", "w3", "b"}
    for number in (*joint["parameters"].values(), joint["inertia"], *joint["gravity"].values()):
        assert set(number) == {"value", "std", "unit"}
    assert set(joint["gravity"]) == {"sine", "cosine"}
    assert set(joint["candidate_laws"][0]) >= {"law", "identify_rms", "validate_rms", "chosen"}
    assert [rung["law"] for rung in joint["candidate_laws"] if rung["chosen"]] == ["three_sigmoid"]
    assert joint["judged_by"] == "logs"
    assert joint["parameters"]["w1"]["value"] > joint["parameters"]["w2"]["value"] > joint["parameters"]["w3"]["value"]


def test_numbers_of_the_joint(outcome: Outcome[Result]) -> None:
    """Inertia and both sides of gravity within 1 % and three standard deviations; Fig. 6 below 0.05."""
    (joint,) = outcome.result.joints
    for found, truth in ((joint.inertia, INERTIA), (joint.gravity["sine"], SINE), (joint.gravity["cosine"], COSINE)):
        assert found.std is not None
        assert abs(found.value - truth) <= min(3.0 * found.std, 0.01 * max(truth, 1.0))
    assert joint.validation.held_out
    assert joint.validation.velocity_error_with is not None
    assert joint.validation.velocity_error_without is not None
    assert joint.validation.velocity_error_with <= 0.05 * joint.validation.velocity_error_without


def test_the_model_carries_the_friction(outcome: Outcome[Result]) -> None:
    """model.json gives the curve again; base parameters nobody fitted are said to be unknown."""
    arm = Arm.from_model(read_model(outcome.folder / "model.json"))
    (law,) = arm.friction
    assert (law.effect.name, law.effect.joint) == ("three_sigmoid", JOINT)
    speed = np.linspace(-5.0, 5.0, 101)
    assert relative(law.effect.curve(speed, arm, law.values), TRUTHS["three_sigmoid"].curve(speed)) < 0.004
    known = arm.body.known_parameters() is not None
    assert all(parameter.origin == ("known" if known else "assumed") for parameter in arm.base)


def test_the_report_has_its_figures(outcome: Outcome[Result]) -> None:
    names = {path.stem for path in (outcome.folder / "figures").glob("*.svg")}
    assert {f"curve-{JOINT}", f"simulation-{JOINT}"} <= names
    page = (outcome.folder / "report.html").read_text()
    assert "Table III" in page
    assert "three sigmoid" in page


def test_the_derived_log_holds_the_friction(outcome: Outcome[Result]) -> None:
    log = open_log(outcome.folder / "logs/three_sigmoid-4.h5").log
    friction = log["tau_friction_model"]
    assert not friction[:, [0, 1]].any()
    assert relative(friction[:, 2], TRUTHS["three_sigmoid"].curve(log["dq_hat"][:, 2])) < 0.01


def test_a_given_law_may_join_several(good: ExperimentLog) -> None:
    (joint,) = computed(good, settings=Settings(law="stribeck+asymmetric_friction")).joints
    assert joint.law == "stribeck+asymmetric_friction"
    assert [rung.law for rung in joint.candidate_laws] == [joint.law]


def one_way(good: ExperimentLog) -> ExperimentLog:
    tau = 1.9 + 0.5 * np.sin(2 * np.pi * 0.5 * np.arange(8000) * STEP)
    states = driven(tau, TRUTHS["coulomb+viscous"].torque, gravity=(0.0, 0.0), start=(0.0, 4.0))
    return as_log(np.round(states[:, 0] / 1e-5) * 1e-5, tau, "one-way")


def limited(log: ExperimentLog, limit: float) -> ExperimentLog:
    """A drive that gives no more than it is described to."""
    joints = tuple(replace(joint, torque=limit) for joint in log.robot.joints)
    text = format_robot(replace(log.robot, joints=joints))
    return replace(changed(log, tau=np.clip(log.tau, -limit, limit)), robot_text=text)


BAD = {
    "D10": one_way,
    "S14": lambda log: changed(log, tau=-log.tau),
    "D05": lambda log: limited(log, 1.6),
    "D16": lambda log: changed(log, q=log.q + 1.5 * np.outer(np.sin(2 * np.pi * 0.3 * log.t), [1.0, 0.0, 0.0]),
                               tau=log.tau + np.outer(np.sin(2 * np.pi * 0.31 * log.t), [1.0, 0.0, 0.0])),
    "S10": lambda log: changed(log, current=log.tau),
}


@pytest.mark.parametrize("code", [pytest.param(code, marks=pytest.mark.row(code)) for code in BAD])
def test_bad_input_is_a_clear_finding(code: str, good: ExperimentLog, tmp_path: Path) -> None:
    """No reversal, a wrong sign, saturated torque, a locked joint that moves, amperes: named, with what to do, and exit 1."""
    found = stage(tmp_path, BAD[code](good), check=True)
    assert code in gates(found.result), [check.message for check in found.result.checks]
    assert gates(found.result)[code].remedy
    assert found.exit_code == 1


def test_a_log_of_another_posture_is_left_out(good: ExperimentLog) -> None:
    """Inertia and gravity are those of the first log; the other is named in a warning."""
    other = replace(changed(good, q=good.q + np.array([0.0, 0.5, 0.0])), name="elsewhere")
    result = computed(good, other)
    assert result.joints[0].logs == (good.name,)
    assert any(check.code == "RRID-D16" and check.where == "elsewhere" for check in result.checks)


def test_no_log_to_fit(good: ExperimentLog) -> None:
    with pytest.raises(NothingMatched) as refused:
        computed(replace(good, role="validate"))
    assert refused.value.exit_code == 5


@pytest.mark.parametrize("settings", [{"law": "stribek"}, {"window": 0.0}, {"window": 10.0}])
def test_settings_have_bounds(settings: dict[str, object], good: ExperimentLog) -> None:
    with pytest.raises(UsageError) as refused:
        computed(good, settings=replace(QUICK, **settings))  # type: ignore[arg-type]
    assert (refused.value.code, refused.value.exit_code) == ("RRID-C02", 2)


def test_joints_that_never_moved_alone(samples: Path) -> None:
    """Excitation of all joints: friction with the base parameters, and inertia of the arm in the middle of its motion."""
    logs = [open_log(samples / f"rrr-closed-form/excitation-{number}.h5").log for number in (1, 2)]
    result = computed(*logs, settings=Settings(law="three_sigmoid"))
    assert result.source == "all joints at once"
    truth = Arm.from_model(read_model("rrr"))
    for joint, law in zip(result.joints, truth.friction, strict=True):
        driven_ = np.abs(joint.series.speed) >= joint.driven[0]
        speed = joint.series.speed[driven_]
        assert relative(joint.series.curve[driven_], law.effect.curve(speed, truth, law.values)) < 0.004
    arm = Arm.from_model(result.model)
    for ours, known in zip(arm.base, truth.base, strict=True):
        assert ours.value == pytest.approx(known.value, abs=0.01)


def test_the_command(good: ExperimentLog, tmp_path: Path) -> None:
    write_log(tmp_path / "logs/a.h5", good)
    made = rrrid("fit-friction", "logs", "--out", "o", "--law", "coulomb+viscous", "--no-report", "--json", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout)["joints"][0]["law"] == "coulomb+viscous"
    wrong = rrrid("fit-friction", "logs", "--out", "o", "--law", "coulom", cwd=tmp_path)
    assert wrong.returncode == 2
    assert "did you mean 'coulomb'" in wrong.stderr


def test_friction_is_handed_on(samples: Path) -> None:
    """`run` fits friction first: where every joint was driven alone, the estimate takes it as known."""
    names = [f"friction-{number}" for number in (1, 2, 3)]
    whole = (open_log(samples / f"rrr-closed-form/{name}.h5") for name in names)
    opened = tuple(replace(one, log=begun(one.log, 5000)) for one in whole)
    inputs = Inputs(opened, label="logs")
    result = fit_friction.compute(inputs, QUICK)
    assert isinstance(fit_friction.STAGE.onward(result, inputs).material, Arm)
    part = Inputs(opened[:1], label="logs")
    assert fit_friction.STAGE.onward(fit_friction.compute(part, QUICK), part).material is None
    assert all(isinstance(joint, JointResult) for joint in result.joints)


def test_run_leaves_joints_that_never_moved_alone_to_the_estimate(samples: Path) -> None:
    """Laws chosen together with the base parameters would not be handed on: `run` passes over, and says who takes such logs."""
    inputs = Inputs((open_log(samples / "rrr-closed-form/excitation-1.h5"),), label="logs")
    assert isinstance(fit_friction.STAGE.in_run, Settings)
    with pytest.raises(NothingMatched) as refused:
        fit_friction.compute(inputs, fit_friction.STAGE.in_run)
    assert "fit-friction by itself" in refused.value.remedy

"""What judges an estimate: other logs, the balance of power, other ways to reconstruct, a given friction."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps
from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.comparison import Compared
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog
from pipelines.io.model_file import model_text
from pipelines.io.robot import format_robot
from pipelines.report.bps_report import bps_report
from pipelines.stage import Request, run_stage
from tests.cli.commands import rrrid
from tests.estimate_bps.estimates import SYMMETRIC, Settings, of_elbow, stage
from tests.healthy import with_signal
from tests.model.estimation.experiments import arm, experiment, truth


def test_the_balance_of_power_agrees_on_a_healthy_log(good: ExperimentLog, tmp_path: Path) -> None:
    balance = stage(tmp_path, good).result.balance
    assert balance is not None
    assert balance.agree, balance.apart


def test_the_balance_of_power_finds_a_late_position(good: ExperimentLog, tmp_path: Path) -> None:
    """Position three samples late beside the torque: the torque fit and the balance then differ."""
    late = with_signal(good, q=np.vstack([np.repeat(good.q[:1], 3, axis=0), good.q[:-3]]))
    balance = stage(tmp_path, late).result.balance
    assert balance is not None
    assert not balance.agree


def test_the_balance_of_power_finds_a_spoilt_acceleration(good: ExperimentLog, tmp_path: Path) -> None:
    """An observer of 3 Hz takes acceleration away that the torque has; position and speed hardly suffer."""
    balance = stage(tmp_path, good, settings=replace(SYMMETRIC, method="observer", bandwidth=(3.0,))).result.balance
    assert balance is not None
    assert not balance.agree


@pytest.fixture(scope="module")
def of_samples(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> estimate_bps.Result:
    request = Request((samples / "rrr-closed-form",), out=tmp_path_factory.mktemp("samples") / "out", no_report=True)
    return run_stage(estimate_bps.STAGE, request, Settings()).result


def test_the_default_wins_held_out(of_samples: estimate_bps.Result) -> None:
    """The table of four ways to reconstruct: none explains the held-out sample log better than the default, but for a trifle."""
    result = of_samples
    assert [c.method for c in result.comparison if c.used] == ["smoother"]
    errors = {c.method: c.validate for c in result.comparison}
    assert errors["smoother"] < 1.01 * min(errors.values()), errors
    assert errors["smoother"] < 0.5 * errors["observer"]
    assert result.held_out == "logs"


def test_slow_samples_of_one_joint_leave_the_others_alone(good: ExperimentLog, tmp_path: Path) -> None:
    """--min-speed: each joint keeps the equations where it moves; its residual is the noise it had, not less."""
    every = stage(tmp_path / "a", good).result
    moving = stage(tmp_path / "b", good, settings=replace(SYMMETRIC, min_speed=(0.0, 1.5, 0.0))).result
    assert moving.equations[0] == every.equations[0] == every.equations[1]
    assert 0.1 * every.equations[1] < moving.equations[1] < 0.8 * every.equations[1]
    np.testing.assert_allclose(moving.torque_rms["identify"], every.torque_rms["identify"], rtol=0.15)
    z = [(p.value - truth([p.name])[0]) / p.std for p in moving.parameters]  # type: ignore[operator]
    assert np.abs(z).max() < 4.0


def test_a_given_friction_is_subtracted(good: ExperimentLog, held_out: ExperimentLog, tmp_path: Path) -> None:
    """--model: the true friction given, none is fitted; the rigid body comes out right, and surer than with it."""
    (tmp_path / "given.json").write_text(model_text(arm().to_model()), encoding="utf-8")
    fitted = stage(tmp_path / "a", good, held_out).result
    given = stage(tmp_path / "b", good, held_out, settings=replace(SYMMETRIC, model=str(tmp_path / "given.json"))).result
    assert (fitted.friction, given.friction) == ("fitted", "given")
    assert not any(p.name.startswith(("coulomb", "viscous")) for p in given.parameters)
    known = {p.name: p for p in fitted.parameters}
    for p in given.parameters:
        assert p.value is not None
        assert p.std is not None
        assert abs(p.value - truth([p.name])[0]) < 4.0 * p.std, p.name
        assert p.std < 1.1 * (known[p.name].std or 0.0), p.name
    assert given.relative_error["validate"] < 1.05 * fitted.relative_error["validate"]
    kept = {f"{law.effect}:{law.joint}": law for law in given.model.friction}
    assert kept["coulomb:1"].parameters["level"].value == 4.8


def test_a_model_of_another_robot_is_refused(good: ExperimentLog, tmp_path: Path) -> None:
    model = arm().to_model()
    robot = replace(arm().robot, joints=arm().robot.joints[:2])
    small = replace(model, robot=format_robot(robot))
    (tmp_path / "small.json").write_text(model_text(small), encoding="utf-8")
    with pytest.raises((UsageError, InputRejected)):
        stage(tmp_path, good, settings=replace(SYMMETRIC, model=str(tmp_path / "small.json")))


def test_the_command_line(good: ExperimentLog, held_out: ExperimentLog, tmp_path: Path) -> None:
    """Exit 5 without a log to fit, 1 with --check where a gate failed; --model and --json; nothing but JSON on stdout."""
    write_log(tmp_path / "judge/a.h5", held_out)
    nothing = rrrid("estimate-bps", "judge", "--out", "o", cwd=tmp_path)
    assert (nothing.returncode, "RRID-C06" in nothing.stderr, nothing.stdout) == (5, True, "")
    write_log(tmp_path / "still/a.h5", of_elbow(experiment(0, moving=np.array([0.0, 0.0, 1.0]))))
    gate = rrrid("estimate-bps", "still", "--out", "o1", "--no-report", "--check", cwd=tmp_path)
    assert gate.returncode == 1
    assert "no sample shows p1" in gate.stdout
    write_log(tmp_path / "good/a.h5", good)
    (tmp_path / "given.json").write_text(model_text(arm().to_model()), encoding="utf-8")
    given = rrrid("estimate-bps", "good", "--out", "o2", "--no-report", "--json", "--model", "given.json", cwd=tmp_path)
    assert given.returncode == 0
    assert json.loads(given.stdout)["friction"] == "given"
    missing = rrrid("estimate-bps", "good", "--out", "o3", "--model", "nowhere.json", cwd=tmp_path)
    assert (missing.returncode, "RRID-C04" in missing.stderr) == (2, True)


@pytest.mark.parametrize(("alone", "min_speed"), [
    (True, 0.5), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((False, 0.0), (True, 0.0), (False, 0.5)))])
def test_all_ways_are_judged_by_the_same_equations(alone: bool, min_speed: float, good: ExperimentLog, held_out: ExperimentLog,
                                                   tmp_path: Path) -> None:
    settings = replace(SYMMETRIC, compare=True, min_speed=(min_speed,))
    result = stage(tmp_path, *((good,) if alone else (good, held_out)), settings=settings).result
    assert len({c.equations for c in result.comparison}) == 1
    assert result.comparison[0].equations > 0


def _compared(**errors: tuple[float, float, float]) -> tuple[Compared, ...]:
    """Of each way its held-out error and the interval of its difference to the first, which is the one used."""
    return tuple(Compared(name, k == 0, error, error, (low, high), low <= 0.0, 9, (1.0,), (0.1,), "")
                 for k, (name, (error, low, high)) in enumerate(errors.items()))


def test_the_report_names_a_better_way_only_where_it_is_measured(good: ExperimentLog, tmp_path: Path) -> None:
    result = stage(tmp_path, good).result

    def said(**errors: tuple[float, float, float]) -> str:
        section = bps_report(replace(result, comparison=_compared(**errors))).sections[-1]
        return section.text[0]

    better = said(smoother=(0.05, 0.0, 0.0), observer=(0.04, -0.012, -0.008))
    assert "observer is measurably better than smoother, which was used" in better
    assert "0.8 to 1.2 percentage points" in better
    assert "--method observer" in better
    draw = "no way is measurably better than smoother, which was used"
    assert said(smoother=(0.05, 0.0, 0.0), observer=(0.04, -0.021, 0.001)).endswith(f"{draw}.")
    assert said(smoother=(0.04, 0.0, 0.0), other=(0.05, 0.008, 0.012)).endswith(f"{draw}; other is measurably worse.")
    assert "better by more than a trifle than smoother" in said(smoother=(0.0401, 0.0, 0.0), observer=(0.04, -0.0002, -0.0001))


def test_what_is_alike_is_called_so(of_samples: estimate_bps.Result) -> None:
    """Sample logs of a fine encoder: smoother and zero-phase filter are indistinguishable, the observer is not."""
    beside = {c.method: c for c in of_samples.comparison}
    assert {name for name, c in beside.items() if c.tied} == {"smoother", "zero-phase"}
    low, high = beside["zero-phase"].apart
    assert low < beside["zero-phase"].validate - beside["smoother"].validate < high
    assert low < 0.0 < high
    assert beside["observer"].apart[0] > 0.5 * (beside["observer"].validate - beside["smoother"].validate)


def test_the_verdict_names_the_worst_joint_and_what_is_small(good: ExperimentLog, tmp_path: Path) -> None:
    result = stage(tmp_path, good).result
    plain = replace(result, relative_error={"identify": 0.05, "validate": 0.05},
                    torque_rms={**result.torque_rms, "validate": (1.0, 1.0, 1.0)},
                    torque_signal_rms={**result.torque_signal_rms, "validate": (20.0, 20.0, 20.0)})
    assert bps_report(plain).tone == "good"
    assert "worst joint" not in bps_report(plain).verdict
    bad = replace(plain, torque_rms={**plain.torque_rms, "validate": (1.0, 1.0, 12.2)})
    assert f"{result.joints[2]} 61 %" in bps_report(bad).verdict
    assert bps_report(bad).tone == "attention"
    small = tuple(replace(p, value=0.5, std=1.0, visible=True) if k < 2 else replace(p, value=10.0, std=1.0, visible=True)
                  for k, p in enumerate(result.parameters))
    report = bps_report(replace(plain, parameters=small))
    assert f"{len(small) - 2} of {len(small)} parameters are clearly visible, 2 known to be small" in report.verdict
    assert [row[3] for row in report.sections[1].tables[0].rows][:3] == ["known to be small", "known to be small", "clearly"]

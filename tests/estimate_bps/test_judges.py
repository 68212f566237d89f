"""What judges an estimate: other logs, other ways to reconstruct, a given friction."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog
from pipelines.io.model_file import model_text
from pipelines.io.robot import format_robot
from pipelines.report.bps_report import bps_report
from tests.cli.commands import rrrid
from tests.estimate_bps.estimates import SYMMETRIC, of_elbow, stage
from tests.estimation.experiments import arm, experiment, truth


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
    assert f"Identifiability of the {len(small)} parameters: {len(small) - 2} good, 2 negligible." in report.verdict
    assert [row[3] for row in report.sections[0].tables[0].rows][:3] == ["negligible", "negligible", "good"]

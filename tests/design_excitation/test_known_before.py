"""What is known before: earlier logs, bounds on the parameters, or nothing of the links."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pipelines.io.robot_files import load_robot
from tests.design_excitation.short import QUICK, designed


def test_earlier_logs_count(tmp_path: Path, samples: Path) -> None:
    """After a log of excitation every parameter is predicted to be known better than by the new experiment alone."""
    after = designed(tmp_path / "after", QUICK, (samples / "rrr-closed-form/excitation-1.h5",)).result
    assert len(after.after) == 1
    alone = designed(tmp_path / "alone").result
    assert after.predicted_relative_std < alone.predicted_relative_std
    assert after.lower_bound is None  # the certificate is one motion's


def testwithout_links_torque_is_not_claimed_to_be_checked(tmp_path: Path) -> None:
    robot = load_robot("rrr")
    from pipelines.io.robot import format_robot

    text = format_robot(replace(robot, joints=tuple(replace(joint, link=None) for joint in robot.joints)))
    (tmp_path / "robot.toml").write_text(text)
    outcome = designed(tmp_path / "out", replace(QUICK, robot=str(tmp_path / "robot.toml")))
    assert not outcome.result.torque_checked
    assert "torque limits could not be checked" in outcome.report.verdict
    assert all(one.quantity != "torque" for one in outcome.result.limits)

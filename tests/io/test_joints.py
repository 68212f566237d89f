"""--joints and --robot: what is chosen is chosen everywhere in the log, and the robot that is left must be described."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.io.files import open_log, write_log
from pipelines.io.log import select_joints, with_robot
from pipelines.io.robot import RobotDescription, parse_robot
from tests.io.logs import ROBOT_TEXT, small_log


def _arm(*joints: int) -> RobotDescription:
    whole = parse_robot(ROBOT_TEXT)
    return replace(whole, name="part", joints=tuple(whole.joints[j - 1] for j in joints))


def test_a_choice_reaches_samples_controller_posture_and_joint() -> None:
    """Joints 3 and 1 of three: everything that has one value a joint follows, in that order."""
    log = small_log(experiment="frf", joint=3, posture=np.array([0.1, 0.2, 0.3]))
    part = with_robot(select_joints(log, (3, 1), _arm(3, 1)), _arm(3, 1))
    assert part.n_joints == 2
    for name in ("q", "tau", "q_ref", "temperature"):
        assert np.array_equal(part[name], log[name][:, [2, 0]])
    assert np.array_equal(part.t, log.t)
    assert part.joint == 1
    assert part.posture is not None
    assert part.posture.tolist() == [0.3, 0.1]
    assert part.controller is not None
    assert part.controller.kp is not None
    assert part.controller.kp.tolist() == [140, 1500]
    assert part.controller.observer_gain is not None
    assert part.controller.observer_gain.tolist() == [[6, 7, 8], [0, 1, 2]]
    assert part.controller.ki is None


@pytest.mark.parametrize(("joints", "words"), [
    ((0, 1), "a log with 3 joints has no joint 0"), ((4,), "a log with 3 joints has no joint 4"),
    ((1, 2), "2 joints are chosen, but the log describes a robot of 3.*--robot"), ((2,), "1 joint is chosen, but")])
def test_a_choice_that_cannot_be_is_refused(joints: tuple[int, ...], words: str) -> None:
    """C02: joints that are not there; and a serial arm cannot lose a joint from its description."""
    with pytest.raises(UsageError, match=f"RRID-C02 .*{words}"):
        select_joints(small_log(), joints)


def _six_columns(path: Path, turned: bool = False) -> Path:
    """A log of six columns that describes an arm of three joints."""
    log = small_log(controller=None)
    write_log(path, log)
    with h5py.File(path, "a") as file:
        del file.attrs["digest"]
        for name in [n for n in file["signals"] if n != "t"]:
            attributes = dict(file["signals"][name].attrs)
            del file["signals"][name]
            values = np.hstack([log[name], log[name] + 100.0])
            file["signals"][name] = values.T if turned else values
            file["signals"][name].attrs.update(attributes)
    return path


@pytest.mark.parametrize("turned", [False, True])
def test_a_log_of_more_columns_than_joints_is_read_with_a_choice(tmp_path: Path, turned: bool) -> None:
    """S02: refused as it is; with the choice that the message asks for, three of the six columns are the log."""
    path = _six_columns(tmp_path / "a.h5", turned)
    with pytest.raises(InputRejected, match="RRID-S02|RRID-S11"):
        open_log(path)
    opened = open_log(path, joints=(1, 5, 3))
    q = small_log()["q"]
    assert np.array_equal(opened.log.q, np.column_stack([q[:, 0], q[:, 1] + 100.0, q[:, 2]]))
    assert "joints 1, 5, 3 of 6 are used" in next(c.message for c in opened.checks if c.code == "RRID-S02")


def test_another_robot_replaces_the_logs_own(tmp_path: Path) -> None:
    """--robot: the description given is the one the log then has; one of another number of joints is refused."""
    write_log(tmp_path / "a.h5", small_log())
    other = replace(_arm(1, 2, 3), gravity=(0.0, 0.0, 0.0))
    assert open_log(tmp_path / "a.h5", robot=other).log.robot == other
    with pytest.raises(InputRejected, match=r"RRID-S02 .*log has 3 joints, model 2.*--joints"):
        open_log(tmp_path / "a.h5", robot=_arm(1, 2))
    assert open_log(tmp_path / "a.h5", robot=_arm(1, 2), joints=(1, 2)).log.n_joints == 2

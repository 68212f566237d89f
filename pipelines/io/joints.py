"""Choose joints of a log, or describe its robot anew: what --joints and --robot do right after a log is opened."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pipelines.errors import Check, InputRejected, UsageError
from pipelines.io.experiment import Array, Controller, ExperimentLog
from pipelines.io.robot import RobotDescription, format_robot

__all__ = ["chosen", "select_joints", "with_robot"]

_PER_JOINT = ("kp", "kd", "ki", "observer_gain", "output_limit", "torque_resolution")


def chosen(log: ExperimentLog, joints: tuple[int, ...], robot: RobotDescription | None) -> tuple[ExperimentLog, tuple[Check, ...]]:
    """`log` of the joints asked for, with the robot asked for; of all joints and its own robot where nothing is asked."""
    checks: tuple[Check, ...] = ()
    if joints:
        names = ", ".join(map(str, joints))
        checks = (Check.of("S02", "warn", f"joints {names} of {_columns(log)} are used, as --joints says",
                           where=log.source or log.name, remedy="leave --joints out to use all"),)
        log = select_joints(log, joints, robot)
    return (log if robot is None else with_robot(log, robot)), checks


def with_robot(log: ExperimentLog, robot: RobotDescription) -> ExperimentLog:
    """`log` with another description of its robot.

    Raises:
        InputRejected: S02, it describes another number of joints.
    """
    if (columns := _columns(log)) not in (0, robot.n_joints):
        raise InputRejected("S02", f"log has {columns} joints, model {robot.n_joints}", where=log.source or log.name,
                            remedy="give the description of this robot, or choose the columns with --joints")
    return replace(log, robot_text=format_robot(robot))


def select_joints(log: ExperimentLog, joints: tuple[int, ...], robot: RobotDescription | None = None) -> ExperimentLog:
    """`log` with the columns of `joints` (1-based) alone, in that order, in every signal, the controller and the posture.

    A serial arm cannot lose a joint from its description: where the log's own robot has another number of joints than
    are chosen, `robot` must describe the arm that is left.

    Raises:
        UsageError: C02, a joint the log does not have, or twice; or no description fits.
        InputRejected: S02, the log is about a joint that is not chosen.
    """
    columns, where = _columns(log), log.source or log.name
    absent = [str(joint) for joint in joints if not 1 <= joint <= columns]
    if absent or len(set(joints)) != len(joints):
        why = (f"a log with {columns} joints has no joint {' or '.join(absent)}" if absent else
               f"'{','.join(map(str, joints))}' names a joint twice")
        raise UsageError("C02", why, where=where, remedy="give each of --joints once, counted from 1")
    if robot is None and log.n_joints != len(joints):
        chosen = "1 joint is" if len(joints) == 1 else f"{len(joints)} joints are"
        raise UsageError("C02", f"{chosen} chosen, but the log describes a robot of {log.n_joints}", where=where,
                         remedy="describe the arm that is left with --robot")
    if log.joint is not None and log.joint not in joints:
        raise InputRejected("S02", f"the log moves joint {log.joint}, which --joints leaves out", where=where,
                            remedy="choose it too, or leave this log out")
    at = np.array(joints) - 1
    samples = log.signals["t"].values.size if "t" in log.signals else -1
    signals = {name: replace(s, values=_of_columns(s.values, at, samples)) for name, s in log.signals.items()}
    return replace(log, signals=signals, joint=None if log.joint is None else joints.index(log.joint) + 1,
                   posture=_of_rows(log.posture, at, columns), controller=_controller(log.controller, at, columns))


def _columns(log: ExperimentLog) -> int:
    """How many joints the samples have, whatever the description says; 0 where no signal has joints."""
    samples = log.signals["t"].values.size if "t" in log.signals else -1
    shapes = [s.values.shape for s in log.signals.values() if s.values.ndim == 2 and 1 not in s.values.shape]
    shapes = shapes or [s.values.shape for name, s in log.signals.items() if s.values.ndim == 2 and name != "t"]
    return max((shape[1] if shape[0] == samples else shape[0] for shape in shapes), default=0)


def _of_columns(values: Array, at: Array, samples: int) -> Array:
    """The columns `at` of samples over joints, also where they were stored turned round (S11)."""
    if values.ndim != 2 or values.shape[0 if values.shape[0] != samples else 1] <= at.max():
        return values  # a vector, or a shape that the format's check refuses by name
    return np.ascontiguousarray(values[:, at] if values.shape[0] == samples else values[at])


def _of_rows(values: Array | None, at: Array, columns: int) -> Array | None:
    return values if values is None or len(values) != columns else values[at]


def _controller(controller: Controller | None, at: Array, columns: int) -> Controller | None:
    if controller is None:
        return None
    changes: dict[str, Any] = {key: _of_rows(getattr(controller, key), at, columns) for key in _PER_JOINT}
    return replace(controller, **changes)

"""A reference as a log for the robot: origin "planned", references only."""

from __future__ import annotations

from pipelines.io import schema
from pipelines.io.log import ExperimentLog, Signal
from pipelines.io.robot import RobotDescription, format_robot
from pipelines.model.rigid.body import Motion

__all__ = ["planned_log"]


def planned_log(name: str, robot: RobotDescription, motion: Motion, experiment: str = "writing",
                role: str = "validate") -> ExperimentLog:
    """The log that carries `motion` (at least two samples, evenly spaced) as q_ref, dq_ref, ddq_ref."""
    signals = {key: Signal(values, schema.unit_of(key), schema.SIGNALS[key][1])
               for key, values in (("t", motion.t), ("q_ref", motion.q), ("dq_ref", motion.dq), ("ddq_ref", motion.ddq))}
    return ExperimentLog(name=name, experiment=experiment, role=role, origin="planned", robot_name=robot.name,
                         sample_time=float(motion.t[-1] - motion.t[0]) / (len(motion.t) - 1), robot_text=format_robot(robot),
                         signals=signals)

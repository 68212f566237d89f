"""What is written of a design: the log of a plan, and the coefficients of eq. (22)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.io.log import ExperimentLog, Signal
from pipelines.model.excitation.others import Plan
from pipelines.model.excitation.task import Task
from pipelines.model.excitation.trajectory import Trajectory
from pipelines.model.rigid.body import Array, Motion
from pipelines.writing.task import planned_log

__all__ = ["coefficients", "joint_motion", "log_of_plan"]


def joint_motion(t: Array, motion: Array) -> Motion:
    """Of q, dq, ddq (3, joints, samples) at times t (samples,) [s]."""
    q, dq, ddq = (np.ascontiguousarray(part.T) for part in motion)
    return Motion(t, q, dq, ddq)


def coefficients(task: Task, trajectory: Trajectory) -> dict[str, object]:
    """Eq. (22), joint by joint, at the harmonics each one has."""
    series, used = trajectory.series, task.harmonics.used
    joints = []
    for j, joint in enumerate(task.robot.joints):
        own = np.flatnonzero(used[j])
        joints.append({"joint": j + 1, "name": joint.name, "q0": float(series.offset[j]), "harmonics": (own + 1).tolist(),
                       "a": series.cosine[j, own].tolist(), "b": series.sine[j, own].tolist()})
    return {"formula": "q = q0 + sum_j (a_j sin(w_j t) - b_j cos(w_j t))/w_j, w_j = 2 pi j / period", "period": series.period,
            "units": {"period": "s", "q0": "rad", "a": "rad/s", "b": "rad/s"}, "run_in": trajectory.run_in,
            "periods": trajectory.periods, "joints": joints}


def log_of_plan(plan: Plan, task: Task) -> ExperimentLog:
    """The planned log of one of the other experiments."""
    log = planned_log(f"{task.robot.name} {plan.name}", task.robot, joint_motion(plan.t, plan.motion), plan.experiment, "identify")
    signals = dict(log.signals)
    if plan.v is not None:
        signals["v"] = Signal(plan.v, "rad/s^2", "injected excitation")
    return replace(log, signals=signals, joint=plan.joint, posture=plan.posture, period=plan.period)

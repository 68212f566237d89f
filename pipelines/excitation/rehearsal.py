"""Rehearse a planned motion in simulation: tracking, torque and speed under a plain controller.

    found, rehearsal, failed = rehearsed_design(task, found, seed, tell)
    rehearsal.beyond                                 limits that it breaks

Every joint gets a PD controller as in Kostić et al. 2004, eq. (23), its gains those of a critically
damped 8 Hz loop about the joint's own inertia at the start; the drives saturate at their limits. No
feed-forward: a real controller will rather do better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Array
from pipelines.errors import Interrupted, RrridError
from pipelines.excitation.config import CONFIG
from pipelines.excitation.optimise import Design
from pipelines.excitation.other_plans import Plan
from pipelines.excitation.task import Task
from pipelines.io.log import Controller
from pipelines.simulation import Experiment, Noise, simulate

__all__ = ["Beyond", "Rehearsal", "rehearse", "rehearsed_design", "rehearsed_plans"]


@dataclass(frozen=True)
class Beyond:
    """A limit that a rehearsal did not keep."""

    joint: int  # counted from 0
    quantity: str  # "position" | "speed" | "torque"
    by: float  # distance beyond the range; share of the speed limit; share of samples cut off
    unit: str = ""  # of a position


@dataclass(frozen=True)
class Rehearsal:
    """The motion of the simulated arm; each (joints,)."""

    seconds: float  # rehearsed
    position_rms: tuple[float, ...]  # [rad] actual minus planned
    position_max: tuple[float, ...]  # [rad]
    torque_peak: tuple[float, ...]  # [N m] commanded
    torque_limit: tuple[float, ...]  # [N m]
    speed_peak: tuple[float, ...]  # [rad/s]
    speed_limit: tuple[float, ...]  # [rad/s]
    saturated: tuple[float, ...]  # share of samples at the torque limit
    position_nearest: tuple[float, ...] | None = None  # [rad or m] nearest to an end of its range
    position_beyond: tuple[float, ...] | None = None  # [rad or m] past that end; NaN where open
    position_units: tuple[str, ...] | None = None  # "rad" or "m"

    @property
    def beyond(self) -> tuple[Beyond, ...]:
        """The limits that were not kept, joint by joint."""
        found, joints = [], len(self.saturated)
        past = self.position_beyond or (math.nan,) * joints
        units = self.position_units or ("rad",) * joints
        for j in range(joints):
            fast = self.speed_peak[j] / self.speed_limit[j] - 1.0
            for quantity, by, unit in (("position", past[j], units[j]), ("speed", fast, ""),
                                       ("torque", self.saturated[j], "")):
                if by > 0.0:
                    found.append(Beyond(j, quantity, by, unit))
        return tuple(found)

    @property
    def safe(self) -> bool:
        """True where no drive saturates and no joint leaves its range or exceeds its speed."""
        return not self.beyond


def rehearse(arm: Arm, sample_time: float, motion: Array, noise: Array, seed: int,
             v: Array | None = None) -> Rehearsal:
    """Simulate motion (3, joints, samples) with torque noise of standard deviation `noise` [N m].

    Args:
        v: excitation (samples, joints) [rad/s^2]; adds the torque that would accelerate the arm so
            where it begins.
    """
    joints, n = arm.robot.joints, arm.n_joints
    q, dq, ddq = (part.T for part in motion)
    matrix = arm.body.mass_matrix(q[:1], arm.p)[0]
    inertia = np.diag(matrix)
    inertia = np.maximum(inertia, CONFIG.lightest * float(inertia.max()))
    omega = 2.0 * np.pi * CONFIG.loop_hz
    limit = np.array([joint.torque for joint in joints])
    controller = Controller("pd", kp=inertia * omega**2, kd=2.0 * inertia * omega, delay=0,
                            velocity="backward-difference",
                            output_limit=limit if np.isfinite(limit).all() else None)
    resolution = np.array([joint.encoder_resolution or 0.0 for joint in joints])
    experiment = Experiment(sample_time, 0.0, controller, q, dq, ddq, q[0], dq[0], np.zeros(n),
                            resolution, v=None if v is None else v @ matrix)
    done = simulate(arm, experiment, Noise(noise, np.zeros(n)), (seed,))
    actual, tau, speed = done.true_q[0], np.abs(done.tau[0]), np.abs(done.true_dq[0])
    away, ranges = actual - q, np.array([joint.position for joint in joints])
    low, high = actual.min(axis=0), actual.max(axis=0)
    under, over = ranges[:, 0] - low, high - ranges[:, 1]
    beyond = np.maximum(under, over)

    def each(values: Array) -> tuple[float, ...]:
        return tuple(float(value) for value in values)

    return Rehearsal(
        len(q) * sample_time, each(np.sqrt((away**2).mean(axis=0))), each(np.abs(away).max(axis=0)),
        each(tau.max(axis=0)), each(limit), each(speed.max(axis=0)),
        tuple(joint.velocity for joint in joints),
        each((tau >= limit * (1.0 - 1e-9)).mean(axis=0)), each(np.where(under > over, low, high)),
        each(np.where(np.isfinite(beyond), beyond, np.nan)),
        tuple("m" if joint.type == "prismatic" else "rad" for joint in joints))


def rehearsed_design(task: Task, found: Design, seed: int, tell: Callable[[str], None],
                     ) -> tuple[Design, Rehearsal | None, str]:
    """Return `found`, its rehearsal, and what failed.

    One period and what leads to it and away are rehearsed. Nothing is rehearsed without a model.
    An interruption keeps the design.
    """
    if task.arm is None:
        return found, None, ""
    tell("rehearsing in simulation")
    _, motion = replace(found.trajectory, periods=1).sampled(task.sample_time)
    try:
        rehearsal = rehearse(task.arm, task.sample_time, motion, task.problem.goal.noise, seed)
    except RrridError as problem:  # a simulation that runs away is no reason to lose the design
        return found, None, problem.message
    except Interrupted as signal:
        return replace(found, stopped=signal.exit_code), None, ""
    return found, rehearsal, ""


def rehearsed_plans(task: Task, plans: Sequence[Plan], seed: int, tell: Callable[[str], None],
                    ) -> tuple[tuple[tuple[str, Rehearsal], ...], str]:
    """Return the rehearsals of plans by name, as far as they went, and what failed."""
    found: list[tuple[str, Rehearsal]] = []
    for plan in plans if task.arm is not None else ():
        tell(f"rehearsing {plan.name} in simulation")
        try:
            assert task.arm is not None
            found.append((plan.name, rehearse(task.arm, task.sample_time, plan.motion,
                                              task.problem.goal.noise, seed, plan.v)))
        except RrridError as problem:
            return tuple(found), f"{plan.name}: {problem.message}"
    return tuple(found), ""

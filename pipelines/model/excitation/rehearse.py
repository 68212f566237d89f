"""Rehearse a planned motion in simulation before the robot moves: tracking, torque and speed under a plain controller.

    found, rehearsal, failed = rehearsed_design(task, found, seed, tell)     made smaller where the arm would go beyond a limit
    rehearsal.beyond                                                         what still does

Every joint gets a PD controller as in eq. (23), its gains those of a critically damped 8 Hz loop about the joint's own inertia
at the start; the drives saturate at their limits. No feed-forward: a real controller will rather do better.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import RrridError
from pipelines.log.experiment import Controller
from pipelines.model.arm import Arm
from pipelines.model.excitation.design import FINISH, Design, finished, landscape
from pipelines.model.excitation.others import Plan
from pipelines.model.excitation.task import Task
from pipelines.model.rigid.body import Array
from pipelines.model.simulation import Experiment, Noise, simulate

__all__ = ["Beyond", "Rehearsal", "rehearse", "rehearsed", "rehearsed_design"]

_LOOP_HZ = 8.0
_SHRINKINGS = 6  # rehearsals of a design that is made smaller
_SATURATED = 1.03  # of its limit that a torque is taken to ask for which the drive cuts off
_INSIDE = 0.998  # of the way to the limit: what is made smaller follows otherwise by about as much
_LIGHTEST = 1e-4  # of the heaviest joint's inertia: a loop about less would ask for gains without bound


@dataclass(frozen=True)
class Beyond:
    """A limit that a rehearsal did not keep."""

    joint: int  # counted from 0
    quantity: str  # "position" | "speed" | "torque"
    share: float  # of the limit that is reached; of a torque 1, for the drive gives no more


@dataclass(frozen=True)
class Rehearsal:
    """What the simulated arm did; each (joints,)."""

    seconds: float  # rehearsed
    position_rms: tuple[float, ...]  # [rad] actual minus planned
    position_max: tuple[float, ...]  # [rad]
    position_reach: tuple[float, ...]  # of the way from the middle of the range to its nearer end; 0 where both are open
    torque_peak: tuple[float, ...]  # [N m] commanded
    torque_limit: tuple[float, ...]  # [N m]
    speed_peak: tuple[float, ...]  # [rad/s]
    speed_limit: tuple[float, ...]  # [rad/s]
    saturated: tuple[float, ...]  # share of samples at the torque limit

    @property
    def beyond(self) -> tuple[Beyond, ...]:
        """What goes beyond its limit, joint by joint."""
        found = []
        for j, (reach, speed, limit, full) in enumerate(zip(self.position_reach, self.speed_peak, self.speed_limit, self.saturated,
                                                            strict=True)):
            found += [Beyond(j, "position", reach)] if reach > 1.0 else []
            found += [Beyond(j, "speed", speed / limit)] if speed > limit else []
            found += [Beyond(j, "torque", 1.0)] if full > 0.0 else []
        return tuple(found)

    @property
    def safe(self) -> bool:
        """No drive saturates, and no joint goes beyond its range or its speed."""
        return not self.beyond

    @property
    def nearest(self) -> float:
        """Share of the limit that is come nearest to; of a torque that is cut off, of what it would have asked for."""
        return max((_SATURATED if one.quantity == "torque" else one.share for one in self.beyond), default=1.0)


def rehearse(arm: Arm, sample_time: float, motion: Array, noise: Array, seed: int, seconds: float,
             v: Array | None = None) -> Rehearsal:
    """The first `seconds` of motion (3, joints, samples), with torque noise of standard deviation `noise` [N m] (joints,).

    Args:
        v: excitation (samples, joints) [rad/s^2]; it adds the torque that would accelerate the arm so where it begins.
    """
    joints = arm.robot.joints
    samples = motion.shape[2] if seconds >= motion.shape[2] * sample_time else max(2, round(seconds / sample_time))
    planned = motion[:, :, :samples]
    matrix = arm.body.mass_matrix(planned[0].T[:1], arm.p)[0]
    inertia = np.diag(matrix)
    inertia = np.maximum(inertia, _LIGHTEST * float(inertia.max()))
    omega = 2.0 * np.pi * _LOOP_HZ
    limit = np.array([joint.torque for joint in joints])
    controller = Controller("pd", kp=inertia * omega**2, kd=2.0 * inertia * omega, velocity="backward-difference", delay=0,
                            output_limit=limit if np.isfinite(limit).all() else None)
    q, dq, ddq = (part.T for part in planned)
    experiment = Experiment(sample_time, 0.0, controller, q, dq, ddq, q[0], dq[0], np.zeros(arm.n_joints),
                            np.array([joint.encoder_resolution or 0.0 for joint in joints]),
                            v=None if v is None else v[:samples] @ matrix)
    done = simulate(arm, experiment, Noise(noise, np.zeros(arm.n_joints)), (seed,))
    away, tau, speed = done.true_q[0] - q, np.abs(done.tau[0]), np.abs(done.true_dq[0])

    def each(values: Array) -> tuple[float, ...]:
        return tuple(float(value) for value in values)

    return Rehearsal(len(q) * sample_time, each(np.sqrt((away**2).mean(axis=0))), each(np.abs(away).max(axis=0)),
                     each(_reach(done.true_q[0], np.array([joint.position for joint in joints]))),
                     each(tau.max(axis=0)), each(limit), each(speed.max(axis=0)), tuple(joint.velocity for joint in joints),
                     each((tau >= limit * (1.0 - 1e-9)).mean(axis=0)))


def _reach(q: Array, ranges: Array) -> Array:
    """How far q (samples, joints) goes towards the nearer end of `ranges` (joints, 2): 1 is the end, 0 where both are open."""
    low, high = np.isfinite(ranges).T
    ends = np.where(np.isfinite(ranges), ranges, 0.0)
    middle = np.where(low & high, ends.mean(axis=1), np.where(high, ends[:, 1] - 1.0, ends[:, 0] + 1.0))
    half = np.where(low & high, 0.5 * (ends[:, 1] - ends[:, 0]), 1.0)
    return np.asarray(np.maximum(np.where(high, (q.max(axis=0) - middle) / half, 0.0),
                                 np.where(low, (middle - q.min(axis=0)) / half, 0.0)))


def rehearsed_design(task: Task, found: Design, seed: int, tell: Callable[[str], None]) -> tuple[Design, Rehearsal | None, str]:
    """`found` with what its rehearsal did, made smaller where that went beyond a limit; in words what went wrong.

    One period and what leads to it and away are rehearsed: further periods repeat them. The design keeps a reserve of speed, so
    that few have to be made smaller; whether its condition number is still what was asked for is for others to look at.
    Nothing is rehearsed without a model.
    """
    if task.arm is None:
        return found, None, ""
    finish = landscape(task, 1, FINISH)
    x, last = finish.space.point(found.trajectory.series), None
    for attempt in range(_SHRINKINGS):
        tell("rehearsing in simulation" if attempt == 0 else f"rehearsing in simulation, {found.shrunk:.3f} times as large")
        _, motion = found.trajectory.sampled(task.sample_time)
        seconds = 2.0 * found.trajectory.run_in + found.trajectory.series.period
        try:
            last = rehearse(task.arm, task.sample_time, motion, task.problem.goal.noise, seed, seconds)
        except RrridError as problem:  # a model whose simulation runs away is worth saying, and no reason to lose the design
            return found, None, problem.message
        if last.safe or attempt == _SHRINKINGS - 1:
            break
        x = finish.space.shrunk(x, _INSIDE / last.nearest)
        smaller = finished(task, finish, x, found.evaluations, found.found_at, found.stopped, found.reached)
        found = replace(smaller, shrunk=found.shrunk * _INSIDE / last.nearest * smaller.shrunk)
    return found, last, ""


def rehearsed(task: Task, plans: tuple[Plan, ...], seed: int, tell: Callable[[str], None],
              ) -> tuple[tuple[tuple[str, Rehearsal], ...], str]:
    """Each plan in simulation, by name, as far as it went; and what went wrong. Nothing without a model."""
    found: list[tuple[str, Rehearsal]] = []
    if task.arm is None:
        return (), ""
    for plan in plans:
        tell(f"rehearsing {plan.name} in simulation")
        try:
            found.append((plan.name, rehearse(task.arm, task.sample_time, plan.motion, task.problem.goal.noise, seed, np.inf,
                                              plan.v)))
        except RrridError as problem:
            return tuple(found), f"{plan.name}: {problem.message}"
    return tuple(found), ""

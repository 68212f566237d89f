"""Rehearse a planned motion in simulation before the robot moves: tracking, torque and speed under a plain controller.

    found, rehearsal, failed = rehearsed_design(task, found, seed, tell)     made smaller where the arm would go beyond a limit
    rehearsal.beyond                                                         what still does

Every joint gets a PD controller as in eq. (23), its gains those of a critically damped 8 Hz loop about the joint's own inertia
at the start; the drives saturate at their limits. No feed-forward: a real controller will rather do better.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import Interrupted, RrridError
from pipelines.io.log import Controller
from pipelines.model.arm import Arm
from pipelines.model.excitation.design import FINISH, Design, finished, landscape
from pipelines.model.excitation.others import Plan
from pipelines.model.excitation.task import Task
from pipelines.model.rigid.body import Array
from pipelines.simulation import Experiment, Noise, simulate

__all__ = ["Beyond", "Rehearsal", "rehearse", "rehearsed", "rehearsed_design"]

_LOOP_HZ = 8.0
_REHEARSALS = 6  # of a design that is made smaller
_SATURATED = 1.03  # of its limit that a torque is taken to ask for which the drive cuts off
_INSIDE = 0.998  # of the way to the limit: what is made smaller follows otherwise by about as much
_HELPS = 0.9  # of what it went beyond before: where a smaller motion goes farther, its size is not what is in the way
_LIGHTEST = 1e-4  # of the heaviest joint's inertia: a loop about less would ask for gains without bound


@dataclass(frozen=True)
class Beyond:
    """A limit that a rehearsal did not keep."""

    joint: int  # counted from 0
    quantity: str  # "position" | "speed" | "torque"
    by: float  # of a position the distance beyond its range; of a speed a share of its limit; of a torque that of samples cut off
    unit: str = ""  # of that distance


@dataclass(frozen=True)
class Rehearsal:
    """What the simulated arm did; each (joints,)."""

    seconds: float  # rehearsed
    position_rms: tuple[float, ...]  # [rad] actual minus planned
    position_max: tuple[float, ...]  # [rad]
    torque_peak: tuple[float, ...]  # [N m] commanded
    torque_limit: tuple[float, ...]  # [N m]
    speed_peak: tuple[float, ...]  # [rad/s]
    speed_limit: tuple[float, ...]  # [rad/s]
    saturated: tuple[float, ...]  # share of samples at the torque limit
    position_nearest: tuple[float, ...] | None = None  # [rad or m] nearest to an end of its range; None: not known
    position_beyond: tuple[float, ...] | None = None  # [rad or m] past that end; less than 0 before it, NaN where both are open
    position_units: tuple[str, ...] | None = None  # "rad" or "m"

    @property
    def beyond(self) -> tuple[Beyond, ...]:
        """What goes beyond its limit, joint by joint."""
        joints = len(self.saturated)
        found, past, units = [], self.position_beyond or (math.nan,) * joints, self.position_units or ("rad",) * joints
        for j, (far, speed, limit, full) in enumerate(zip(past, self.speed_peak, self.speed_limit, self.saturated, strict=True)):
            found += [Beyond(j, "position", far, units[j])] if far > 0.0 else []
            found += [Beyond(j, "speed", speed / limit - 1.0)] if speed > limit else []
            found += [Beyond(j, "torque", full)] if full > 0.0 else []
        return tuple(found)

    @property
    def safe(self) -> bool:
        """No drive saturates, and no joint goes beyond its range or its speed."""
        return not self.beyond

    def size(self, centre: Array) -> float:
        """Times as large as it is that the motion would keep its limits, if all that it does grew with it.

        Args:
            centre: (joints,) [rad or m] about which it is made smaller.
        """
        return min((self._size(one, centre) for one in self.beyond), default=1.0)

    def _size(self, one: Beyond, centre: Array) -> float:
        if one.quantity == "torque":  # more was asked for than is known
            return 1.0 / _SATURATED
        if one.quantity == "speed" or self.position_nearest is None:
            return 1.0 / (1.0 + one.by)
        # (limit - centre) / (reach - centre): the range may lie anywhere about the motion, and be open on one side
        return float(1.0 - one.by / max(abs(self.position_nearest[one.joint] - centre[one.joint]), 1e-300))


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
    nearest, beyond = _nearest(done.true_q[0], np.array([joint.position for joint in joints]))
    away, tau, speed = done.true_q[0] - q, np.abs(done.tau[0]), np.abs(done.true_dq[0])

    def each(values: Array) -> tuple[float, ...]:
        return tuple(float(value) for value in values)

    return Rehearsal(len(q) * sample_time, each(np.sqrt((away**2).mean(axis=0))), each(np.abs(away).max(axis=0)),
                     each(tau.max(axis=0)), each(limit), each(speed.max(axis=0)), tuple(joint.velocity for joint in joints),
                     each((tau >= limit * (1.0 - 1e-9)).mean(axis=0)),
                     each(nearest), each(beyond),
                     tuple("m" if joint.type == "prismatic" else "rad" for joint in joints))


def _nearest(q: Array, ranges: Array) -> tuple[Array, Array]:
    """Where q (samples, joints) comes nearest to an end of `ranges` (joints, 2), and how far that lies beyond it."""
    low, high = q.min(axis=0), q.max(axis=0)
    under, over = ranges[:, 0] - low, high - ranges[:, 1]
    beyond = np.maximum(under, over)
    return np.where(under > over, low, high), np.where(np.isfinite(beyond), beyond, np.nan)


def rehearsed_design(task: Task, found: Design, seed: int, tell: Callable[[str], None]) -> tuple[Design, Rehearsal | None, str]:
    """`found` with what its rehearsal did, made smaller where that keeps its limits; in words what went wrong.

    One period and what leads to it and away are rehearsed: further periods repeat them. The design keeps a reserve of speed, so
    that few have to be made smaller. Where no smaller one keeps them either, for noise or gravity is in the way, the motion
    stays as large as it was designed. Nothing is rehearsed without a model. Who stops a rehearsal keeps the design as it was
    before.
    """
    first = None
    try:
        if (first := _alone(task, found, seed, tell)) is None or first.safe:
            return found, first, ""
    except RrridError as problem:  # a model whose simulation runs away is worth saying, and no reason to lose the design
        return found, None, problem.message
    except Interrupted as signal:
        return replace(found, stopped=signal.exit_code), None, ""
    try:
        smaller = _smaller(task, found, first, seed, tell)
    except RrridError:
        smaller = None
    except Interrupted as signal:
        return replace(found, stopped=signal.exit_code), first, ""
    return (found, first, "") if smaller is None else (*smaller, "")


def _alone(task: Task, found: Design, seed: int, tell: Callable[[str], None], size: float = 1.0) -> Rehearsal | None:
    """`size`: how much smaller its rehearsals have made it by now; not what its limits asked for before."""
    if task.arm is None:
        return None
    tell("rehearsing in simulation" if size == 1.0 else f"rehearsing in simulation, {size:.3f} times as large")
    _, motion = replace(found.trajectory, periods=1).sampled(task.sample_time)
    return rehearse(task.arm, task.sample_time, motion, task.problem.goal.noise, seed, np.inf)


def _smaller(task: Task, found: Design, last: Rehearsal, seed: int, tell: Callable[[str], None]) -> tuple[Design, Rehearsal] | None:
    """The largest motion like `found` that keeps its limits in its rehearsal; None where making it smaller does not help."""
    finish = landscape(task, 1, FINISH)
    whole = 1.0
    for _ in range(_REHEARSALS - 1):
        centre = found.trajectory.series.offset if task.home is None else task.home
        size = _INSIDE * last.size(centre)
        if size <= 0.0:  # even at a standstill it is beyond
            return None
        x = finish.space.shrunk(finish.space.point(found.trajectory.series), size)
        made = finished(task, finish, x, found.evaluations, found.found_at, found.stopped)
        asked = (f"{one.quantity} of joint {one.joint + 1} in the rehearsal" for one in last.beyond)
        why = dict.fromkeys((*found.shrunk_for, *asked, *made.shrunk_for))
        found = replace(made, shrunk=found.shrunk * size * made.shrunk, shrunk_for=tuple(why))
        whole *= size * made.shrunk
        now = _alone(task, found, seed, tell, whole)
        if now is None or now.safe:
            return None if now is None else (found, now)
        if not _nearer(now, last):
            return None
        last = now
    return None


def _nearer(now: Rehearsal, last: Rehearsal) -> bool:
    """Return whether what goes beyond its limits does so by clearly less than before."""
    before = {(one.joint, one.quantity): one.by for one in last.beyond}
    return all(one.by < _HELPS * before.get((one.joint, one.quantity), np.inf) for one in now.beyond)


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

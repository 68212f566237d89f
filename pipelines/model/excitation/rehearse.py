"""Rehearse a planned motion in simulation before the robot moves: tracking, torque and speed under a plain controller.

Every joint gets a PD controller as in eq. (23), its gains those of a critically damped 8 Hz loop about the joint's own inertia
at the start; the drives saturate at their limits. No feed-forward: a real controller will rather do better.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipelines.errors import RrridError
from pipelines.log.experiment import Controller
from pipelines.model.arm import Arm
from pipelines.model.excitation.others import Plan
from pipelines.model.excitation.task import Task
from pipelines.model.rigid.body import Array
from pipelines.model.simulation import Experiment, Noise, simulate

__all__ = ["Rehearsal", "rehearse", "rehearsed"]

_LOOP_HZ = 8.0
_OVERSHOOT = 1.05  # a plan that uses its limits to the full is overshot a little by any controller without feed-forward
_LIGHTEST = 1e-4  # of the heaviest joint's inertia: a loop about less would ask for gains without bound


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

    @property
    def too_fast(self) -> tuple[tuple[int, float], ...]:
        """Joints, counted from 0, that go faster than their limit, and what share of it they reach."""
        shares = (v / limit for v, limit in zip(self.speed_peak, self.speed_limit, strict=True))
        return tuple((j, share) for j, share in enumerate(shares) if share > 1.0)

    @property
    def safe(self) -> bool:
        """No drive saturates, and no joint goes faster than its limit by more than the controller's overshoot explains."""
        return max(self.saturated) == 0.0 and all(
            v <= _OVERSHOOT * limit for v, limit in zip(self.speed_peak, self.speed_limit, strict=True))


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
                     each(tau.max(axis=0)), each(limit), each(speed.max(axis=0)), tuple(joint.velocity for joint in joints),
                     each((tau >= limit * (1.0 - 1e-9)).mean(axis=0)))


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

"""Simulate a joint under its measured torque: Kostić et al. 2004, Fig. 6."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.dynamics.functions import NUMBERS
from pipelines.effects.base import Effect
from pipelines.friction.config import FRICTION
from pipelines.friction.fit import LawFit
from pipelines.friction.laws import OneJoint, gravity_columns
from pipelines.friction.weak_form import Stretch

__all__ = ["Simulated", "simulate_joint"]

# position [rad], speed [rad/s], what presliding friction remembers, command and load [N m]
# -> acceleration [rad/s^2] and the rate of that number
Rate = Callable[[float, float, float, float, float], tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Simulated:
    """Simulated motion at the samples of a stretch; NaN from where it ran away."""

    q: Array  # [rad] (samples,)
    dq: Array  # [rad/s] (samples,)


def simulate_joint(stretch: Stretch, fit: LawFit, friction: bool = True) -> Simulated:
    """Integrate eq. (11) under the torque of `stretch` from its first sample.

    Gravity is taken at the measured position, as the paper's experiment compensated it in a loop
    around the joint; an arm that gravity would tip over can be simulated so as well. What joints
    that are held and sway do is taken as measured too. The joint is stepped in plain numbers: much
    faster than arrays of one.
    """
    states = np.full((len(stretch.t), 2), np.nan)
    joint = fit.joint.carrying(fit.found.beta)
    if joint.inertia <= 0.0:
        return Simulated(states[:, 0], states[:, 1])
    weight = gravity_columns(stretch.q, stretch.revolute) @ np.array(joint.gravity)
    load = (0.5 * (weight[1:] + weight[:-1]) + stretch.more @ fit.more).tolist()
    parts, rate = 1, _rate_of(fit if friction else None, joint)
    if friction:
        side = np.geomspace(1e-5, 20.0, 400)
        speed = np.concatenate([-side[::-1], side])
        steepest = float(np.abs(np.diff(fit.curve(speed)) / np.diff(speed)).max())
        slope = steepest * float(np.median(np.diff(stretch.t))) / joint.inertia
        parts = min(max(math.ceil(slope / FRICTION.stable), 1), FRICTION.most_steps)
    q, v = states[0] = float(stretch.q[0]), float(stretch.dq[0])
    z, tau, steps = 0.0, stretch.known_tau.tolist(), (np.diff(stretch.t) / parts).tolist()
    for k, h in enumerate(steps):
        for _ in range(parts):
            q, v, z = _runge_kutta(rate, (q, v, z), tau[k], load[k], h)
        if not abs(v) < FRICTION.fastest:
            break
        states[k + 1] = q, v
    return Simulated(states[:, 0], states[:, 1])


def _rate_of(fit: LawFit | None, joint: OneJoint) -> Rate:
    """Return the rate of a joint with the friction of `fit`, or without."""
    constant = viscous = 0.0
    sigmoids: list[tuple[float, float]] = []
    loads, memories, drives, tanh, inertia = [], [], [], math.tanh, joint.inertia
    law: Iterable[tuple[Effect, dict[str, float]]] = ()
    if fit is not None:
        values = fit.law.values(fit.theta, fit.amplitudes)
        law = zip(fit.law.shaped(fit.theta), values, strict=True)
    for effect, own in law:
        if (curve := effect.speed_curve(own)) is not None:
            constant, viscous = constant + curve.constant, viscous + curve.viscous
            sigmoids += zip(curve.heights, curve.sharpnesses, strict=True)
        elif (memory := effect.own_memory(own)) is not None:
            memories.append(memory)
        elif (load_of := effect.own_load(own)) is not None:
            loads.append(load_of)
        elif (hook := effect.simulate(joint, own)).drive is not None:
            drives.append(hook.drive[1])  # friction that grows with load lowers the command

    def rate(q: float, v: float, z: float, command: float, load: float) -> tuple[float, float]:
        change = 0.0
        for drive in drives:
            command = drive((command,), (v,), NUMBERS)
        torque = command - load - constant - viscous * v
        for height, sharpness in sigmoids:
            torque -= height * tanh(sharpness * v)
        for load_of in loads:
            torque -= load_of(q, v, NUMBERS)
        for memory in memories:
            change = memory.rate(z, v, NUMBERS)
            torque -= memory.load(z, change)
        return torque / inertia, change

    return rate


def _runge_kutta(
    rate: Rate, state: tuple[float, float, float], command: float, load: float, h: float
) -> tuple[float, float, float]:
    """Return position, speed and memory after a step `h` [s], of fourth order."""
    q, v, z = state
    half, sixth = 0.5 * h, h / 6.0
    a1, r1 = rate(q, v, z, command, load)
    v2 = v + half * a1
    a2, r2 = rate(q + half * v, v2, z + half * r1, command, load)
    v3 = v + half * a2
    a3, r3 = rate(q + half * v2, v3, z + half * r2, command, load)
    v4 = v + h * a3
    a4, r4 = rate(q + h * v3, v4, z + h * r3, command, load)
    return (
        q + sixth * (v + 2.0 * v2 + 2.0 * v3 + v4),
        v + sixth * (a1 + 2.0 * a2 + 2.0 * a3 + a4),
        z + sixth * (r1 + 2.0 * r2 + 2.0 * r3 + r4),
    )

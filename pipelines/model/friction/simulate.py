"""What a joint does under a measured torque, by the fitted model alone: Fig. 6 of Kostić et al. 2004.

A law that depends on speed and position only is laid out as a table, and the joint is stepped in plain numbers: a thousand
times as fast as arrays of one. Any other law enters by its hooks, the same that simulate a whole arm.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.model.effects.base import Hooks
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.one_joint import OneJoint, gravity_columns
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Simulated", "simulate_joint"]

_STABLE = 1.0  # of step × slope / J: a fourth-order Runge-Kutta step stands 2.7
_MOST_STEPS = 20  # a sample
_TURN = 128  # positions in a table, a turn
_FASTEST = 1e4  # [rad/s] beyond it the simulation has run away


@dataclass(frozen=True, eq=False)
class Simulated:
    """Simulated motion at the samples of a stretch; NaN from where it ran away."""

    q: Array  # [rad] (samples,)
    dq: Array  # [rad/s] (samples,)


def simulate_joint(stretch: Stretch, fit: LawFit, friction: bool = True) -> Simulated:
    """Integrate eq. (11) under the torque of `stretch` from its first sample; without `friction`, the law is left out.

    Gravity is taken at the measured position, as the paper's experiment compensated it in a loop around the joint; an arm
    that gravity would tip over can be simulated so as well. What joints that are held and sway do is taken as measured too.
    """
    joint, coupling = fit.at(stretch)
    weight = gravity_columns(stretch.q, stretch.revolute) @ np.array(joint.gravity)
    if stretch.held:
        weight[:-1] = 0.5 * (weight[1:] + weight[:-1])
    given = weight + stretch.sway @ coupling
    if joint.inertia <= 0.0:
        lost = np.full(len(stretch.t), np.nan)
        return Simulated(lost, lost)
    if friction and (fit.law.sees_load or not fit.law.pointwise):
        return _hooked(stretch, joint, fit, given)
    stretch = replace(stretch, tau=stretch.tau - given)
    if not friction:
        return _stepped(stretch, joint, _none, 1)
    slope = _steepest(fit) * float(np.median(np.diff(stretch.t))) / joint.inertia
    return _stepped(stretch, joint, _table(fit, stretch), int(np.clip(math.ceil(slope / _STABLE), 1, _MOST_STEPS)))


def _none(_q: float, _v: float) -> float:
    return 0.0


def _torque(stretch: Stretch) -> tuple[list[float], list[float]]:
    """Torque at the beginning and at the end of every step [N m]."""
    tau = np.where(np.isfinite(stretch.tau), stretch.tau, 0.0)
    return tau[:-1].tolist(), (tau[:-1] if stretch.held else tau[1:]).tolist()


def _stepped(stretch: Stretch, joint: OneJoint, lost: Callable[[float, float], float], parts: int) -> Simulated:
    """Runge-Kutta of fourth order with `parts` steps a sample."""
    J = joint.inertia
    q, v = float(stretch.q[0]), float(stretch.dq[0])
    states = np.full((len(stretch.t), 2), np.nan)
    states[0] = q, v
    begin, end = _torque(stretch)
    steps = (np.diff(stretch.t) / parts).tolist()
    for k, h in enumerate(steps):
        first, change = begin[k], (end[k] - begin[k]) / parts
        for part in range(parts):
            u0 = first + part * change
            um, u1 = u0 + 0.5 * change, u0 + change
            a1 = (u0 - lost(q, v)) / J
            q2, v2 = q + 0.5 * h * v, v + 0.5 * h * a1
            a2 = (um - lost(q2, v2)) / J
            q3, v3 = q + 0.5 * h * v2, v + 0.5 * h * a2
            a3 = (um - lost(q3, v3)) / J
            q4, v4 = q + h * v3, v + h * a3
            a4 = (u1 - lost(q4, v4)) / J
            q += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if not abs(v) < _FASTEST:
            break
        states[k + 1] = q, v
    return Simulated(states[:, 0], states[:, 1])


def _steepest(fit: LawFit) -> float:
    """Largest slope of the friction curve [N m s/rad]."""
    speed = np.concatenate([-np.geomspace(1e-5, 20.0, 400)[::-1], np.geomspace(1e-5, 20.0, 400)])
    return float(np.abs(np.diff(fit.curve(speed)) / np.diff(speed)).max())


def _table(fit: LawFit, stretch: Stretch) -> Callable[[float, float], float]:
    """The law by linear interpolation in asinh(v/v_0), fine about zero, and in position where it depends on that."""
    fastest = 100.0 * (1.0 + float(np.abs(stretch.dq).max()))  # the axis is a logarithm: reach costs little
    fine = 0.02 / max(_steepest(fit) / max(float(np.abs(fit.curve(np.array([0.003 * fastest])))[0]), 1e-9), 1.0)
    half = int(np.clip(math.asinh(fastest / fine) / 0.002, 500, 20000))
    axis = np.linspace(-math.asinh(fastest / fine), math.asinh(fastest / fine), 2 * half + 1)
    speed = fine * np.sinh(axis)
    low, high = float(stretch.q.min()) - math.pi, float(stretch.q.max()) + math.pi
    places = max(2, math.ceil((high - low) / (2.0 * math.pi) * _TURN))
    positions = np.linspace(low, high, places)
    rows = [_row(fit, position, speed) for position in positions[:3]]
    if np.array_equal(rows[0], rows[1]) and np.array_equal(rows[0], rows[2]):
        row = rows[0].tolist()
        return _by_speed(row, fine, half / math.asinh(fastest / fine), half)
    table = [_row(fit, position, speed).tolist() for position in positions]
    curves = [_by_speed(row, fine, half / math.asinh(fastest / fine), half) for row in table]
    step = (high - low) / (places - 1)

    def lost(q: float, v: float) -> float:
        at = min(max((q - low) / step, 0.0), places - 1.001)
        below = int(at)
        share = at - below
        return (1.0 - share) * curves[below](q, v) + share * curves[below + 1](q, v)

    return lost


def _by_speed(row: list[float], fine: float, scale: float, half: int) -> Callable[[float, float], float]:
    asinh, last = math.asinh, 2 * half - 1

    def lost(_q: float, v: float) -> float:
        at = asinh(v / fine) * scale + half
        below = min(max(int(at), 0), last)
        return row[below] + (at - below) * (row[below + 1] - row[below])

    return lost


def _row(fit: LawFit, position: float, speed: Array) -> Array:
    still = np.zeros((len(speed), 1))
    motion = Motion(np.zeros(len(speed)), still + position, speed[:, None], still)
    return np.asarray(fit.law.columns(motion, fit.joint, fit.theta) @ fit.amplitudes)


def _hooked(stretch: Stretch, joint: OneJoint, fit: LawFit, given: Array) -> Simulated:
    """By the hooks of each effect, two steps of Heun a sample: for laws with memory or load."""
    effects = zip(fit.law.shaped(fit.theta), fit.law.values(fit.theta, fit.amplitudes), strict=True)
    hooks = [effect.simulate(joint, values) for effect, values in effects]
    states = [np.zeros((1, hook.states)) for hook in hooks]
    q, v = float(stretch.q[0]), float(stretch.dq[0])
    out = np.full((len(stretch.t), 2), np.nan)
    out[0] = q, v
    slope = _steepest(fit) * float(np.median(np.diff(stretch.t))) / joint.inertia
    parts = int(np.clip(math.ceil(slope / _STABLE), 2, _MOST_STEPS))
    begin, _ = _torque(stretch)
    for k, step in enumerate(np.diff(stretch.t).tolist()):
        h, command, other = step / parts, np.array([[begin[k]]]), float(given[k])
        for _ in range(parts):
            a1, r1 = _rates(joint, hooks, states, (q, v), command, other)
            ahead = [z + h * r for z, r in zip(states, r1, strict=True)]
            a2, r2 = _rates(joint, hooks, ahead, (q + h * v, v + h * a1), command, other)
            q, v = q + h * v + 0.5 * h * h * a1, v + 0.5 * h * (a1 + a2)
            states = [z + 0.5 * h * (r + s) for z, r, s in zip(states, r1, r2, strict=True)]
        if not abs(v) < _FASTEST:
            break
        out[k + 1] = q, v
    return Simulated(out[:, 0], out[:, 1])


def _rates(joint: OneJoint, hooks: list[Hooks], states: list[Array], at: tuple[float, float], command: Array,
           given: float) -> tuple[float, list[Array]]:
    """Acceleration, and the rates of the effects' states, under `command` and a load that is `given`."""
    motion = Motion(np.zeros(1), np.array([[at[0]]]), np.array([[at[1]]]), np.zeros((1, 1)))
    load, applied = np.full((1, 1), given), command
    for hook, z in zip(hooks, states, strict=True):
        if hook.load is not None:
            load = load + hook.load(motion, z)
        if hook.actuator is not None:  # friction that grows with load: what it leaves of the command
            applied = hook.actuator(applied, motion, z)
    rates = [hook.rate(motion, command, z) if hook.rate is not None else np.zeros_like(z)
             for hook, z in zip(hooks, states, strict=True)]
    return float((applied - load)[0, 0]) / joint.inertia, rates

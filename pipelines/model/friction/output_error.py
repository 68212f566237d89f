"""Simulate a joint under its measured torque, and find the numbers for which it follows the log.

    simulate_joint(stretch, fit)      what the fitted model alone does: Kostić et al. 2004, Fig. 6
    polished(stretches, fit)          the numbers of least output error

For the second the stretches are cut into short windows. Each is simulated from its own start, which
is estimated with the rest, so that noise of the torque does not add up over the whole log (multiple
shooting; Bock 1983). Gauss-Newton over the law's numbers; the two numbers of each start are
eliminated window by window. All windows and all disturbed sets of numbers run at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.errors import UsageError
from pipelines.model.effects.base import Hooks
from pipelines.model.friction.fit import LawEquations, LawFit
from pipelines.model.friction.laws import Law, OneJoint, gravity_columns
from pipelines.model.friction.weak_form import Stretch

__all__ = ["Simulated", "polished", "refuse_unpolished", "simulate_joint"]

T = TypeVar("T", float, Array)
Lost = Callable[[float, float], float]  # [N m] of friction by position and speed
_TINY = 1e-5  # of a finite difference, relative


@dataclass(frozen=True)
class OutputErrorConfig:
    """Numbers of the simulation of a joint, and of the search for its least error."""

    stable: float = 1.0  # of step × slope / J: a fourth-order Runge-Kutta step is stable to 2.7
    most_steps: int = 20  # a sample
    turn: int = 128  # positions in a table of friction, a turn
    fastest: float = 1e4  # [rad/s] beyond it the simulation has run away
    window: float = 0.1  # [s]: noise of the torque moves the output less than the law does
    rounds: int = 10
    settled: float = 1e-3  # standard deviations that a last step may be
    window_stable: float = 1.5  # of step × slope / J in a window,
    window_steps: int = 8  # and steps of a sample


_CONFIG = OutputErrorConfig()


@dataclass(frozen=True, eq=False)
class Simulated:
    """Simulated motion at the samples of a stretch; NaN from where it ran away."""

    q: Array  # [rad] (samples,)
    dq: Array  # [rad/s] (samples,)


def simulate_joint(stretch: Stretch, fit: LawFit, friction: bool = True) -> Simulated:
    """Integrate eq. (11) under the torque of `stretch` from its first sample.

    Gravity is taken at the measured position, as the paper's experiment compensated it in a loop
    around the joint; an arm that gravity would tip over can be simulated so as well. What joints
    that are held and sway do is taken as measured too. A law of speed and position is evaluated
    once, as a table, and the joint is stepped in plain numbers: a thousand times as fast as arrays
    of one.
    """
    joint, coupling = fit.at(stretch)
    weight = gravity_columns(stretch.q, stretch.revolute) @ np.array(joint.gravity)
    weight[:-1] = 0.5 * (weight[1:] + weight[:-1])
    given = weight + stretch.sway @ coupling
    states = np.full((len(stretch.t), 2), np.nan)
    if joint.inertia > 0.0:
        parts = 1
        if friction:
            slope = _steepest(fit) * float(np.median(np.diff(stretch.t))) / joint.inertia
            parts = min(max(math.ceil(slope / _CONFIG.stable), 1), _CONFIG.most_steps)
        if friction and (fit.law.sees_load or not fit.law.pointwise):
            _with_hooks(stretch, joint, fit, given, max(parts, 2), states)
        else:
            lost = _table(fit, stretch) if friction else lambda q, v: 0.0
            _stepped(replace(stretch, tau=stretch.tau - given), joint.inertia, lost, parts, states)
    return Simulated(states[:, 0], states[:, 1])


def _stepped(stretch: Stretch, J: float, lost: Lost, parts: int, states: Array) -> None:
    """Fill `states` (samples, 2) by steps of Runge and Kutta, `parts` a sample."""
    q, v = states[0] = float(stretch.q[0]), float(stretch.dq[0])
    tau, steps = stretch.known_tau.tolist(), (np.diff(stretch.t) / parts).tolist()

    def rate(q: float, v: float, u: float) -> float:
        return (u - lost(q, v)) / J

    for k, h in enumerate(steps):
        for _ in range(parts):
            q, v = _runge_kutta(rate, q, v, tau[k], h)
        if not abs(v) < _CONFIG.fastest:
            break
        states[k + 1] = q, v


def _runge_kutta(rate: Callable[[T, T, T], T], q: T, v: T, u: T, h: float) -> tuple[T, T]:
    """Return q and v after a step `h` [s] of dv/dt = rate(q, v, u), of fourth order."""
    a1 = rate(q, v, u)
    v2 = v + 0.5 * h * a1
    a2 = rate(q + 0.5 * h * v, v2, u)
    v3 = v + 0.5 * h * a2
    a3 = rate(q + 0.5 * h * v2, v3, u)
    v4 = v + h * a3
    a4 = rate(q + h * v3, v4, u)
    return (q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4),
            v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4))


def _steepest(fit: LawFit) -> float:
    """Return the largest slope of the friction curve [N m s/rad]."""
    side = np.geomspace(1e-5, 20.0, 400)
    speed = np.concatenate([-side[::-1], side])
    return float(np.abs(np.diff(fit.curve(speed)) / np.diff(speed)).max())


def _table(fit: LawFit, stretch: Stretch) -> Lost:
    """Return the law by linear interpolation in position, where it counts, and in asinh(v/v_0)."""
    fastest = 100.0 * (1.0 + float(np.abs(stretch.dq).max()))  # the axis is a logarithm
    level = max(float(np.abs(fit.curve(np.array([0.003 * fastest])))[0]), 1e-9)
    fine = 0.02 / max(_steepest(fit) / level, 1.0)
    end = math.asinh(fastest / fine)
    half = int(np.clip(end / 0.002, 500, 20000))
    speed = fine * np.sinh(np.linspace(-end, end, 2 * half + 1))
    low, high = float(stretch.q.min()) - math.pi, float(stretch.q.max()) + math.pi
    places = math.ceil((high - low) / (2.0 * math.pi) * _CONFIG.turn)

    def row(position: float) -> list[float]:
        still = np.zeros((len(speed), 1))
        motion = Motion(np.zeros(len(speed)), still + position, speed[:, None], still)
        torque: list[float] = (fit.law.columns(motion, fit.joint, fit.theta)
                               @ fit.amplitudes).tolist()
        return torque

    def by_speed(row: list[float]) -> Lost:
        asinh, scale, last = math.asinh, half / end, 2 * half - 1

        def lost(_q: float, v: float) -> float:
            at = asinh(v / fine) * scale + half
            below = min(max(int(at), 0), last)
            return row[below] + (at - below) * (row[below + 1] - row[below])

        return lost

    positions, step = np.linspace(low, high, places).tolist(), (high - low) / (places - 1)
    rows = [row(position) for position in positions[:3]]
    if rows[0] == rows[1] == rows[2]:
        return by_speed(rows[0])
    curves = [by_speed(each) for each in (*rows, *(row(position) for position in positions[3:]))]

    def lost(q: float, v: float) -> float:
        at = min(max((q - low) / step, 0.0), places - 1.001)
        below = int(at)
        share = at - below
        return (1.0 - share) * curves[below](q, v) + share * curves[below + 1](q, v)

    return lost


def _with_hooks(stretch: Stretch, joint: OneJoint, fit: LawFit, given: Array, parts: int,
                states: Array) -> None:
    """Fill `states` (samples, 2) by steps of Heun, for laws with memory or load.

    They enter by the hooks of each effect, the same that simulate a whole arm.
    """
    effects = zip(fit.law.shaped(fit.theta), fit.law.values(fit.theta, fit.amplitudes), strict=True)
    hooks = [effect.simulate(joint, values) for effect, values in effects]
    memory = [np.zeros((1, hook.states)) for hook in hooks]
    q, v = states[0] = float(stretch.q[0]), float(stretch.dq[0])
    tau = stretch.known_tau
    for k, step in enumerate(np.diff(stretch.t).tolist()):
        h, command, load = step / parts, np.array([[tau[k]]]), float(given[k])
        for _ in range(parts):
            a1, r1 = _rates(joint, hooks, memory, q, v, command, load)
            ahead = [z + h * r for z, r in zip(memory, r1, strict=True)]
            a2, r2 = _rates(joint, hooks, ahead, q + h * v, v + h * a1, command, load)
            q, v = q + h * v + 0.5 * h * h * a1, v + 0.5 * h * (a1 + a2)
            memory = [z + 0.5 * h * (r + s) for z, r, s in zip(memory, r1, r2, strict=True)]
        if not abs(v) < _CONFIG.fastest:
            break
        states[k + 1] = q, v


def _rates(joint: OneJoint, hooks: Sequence[Hooks], memory: Sequence[Array], q: float, v: float,
           command: Array, given: float) -> tuple[float, list[Array]]:
    """Return the acceleration, and the rates of `memory`, under `command` and a `given` load."""
    motion = Motion(np.zeros(1), np.array([[q]]), np.array([[v]]), np.zeros((1, 1)))
    load, applied = np.full((1, 1), given), command
    for hook, z in zip(hooks, memory, strict=True):
        if hook.load is not None:
            load = load + hook.load(motion, z)
        if hook.actuator is not None:  # friction that grows with load lowers the command
            applied = hook.actuator(applied, motion, z)
    rates = [hook.rate(motion, command, z) if hook.rate is not None else np.zeros_like(z)
             for hook, z in zip(hooks, memory, strict=True)]
    return float((applied - load)[0, 0]) / joint.inertia, rates


def refuse_unpolished(law: Law) -> None:
    """Refuse a law with memory or load, whose simulation is not of this form.

    Raises:
        UsageError: C02.
    """
    if not law.pointwise or law.sees_load:
        raise UsageError("C02", f"{law.name} cannot be polished: it depends on more than position "
                         "and speed", where="--method",
                         remedy="take --method varpro, or another law")


@dataclass(frozen=True, eq=False)
class _Windows:
    """Measured windows of equal length, stacked: (windows, …)."""

    step: float  # [s]
    start: Array  # (windows, 2) position and speed it begins with
    measured: Array  # (windows, samples + 1) [rad]
    torque: Array  # (windows, samples) [N m]
    sway: Array  # (windows, samples, columns) of joints that are held and sway
    posture: Array  # (windows,) which of the fit's


def polished(stretches: Sequence[Stretch], fit: LawFit) -> LawFit:
    """Return `fit` with the numbers of least output error.

    Raises:
        UsageError: C02, a law with memory or load.
    """
    refuse_unpolished(fit.law)
    windows = _windows(stretches, fit)
    numbers, starts = np.concatenate([fit.found.beta, fit.theta]), windows.start
    best, cost, covariance = (numbers, starts), np.inf, fit.found.covariance
    for _ in range(_CONFIG.rounds):
        error, slopes = _sensitivities(windows, fit, numbers, starts)
        now = float(np.sum(np.square(error)))
        if not now < cost:
            numbers, starts = 0.5 * (numbers + best[0]), 0.5 * (starts + best[1])
            continue
        cost, best = now, (numbers, starts)
        change, begin, covariance = _gauss_newton(error, slopes)
        numbers, starts = numbers + change, starts + begin
        std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        if np.all(np.abs(change) <= _CONFIG.settled * std):
            best = (numbers, starts)
            break
    beta, theta = np.split(best[0], [len(fit.found.beta)])
    found = replace(fit.found, beta=beta, theta=theta, covariance=covariance)
    equations = LawEquations.of(stretches, fit.joint)
    found = replace(found, residual=equations.residual(replace(fit, found=found)))
    return replace(fit, found=found, joint=equations.arms(beta)[0])


def _windows(stretches: Sequence[Stretch], fit: LawFit) -> _Windows:
    step = float(np.median(np.diff(stretches[0].t)))
    size = max(8, round(_CONFIG.window / step))
    parts: list[tuple[Array | int, ...]] = []
    for stretch in stretches:
        tau, posture = stretch.known_tau, fit.posture_of(stretch)
        for first in range(0, len(stretch.t) - size - 1, size):
            inner, rows = slice(first, first + size), slice(first, first + size + 1)
            measured = stretch.measured[rows]
            if not stretch.spoilt[rows].any() and np.isfinite(measured).all():
                start = np.array([stretch.q[first], stretch.dq[first]])
                parts.append((start, measured, tau[inner], stretch.sway[inner], posture))
    return _Windows(step, *(np.array(column) for column in zip(*parts, strict=True)))


def _sensitivities(windows: _Windows, fit: LawFit, numbers: Array,
                   starts: Array) -> tuple[Array, Array]:
    """Return the output error (windows, samples + 1) [rad], and slopes of the output.

    The slopes (numbers + 2, windows, samples + 1) are by the numbers, then by the two of each
    start.
    """
    count = len(numbers)
    steps = _TINY * np.concatenate([np.maximum(np.abs(numbers), 1e-3), [1e-2, 1e-1]])
    sets, begin = np.tile(numbers, (count + 3, 1)), np.tile(starts, (count + 3, 1, 1))
    sets[1:count + 1] += np.diag(steps[:count])
    begin[count + 1:] += np.diag(steps[count:])[:, None]
    out = _simulated(windows, fit, sets, begin)
    return windows.measured - out[0], (out[1:] - out[0]) / steps[:, None, None]


def _simulated(windows: _Windows, fit: LawFit, sets: Array, begin: Array) -> Array:
    """Return positions (sets, windows, samples + 1) [rad] by Runge-Kutta of fourth order."""
    count, last = len(windows.posture), 1 + len(fit.joint.gravity)
    rigid = sets[:, :fit.rigid.size].reshape(len(sets), -1, fit.rigid_size)[:, windows.posture]
    inertia, gravity, coupling = rigid[..., 0], rigid[..., 1:last], rigid[..., last:]
    friction = _friction(fit, sets, count)
    axis = np.linspace(-0.2, 0.2, 801)
    slope = float(np.abs(np.gradient(fit.curve(axis), axis)).max()) * windows.step
    slope /= abs(fit.inertia) * _CONFIG.window_stable
    parts = min(max(math.ceil(slope), 1), _CONFIG.window_steps)

    def rate(q: Array, v: Array, push: Array) -> Array:
        weight = gravity[..., 0]
        if fit.joint.revolute:
            weight = weight * np.sin(q) + gravity[..., 1] * np.cos(q)
        return np.asarray((push - weight - friction(q, v)) / inertia)

    q, v = begin[..., 0].copy(), begin[..., 1].copy()
    out = np.empty((len(sets), count, windows.measured.shape[1]))
    out[..., 0] = q
    for k in range(windows.torque.shape[1]):
        u = windows.torque[:, k] - np.einsum("swc,wc->sw", coupling, windows.sway[:, k])
        for _ in range(parts):
            q, v = _runge_kutta(rate, q, v, u, windows.step / parts)
        out[..., k + 1] = q
    return out


def _friction(fit: LawFit, sets: Array, windows: int) -> Callable[[Array, Array], Array]:
    """Return the law's torque of (sets, windows) positions and speeds, each set with its numbers.

    The numbers of an effect may be arrays: its columns then are those of every replica at once.
    """
    own = np.repeat(sets[:, fit.rigid.size:], windows, axis=0)
    amplitudes, theta = np.split(own, [fit.law.amplitudes], axis=1)
    effects = []
    for k, effect in enumerate(fit.law.effects):
        numbers: dict[str, Any] = {number.name: np.exp(theta[:, i])
                                   for i, number in enumerate(fit.law.nonlinear)
                                   if k in number.effects}
        effects.append(replace(effect, **numbers))
    still = np.zeros((len(own), 1))

    def torque(q: Array, v: Array) -> Array:
        motion = Motion(still[:, 0], q.reshape(-1, 1), v.reshape(-1, 1), still)
        columns = np.hstack([effect.columns(motion, fit.joint)[:, 0] for effect in effects])
        return np.asarray(np.einsum("nk,nk->n", columns, amplitudes).reshape(q.shape))

    return torque


def _gauss_newton(error: Array, slopes: Array) -> tuple[Array, Array, Array]:
    """Return the step of the numbers, of every window's start, and the numbers' covariance.

    The covariance sums what each window says on its own: errors within a window are one history of
    the torque's noise.
    """
    by_window = slopes.transpose(1, 2, 0)  # (windows, samples, numbers + 2)
    shared, own = by_window[..., :-2], by_window[..., -2:]
    project = np.linalg.inv(own.transpose(0, 2, 1) @ own) @ own.transpose(0, 2, 1)
    outside = shared - own @ (project @ shared)
    rest = error - (own @ (project @ error[..., None]))[..., 0]
    scores = np.einsum("wsp,ws->wp", outside, rest)
    normal = np.einsum("wsp,wsq->pq", outside, outside)
    scale = np.sqrt(np.diag(normal))
    scale = np.where(scale > 0.0, scale, 1.0)
    bread = np.linalg.pinv(normal / scale / scale[:, None], rcond=1e-9, hermitian=True)
    bread = bread / scale / scale[:, None]
    change = bread @ scores.sum(axis=0)
    begin = (project @ (error - np.einsum("wsp,p->ws", shared, change))[..., None])[..., 0]
    after = np.einsum("wsp,ws->wp", outside, rest - np.einsum("wsp,p->ws", outside, change))
    return change, begin, bread @ (after.T @ after) @ bread

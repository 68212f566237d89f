"""Output-error polishing: numbers of a law for which the simulated joint follows the measured one.

The stretches are cut into short windows. Each is simulated from its own start, which is estimated with the rest, so that noise
of the torque does not add up over the whole log (multiple shooting; Bock 1983). Gauss-Newton over the law's numbers; the two
numbers of each start are eliminated window by window. All windows and all disturbed sets of numbers run at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipelines.errors import UsageError
from pipelines.fit.varpro import SeparableFit
from pipelines.model.effects.base import Effect
from pipelines.model.friction.equations import LawEquations
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import Law
from pipelines.model.friction.one_joint import gravity_names
from pipelines.model.friction.postures import nearest
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array, Motion

__all__ = ["polished", "refuse_unpolished"]

_WINDOW = 0.1  # [s]: noise of the torque moves the output less than the law does
_ROUNDS = 10
_SETTLED = 1e-3  # standard deviations that a last step may be
_MOST_PARTS = 8  # of a sample
_STABLE = 1.5  # of step × slope / J
_TINY = 1e-5  # of a finite difference, relative


@dataclass(frozen=True, eq=False)
class _Windows:
    """Measured windows of equal length, stacked: (windows, …)."""

    step: float  # [s]
    start: Array  # (windows, 2) position and speed it begins with
    measured: Array  # (windows, samples + 1) [rad]
    torque: Array  # (windows, samples, 2) [N m] at the beginning and at the end of every step
    sway: Array  # (windows, samples, columns) of joints that are held and sway
    posture: Array  # (windows,) which one


def refuse_unpolished(law: Law) -> None:
    """UsageError C02: a law with memory or load, whose simulation is not of this form."""
    if not law.pointwise or law.sees_load:
        raise UsageError("C02", f"{law.name} cannot be polished: it depends on more than position and speed", where="--method",
                         remedy="take --method varpro, or another law")


def polished(stretches: Sequence[Stretch], fit: LawFit) -> LawFit:
    """`fit` with the numbers of least output error."""
    refuse_unpolished(fit.law)
    windows = _windows(stretches, fit)
    numbers = np.concatenate([fit.found.beta, fit.theta])
    starts, cost = windows.start, np.inf
    best = (numbers, starts)
    covariance = fit.found.covariance
    for _ in range(_ROUNDS):
        error, slopes = _sensitivities(windows, fit, numbers, starts)
        now = float(np.sum(np.square(error)))
        if not now < cost:
            numbers, starts = 0.5 * (numbers + best[0]), 0.5 * (starts + best[1])
            continue
        cost, best = now, (numbers, starts)
        change, begin, covariance = _step(error, slopes)
        numbers, starts = numbers + change, starts + begin
        if np.all(np.abs(change) <= _SETTLED * np.sqrt(np.maximum(np.diag(covariance), 1e-300))):
            best = (numbers, starts)
            break
    count = len(fit.found.beta)
    found: SeparableFit = replace(fit.found, beta=best[0][:count], theta=best[0][count:], covariance=covariance)
    equations = LawEquations.of(stretches, fit.joint)
    arm = equations.arms(found.beta)[0]
    return replace(fit, found=replace(found, residual=equations.predicted(replace(fit, found=found)).residual), joint=arm)


def _windows(stretches: Sequence[Stretch], fit: LawFit) -> _Windows:
    step = float(np.median(np.diff(stretches[0].t)))
    size = max(8, round(_WINDOW / step))
    parts: list[tuple[Array, Array, Array, Array, float]] = []
    for stretch in stretches:
        tau = np.where(np.isfinite(stretch.tau), stretch.tau, 0.0)
        ends = np.stack([tau[:-1], tau[:-1] if stretch.held else tau[1:]], axis=1)
        sway = stretch.sway[:-1]
        for first in range(0, len(stretch.t) - size - 1, size):
            rows = slice(first, first + size + 1)
            if stretch.spoilt[rows].any() or not np.isfinite(stretch.measured[rows]).all():
                continue
            inner = slice(first, first + size)
            parts.append((np.array([stretch.q[first], stretch.dq[first]]), stretch.measured[rows], ends[inner], sway[inner],
                          float(nearest(stretch.posture, fit.postures))))
    return _Windows(step, *(np.array([part[k] for part in parts]) for k in range(5)))


def _sensitivities(windows: _Windows, fit: LawFit, numbers: Array, starts: Array) -> tuple[Array, Array]:
    """Output error (windows, samples) and the derivatives of the output (numbers + 2, windows, samples)."""
    scale = np.concatenate([np.maximum(np.abs(numbers), 1e-3), [1e-2, 1e-1]])
    steps = _TINY * scale
    sets = np.tile(numbers, (len(numbers) + 3, 1))
    begin = np.tile(starts, (len(numbers) + 3, 1, 1))
    for i in range(len(numbers)):
        sets[i + 1, i] += steps[i]
    for i in range(2):
        begin[len(numbers) + 1 + i, :, i] += steps[len(numbers) + i]
    out = _simulated(windows, fit, sets, begin)
    slopes = (out[1:] - out[0]) / steps[:, None, None]
    return windows.measured - out[0], slopes


def _simulated(windows: _Windows, fit: LawFit, sets: Array, begin: Array) -> Array:
    """Positions (sets, windows, samples + 1) by Runge-Kutta of fourth order."""
    count, width = len(windows.posture), fit.rigid_size
    posture = windows.posture.astype(np.intp)
    rigid = sets[:, :width * len(fit.postures)].reshape(len(sets), -1, width)[:, posture]  # (sets, windows, width)
    last = 1 + len(gravity_names(fit.joint.revolute))
    inertia, gravity, coupling = rigid[..., 0], rigid[..., 1:last], rigid[..., last:]
    friction = _friction(fit, sets, count)
    slope = float(np.abs(np.gradient(fit.curve(axis := np.linspace(-0.2, 0.2, 801)), axis)).max())
    parts = int(np.clip(math.ceil(slope * windows.step / abs(fit.inertia) / _STABLE), 1, _MOST_PARTS))
    h = windows.step / parts

    def rate(q: Array, v: Array, push: Array) -> Array:
        weight = gravity[..., 0] * np.sin(q) + gravity[..., 1] * np.cos(q) if fit.joint.revolute else gravity[..., 0]
        return np.asarray((push - weight - friction(q, v)) / inertia)

    q, v = begin[..., 0].copy(), begin[..., 1].copy()
    out = np.empty((len(sets), count, windows.measured.shape[1]))
    out[..., 0] = q
    for k in range(windows.torque.shape[1]):
        sway = np.einsum("swc,wc->sw", coupling, windows.sway[:, k])
        first, change = windows.torque[:, k, 0], (windows.torque[:, k, 1] - windows.torque[:, k, 0]) / parts
        for part in range(parts):
            u0 = first + part * change - sway
            um, u1 = u0 + 0.5 * change, u0 + change
            a1 = rate(q, v, u0)
            v2 = v + 0.5 * h * a1
            a2 = rate(q + 0.5 * h * v, v2, um)
            v3 = v + 0.5 * h * a2
            a3 = rate(q + 0.5 * h * v2, v3, um)
            v4 = v + h * a3
            a4 = rate(q + h * v3, v4, u1)
            q = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        out[..., k + 1] = q
    return out


def _friction(fit: LawFit, sets: Array, windows: int) -> Callable[[Array, Array], Array]:
    """The law's torque of (sets, windows) positions and speeds, each set with numbers of its own.

    The numbers of an effect may be arrays, one a replica: its columns then are those of every replica at once.
    """
    first = fit.rigid_size * len(fit.postures)
    amplitudes = np.repeat(sets[:, first:first + fit.law.amplitudes], windows, axis=0)
    theta = np.exp(np.repeat(sets[:, first + fit.law.amplitudes:], windows, axis=0))
    effects: list[Effect] = []
    for k, effect in enumerate(fit.law.effects):
        own: dict[str, Any] = {place.name: theta[:, i] for i, place in enumerate(fit.law.places) if k in place.effects}
        effects.append(replace(effect, **own))
    still = np.zeros((len(amplitudes), 1))

    def torque(q: Array, v: Array) -> Array:
        motion = Motion(still[:, 0], q.reshape(-1, 1), v.reshape(-1, 1), still)
        columns = np.hstack([effect.columns(motion, fit.joint)[:, 0] for effect in effects])
        return np.asarray(np.einsum("nk,nk->n", columns, amplitudes).reshape(q.shape))

    return torque


def _step(error: Array, slopes: Array) -> tuple[Array, Array, Array]:
    """Gauss-Newton step of the numbers, of every window's start, and the numbers' covariance.

    The covariance sums what each window says on its own: errors within a window are one history of the torque's noise.
    """
    p = len(slopes) - 2
    by_window = slopes.transpose(1, 2, 0)  # (windows, samples, p + 2)
    own = by_window[..., p:]
    inverse = np.linalg.inv(own.transpose(0, 2, 1) @ own)
    project = inverse @ own.transpose(0, 2, 1)
    shared = by_window[..., :p]
    left = shared - own @ (project @ shared)
    rest = error - (own @ (project @ error[..., None]))[..., 0]
    scores = np.einsum("wsp,ws->wp", left, rest)
    normal = np.einsum("wsp,wsq->pq", left, left)
    scale = np.sqrt(np.diag(normal))
    scale = np.where(scale > 0.0, scale, 1.0)
    bread = np.linalg.pinv(normal / scale / scale[:, None], rcond=1e-9, hermitian=True) / scale / scale[:, None]
    change = bread @ scores.sum(axis=0)
    begin = (project @ (error - np.einsum("wsp,p->ws", shared, change))[..., None])[..., 0]
    after = np.einsum("wsp,ws->wp", left, rest - np.einsum("wsp,p->ws", left, change))
    spread = bread @ (after.T @ after) @ bread
    return change, begin, spread

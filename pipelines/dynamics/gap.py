"""A link that moves between the two flanks of a gap, over a whole log.

Many gaps and many stretches of time at once.

    x = followed(t, mass, force, Gaps(half, film, stiffness, damping))        (gaps, samples)

    m ẍ = f - c ẋ - flank,    flank = k (|x| - half) sign x + d ẋ beyond the gap, never pulling

A flank forgets within milliseconds how the link came to it. So each stretch of a log starts by
itself some time early, and what was found at the seams is compared: where two stretches do not
meet, the later one is followed once more from where the other ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array

__all__ = ["Gaps", "followed"]

_LENGTH, _EARLY = 600, 400  # numerics: samples of a stretch, and before it
_FEW, _SHORT = 4, 300  # numerics: gaps whose arrays cost hardly more than a call; samples then
# of the gap, by which two stretches may differ; [s] in which a speed counts as a way
_SEAM, _TICK = 1e-12, 1e-3  # numerics: see above


@dataclass(frozen=True, eq=False)
class Gaps:
    """Several gaps of one joint."""

    half: Array  # [rad] (gaps,) half the play
    film: Array  # [N m s/rad] (gaps,) drag of the lubricant
    stiffness: Array  # k [N m/rad] (gaps,) of a flank
    damping: Array  # d [N m s/rad] (gaps,)


def followed(t: Array, mass: Array, force: Array, gaps: Gaps) -> Array:
    """x (gaps, samples) [rad] of the link against its motor.

    T (samples,), mass [kg m^2] and force [N m] (gaps, samples), or (1, samples) where they are
    those of all gaps.

    Over a sample, trapezoids; flank and film implicit.
    """
    length = _SHORT if len(gaps.half) <= _FEW else _LENGTH
    samples, count = len(t), max(1, -(-(len(t) - 1) // length))
    h = np.append(np.diff(t), 0.0)
    m, f = (np.append(0.5 * (x[:, 1:] + x[:, :-1]), np.zeros((len(x), 1)), axis=1)
            for x in (mass, force))
    early = np.arange(count) * length - _EARLY
    steps = early + np.arange(length + _EARLY)[:, None]  # (steps, stretches)
    within = np.where((steps >= 0) & (steps < samples - 1), steps, samples - 1)
    inertia = np.where(m > 0.0, m, 1.0)  # outside the log no time goes by
    start = _start(force[:, np.maximum(early, 0)], gaps)
    x, v, seams = _moved(h[within], _stretched(inertia, within), _stretched(f, within), start, gaps)
    for gap in range(len(gaps.half)):
        place, speed = x[-1, gap, 0], v[gap, 0]
        for k in range(1, count):
            if abs(place - x[_EARLY, gap,
                             k]) + _TICK * abs(speed - seams[gap, k]) > _SEAM * gaps.half[gap]:
                own, before = within[_EARLY:, k], (float(place), float(speed))
                inert, pull = m[gap % len(m), own], f[gap % len(f), own]
                x[_EARLY:, gap, k], v[gap, k] = _step_by_step(h[own], inert, pull, before, gaps,
                                                              gap)
            place, speed = x[-1, gap, k], v[gap, k]
    return np.concatenate([
        x[_EARLY, :, :1], x[_EARLY + 1:].transpose(1, 2, 0).reshape(len(gaps.half), -1)
    ], axis=1)[:, :samples]


def _stretched(x: Array, within: npt.NDArray[np.intp]) -> Array:
    """x (gaps, samples) at `within` (steps, stretches), as (steps, gaps, stretches)."""
    return np.ascontiguousarray(x[:, within].transpose(1, 0, 2))


def _start(force: Array, gaps: Gaps) -> Array:
    """x (gaps, stretches) settled on the flank that the force presses on."""
    return np.asarray(gaps.half[:, None] * np.sign(force) + force / gaps.stiffness[:, None])


def _moved(h: Array, m: Array, f: Array, x: Array, gaps: Gaps) -> tuple[Array, Array, Array]:
    """x (steps + 1, gaps, stretches), v (gaps, stretches) at the end, and where a stretch begins.

    H (steps, stretches), m and f (steps, gaps, stretches), or one for all gaps.
    """
    k, d, half = gaps.stiffness[:, None], gaps.damping[:, None], gaps.half[:, None]
    h = h[:, None]
    out, v = np.empty((len(h) + 1, *x.shape)), np.zeros_like(x)
    out[0], seams = x, v
    drag, more = 0.5 * h * gaps.film[:, None], 0.5 * h * d + 0.25 * h * h * k
    given, push, half_step = h * f, h * k, 0.5 * h
    for i in range(len(h)):
        over = x - np.minimum(np.maximum(x, -half), half)
        over *= (k * over + d * v) * over > 0.0  # what is not closed does not push
        slowing = drag[i] + more[i] * (over != 0.0)
        after = (v * (m[i] - slowing) + given[i] - push[i] * over) / (m[i] + slowing)
        x = x + half_step[i] * (v + after)
        v = after
        out[i + 1] = x
        if i + 1 == _EARLY:
            seams = v
    return out, v, seams


def _step_by_step(h: Array, m: Array, f: Array, start: tuple[float, float], gaps: Gaps,
                  gap: int) -> tuple[Array, float]:
    """x (samples,) of one gap from where the stretch before ended, and the speed at the end."""
    k, d, half, film = (float(x[gap]) for x in (gaps.stiffness, gaps.damping, gaps.half, gaps.film))
    x, v = start
    found = [x]
    for step, inertia, pull in zip(h.tolist(), m.tolist(), f.tolist(), strict=True):
        if step:
            over = x - half if x > half else x + half if x < -half else 0.0
            closed = (k * over + d * v) * over > 0.0
            c, spring = (0.5 * step *
                         (film + d), 0.25 * step * step * k) if closed else (0.5 * step * film, 0.0)
            after = (v * (inertia - c - spring) + step *
                     (pull - (k * over if closed else 0.0))) / (inertia + c + spring)
            x += 0.5 * step * (v + after)
            v = after
        found.append(x)
    return np.array(found), v

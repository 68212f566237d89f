"""Weigh hypotheses, and compare the columns of a recording with each other.

A hypothesis is a value that a recipe may take, such as a unit. A clue speaks for or against one
with a score, about the logarithm of a likelihood ratio; the best hypothesis is taken where it is
better than nothing and than every other by a margin. Names, lines of the file, limits of the robot
and the numbers give the clues: a velocity is the slope of its position, a counter jumps by its
range, dry friction turns with the speed.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.importers.config import EVIDENCE, SCORES
from pipelines.io.log import Array

Confidence = Literal["sure", "likely", "unsure"]
OTHER = "?"  # the hypothesis that no value is right
# Slope of the position over the velocity, by their units: q in the first, dq in the second.
_ANGULAR_RATIOS = {
    1.0: ("", ""), 180.0 / math.pi: ("deg", "rad/s"), math.pi / 180.0: ("rad", "deg/s"),
    1.0 / 60.0: ("rev", "rpm"), 6.0: ("deg", "rpm"), math.pi / 30.0: ("rad", "rpm"),
}  # fmt: skip


@dataclass(frozen=True)
class Guess:
    """A value with how sure it is and why; "" where it stays open."""

    value: str
    confidence: Confidence
    why: str


@dataclass(frozen=True)
class Clue:
    """A reason for a hypothesis (a positive score) or against it, in words."""

    value: str
    score: float
    why: str = ""


def unsure(why: str) -> Guess:
    return Guess("", "unsure", why)


def weigh(clues: Sequence[Clue]) -> Guess:
    """Return the hypothesis of the best total score; open where another is nearly as good."""
    totals: dict[str, float] = defaultdict(float)
    for clue in clues:
        totals[clue.value] += clue.score
    ranked = sorted(totals, key=lambda value: -totals[value])
    best = ranked[0] if ranked else OTHER
    second = max([0.0, *(totals[value] for value in ranked[1:])])
    if best == OTHER or totals[best] < SCORES.enough or totals[best] - second < SCORES.margin:
        return unsure("; ".join(dict.fromkeys(clue.why for clue in clues if clue.why)))
    words = dict.fromkeys(c.why for c in clues if c.why and c.value == best and c.score > 0.0)
    return Guess(best, "sure" if totals[best] >= SCORES.sure else "likely", "; ".join(words))


@dataclass(frozen=True)
class Slope:
    """The relation of a velocity to a position: q[k] - q[l] = factor times the integral of dq."""

    factor: float  # [unit of q / (unit of dq times unit of t)]
    correlation: float  # the lowest of the joints that move


def slope_of(q: Array, dq: Array, t: Array | None, every: bool = False) -> Slope | None:
    """Return the relation of `dq` to `q` (samples, joints); None where it is not its slope.

    Both are compared over stretches of the recording, short ones first: the integral form does not
    amplify the steps of an encoder as a difference of neighbours does. With `every`, columns that
    hardly move beside the others must agree as well: they may be something else.
    """
    if q.shape != dq.shape or len(q) < EVIDENCE.fewest:
        return None
    steps = np.diff(np.arange(len(q), dtype=np.float64) if t is None else t)
    areas = np.cumsum(0.5 * (dq[1:] + dq[:-1]) * steps[:, None], axis=0)
    summed = np.concatenate([np.zeros((1, q.shape[1])), areas])
    least = 0.0 if every else EVIDENCE.hardly_moves
    moving = (np.ptp(q, axis=0) > least * np.ptp(q)) & (np.ptp(dq, axis=0) > least * np.ptp(dq))
    if not moving.any():
        return None
    q, summed = q[:, moving], summed[:, moving]
    for width in sorted({max(2, len(q) // share) for share in EVIDENCE.stretches}):
        moved, expected = q[width:] - q[:-width], summed[width:] - summed[:-width]
        power = (expected**2).sum(axis=0)
        inner = (moved * expected).sum(axis=0)
        size = np.sqrt(power * (moved**2).sum(axis=0))
        if not (size > 0).all():
            continue
        correlation, factors = float((inner / size).min()), inner / power
        factor = float(inner.sum() / power.sum())
        scatter = np.abs(factors / factor - 1.0).max()
        if correlation >= EVIDENCE.like and scatter <= EVIDENCE.same_ratio:
            return Slope(factor, correlation)
    return None


def crossed(q: Array, dq: Array, t: Array | None) -> bool:
    """Return whether the position of one joint has the velocity of another for its slope."""
    pairs = itertools.permutations(range(q.shape[1]), 2)
    return any(
        slope_of(q[:, [j]], dq[:, [k]], t) and not slope_of(q[:, [j]], dq[:, [j]], t)
        for j, k in pairs
    )


def units_of_ratio(factor: float, tolerance: float = EVIDENCE.same_ratio) -> tuple[str, str] | None:
    """Return the units of position and velocity that are a factor apart, ("", "") where equal.

    A power of ten is of a wrong unit of time, not of angles: 0.1 is not the 0.105 of rad and rpm.
    """
    nearest = min(_ANGULAR_RATIOS, key=lambda ratio: abs(factor / ratio - 1.0))
    off = abs(factor / nearest - 1.0)
    if factor > 0 and off > abs(factor / 10.0 ** round(math.log10(factor)) - 1.0):
        return None
    return _ANGULAR_RATIOS[nearest] if off <= tolerance else None


def rollover(values: Array) -> float | None:
    """Return the size of the jumps where a counter starts again: equal, larger than any step."""
    steps, size = np.diff(values, axis=0), float(np.ptp(values))
    large = np.abs(steps) > EVIDENCE.jump * size
    jumps = np.abs(steps[large]) if size > 0 else np.empty(0)
    if not jumps.size or np.ptp(jumps) > EVIDENCE.same_ratio * jumps.mean():
        return None
    if np.abs(steps[~large]).max(initial=0.0) > EVIDENCE.small_step * size:
        return None
    back = np.abs(steps[1:] + steps[:-1])[np.abs(steps[1:]) > EVIDENCE.jump * size]
    if (back < EVIDENCE.small_step * size).any():
        return None  # there and back again: numbers that mark a lost sample
    candidates = (360.0, 2 * math.pi, 1.0, *map(float, EVIDENCE.resolutions))
    near = min(candidates, key=lambda c: abs(jumps.max() - c) / c)
    return near if abs(jumps.max() / near - 1.0) < EVIDENCE.same_ratio else float(jumps.max())


def quarter_turns(q: Array) -> dict[int, int]:
    """Return joint (from 0) -> quarter turns [pi/2] at the start, of those far from zero.

    Robots rest at right angles: a motor then stands at its gear ratio times quarter turns, in rad.
    Empty where one is at no quarter turn, or only one joint is, as by chance.
    """
    far = np.flatnonzero(np.abs(q[0]) > EVIDENCE.far_start)
    start = q[0][far] / (0.5 * math.pi)
    if start.size <= 1 or np.abs(start - np.round(start)).max() > EVIDENCE.quarter_turn:
        return {}
    return dict(zip(far.tolist(), np.round(start).astype(int).tolist(), strict=True))


def whole(values: Array) -> bool:
    """Return whether nearly all numbers are whole."""
    return bool((values == np.round(values)).mean() > EVIDENCE.all_whole)


def is_share(values: Array) -> bool:
    """Return whether numbers keep 0..1, 0..100, or ±, and reach the upper end, unlike joints."""
    low, high, slack = float(values.min()), float(values.max()), EVIDENCE.share
    full = 1.0 if max(high, -low) <= 1.0 + slack else 100.0
    near = (1.0 - slack) * full <= high <= (1.0 + slack) * full
    signed = -(1.0 + slack) * full <= low < -EVIDENCE.share_below * full
    return near and (-slack * full <= low < EVIDENCE.share_above * full or signed)


def held(tau: Array, q: Array) -> Guess:
    """Return whether a torque is a held command: constant while the position moves."""
    steps = np.diff(tau, axis=0)
    if tau.shape == q.shape:
        steps = steps[np.abs(np.diff(q, axis=0)) > 0]
    share = float(np.mean(steps == 0)) if steps.size else 0.0
    if share > EVIDENCE.still and np.unique(tau).size > EVIDENCE.fewest:
        still = f"{100 * share:.0f} % of the steps between samples are zero while the position "
        why = f"{still}moves: a command, held over several samples, or a slower bus?"
        return Guess("held-command", "unsure", why)
    why = 'nothing in the numbers tells; ask who recorded them: "held-command" where this is what '
    why += "the drive was commanded, to be held until the next sample"
    return Guess("measured", "unsure", why)


def sign_of(q: Array, tau: Array, links: Array | None = None) -> Guess:
    """Return the sign of each joint's torque: by the robot's links (-1, 0, 1), else by friction.

    Dry friction turns with the speed: where a joint reverses, its torque jumps the same way, and
    all else is smooth. About each reversal, tau = a + b k + c k² + d k³ + F sign(dq); F is positive
    (Coulomb's law; Armstrong-Hélouvry 1991). Student's test of the mean F of a joint's reversals,
    at a small chance over all joints. A jump that fits better elsewhere than at the reversal is no
    friction at it: the position leads or lags the torque.
    """
    from scipy.special import stdtr

    half = max(EVIDENCE.least_half, len(q) // EVIDENCE.windows)
    step = max(1, half // 10)
    shifts = step * np.arange(-(half // 2 // step), half // 2 // step + 1)
    smooth = np.ones(max(3, half // 2)) / max(3, half // 2)
    claims = np.zeros(q.shape[1])  # sign of F where it is significant
    for j in range(q.shape[1]):
        speed = np.gradient(np.convolve(q[:, j], smooth, mode="same"))
        jumps, residuals = _jumps(speed, tau[:, j], half, shifts)
        if len(jumps) < EVIDENCE.fewest_turns or shifts[np.argmin(residuals)] != 0:
            continue
        mean = float(np.mean(jumps))
        error = float(np.std(jumps, ddof=1)) / math.sqrt(len(jumps))
        chance = 2.0 * stdtr(len(jumps) - 1, -abs(mean) / max(error, 1e-300))
        claims[j] = np.sign(mean) if chance < EVIDENCE.false_sign / q.shape[1] else 0.0
    weight = np.zeros(q.shape[1]) if links is None else links
    signs = np.where(weight != 0.0, weight, claims)
    wrong = ", ".join(str(j + 1) for j in np.flatnonzero(signs < 0))
    if (weight * claims < 0).any():
        why = "sign: friction and the robot's links tell opposite signs of a joint"
        return Guess("sign = -1?", "unsure", why)
    if wrong and (weight[signs < 0] < 0).all():
        why = f"sign: torque of joint {wrong} follows the robot's own links with the other sign"
        return Guess(str([-1 if sign < 0 else 1 for sign in signs]), "likely", why)
    if wrong:
        why = f"torque of joint {wrong} jumps against the speed where it reverses, unlike friction"
        why += ": sign = -1 there, unless its transmission is negative"
        return Guess("sign = -1?", "likely", why)
    if (weight > 0).all():
        return Guess("as recorded", "likely", "sign: torque follows the robot's own links")
    if (claims > 0).all():
        why = "sign: torque jumps with the speed where a joint reverses, as friction does"
        return Guess("as recorded", "likely", why)
    return Guess("as recorded", "unsure", "sign: torque and motion do not tell")


def _jumps(
    speed: Array, tau: Array, half: int, shifts: npt.NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return F of each clean reversal, and the squared residual with the jump at each shift."""
    k = np.linspace(-1.0, 1.0, 2 * half + 1)
    jumps, residuals = [], np.zeros(shifts.size)
    turning = speed[half + 1 : -half - 1] * speed[half : -half - 2] < 0
    for at in np.flatnonzero(turning) + half + 1:
        turn = np.sign(speed[at - half : at + half + 1])
        before, after = turn[: half - 1], turn[half + 2 :]
        if turn[0] == 0 or (before != turn[0]).any() or (after != -turn[0]).any():
            continue
        window = tau[at - half : at + half + 1]
        for s, shift in enumerate(shifts):
            direction = turn[np.clip(np.arange(k.size) - shift, 0, k.size - 1)]
            columns = np.column_stack([direction, k**0, k, k**2, k**3])
            numbers = np.linalg.lstsq(columns, window, rcond=None)[0]
            residuals[s] += np.sum((window - columns @ numbers) ** 2)
            if shift == 0:
                jumps.append(numbers[0])
    return np.array(jumps), residuals

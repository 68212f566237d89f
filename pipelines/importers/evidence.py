"""Compare the columns of a recording with each other and with the robot's links.

A velocity is the slope of its position; a counter jumps by its range; dry friction turns with the
speed. Weight and inertia of the links follow from the robot's description; friction is fitted:

    tau = a·tau_links(q, dq, ddq) + F sign(dq) + B dq + c

The torque agrees with one unit of position, with one order of the joints and with angles that are
counted from the link before or, behind parallel links, from the one before that, if with any.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.importers.config import EVIDENCE, LINKS
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array

Confidence = Literal["sure", "likely", "unsure"]
# Slope of the position over the velocity, by their units: q in the first, dq in the second.
_ANGULAR_RATIOS = {
    1.0: ("", ""), 180.0 / math.pi: ("deg", "rad/s"), math.pi / 180.0: ("rad", "deg/s"),
    1.0 / 60.0: ("rev", "rpm"), 6.0: ("deg", "rpm"), math.pi / 30.0: ("rad", "rpm"),
}  # fmt: skip
# (samples, joints) q, dq, ddq [rad] -> torque [N m]; None where links are unknown
TorqueModel = Callable[[Array, Array, Array], Array | None]
Motion = tuple[Array, Array, Array]  # q, dq, ddq


@dataclass(frozen=True)
class Guess:
    """A value with how sure it is and why."""

    value: str
    confidence: Confidence
    why: str


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
    for j, k in itertools.permutations(range(q.shape[1]), 2):
        other = slope_of(q[:, [j]], dq[:, [k]], t)
        if other is not None and slope_of(q[:, [j]], dq[:, [j]], t) is None:
            return True
    return False


def rollover(values: Array) -> float | None:
    """Return the size of the jumps where a counter starts again: equal, larger than any step."""
    steps = np.diff(values, axis=0)
    size = float(np.ptp(values))
    large = np.abs(steps) > EVIDENCE.jump * size
    jumps = np.abs(steps[large]) if size > 0 else np.empty(0)
    others = np.abs(steps[~large])
    if not jumps.size or (others.size and others.max() > EVIDENCE.small_step * size):
        return None
    if np.ptp(jumps) > EVIDENCE.same_ratio * jumps.mean():
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
    return {int(j): int(x) for j, x in zip(far, np.round(start), strict=True)}


def held(tau: Array, q: Array) -> Guess:
    """Return whether a torque is a held command: constant while the position moves."""
    steps = np.diff(tau, axis=0)
    if tau.shape == q.shape:
        steps = steps[np.abs(np.diff(q, axis=0)) > 0]
    share = float(np.mean(steps == 0)) if steps.size else 0.0
    if share > EVIDENCE.still and np.unique(tau).size > EVIDENCE.fewest:
        still = (
            f"{100 * share:.0f} % of the steps between samples are zero while the position moves"
        )
        why = "a command, held over several samples, or a measurement from a slower bus?"
        return Guess("held-command", "unsure", f"{still}: {why}")
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
        listed = ", ".join("-1" if sign < 0 else "1" for sign in signs)
        return Guess(f"[{listed}]", "likely", why)
    if wrong:
        against = (
            f"torque of joint {wrong} jumps against the speed where it reverses, unlike friction"
        )
        why = f"{against}: sign = -1 there, unless its transmission is negative"
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


def units_of_ratio(factor: float, tolerance: float = EVIDENCE.same_ratio) -> tuple[str, str] | None:
    """Return the units of position and velocity that are a factor apart, ("", "") where equal.

    A power of ten is of a wrong unit of time, not of angles: 0.1 is not the 0.105 of rad and rpm.
    """
    nearest = min(_ANGULAR_RATIOS, key=lambda ratio: abs(factor / ratio - 1.0))
    off = abs(factor / nearest - 1.0)
    if factor > 0 and off > abs(factor / 10.0 ** round(math.log10(factor)) - 1.0):
        return None
    return _ANGULAR_RATIOS[nearest] if off <= tolerance else None


@dataclass(frozen=True)
class LinkFit:
    """The fit of a torque by weight and inertia of the robot's own links."""

    gains: Array  # (joints,) recorded torque per N m of the links; nan where not explained
    followed: bool  # at the joints that have most of the links' torque
    alone: bool  # without any friction: computed, or simulated
    varies: bool  # the links' torque changes over the motion
    left: float  # unexplained share of the torque's change, mean of the joints
    signs: Array  # (joints,) of weight and friction where both agree, else 0
    otherwise: str = ""  # a far better explanation: joints exchanged, an angle of another link


def fits_by_unit(
    model: TorqueModel, q: Array, tau: Array, t: Array, factors: Mapping[str, Array]
) -> dict[str, LinkFit]:
    """Return the fit for each unit that positions `q` may be in; `factors` are SI, one a joint."""
    torque = _smooth(tau, t)[0]
    found: dict[str, LinkFit] = {}
    if len(torque) < FEWEST:
        return found  # the steps of time are too uneven
    every = max(1, len(torque) // LINKS.samples_of_orders)
    for unit, factor in factors.items():
        q_si, dq, ddq = _smooth(np.unwrap(q * factor, axis=0), t)
        links = model(q_si, dq, ddq)
        if links is None or not np.isfinite(links).all():
            continue
        some = q_si[::every], dq[::every], ddq[::every]
        otherwise = _otherwise(model, some, torque[::every])
        found[unit] = replace(_fit_of_links(torque, links, dq), otherwise=otherwise)
    return found


def best_unit(fits: Mapping[str, LinkFit], proved: bool = True) -> str:
    """Return the unit that explains the torque far better than any other; "" where none does.

    Gears near 57 make radians of a motor look like degrees of a joint: proved is a unit in which
    torques are N m as well.
    """
    by_fit = sorted(fits, key=lambda unit: fits[unit].left)
    if not by_fit:
        return ""
    best = fits[by_fit[0]]
    if len(by_fit) > 1 and best.left > LINKS.better * fits[by_fit[1]].left:
        return ""
    logs = np.abs(np.log(np.abs(best.gains[np.isfinite(best.gains)])))
    sure = best.followed and best.varies and best.left < LINKS.proof
    sure = sure and bool((logs < math.log(LINKS.unnamed_gain)).all())
    return by_fit[0] if sure or not proved else ""


def _fit_of_links(tau: Array, model: Array, dq: Array) -> LinkFit:
    """Fit the recorded torque by that of the links' model and by friction.

    The model explains a joint's torque where it takes most of what friction leaves.
    """
    rest, links = _without_friction(tau, dq), _without_friction(model, dq)
    inner, power = (rest * links).sum(axis=0), (links**2).sum(axis=0)
    explains = inner**2 > LINKS.explained * (rest**2).sum(axis=0) * power
    gains = np.where(explains, inner / np.where(power > 0.0, power, 1.0), math.nan)
    # Not at rest, or one joint at even speeds:
    varies = bool(power.sum() >= LINKS.changes**2 * float(np.sum(model**2)))
    followed = float(power[explains].sum()) > LINKS.most * float(power.sum())
    residual = tau - np.nan_to_num(gains) * model
    unexplained = np.var(residual, axis=0).sum()
    alone = bool(unexplained < (1.0 - LINKS.alone) * np.var(tau, axis=0).sum())
    signs = np.sign(np.nan_to_num(gains))
    x, y = (v - v.mean(axis=0) for v in (residual, np.sign(dq)))
    size = np.sqrt((x**2).sum(axis=0) * (y**2).sum(axis=0))
    friction = (x * y).sum(axis=0) / np.where(size > 0.0, size, 1.0)
    signs = np.where(signs * friction > LINKS.friction, signs, 0.0)
    return LinkFit(gains, followed, alone, varies, _left(rest, links, tau), signs)


def _without_friction(values: Array, dq: Array) -> Array:
    """Return the residual of sign(dq), dq and 1, joint by joint; friction at rest may be any."""
    rest = np.empty_like(values)
    for j in range(values.shape[1]):
        slow = max(LINKS.slow * float(np.abs(dq[:, j]).max()), 1e-300)
        columns = [np.clip(dq[:, j] / slow, -1.0, 1.0), dq[:, j], np.ones(len(dq))]
        friction = np.column_stack(columns)
        numbers = np.linalg.lstsq(friction, values[:, j], rcond=None)[0]
        rest[:, j] = values[:, j] - friction @ numbers
    return rest


def _left(rest: Array, links: Array, tau: Array) -> float:
    """Return the share of a joint's torque that neither links nor friction explain, the mean."""
    power = (links**2).sum(axis=0)
    gain = (rest * links).sum(axis=0) / np.where(power > 0.0, power, 1.0)
    gain = np.where(power > 0.0, gain, 0.0)
    size = np.maximum(tau.var(axis=0), 1e-300)
    return float(np.mean(((rest - gain * links) ** 2).mean(axis=0) / size))


def _left_of(tau: Array, links: Array, dq: Array) -> float:
    return _left(_without_friction(tau, dq), _without_friction(links, dq), tau)


def _otherwise(model: TorqueModel, motion: Motion, tau: Array) -> str:
    """Return under which other meaning q' = N^-1 q the links explain the torque far better.

    Two joints the other way round, in the torque alone or in the motion as well; or a joint counted
    from the link before the last, with either sign of that. The torque is then the joints' or,
    where a drive turns it by such a rod, N^T times the drives'.
    """
    links, n = model(*motion), tau.shape[1]
    if links is None:
        return ""
    changes: list[tuple[str, Array, bool]] = []
    for a, b in itertools.combinations(range(n), 2):
        exchange = np.eye(n)
        exchange[[a, b]] = exchange[[b, a]]
        words = f"joints {a + 1} and {b + 1} exchanged: in which order are they?"
        changes.append((words, exchange, True))
    for a, sign in itertools.product(range(n - 1), (1.0, -1.0)):
        back = np.eye(n)  # N^-1
        back[a + 1, a] = -sign
        words = f"joint {a + 2} counted from link {a}, not from link {a + 1}"
        changes.append((f"{words}: is it, or are two drives coupled?", back, False))
    best, found = LINKS.better * _left_of(tau, links, motion[1]), ""
    for words, change, exchanged in changes:
        q, dq, ddq = (x @ change.T for x in motion)
        other = model(q, dq, ddq)
        left = _left_of(tau @ change.T, links, motion[1]) if exchanged else math.inf
        if other is not None:
            left = min(left, _left_of(tau, other @ change, motion[1]))
            left = left if exchanged else min(left, _left_of(tau, other, dq))
        if left < best:
            best, found = left, words
    return found


def unlike_links(fit: LinkFit, factor: float, named: bool) -> str:
    """Return how torques differ from those of the robot's links; `factor` is their unit in SI."""
    known = factor * fit.gains[np.isfinite(fit.gains)]
    if not (fit.followed or named):
        why = "they do not follow from the motion by the robot's own links"
        return f"{why}: measured joint torques in N m?"
    if not known.size:
        return ""
    off = float(known[np.argmax(np.abs(np.log(np.abs(known))))])
    most = LINKS.gain if named else LINKS.unnamed_gain
    if 1.0 / most <= abs(off) <= most:
        return ""
    times = f"{off:.3g} times what weight and inertia of the robot's own links ask for at one joint"
    return f"{times}: a share of a rated torque, or the motor's side?"


def _smooth(q: Array, t: Array) -> Motion:
    """Return values and two derivatives (samples, joints) by local cubics, where no gap is near."""
    from scipy.signal import savgol_filter

    step = float(np.median(np.diff(t)))
    width = max(LINKS.fewest, min(round(LINKS.window / step), (len(q) - 1) // 2) | 1)
    half = width // 2
    lasts = t[2 * half :] - t[: -2 * half]  # a window over a gap lasts longer
    some = half + np.flatnonzero(np.abs(lasts - (width - 1) * step) < 0.5 * width * step)
    some = some[:: max(1, len(some) // LINKS.samples)]
    q, dq, ddq = (savgol_filter(q, width, 3, deriv=k, delta=step, axis=0)[some] for k in range(3))
    return q, dq, ddq

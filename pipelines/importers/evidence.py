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
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.io.experiment import Array
from pipelines.io.limits import FEWEST

__all__ = ["RESOLUTIONS", "Confidence", "Guess", "LinkFit", "Slope", "TorqueModel", "best_unit",
           "crossed", "fits_by_unit", "held", "quarter_turns", "rollover", "sign_of", "slope_of",
           "unlike_links"]  # fmt: skip

Confidence = Literal["sure", "likely", "unsure"]
# (samples, joints) q, dq, ddq [rad] -> torque [N m]; None where links are unknown
TorqueModel = Callable[[Array, Array, Array], Array | None]

# Counts of encoders in one turn.
RESOLUTIONS = (4096, 8192, 16384, 2048, 1024, 65536, 131072, 262144, 1048576, 4000, 10000, 20000)
_STRETCHES = (200, 60, 20)  # parts of a recording over which a velocity is summed
_LIKE = 0.95  # correlation over which one block is the slope of another
_SAME_RATIO = 0.1  # scatter of the ratio over the joints
_FALSE_SIGN = 1e-3  # chance that a recording without friction is given a sign


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
    if q.shape != dq.shape or len(q) < 50:
        return None
    steps = np.diff(np.arange(len(q), dtype=np.float64) if t is None else t)
    areas = np.cumsum(0.5 * (dq[1:] + dq[:-1]) * steps[:, None], axis=0)
    summed = np.concatenate([np.zeros((1, q.shape[1])), areas])
    least = 0.0 if every else 1e-3
    moving = (np.ptp(q, axis=0) > least * np.ptp(q)) & (np.ptp(dq, axis=0) > least * np.ptp(dq))
    if not moving.any():
        return None
    widths = sorted({max(2, len(q) // share) for share in _STRETCHES})
    found = (_slope_over(q[:, moving], summed[:, moving], width) for width in widths)
    return next((slope for slope in found if slope is not None), None)


def _slope_over(q: Array, summed: Array, width: int) -> Slope | None:
    """Return the relation over stretches of `width` samples; `summed` integrates the velocity."""
    moved, expected = q[width:] - q[:-width], summed[width:] - summed[:-width]
    power = (expected**2).sum(axis=0)
    inner = (moved * expected).sum(axis=0)
    size = np.sqrt(power * (moved**2).sum(axis=0))
    if not (size > 0).all():
        return None
    correlation, factors = inner / size, inner / power
    factor = float(inner.sum() / power.sum())
    if correlation.min() < _LIKE or np.abs(factors / factor - 1.0).max() > _SAME_RATIO:
        return None
    return Slope(factor, float(correlation.min()))


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
    large = np.abs(steps) > 0.8 * size
    jumps = np.abs(steps[large]) if size > 0 else np.empty(0)
    others = np.abs(steps[~large])
    if not jumps.size or (others.size and others.max() > 0.2 * size):
        return None
    if np.ptp(jumps) > 0.1 * jumps.mean():
        return None
    if (np.abs(steps[1:] + steps[:-1])[np.abs(steps[1:]) > 0.8 * size] < 0.2 * size).any():
        return None  # there and back again: numbers that mark a lost sample
    candidates = (360.0, 2 * math.pi, 1.0, *map(float, RESOLUTIONS))
    near = min(candidates, key=lambda c: abs(jumps.max() - c) / c)
    return near if abs(jumps.max() - near) / near < 0.1 else float(jumps.max())


def quarter_turns(q: Array) -> dict[int, int]:
    """Return joint (from 0) -> quarter turns [pi/2] at the start, of those far from zero.

    Robots rest at right angles: a motor then stands at its gear ratio times quarter turns, in rad.
    Empty where one is at no quarter turn, or only one joint is, as by chance.
    """
    far = np.flatnonzero(np.abs(q[0]) > 4.0 * math.pi)
    start = q[0][far] / (0.5 * math.pi)
    if start.size < 2 or np.abs(start - np.round(start)).max() > 2e-3:
        return {}
    return {int(j): int(x) for j, x in zip(far, np.round(start), strict=True)}


def held(tau: Array, q: Array) -> Guess:
    """Return whether a torque is a held command: constant while the position moves."""
    steps = np.diff(tau, axis=0)
    if tau.shape == q.shape:
        steps = steps[np.abs(np.diff(q, axis=0)) > 0]
    share = float(np.mean(steps == 0)) if steps.size else 0.0
    if share > 0.4 and np.unique(tau).size > 50:
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
    at `_FALSE_SIGN` over all joints. A jump that fits better elsewhere than at the reversal is no
    friction at it: the position leads or lags the torque.
    """
    from scipy.special import stdtr

    half = max(6, len(q) // 200)
    step = max(1, half // 10)
    shifts = step * np.arange(-(half // 2 // step), half // 2 // step + 1)
    smooth = np.ones(max(3, half // 2)) / max(3, half // 2)
    claims = np.zeros(q.shape[1])  # sign of F where it is significant
    for j in range(q.shape[1]):
        speed = np.gradient(np.convolve(q[:, j], smooth, mode="same"))
        jumps, residuals = _jumps(speed, tau[:, j], half, shifts)
        if len(jumps) < 3 or shifts[np.argmin(residuals)] != 0:
            continue
        mean = float(np.mean(jumps))
        error = float(np.std(jumps, ddof=1)) / math.sqrt(len(jumps))
        chance = 2.0 * stdtr(len(jumps) - 1, -abs(mean) / max(error, 1e-300))
        claims[j] = np.sign(mean) if chance < _FALSE_SIGN / q.shape[1] else 0.0
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


@dataclass(frozen=True)
class Config:
    """The comparison of a torque with that of the robot's own links."""

    window: float = 0.1  # [s] of the local cubic (Savitzky & Golay 1964): moves take longer
    fewest: int = 5  # samples in it: a cubic has four coefficients
    changes: float = 0.1  # of the links' torque over the motion: else friction and noise dominate
    explained: float = 0.5  # of the power that friction leaves, or the torque does not follow
    most: float = 0.8  # of the links' torque is at joints they explain: not at a light wrist
    slow: float = 0.01  # of a joint's fastest speed: below, it may rest and noise gives it a sign
    alone: float = 0.99  # of the torque with its friction, a hundredth or more in any drive
    gain: float = 3.0  # a payload as heavy as the links, whose masses are roughly known
    unnamed_gain: float = 1.5  # without a unit: a share of a rated torque may be near it by chance
    better: float = 0.5  # of the residual of one unit or order is that of another that fits better
    proof: float = 0.1  # of the torque may be unexplained under the unit that is proved
    friction: float = 0.3  # correlation of the rest with the direction of motion
    samples: int = 4000  # of a recording that are compared: ten seconds of a fast one
    samples_of_orders: int = 600  # of these, for each exchange of two joints


_DEFAULT = Config()


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
    every = max(1, len(torque) // _DEFAULT.samples_of_orders)
    for unit, factor in factors.items():
        q_si, dq, ddq = _smooth(np.unwrap(q * factor, axis=0), t)
        links = model(q_si, dq, ddq)
        if links is None or not np.isfinite(links).all():
            continue
        some = q_si[::every], dq[::every], ddq[::every]
        otherwise = _otherwise(model, some, torque[::every])
        found[unit] = replace(_fit_of_links(torque, links, dq), otherwise=otherwise)
    return found


def best_unit(fits: Mapping[str, LinkFit], config: Config = _DEFAULT) -> tuple[str, bool]:
    """Return the unit that explains the torque far better than any other, and whether it is proved.

    Gears near 57 make radians of a motor look like degrees of a joint: proved is a unit in which
    torques are N m as well.
    """
    by_fit = sorted(fits, key=lambda unit: fits[unit].left)
    if not by_fit:
        return "", False
    best = fits[by_fit[0]]
    if len(by_fit) > 1 and best.left > config.better * fits[by_fit[1]].left:
        return "", False
    logs = np.abs(np.log(np.abs(best.gains[np.isfinite(best.gains)])))
    nearly_one = bool((logs < math.log(config.unnamed_gain)).all())
    return by_fit[0], best.followed and best.varies and best.left < config.proof and nearly_one


def _fit_of_links(tau: Array, model: Array, dq: Array, config: Config = _DEFAULT) -> LinkFit:
    """Fit the recorded torque by that of the links' model and by friction.

    The model explains a joint's torque where it takes most of what friction leaves.
    """
    rest, links = _without_friction(tau, dq), _without_friction(model, dq)
    inner, power = (rest * links).sum(axis=0), (links**2).sum(axis=0)
    explains = inner**2 > config.explained * (rest**2).sum(axis=0) * power
    gains = np.where(explains, inner / np.where(power > 0.0, power, 1.0), math.nan)
    # Not at rest, or one joint at even speeds:
    varies = bool(power.sum() >= config.changes**2 * float(np.sum(model**2)))
    followed = float(power[explains].sum()) > config.most * float(power.sum())
    residual = tau - np.nan_to_num(gains) * model
    unexplained = np.var(residual, axis=0).sum()
    alone = bool(unexplained < (1.0 - config.alone) * np.var(tau, axis=0).sum())
    signs = np.sign(np.nan_to_num(gains))
    x, y = (v - v.mean(axis=0) for v in (residual, np.sign(dq)))
    size = np.sqrt((x**2).sum(axis=0) * (y**2).sum(axis=0))
    friction = (x * y).sum(axis=0) / np.where(size > 0.0, size, 1.0)
    signs = np.where(signs * friction > config.friction, signs, 0.0)
    return LinkFit(gains, followed, alone, varies, _left(rest, links, tau), signs)


def _without_friction(values: Array, dq: Array) -> Array:
    """Return the residual of sign(dq), dq and 1, joint by joint; friction at rest may be any."""
    rest = np.empty_like(values)
    for j in range(values.shape[1]):
        slow = max(_DEFAULT.slow * float(np.abs(dq[:, j]).max()), 1e-300)
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


Motion = tuple[Array, Array, Array]  # q, dq, ddq
# Words, and pairs of a torque, the links' torque, and a speed (samples, joints).
Meanings = Iterator[tuple[str, list[Motion]]]


def _otherwise(model: TorqueModel, motion: Motion, tau: Array) -> str:
    """Return under which other meaning of the joints the links explain the torque far better."""
    links = model(*motion)
    if links is None:
        return ""
    best, found = _DEFAULT.better * _left_of(tau, links, motion[1]), ""
    meanings = itertools.chain(_exchanged(model, motion, links, tau), _coupled(model, motion, tau))
    for words, candidates in meanings:
        left = min((_left_of(*candidate) for candidate in candidates), default=math.inf)
        if left < best:
            best, found = left, words
    return found


def _exchanged(model: TorqueModel, motion: Motion, links: Array, tau: Array) -> Meanings:
    """Yield each two joints the other way round, in the torque alone or in the motion as well."""
    for a, b in itertools.combinations(range(tau.shape[1]), 2):
        order = np.arange(tau.shape[1])
        order[[a, b]] = b, a
        q, dq, ddq = (x[:, order] for x in motion)
        other = model(q, dq, ddq)
        both = [] if other is None else [(tau[:, order], other, dq)]
        words = f"joints {a + 1} and {b + 1} exchanged: in which order are they?"
        yield words, [(tau[:, order], links, motion[1]), *both]


def _coupled(model: TorqueModel, motion: Motion, tau: Array) -> Meanings:
    """Yield each joint counted from the link before the last, with either sign of that: q' = N q.

    The torque is the joints' or, where a drive turns it by such a rod, N^T times the drives'.
    """
    for a, sign in itertools.product(range(tau.shape[1] - 1), (1.0, -1.0)):
        back = np.eye(tau.shape[1])  # N^-1
        back[a + 1, a] = -sign
        q, dq, ddq = (x @ back.T for x in motion)
        links = model(q, dq, ddq)
        counted = f"joint {a + 2} counted from link {a}, not from link {a + 1}"
        if links is not None:
            words = f"{counted}: is it, or are two drives coupled?"
            yield words, [(tau, links, dq), (tau, links @ back, motion[1])]


def _left_of(tau: Array, links: Array, dq: Array) -> float:
    return _left(_without_friction(tau, dq), _without_friction(links, dq), tau)


def unlike_links(fit: LinkFit, factor: float, named: bool, config: Config = _DEFAULT) -> str:
    """Return how torques differ from those of the robot's links; `factor` is their unit in SI."""
    known = factor * fit.gains[np.isfinite(fit.gains)]
    if not (fit.followed or named):
        why = "they do not follow from the motion by the robot's own links"
        return f"{why}: measured joint torques in N m?"
    if not known.size:
        return ""
    off = float(known[np.argmax(np.abs(np.log(np.abs(known))))])
    most = config.gain if named else config.unnamed_gain
    if 1.0 / most <= abs(off) <= most:
        return ""
    times = f"{off:.3g} times what weight and inertia of the robot's own links ask for at one joint"
    return f"{times}: a share of a rated torque, or the motor's side?"


def _smooth(q: Array, t: Array, config: Config = _DEFAULT) -> Motion:
    """Return values and two derivatives (samples, joints) by local cubics, where no gap is near."""
    from scipy.signal import savgol_filter

    step = float(np.median(np.diff(t)))
    width = max(config.fewest, min(round(config.window / step), (len(q) - 1) // 2) | 1)
    half = width // 2
    lasts = t[2 * half :] - t[: -2 * half]  # a window over a gap lasts longer
    some = half + np.flatnonzero(np.abs(lasts - (width - 1) * step) < 0.5 * width * step)
    some = some[:: max(1, len(some) // config.samples)]
    q, dq, ddq = (savgol_filter(q, width, 3, deriv=k, delta=step, axis=0)[some] for k in range(3))
    return q, dq, ddq

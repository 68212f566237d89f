"""Compare recorded torques with what the robot's own links ask for in the recorded motion.

Weight and inertia of the links follow from the description; friction is fitted, joint by joint:

    tau = a·tau_links(q, dq, ddq) + F sign(dq) + B dq + c

The torque agrees with one unit of position, with one order of the joints and with angles that are counted from
the link before or, behind parallel links, from the one before that, if with any.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.log.limits import FEWEST

__all__ = ["LinkFit", "TorqueModel", "best_unit", "fit_of_links", "fits_by_unit", "unlike_links"]

TorqueModel = Callable[
    [Array, Array, Array], Array | None
]  # (samples, joints) [rad] -> [N m]; None where links are unknown


@dataclass(frozen=True)
class Config:
    """How a torque is compared with what the robot's own links ask for."""

    window: float = 0.1  # [s] of the cubic that is differentiated (Savitzky & Golay 1964): an arm's moves take longer
    fewest: int = 5  # samples in it: a cubic has four coefficients
    changes: float = 0.1  # of the links' torque over the motion: else friction and noise are most of what changes
    explained: float = (
        0.5  # of the power that friction leaves: most of it, or the torque is not said to follow
    )
    most: float = 0.8  # of the links' torque is at joints they explain: the light ones of a wrist may be friction alone
    slow: float = 0.01  # of a joint's fastest speed: below, it may rest, and noise alone gives the speed a sign
    alone: float = (
        0.99  # of the torque with its friction, which takes more than a hundredth of any drive's
    )
    gain: float = 3.0  # a payload as heavy as the links, whose masses are roughly known
    unnamed_gain: float = (
        1.5  # of a torque without a unit: a share of a rated torque may be near it by chance
    )
    better: float = 0.5  # of what one unit or order leaves open is left by another that fits better
    proof: float = 0.1  # of the torque may be left open by the unit that is proved
    friction: float = 0.3  # correlation with the direction of motion of what the links leave: where it is friction
    samples: int = 4000  # of a recording that are compared: ten seconds of a fast one
    samples_of_orders: int = 600  # of these, for each exchange of two joints


@dataclass(frozen=True)
class LinkFit:
    """How a torque follows from the motion by weight and inertia of the robot's own links."""

    gains: Array  # (joints,) recorded torque per N m of the links; nan where they do not explain it
    followed: bool  # at the joints that have most of the links' torque
    alone: bool  # without any friction: computed, or simulated
    varies: bool  # the links' torque changes over the motion, so that the others say something
    left: (
        float  # share of the torque's change that links and friction leave open, mean of the joints
    )
    signs: Array  # (joints,) -1 where weight and friction both have the other sign, 1 where both have the links', else 0
    otherwise: str = ""  # what would explain it far better: two joints exchanged, or an angle counted from another link


def fits_by_unit(
    model: TorqueModel,
    q: Array,
    tau: Array,
    t: Array,
    factors: Mapping[str, Array],
    config: Config = Config(),
) -> dict[str, LinkFit]:
    """Return the fit for each unit that positions `q` may be in; `factors` hold its SI value, one a joint."""
    torque = _smooth(tau, t, config)[0]
    found: dict[str, LinkFit] = {}
    if len(torque) < FEWEST:
        return found  # the steps of time are too uneven
    for unit, factor in factors.items():
        motion = _smooth(np.unwrap(q * factor, axis=0), t, config)
        links = model(*motion)
        if links is None or not np.isfinite(links).all():
            continue
        every = max(1, len(torque) // config.samples_of_orders)
        some = (motion[0][::every], motion[1][::every], motion[2][::every])
        found[unit] = replace(
            fit_of_links(torque, links, motion[1], config),
            otherwise=_otherwise(model, some, torque[::every], config),
        )
    return found


def best_unit(fits: Mapping[str, LinkFit], config: Config = Config()) -> tuple[str, bool]:
    """Return the unit that leaves far less of the torque open than any other, "" where none does; and whether it is proved.

    Gears near 57 make radians of a motor look like degrees of a joint: proved is a unit in which torques are N m as well.
    """
    by_fit = sorted(fits, key=lambda unit: fits[unit].left)
    if not by_fit or (
        len(by_fit) > 1 and fits[by_fit[0]].left > config.better * fits[by_fit[1]].left
    ):
        return "", False
    best = fits[by_fit[0]]
    nearly_one = np.abs(np.log(np.abs(best.gains[np.isfinite(best.gains)]))) < math.log(
        config.unnamed_gain
    )
    return by_fit[0], best.followed and best.varies and best.left < config.proof and bool(
        nearly_one.all()
    )


def fit_of_links(tau: Array, model: Array, dq: Array, config: Config = Config()) -> LinkFit:
    """Fit the recorded torque by that of the links' model and by friction.

    The model explains a joint's torque where it takes most of what friction leaves.
    """
    rest, links = _without_friction(tau, dq, config), _without_friction(model, dq, config)
    inner, power, all_power = (
        (rest * links).sum(axis=0),
        (links**2).sum(axis=0),
        (rest**2).sum(axis=0),
    )
    explains = inner**2 > config.explained * all_power * power
    gains = np.where(explains, inner / np.where(power > 0.0, power, 1.0), math.nan)
    varies = bool(
        power.sum() >= config.changes**2 * float(np.sum(model**2))
    )  # not at rest, or one joint at even speeds
    followed = float(power[explains].sum()) > config.most * float(power.sum())
    left = np.var(tau - np.nan_to_num(gains) * model, axis=0).sum()
    alone = bool(left < (1.0 - config.alone) * np.var(tau, axis=0).sum())
    signs = np.sign(np.nan_to_num(gains))
    friction = _correlation(tau - np.nan_to_num(gains) * model, np.sign(dq))
    signs = np.where(signs * friction > config.friction, signs, 0.0)
    return LinkFit(gains, followed, alone, varies, _left(rest, links, tau), signs)


def _correlation(x: Array, y: Array) -> Array:
    """Return the correlation of each column of `x` with that of `y`."""
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    size = np.sqrt((x**2).sum(axis=0) * (y**2).sum(axis=0))
    return np.asarray((x * y).sum(axis=0) / np.where(size > 0.0, size, 1.0))


def _without_friction(values: Array, dq: Array, config: Config) -> Array:
    """Return what friction cannot explain: the residual of sign(dq), dq and 1, joint by joint; at rest it may be anything."""
    rest = np.empty_like(values)
    for j in range(values.shape[1]):
        slow = max(config.slow * float(np.abs(dq[:, j]).max()), 1e-300)
        friction = np.column_stack(
            [np.clip(dq[:, j] / slow, -1.0, 1.0), dq[:, j], np.ones(len(dq))]
        )
        rest[:, j] = (
            values[:, j] - friction @ np.linalg.lstsq(friction, values[:, j], rcond=None)[0]
        )
    return rest


def _left(rest: Array, links: Array, tau: Array) -> float:
    """Return the share of each joint's torque that neither links nor friction explain, its mean over the joints."""
    power = (links**2).sum(axis=0)
    gain = np.where(
        power > 0.0, (rest * links).sum(axis=0) / np.where(power > 0.0, power, 1.0), 0.0
    )
    size = np.maximum(tau.var(axis=0), 1e-300)
    return float(np.mean(((rest - gain * links) ** 2).mean(axis=0) / size))


def _otherwise(
    model: TorqueModel, motion: tuple[Array, Array, Array], tau: Array, config: Config
) -> str:
    """Return under which other meaning of the joints the links explain the torque far better; "" where under none."""
    dq = motion[1]
    links = model(*motion)
    if links is None:
        return ""
    best, found = config.better * _left_of(tau, links, dq, config), ""
    for words, candidates in itertools.chain(
        _exchanged(model, motion, links, tau), _coupled(model, motion, tau)
    ):
        left = min((_left_of(*candidate, config) for candidate in candidates), default=math.inf)
        if left < best:
            best, found = left, words
    return found


_Meanings = Iterator[
    tuple[str, list[tuple[Array, Array, Array]]]
]  # words, and torque, links' torque, speed (samples, joints)


def _exchanged(
    model: TorqueModel, motion: tuple[Array, Array, Array], links: Array, tau: Array
) -> _Meanings:
    """Yield each two joints the other way round, in the torque alone or in the motion as well."""
    for a, b in itertools.combinations(range(tau.shape[1]), 2):
        order = np.arange(tau.shape[1])
        order[[a, b]] = b, a
        q, dq, ddq = (x[:, order] for x in motion)
        other = model(q, dq, ddq)
        both = [] if other is None else [(tau[:, order], other, dq)]
        yield (
            f"joints {a + 1} and {b + 1} exchanged: in which order are they?",
            [(tau[:, order], links, motion[1]), *both],
        )


def _coupled(model: TorqueModel, motion: tuple[Array, Array, Array], tau: Array) -> _Meanings:
    """Yield each joint counted from the link before the last, with either sign of that one's angle: q' = N q.

    The torque is the joints' or, where a drive turns the joint by such a rod, N^T times the drives'.
    """
    for a, sign in itertools.product(range(tau.shape[1] - 1), (1.0, -1.0)):
        back = np.eye(tau.shape[1])  # N^-1
        back[a + 1, a] = -sign
        q, dq, ddq = (x @ back.T for x in motion)
        links = model(q, dq, ddq)
        words = f"joint {a + 2} counted from link {a}, not from link {a + 1}: is it, or are two drives coupled?"
        if links is not None:
            yield words, [(tau, links, dq), (tau, links @ back, motion[1])]


def _left_of(tau: Array, links: Array, dq: Array, config: Config) -> float:
    return _left(_without_friction(tau, dq, config), _without_friction(links, dq, config), tau)


def unlike_links(fit: LinkFit, factor: float, named: bool, config: Config = Config()) -> str:
    """Say how torques differ from what the robot's links ask for, "" where they do not; `factor` is the SI value of their unit."""
    known = factor * fit.gains[np.isfinite(fit.gains)]
    if not (fit.followed or named):
        return "they do not follow from the motion by the robot's own links: measured joint torques in N m?"
    if not known.size:
        return ""
    off = float(known[np.argmax(np.abs(np.log(np.abs(known))))])
    most = config.gain if named else config.unnamed_gain
    return (
        ""
        if 1.0 / most <= abs(off) <= most
        else (
            f"{off:.3g} times what weight and inertia of the robot's own links ask for at one joint: a share of a rated torque, "
            "or the motor's side?"
        )
    )


def _smooth(q: Array, t: Array, config: Config) -> tuple[Array, Array, Array]:
    """Return values and their two derivatives (samples, joints) by local cubics, at samples without a gap nearby."""
    from scipy.signal import savgol_filter

    step = float(np.median(np.diff(t)))
    width = max(config.fewest, min(round(config.window / step), (len(q) - 1) // 2) | 1)
    half = width // 2
    lasts = t[2 * half :] - t[: -2 * half]  # a window over a gap lasts longer
    some = half + np.flatnonzero(np.abs(lasts - (width - 1) * step) < 0.5 * width * step)
    some = some[:: max(1, len(some) // config.samples)]
    q, dq, ddq = (savgol_filter(q, width, 3, deriv=k, delta=step, axis=0)[some] for k in range(3))
    return q, dq, ddq

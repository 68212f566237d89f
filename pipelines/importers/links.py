"""Compare a recorded torque with weight and inertia of the robot's own links.

These follow from the robot's description; friction is fitted:

    tau = a·tau_links(q, dq, ddq) + F sign(dq) + B dq + c

The torque agrees with one unit of position, with one order of the joints and with angles that are
counted from the link before or, behind parallel links, from the one before that, if with any.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pipelines.importers.config import LINKS
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array

# (samples, joints) q, dq, ddq [rad] -> torque [N m] of a robot's links
TorqueModel = Callable[[Array, Array, Array], Array]
Motion = tuple[Array, Array, Array]  # q, dq, ddq


@dataclass(frozen=True)
class LinkFit:
    """The fit of a torque by weight and inertia of the robot's own links."""

    gains: Array  # (joints,) recorded torque per N m of the links; nan where not explained
    followed: bool  # at the joints that have most of the links' torque
    alone: bool  # without any friction: computed, or simulated
    varies: bool  # the links' torque changes over the motion
    unexplained: float  # share of the torque's change, mean of the joints
    signs: Array  # (joints,) of weight and friction where both agree, else 0
    otherwise: str = ""  # a far better explanation: joints exchanged, an angle of another link

    @property
    def known_gains(self) -> Array:
        return self.gains[np.isfinite(self.gains)]


def fits_by_unit(
    model: TorqueModel, q: Array, tau: Array, t: Array, factors: Mapping[str, Array]
) -> dict[str, LinkFit]:
    """Return the fit for each unit that positions `q` may be in; `factors` are SI, one a joint."""
    found: dict[str, LinkFit] = {}
    torque = _smooth(tau, t)[0]
    every = max(1, len(torque) // LINKS.samples_of_orders)
    for unit, factor in factors.items() if len(torque) >= FEWEST else ():  # else uneven steps
        motion = _smooth(np.unwrap(q * factor, axis=0), t)
        links = model(*motion)
        if np.isfinite(links).all():
            q_some, dq_some, ddq_some = (x[::every] for x in motion)
            otherwise = _otherwise(model, (q_some, dq_some, ddq_some), torque[::every])
            found[unit] = _fit(torque, links, motion[1], otherwise)
    return found


def best_unit(fits: Mapping[str, LinkFit], proved: bool = True) -> str:
    """Return the unit that explains the torque far better than any other; "" where none does.

    Gears near 57 make radians of a motor look like degrees of a joint: proved is a unit in which
    torques are N m as well.
    """
    by_fit = sorted(fits, key=lambda unit: fits[unit].unexplained)
    if not by_fit:
        return ""
    best = fits[by_fit[0]]
    if by_fit[1:] and best.unexplained > LINKS.better * fits[by_fit[1]].unexplained:
        return ""
    near = np.abs(np.log(np.abs(best.known_gains))) < math.log(LINKS.unnamed_gain)
    sure = best.followed and best.varies and best.unexplained < LINKS.proof and bool(near.all())
    return by_fit[0] if sure or not proved else ""


def unlike_links(fit: LinkFit, factor: float, named: bool) -> str:
    """Return how torques differ from those of the robot's links; `factor` is their unit in SI."""
    if not (fit.followed or named):
        why = "they do not follow from the motion by the robot's own links"
        return f"{why}: measured joint torques in N m?"
    known = factor * fit.known_gains
    off = float(known[np.argmax(np.abs(np.log(np.abs(known))))]) if known.size else 1.0
    most = LINKS.gain if named else LINKS.unnamed_gain
    if 1.0 / most <= abs(off) <= most:
        return ""
    times = f"{off:.3g} times what weight and inertia of the robot's own links ask for at one joint"
    return f"{times}: a share of a rated torque, or the motor's side?"


def _fit(tau: Array, links: Array, dq: Array, otherwise: str) -> LinkFit:
    """Fit the recorded torque by that of the links and by friction.

    The links explain a joint's torque where they take most of what friction leaves.
    """
    rest, model = _without_friction(tau, dq), _without_friction(links, dq)
    inner, power = (rest * model).sum(axis=0), (model**2).sum(axis=0)
    explains = inner**2 > LINKS.explained * (rest**2).sum(axis=0) * power
    gains = np.where(explains, inner / np.where(power > 0.0, power, 1.0), math.nan)
    residual = tau - np.nan_to_num(gains) * links
    x, y = (v - v.mean(axis=0) for v in (residual, np.sign(dq)))
    size = np.sqrt((x**2).sum(axis=0) * (y**2).sum(axis=0))
    friction = (x * y).sum(axis=0) / np.where(size > 0.0, size, 1.0)
    signs = np.sign(np.nan_to_num(gains))
    return LinkFit(
        gains=gains,
        followed=float(power[explains].sum()) > LINKS.most * float(power.sum()),
        alone=bool(residual.var(axis=0).sum() < (1.0 - LINKS.alone) * tau.var(axis=0).sum()),
        # Not at rest, or one joint at even speeds:
        varies=bool(power.sum() >= LINKS.changes**2 * float(np.sum(links**2))),
        unexplained=_unexplained(tau, links, dq),
        signs=np.where(signs * friction > LINKS.friction, signs, 0.0),
        otherwise=otherwise,
    )


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


def _unexplained(tau: Array, links: Array, dq: Array) -> float:
    """Return the share of a joint's torque that neither links nor friction explain, the mean."""
    rest, model = _without_friction(tau, dq), _without_friction(links, dq)
    power = (model**2).sum(axis=0)
    gain = (rest * model).sum(axis=0) / np.where(power > 0.0, power, math.inf)
    size = np.maximum(tau.var(axis=0), 1e-300)
    return float(np.mean(((rest - gain * model) ** 2).mean(axis=0) / size))


def _otherwise(model: TorqueModel, motion: Motion, tau: Array) -> str:
    """Return under which other meaning q' = N^-1 q the links explain the torque far better.

    Two joints the other way round, in the torque alone or in the motion as well; or a joint counted
    from the link before the last, with either sign of that. The torque is then the joints' or,
    where a drive turns it by such a rod, N^T times the drives'.
    """
    links, n, dq = model(*motion), tau.shape[1], motion[1]
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
    best, found = LINKS.better * _unexplained(tau, links, dq), ""
    for words, change, exchanged in changes:
        q, speed, acceleration = (x @ change.T for x in motion)
        other = model(q, speed, acceleration)
        if exchanged:
            second = _unexplained(tau @ change.T, links, dq)
        else:
            second = _unexplained(tau, other, speed)
        share = min(second, _unexplained(tau, other @ change, dq))
        if share < best:
            best, found = share, words
    return found


def _smooth(q: Array, t: Array) -> Motion:
    """Return values and two derivatives (samples, joints) by local cubics, where no gap is near.

    Least squares in a window about each sample (Savitzky & Golay 1964).
    """
    step = float(np.median(np.diff(t)))
    width = max(LINKS.fewest, min(round(LINKS.window / step), (len(q) - 1) // 2) | 1)
    half = width // 2
    lasts = t[2 * half :] - t[: -2 * half]  # a window over a gap lasts longer
    some = np.flatnonzero(np.abs(lasts - (width - 1) * step) < 0.5 * width * step)
    some = some[:: max(1, len(some) // LINKS.samples)]
    value, slope, curve, _ = np.linalg.pinv(np.vander(np.linspace(-1.0, 1.0, width), 4)[:, ::-1])
    windows = np.lib.stride_tricks.sliding_window_view(q, width, axis=0)[some]
    reach = half * step
    return windows @ value, windows @ slope / reach, windows @ curve * 2.0 / reach**2

"""Torques along the angle of a joint: waves of torque or of friction, and springs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import Functions
from pipelines.effects.base import ArmModel, Pointwise, SpeedCurve, Values
from pipelines.effects.config import EFFECTS, ORDERS
from pipelines.effects.hooks import sign_curve

__all__ = ["Cogging", "PositionFriction", "Spring"]

_ROUNDED = 1e-11  # numerics: difference of orders that is rounding
_STILL = 1e-3  # numerics: [rad or m] of travel: none
_TAILS = ("", "_2", "_3")  # of the names of harmonics
# The first is tried first; the other is for what hardens or gives way far out.
_DEGREE, _MORE = 5, 7  # numerics: degrees of the polynomial
_FAR = 1e3  # numerics: [rad] where nobody says how far it was seen
_TERMS = ("stiffness", "curvature", "hardening", "fourth", "fifth", "sixth", "seventh")


@dataclass(frozen=True)
class _Waves(Pointwise):
    """Σ A_m sin(m k q + φ_m), m = 1, 2, 3, of columns sin mkq, cos mkq.

    A search looks for m = 1 alone. What turns with the joint has a whole k, what turns behind a
    gear a k of its own; on a prismatic joint it counts waves in 2π metres.
    """

    order: float = 1.0  # k [1/rev of the joint]
    harmonics: int = 3  # how many m there are
    whole: bool = False  # whether k is held as it is

    @property
    def free(self) -> tuple[str, ...]:
        return tuple(name for name in super().free if not (self.whole and name == "order"))

    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        """Return each harmonic from the one before: a sine costs most."""
        sine, cosine = s, c = m.sin(self.order * q), m.cos(self.order * q)
        parts = [s, c]
        for _ in range(1, self.harmonics):
            s, c = s * cosine + c * sine, c * cosine - s * sine
            parts += (s, c)
        return parts

    def amplitudes(self, values: Values) -> Array:
        each = [
            values[f"amplitude{tail}"] * np.exp(1j * values[f"phase{tail}"])
            for tail in _TAILS[: self.harmonics]
        ]
        return np.array([part for wave in each for part in (wave.real, wave.imag)])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        known = np.zeros((len(_TAILS), 2))
        known[: self.harmonics] = np.reshape(amplitudes, (-1, 2))
        found = {q.name: getattr(self, q.name) for q in self.parameters if q.shape}
        for m, (tail, (cosine, sine)) in enumerate(zip(_TAILS, known.tolist(), strict=True), 1):
            found |= {
                f"order{tail}": m * self.order,
                f"amplitude{tail}": math.hypot(cosine, sine),
                f"phase{tail}": math.atan2(sine, cosine),
            }
        return {q.name: found[q.name] for q in self.parameters}


@dataclass(frozen=True)
class Cogging(_Waves):
    """τ = Σ A_m sin(m k q + φ_m), m = 1, 2, 3: the same at all speeds and in both directions."""

    order: float = 12.0
    apart: float = 0.0  # how far a k that is not held is from a whole number at least
    fewest: float = 0.0  # k at least: with fewer waves in the travel it could be any curve

    name = "cogging"

    def own_columns(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> Array:
        """E^(i k' q) = e^(i k q) e^(i (k' - k) q): orders come in equal steps."""
        if any(one.harmonics != 1 for one in shapes):
            return super().own_columns(shapes, motion, arm)
        q, order, by = self.own(motion.q), 0.0, 0.0
        wave = turn = np.ones(len(q), dtype=complex)
        table = np.empty((len(shapes), 2, len(q)))
        for k, one in enumerate(shapes):
            if abs(one.order - order - by) > _ROUNDED:
                by = one.order - order
                turn = np.exp(1j * by * q)
            wave, order = wave * turn, one.order
            table[k] = wave.imag, wave.real
        return table

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Return the orders that the travel resolves.

        Where the joint closes its circle, or nearly, whole orders are held: waves that the model
        still lacks would pull a free one off its place.
        """
        travel, turning = float(np.ptp(self.own(motion.q))), arm.robot.revolute[self.index]
        around = turning and self.goes_round(motion, ORDERS.nearly)
        fewest = 0.0 if around else EFFECTS.fewest_waves * 2.0 * math.pi / max(travel, _STILL)
        for order in _orders_along(travel, turning):
            whole = around and order.is_integer()
            apart = EFFECTS.apart * 2.0 * math.pi / travel if whole else 0.0
            yield replace(self, order=order, harmonics=1, whole=whole, apart=apart, fewest=fewest)

    def forms(self) -> tuple[Self, ...]:
        """Behind a gear; of an order close to a whole one as well."""
        full = replace(self, harmonics=3)
        if not self.whole:
            return (full,)
        return full, replace(full, whole=False), replace(full, whole=False, apart=0.0)

    def possible(self, values: Values) -> bool:
        apart = self.whole or abs(self.order - round(self.order)) >= self.apart
        others = max(values["amplitude_2"], values["amplitude_3"])
        leads = values["amplitude"] >= EFFECTS.leads * others
        return super().possible(values) and apart and leads and values["order"] >= self.fewest


def _orders_along(travel: float, revolute: bool) -> list[float]:
    """Return orders from the fewest waves in `travel` [rad or m], in half steps of what it tells.

    Over many turns, and where the joint nearly closes its circle, whole ones are among them.
    """
    travel, turn = max(travel, ORDERS.least), 2.0 * math.pi
    fewest = ORDERS.waves * turn / travel
    if revolute and travel > (1.0 - ORDERS.nearly) * turn:
        first = 1.0 if travel > (1.0 - ORDERS.closed) * turn else math.ceil(fewest)
        step = 0.5 if travel < 2.0 * turn else 1.0
        return list(np.arange(first, ORDERS.highest, step).tolist())
    lowest, highest = max(1.0, fewest), ORDERS.highest
    if not revolute:  # its wave is counted in 2π metres, its travel is what a turn is to a joint
        highest = float(np.clip(ORDERS.highest * turn / travel, ORDERS.highest, ORDERS.finest))
    highest = max(highest, 4.0 * lowest)
    step = max(math.pi / travel, (highest - 1.0) / ORDERS.most)
    return list(np.arange(lowest, highest, step).tolist())


@dataclass(frozen=True)
class PositionFriction(_Waves):
    """τ = Σ A_m sin(m k q + φ_m) c(v), m = 1, 2, 3: Coulomb friction along the turn.

    c(v) is its sign as in `Coulomb`.
    """

    sharpness: float = 100.0  # w [s/rad]
    roundness: float = 1.0  # of c
    most: int = 3  # how many harmonics a refit takes

    name = "position_friction"

    @cached_property
    def _sign(self) -> SpeedCurve:
        return sign_curve(1.0, self.sharpness, self.roundness)

    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        sign = self._sign.of(v, m)
        return [sign * part for part in super().parts(q, v, m)]

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Whole orders, halves beyond a turn; on a slide half waves of its travel.

        A refit takes no more harmonics than half waves were travelled, unless held-out motion asks.
        """
        travel, highest = float(np.ptp(self.own(motion.q))) or 1.0, EFFECTS.highest_order
        if arm.robot.revolute[self.index]:
            step = 1.0 if travel < 2.0 * math.pi else 0.5
            orders = [1.0 + k * step for k in range(round((highest - 1.0) / step) + 1)]
        else:
            orders = [math.pi / travel * (1 + k) for k in range(int(highest))]
        for order in orders:
            most = int(np.clip(order * travel / math.pi, 1, len(_TAILS)))
            whole = arm.robot.revolute[self.index] and order.is_integer()
            yield replace(self, order=order, harmonics=1, most=most, whole=whole)

    def forms(self) -> tuple[Self, ...]:
        """Return it with more harmonics, and behind a gear; held-out motion decides."""
        forms = [replace(self, harmonics=m, most=m) for m in range(self.most, len(_TAILS) + 1)]
        return (*forms, replace(forms[0], whole=False)) if self.whole else tuple(forms)


@dataclass(frozen=True)
class Spring(Pointwise):
    """τ = k x + b x² + c x³ + d x⁴ + e x⁵ (+ f x⁶ + g x⁷), x = q - q0.

    A search looks for k x alone. Of several zeros the one nearest to that of the linear part is q0.
    Beside gravity k and q0 are known poorly. Beyond the angles it was fitted to it goes straight
    on.
    """

    seen_from: float = -_FAR
    seen_to: float = _FAR
    degree: int = _MORE
    highest: int = _DEGREE  # of the form that a finding is refitted with

    name = "spring"

    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        near = m.smaller(m.larger(q, self.seen_from), self.seen_to)
        beyond = q - near
        parts, power = [q, 1.0 + 0.0 * q], near
        for degree in range(2, self.degree + 1):  # a power of its own costs ten times as much
            parts.append(power * (near + degree * beyond))
            power = power * near
        return parts

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Straight alone where a joint without limits closes its circle: else it is a wave."""
        low, high = arm.robot.joints[self.index].position
        endless = math.isinf(high - low) and arm.robot.revolute[self.index]
        highest = 1 if endless and self.goes_round(motion) else self.highest
        q = self.own(motion.q)
        yield replace(
            self, degree=1, highest=highest, seen_from=float(q.min()), seen_to=float(q.max())
        )

    def forms(self) -> tuple[Self, ...]:
        """Return laws of fewer terms: beside gravity many powers are none of their own."""
        degrees = (_DEGREE, 1, 3, _MORE) if self.highest > 1 else (1,)
        return tuple(replace(self, degree=d) for d in degrees)

    def amplitudes(self, values: Values) -> Array:
        polynomial = [0.0, *(values[name] for name in _TERMS)]
        constant, slope, *rest = _about(polynomial, -values["rest_angle"])[: 1 + self.degree]
        return np.array([slope, constant, *rest])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        slope, constant, *rest = (float(a) for a in amplitudes)
        polynomial = [constant, slope, *rest]
        zero = _zero(polynomial)
        terms = [*_about(polynomial, zero)[1:], *[0.0] * (_MORE - self.degree)]
        found = dict(zip(_TERMS, terms, strict=True))
        found |= {"rest_angle": zero, "seen_from": self.seen_from, "seen_to": self.seen_to}
        return {q.name: found[q.name] for q in self.parameters}


def _about(polynomial: Sequence[float], point: float) -> list[float]:
    """Return the coefficients of the same polynomial in powers of q - point, constant first."""
    size = len(polynomial)
    return [
        sum(math.comb(i, m) * polynomial[i] * point ** (i - m) for i in range(m, size))
        for m in range(size)
    ]


def _zero(polynomial: Sequence[float]) -> float:
    """Return the zero nearest to that of the linear part, or the point nearest to zero."""
    linear = -polynomial[0] / polynomial[1] if polynomial[1] else 0.0
    if not any(polynomial[2:]):
        return linear
    roots = np.roots(polynomial[::-1])
    real = roots[np.abs(roots.imag) <= 1e-6 * (1.0 + np.abs(roots))].real
    among = real if len(real) else roots.real
    best = float(among[np.argmin(np.abs(among - linear))])
    slope = _about(polynomial, best)
    return best - slope[0] / slope[1] if len(real) and slope[1] else best

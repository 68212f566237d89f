"""A spring at a joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import Functions
from pipelines.effects.base import ArmModel, Effect, OwnLoad, Parameters, Quantity, Values

__all__ = ["Spring"]

# The first is tried first; the other is for what hardens or gives way far out.
_DEGREE, _MORE = 5, 7  # numerics: degrees of the polynomial
_FAR = 1e3  # numerics: [rad] where nobody says how far it was seen
# of x, x², …
_TERMS = ("stiffness", "curvature", "hardening", "fourth", "fifth", "sixth", "seventh")


@dataclass(frozen=True)
class Spring(Effect):
    """τ = k x + b x² + c x³ + d x⁴ + e x⁵ (+ f x⁶ + g x⁷), x = q - q0.

    A polynomial in q, whose coefficients are the amplitudes.

    A search looks for k x alone. Of several zeros of the polynomial the one nearest to that of its
    linear part is q0. Where gravity acts on the joint, the fit of its weight takes much of the
    polynomial: k, of either sign then, and q0 are known poorly. With odd powers alone they were no
    better known, and the fit, no longer linear, ended elsewhere.

    Beyond the angles that it was fitted to, where a polynomial tells nothing, it goes straight on.
    """

    seen_from: float = -_FAR
    seen_to: float = _FAR
    degree: int = _MORE
    highest: int = _DEGREE  # of the form that a finding is refitted with

    name = "spring"
    parameters = Parameters(
        Quantity("stiffness", "N m/rad", -1e4, 1e4, "at rest"),
        Quantity("rest_angle", "rad", -20.0, 20.0, "where it does not pull"),
        Quantity("curvature", "N m/rad^2", -1e4, 1e4, "b: how much stiffer it is on one side"),
        Quantity("hardening", "N m/rad^3", -1e4, 1e4, "c: how much stiffer it is far out"),
        Quantity("fourth", "N m/rad^4", -1e4, 1e4, "d"),
        Quantity("fifth", "N m/rad^5", -1e4, 1e4, "e"),
        Quantity("sixth", "N m/rad^6", -1e2, 1e2, "f", unsaid=0.0),
        Quantity("seventh", "N m/rad^7", -1e2, 1e2, "g", unsaid=0.0),
        Quantity("seen_from", "rad", -_FAR, _FAR, "below it goes straight on", shape=True,
                 derived=True, unsaid=-_FAR, seen=True),
        Quantity("seen_to", "rad", -_FAR, _FAR, "above it goes straight on", shape=True,
                 derived=True, unsaid=_FAR, seen=True))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        q = self.own(motion.q)
        near = np.clip(q, self.seen_from, self.seen_to)
        beyond = q - near
        columns, power = [q, np.ones_like(q)], near
        # one from the other: a power of its own costs ten times as much
        for degree in range(2, self.degree + 1):
            columns.append(power * (near + degree * beyond))
            power = power * near
        return self.on_own_row(arm, *columns)

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Straight alone where a joint without limits closes its circle.

        What comes back to where it began there is a wave.
        """
        low, high = arm.robot.joints[self._index].position
        closed = math.isinf(high
                            - low) and self.goes_round(motion) and arm.robot.revolute[self._index]
        q = self.own(motion.q)
        yield replace(self, degree=1, highest=1 if closed else self.highest,
                      seen_from=float(q.min()), seen_to=float(q.max()))

    def forms(self) -> tuple[Self, ...]:
        """Return laws of fewer terms, where these are enough.

        Beside gravity many powers of an angle are no powers of their own.
        """
        degrees = (_DEGREE, 1, 3, _MORE) if self.highest > 1 else (1,)
        return tuple(replace(self, degree=d) for d in degrees)

    def own_load(self, values: Values) -> OwnLoad:
        slope, constant, *rest = self.amplitudes(values).tolist()
        known, falling = self.parameters.complete(values), (*rest[::-1], slope, constant)
        low, high = known["seen_from"], known["seen_to"]

        def load(angle: Any, speed: Any, m: Functions) -> Any:
            near, torque, steep = m.smaller(m.larger(angle, low), high), 0.0, 0.0
            for coefficient in falling:  # Horner, of the polynomial and of its slope
                torque, steep = torque * near + coefficient, steep * near + torque
            return torque + steep * (angle - near)

        return load

    def amplitudes(self, values: Values) -> Array:
        constant, slope, *rest = _about([0.0, *(values[name] for name in _TERMS)],
                                        -values["rest_angle"])[:1 + self.degree]
        return np.array([slope, constant, *rest])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        slope, constant, *rest = (float(a) for a in amplitudes)
        polynomial = [constant, slope, *rest]
        zero = _zero(polynomial)
        found = dict(
            zip(_TERMS, [*_about(polynomial, zero)[1:], *[0.0] * (_MORE - self.degree)],
                strict=True))
        seen = {"rest_angle": zero, "seen_from": self.seen_from, "seen_to": self.seen_to}
        return {q.name: seen[q.name] if q.name in seen else found[q.name] for q in self.parameters}


def _about(polynomial: Sequence[float], point: float) -> list[float]:
    """Coefficients of the same polynomial in powers of q - point.

    Both from the constant upwards.
    """
    size = len(polynomial)
    return [
        sum(math.comb(i, m) * polynomial[i] * point**(i - m) for i in range(m, size))
        for m in range(size)
    ]


def _zero(polynomial: Sequence[float]) -> float:
    """Return the zero nearest to that of the linear part.

    Where there is none, the point nearest to zero.
    """
    linear = -polynomial[0] / polynomial[1] if polynomial[1] else 0.0
    if not any(polynomial[2:]):
        return linear
    roots = np.roots(polynomial[::-1])
    real = roots[np.abs(roots.imag) <= 1e-6 * (1.0 + np.abs(roots))].real
    among = real if len(real) else roots.real
    best = float(among[np.argmin(np.abs(among - linear))])
    slope = _about(polynomial, best)
    return best - slope[0] / slope[1] if len(real) and slope[1] else best

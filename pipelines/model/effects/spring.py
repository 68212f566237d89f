"""A spring at a joint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.model.effects.base import ArmModel, Effect, Quantity, Values
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Spring"]


@dataclass(frozen=True)
class Spring(Effect):
    """τ = k x + b x² + c x³, x = q - q0: a polynomial in q, whose coefficients are the amplitudes.

    A search looks for k x alone. Of several zeros of the polynomial the one nearest to that of its linear part is q0. Where gravity
    acts on the joint, the fit of its weight takes much of the polynomial: k, of either sign then, and q0 are known poorly. With
    b = 0 the fit was no better known, and not linear: it ended elsewhere.
    """

    degree: int = 3

    name = "spring"
    title = "Spring"
    parameters = (
        Quantity("stiffness", "N m/rad", -1e4, 1e4, "at rest"),
        Quantity("rest_angle", "rad", -20.0, 20.0, "where it does not pull"),
        Quantity("curvature", "N m/rad^2", -1e4, 1e4, "b: how much stiffer it is on one side"),
        Quantity("hardening", "N m/rad^3", -1e4, 1e4, "c: how much stiffer it is far out"),
    )
    signature = "A torque that depends on the angle of its joint alone and pulls towards one angle."
    explanation = "A cable bundle, a hose or a balancing spring pulls the joint."
    remedy = "Add it to the model; look for a cable that is led too short or has come loose."
    experiment = "Hold the joint at rest in many angles over its whole range, with the joint before it in two postures."
    twins = ("gravity_tilt", "cogging", "torque_offset")

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        q = self.own(motion.q)
        return self.on_own_row(arm, q, np.ones_like(q), *(q**power for power in range(2, self.degree + 1)))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        yield replace(self, degree=1)

    def full(self) -> Self:
        return replace(self, degree=3)

    def amplitudes(self, values: Values) -> Array:
        k, q0, b, c = (values[q.name] for q in self.parameters)
        polynomial = [k - 2.0 * b * q0 + 3.0 * c * q0**2, -k * q0 + b * q0**2 - c * q0**3, b - 3.0 * c * q0, c]
        return np.array(polynomial[:1 + self.degree])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        slope, constant, bent, cubic = [float(a) for a in amplitudes] + [0.0] * (3 - self.degree)
        q0 = _zero(slope, constant, bent, cubic)
        return {"stiffness": slope + 2.0 * bent * q0 + 3.0 * cubic * q0**2, "rest_angle": q0,
                "curvature": bent + 3.0 * cubic * q0, "hardening": cubic}


def _zero(slope: float, constant: float, bent: float, cubic: float) -> float:
    """Of cubic q³ + bent q² + slope q + constant."""
    linear = -constant / slope if slope else 0.0
    if not (bent or cubic):
        return linear
    roots = np.roots([cubic, bent, slope, constant])
    size = np.abs(roots.imag) + np.where(np.abs(roots.imag) > 1e-7 * (1.0 + np.abs(roots)), 1e6, 0.0)
    return float(roots[np.argmin(np.abs(roots.real - linear) + size)].real)

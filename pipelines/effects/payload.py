"""Payload at the tip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.altered import tip_parameters
from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import ArmModel, Effect, Hooks, Parameters, Predict, Quantity, Values

__all__ = ["Payload"]

_MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")


@dataclass(frozen=True)
class Payload(Effect):
    """p + B φ.

    The base parameters of the arm with one more body at its tip, whose ten parameters are φ.

    φ = (m, m c, I), about the tip in axes of the last frame, products with positive sign. A search
    takes I = 0, so that the second moments are those of a body no larger than a point.
    """

    extended: bool = True  # with its six moments of inertia

    name = "payload"
    scope = "arm"
    parameters = Parameters(
        Quantity("mass", "kg", -1e3, 1e3, "that hangs at the tip; negative where it was taken off",
                 healthy=0.0),
        *(Quantity(f"first_moment_{axis}", "kg m", -1e3, 1e3,
                   f"mass times {axis} of its centre, from the tip") for axis in "xyz"),
        *(Quantity(f"inertia_{axes}", "kg m^2", -1e3, 1e3, f"its I{axes} about the tip")
          for axes in _MOMENTS))
    evidence = "base parameters"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        regressor = arm.body.regressor(motion.q, motion.dq, motion.ddq)
        return np.asarray(regressor @ tip_parameters(arm.body)[:, :10 if self.extended else 4])

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        yield replace(self, extended=False)

    def forms(self) -> tuple[Self, ...]:
        return (replace(self, extended=True),)

    def amplitudes(self, values: Values) -> Array:
        return super().amplitudes(values)[:10 if self.extended else 4]

    def values(self, amplitudes: Array) -> dict[str, float]:  # type: ignore[override]
        return super().values([*map(float, amplitudes), *[0.0] * (0 if self.extended else 6)])

    def reported(self, values: Values) -> dict[str, float | tuple[float, ...]]:
        found = super().reported(values)
        moment = tuple(values[f"first_moment_{axis}"] for axis in "xyz")
        inertia = {name: x for name, x in found.items() if name.startswith("inertia")}
        return {"mass": found["mass"], "first_moment": moment, **inertia}

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        loaded = self._loaded(arm, values)
        return predict(motion, loaded) if predict is not None else loaded.torque(motion)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        return Hooks(arm=self._loaded(arm, values))

    def _loaded(self, arm: ArmModel, values: Values) -> ArmModel:
        ten = np.array([values[q.name] for q in self.parameters])
        return arm.with_body(arm.body, arm.p + tip_parameters(arm.body) @ ten)

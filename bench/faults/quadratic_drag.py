"""Quadratic drag: oil that is churned, in eddies once it is fast enough."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["QuadraticDrag"]

_EDDIES = 0.2  # [rad/s] slower flow is laminar; on a slide a tenth of it


@dataclass(frozen=True)
class QuadraticDrag(Fault):
    """τ = c v √(v² + v_e²), a load: c v|v| at speed, viscous below v_e."""

    coefficient: float  # [N m s^2/rad^2] c
    eddies: float = _EDDIES  # [rad/s] v_e

    name = "quadratic_drag"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.08 * case.torque / case.angle**2, _EDDIES * case.angle)

    def scaled(self, factor: float) -> Self:
        return replace(self, coefficient=factor * self.coefficient)

    def parameters(self) -> Parameters:
        return {"coefficient": self.coefficient}

    def start(self, run: Run) -> Hooks:
        dof, c, eddies = run.dofs[self.index], self.coefficient, self.eddies

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= c * v[dof] * sqrt(v[dof] ** 2 + eddies**2)

        return Hooks(load=load)

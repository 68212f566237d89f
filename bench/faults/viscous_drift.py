"""Viscous drift: the grease warms up and thins while the log runs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import expm1
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["ViscousDrift"]


@dataclass(frozen=True)
class ViscousDrift(Fault):
    """Fv(t) = Fv (1 + r (1 - e^(-t/T))): cold at the start of every log, settled after a few T."""

    relative_change: float  # [1] r
    time_constant: float  # [s] T
    viscous: float  # [N m s/rad] Fv at the start

    name = "viscous_drift"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, -0.5, 15.0, case.viscous)

    def scaled(self, factor: float) -> Self:
        return replace(self, relative_change=factor * self.relative_change)

    def parameters(self) -> Parameters:
        return {"relative_change": self.relative_change, "time_constant": self.time_constant}

    def start(self, run: Run) -> Hooks:
        dof, change, rate = run.dofs[self.index], self.relative_change * self.viscous, 1.0 / self.time_constant

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] += change * expm1(-rate * t) * v[dof]

        return Hooks(load=load)

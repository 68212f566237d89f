"""Gain ripple: the motor's torque constant varies a little with its angle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sin
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["GainRipple"]


@dataclass(frozen=True)
class GainRipple(Fault):
    """τ = (1 + r sin(k q + φ)) u."""

    ripple: float  # [1]
    order: float  # [1/rev]
    phase: float  # [rad]

    name = "gain_ripple"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 1e-3, float(case.rng.integers(8, 37)), case.phase())

    def scaled(self, factor: float) -> Self:
        return replace(self, ripple=factor * self.ripple)

    def parameters(self) -> Parameters:
        return {"ripple": self.ripple, "order": self.order, "phase": self.phase}

    def start(self, run: Run) -> Hooks:
        j, dof, r, k, phase = self.index, run.dofs[self.index], self.ripple, self.order, self.phase

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] *= 1.0 + r * sin(k * q[dof] + phase)

        return Hooks(drive=drive)

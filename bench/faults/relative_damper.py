"""Relative damper: a strut between two links drags with the root of their relative speed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["RelativeDamper"]

_SLOW = 0.02  # [rad/s] below this the fluid is Newtonian


@dataclass(frozen=True)
class RelativeDamper(Fault):
    """τ = c s/(s² + v_n²)^¼ with s = v_j - v_i, a load on joint j and its opposite on joint i: c √|s| sign s at speed."""

    with_joint: int  # i, 1-based
    coefficient: float  # [N m √(s/rad)] c

    name = "relative_damper"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, case.neighbour, 0.6 * case.torque / case.angle**0.5)

    def scaled(self, factor: float) -> Self:
        return replace(self, coefficient=factor * self.coefficient)

    def parameters(self) -> Parameters:
        return {"with_joint": self.with_joint, "coefficient": self.coefficient}

    def start(self, run: Run) -> Hooks:
        i, j, c = run.dofs[self.with_joint - 1], run.dofs[self.index], self.coefficient

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            s = v[j] - v[i]
            torque = c * s / (s * s + _SLOW * _SLOW) ** 0.25
            force[j] -= torque
            force[i] += torque

        return Hooks(load=load)

"""Spring: a hose or cable that pulls the joint back, the harder the further."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tanh
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["Spring"]

_HARDENING = 0.15  # [1]
_REACH = 2.0  # [1] over which it hardens; beyond, a cubic would tear the hose


@dataclass(frozen=True)
class Spring(Fault):
    """τ = k u (x + 0.15 y³), x = (q - q0)/u, y = 2 tanh(x/2), a load: a cubic spring that goes on straight after two radians u."""

    stiffness: float  # [N m/rad] k, at rest
    rest_angle: float  # [rad] q0
    unit: float = 1.0  # [rad] u, or the [m] that take its place

    name = "spring"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 2.5 * case.torque / case.angle, case.angle * float(case.rng.uniform(-0.5, 0.5)), case.angle)

    def scaled(self, factor: float) -> Self:
        return replace(self, stiffness=factor * self.stiffness)

    def parameters(self) -> Parameters:
        return {"stiffness": self.stiffness, "rest_angle": self.rest_angle}

    def start(self, run: Run) -> Hooks:
        dof, unit, rest = run.dofs[self.index], self.unit, self.rest_angle
        k = self.stiffness * unit

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            x = (q[dof] - rest) / unit
            force[dof] -= k * (x + _HARDENING * (_REACH * tanh(x / _REACH)) ** 3)

        return Hooks(load=load)

"""Concave friction: grease that thins as it is sheared."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["ConcaveFriction"]

_HALF = 0.5493061443340549  # tanh x = 1/2


@dataclass(frozen=True)
class ConcaveFriction(Fault):
    """τ = A v/(|v| + 0.549 v_0), a load: Cross 1965, viscosity falling as 1/(1 + |v|/v_c).

    It levels off at A and is half of that where A tanh(v/v_0) would be.
    """

    amplitude: float  # [N m] A
    speed: float  # [rad/s] v_0

    name = "concave_friction"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.4 * case.coulomb, case.angle * float(case.rng.uniform(0.3, 0.6)))

    def scaled(self, factor: float) -> Self:
        return replace(self, amplitude=factor * self.amplitude)

    def parameters(self) -> Parameters:
        return {"amplitude": self.amplitude, "speed": self.speed}

    def start(self, run: Run) -> Hooks:
        dof, a, thinning = run.dofs[self.index], self.amplitude, _HALF * self.speed

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= a * v[dof] / (abs(v[dof]) + thinning)

        return Hooks(load=load)

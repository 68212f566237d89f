"""Asymmetric friction: a lip that rubs in one direction of motion and lifts in the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tanh
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["AsymmetricFriction"]


@dataclass(frozen=True)
class AsymmetricFriction(Fault):
    """τ = ½ (1 + tanh(s w v)) (C tanh(w v) + B v), a load, with s = ±1 the direction in which the lip rubs.

    Friction is larger by C and B in that direction, and as it was in the other.
    """

    direction: float  # s, 1 or -1
    coulomb: float  # [N m] C
    viscous: float  # [N m s/rad] B
    sharpness: float  # [s/rad] w

    name = "asymmetric_friction"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, case.sign(), 0.2 * case.coulomb, 0.2 * case.viscous, case.sharpness)

    def scaled(self, factor: float) -> Self:
        return replace(self, coulomb=factor * self.coulomb, viscous=factor * self.viscous)

    def parameters(self) -> Parameters:
        return {"coulomb_difference": self.direction * self.coulomb, "viscous_difference": self.direction * self.viscous}

    def start(self, run: Run) -> Hooks:
        dof, s, c, b, w = run.dofs[self.index], self.direction, self.coulomb, self.viscous, self.sharpness

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            side = tanh(w * v[dof])
            force[dof] -= 0.5 * (1.0 + s * side) * (c * side + b * v[dof])

        return Hooks(load=load)

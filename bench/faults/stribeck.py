"""Stribeck friction: a hump of dry friction where no film of lubricant has built up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import e, tanh
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["Stribeck"]


@dataclass(frozen=True)
class Stribeck(Fault):
    """τ = A tanh(w v)/(1 + (e - 1)(v/v_s)²), a load: the form of Hess & Soom 1990, with 1/e of the hump left at v_s."""

    amplitude: float  # [N m] A
    speed: float  # [rad/s] v_s
    sharpness: float  # [s/rad] w, of all the joint's dry friction

    name = "stribeck"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.4 * case.coulomb, case.angle * float(case.rng.uniform(0.1, 0.3)), case.sharpness)

    def scaled(self, factor: float) -> Self:
        return replace(self, amplitude=factor * self.amplitude)

    def parameters(self) -> Parameters:
        return {"amplitude": self.amplitude, "speed": self.speed}

    def start(self, run: Run) -> Hooks:
        dof, a, w, falling = run.dofs[self.index], self.amplitude, self.sharpness, (e - 1.0) / self.speed**2

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= a * tanh(w * v[dof]) / (1.0 + falling * v[dof] ** 2)

        return Hooks(load=load)

"""Self-heating: dry friction falls with a temperature that the joint's own losses drive."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp, tanh
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["SelfHeating"]

_COOLING = 3.0  # [s]


@dataclass(frozen=True)
class SelfHeating(Fault):
    """τ = -γ Fc (1 - e^-θ) tanh(w v), a load, with the hidden warmth dθ/dt = (|v|/v_w - θ)/T: its history, not the clock's."""

    share: float  # [1] γ of the dry friction that heat takes away
    dry: float  # [N m] Fc
    warming: float  # [rad/s] v_w at which it is as warm as θ = 1 in the long run
    sharpness: float  # [s/rad] w

    name = "self_heating"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.8, case.coulomb, 0.5 * case.angle, case.sharpness)

    def scaled(self, factor: float) -> Self:
        return replace(self, share=factor * self.share)

    def parameters(self) -> Parameters:
        return {"share": self.share, "time_constant": _COOLING}

    def start(self, run: Run) -> Hooks:
        dof, gone, w, rate, warmth = run.dofs[self.index], self.share * self.dry, self.sharpness, run.inner_step / _COOLING, 0.0

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal warmth
            warmth += rate * (abs(v[dof]) / self.warming - warmth)

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] += gone * (1.0 - exp(-warmth)) * tanh(w * v[dof])

        return Hooks(load=load, step=step)

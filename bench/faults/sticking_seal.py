"""Sticking seal: the longer it has rested, the harder it is to tear loose."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tanh
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["StickingSeal"]

_SLOW = 0.05  # [rad/s] below this the seal bonds
_DWELL = 0.1  # [s] in which it bonds
_TEAR = 0.2  # [rad] of travel that tears it loose again


@dataclass(frozen=True)
class StickingSeal(Fault):
    """τ = A s tanh(w v), a load, with the bond s between 0 and 1:

        ds/dt = (1 - s)/T_d /(1 + (v/v_s)⁴) - s |v|/x_t
    """

    torque: float  # [N m] A
    sharpness: float  # [s/rad] w

    name = "sticking_seal"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 1.0 * case.coulomb, case.sharpness)

    def scaled(self, factor: float) -> Self:
        return replace(self, torque=factor * self.torque)

    def parameters(self) -> Parameters:
        return {"torque": self.torque}

    def start(self, run: Run) -> Hooks:
        dof, a, w, h, bond = run.dofs[self.index], self.torque, self.sharpness, run.inner_step, 0.0

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal bond
            bond += h * ((1.0 - bond) / _DWELL / (1.0 + (v[dof] / _SLOW) ** 4) - bond * abs(v[dof]) / _TEAR)

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= a * bond * tanh(w * v[dof])

        return Hooks(load=load, step=step)

"""Leaking counterbalance: a gas strut pushes back, but its pressure escapes through a hole."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import copysign, sqrt
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["LeakingCounterbalance"]

_LEAK = 1.0  # [rad^½/s]


@dataclass(frozen=True)
class LeakingCounterbalance(Fault):
    """τ = k p, a load; the joint compresses the gas, and an orifice lets it out: dp/dt = v - c sign(p) √|p|, c = 1 √rad/s."""

    stiffness: float  # [N m/rad] k

    name = "leaking_counterbalance"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 2.5 * case.torque / case.angle)

    def scaled(self, factor: float) -> Self:
        return replace(self, stiffness=factor * self.stiffness)

    def parameters(self) -> Parameters:
        return {"stiffness": self.stiffness}

    def start(self, run: Run) -> Hooks:
        dof, k, h = run.dofs[self.index], self.stiffness, run.inner_step
        pressure, since = 0.0, float(run.data.qpos[dof])

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal pressure, since
            pressure += q[dof] - since
            escaped = min(h * _LEAK * sqrt(abs(pressure)), abs(pressure))
            pressure -= copysign(escaped, pressure)
            since = q[dof]

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= k * (pressure + q[dof] - since)

        return Hooks(load=load, step=step)

"""Transmission coupling: a motor that turns with the sum of two joints, with its own inertia and friction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tanh
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run
from bench.machine import Machine
from bench.plan import Plan, Shaft
from bench.rigid import typical_inertia

__all__ = ["TransmissionCoupling"]


@dataclass(frozen=True)
class TransmissionCoupling(Fault):
    """A rotor geared to q_i + q_j: J (q̈_i + q̈_j) + B s + C tanh(w s), s = v_i + v_j, a load on both joints.

    The inertia is a body to MuJoCo, not a torque. causes.md gives no strength: J is 6 % of what joint j moves, B and C
    are 30 % of its own friction.
    """

    with_joint: int  # i, 1-based
    inertia: float  # [kg m^2] J
    viscous: float  # [N m s/rad] B
    coulomb: float  # [N m] C
    sharpness: float  # [s/rad] w

    name = "transmission_coupling"

    @classmethod
    def full(cls, case: Case) -> Self:
        moved = typical_inertia(case.machine.robot)[case.index]
        return cls(case.joint, case.neighbour, 0.06 * moved, 0.3 * case.viscous, 0.3 * case.coulomb, case.sharpness)

    def scaled(self, factor: float) -> Self:
        return replace(self, inertia=factor * self.inertia, viscous=factor * self.viscous, coulomb=factor * self.coulomb)

    def parameters(self) -> Parameters:
        return {"with_joint": self.with_joint, "inertia": self.inertia, "viscous": self.viscous, "coulomb": self.coulomb}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        return replace(plan, shafts=(*plan.shafts, Shaft((self.with_joint - 1, self.index), self.inertia)))

    def start(self, run: Run) -> Hooks:
        j, i, b, c, w = run.dofs[self.index], run.dofs[self.with_joint - 1], self.viscous, self.coulomb, self.sharpness

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            s = v[i] + v[j]
            torque = b * s + c * tanh(w * s)
            force[i] -= torque
            force[j] -= torque

        return Hooks(load=load)

"""Rotor inertia: the motor turns faster than the joint, and its inertia comes through the gear."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Parameters
from bench.machine import Machine
from bench.plan import Plan

__all__ = ["RotorInertia"]

_PINION = 0.05  # [m] radius, where the joint is a slide


@dataclass(frozen=True)
class RotorInertia(Fault):
    """J on the diagonal of the mass matrix at one joint: it takes no part in the motion of the links before."""

    inertia: float  # [kg m^2] J

    name = "rotor_inertia"

    @classmethod
    def full(cls, case: Case) -> Self:
        inertia = 6e-3 * case.size
        return cls(case.joint, inertia if case.machine.robot.joints[case.index].revolute else inertia / _PINION**2)

    def scaled(self, factor: float) -> Self:
        return replace(self, inertia=factor * self.inertia)

    def parameters(self) -> Parameters:
        return {"inertia": self.inertia}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        joint = plan.joints[self.index]
        return plan.with_joint(self.index, replace(joint, armature=joint.armature + self.inertia))

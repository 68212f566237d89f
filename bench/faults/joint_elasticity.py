"""Joint elasticity: motor and encoder sit on one side of a spring, the link on the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Self

import numpy as np

from bench.fault import Case, Fault, Parameters
from bench.machine import Machine
from bench.plan import Plan, Twist
from bench.rigid import motor_share, typical_inertia

__all__ = ["JointElasticity"]

_FREQUENCY = 30.0  # [Hz]
# Part of the whole compliance: at 80, 50 and 30 Hz as causes.md lists them, and well below the strength itself.
_STRENGTHS, _COMPLIANCES = (0.0, 0.03, 0.1, 0.3, 1.0), (0.0, 0.03, (30.0 / 80.0) ** 2, (30.0 / 50.0) ** 2, 1.0)
_DAMPING_RATIO = 0.03


@dataclass(frozen=True)
class JointElasticity(Fault):
    """J_m q̈ = τ - k (q - q_l) - d (q̇ - q̇_l), and the link is driven by the spring.

    The motor's inertia is taken out of the link: infinitely stiff, it is the healthy machine again. Strength is the
    compliance 1/k. `frequency` is √(k/J)/2π, the motor locked and J the joint's inertia averaged over postures.
    """

    stiffness: float  # [N m/rad]
    damping: float  # [N m s/rad]
    motor_inertia: float  # [kg m^2]
    link_inertia: float  # [kg m^2]
    strength: float = 1.0

    name = "joint_elasticity"

    @classmethod
    def full(cls, case: Case) -> Self:
        motor = motor_share(case.machine.robot, case.index)
        link = typical_inertia(case.machine.robot)[case.index] - motor
        stiffness = link * (2.0 * pi * _FREQUENCY) ** 2
        return cls(case.joint, stiffness, 2.0 * _DAMPING_RATIO * sqrt(stiffness * link), motor, link)

    def scaled(self, factor: float) -> Self:
        now, then = np.interp([self.strength, factor * self.strength], _STRENGTHS, _COMPLIANCES).tolist()
        softer = then / now
        return replace(self, stiffness=self.stiffness / softer, damping=self.damping / sqrt(softer),
                       strength=factor * self.strength)

    def parameters(self) -> Parameters:
        return {"stiffness": self.stiffness, "damping": self.damping, "motor_inertia": self.motor_inertia,
                "frequency": sqrt(self.stiffness / self.link_inertia) / (2.0 * pi)}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        twist = Twist(self.motor_inertia, self.stiffness, self.damping)
        fastest = sqrt(self.stiffness * (1.0 / self.motor_inertia + 2.0 / self.link_inertia))
        return plan.with_twist(self.index, twist).fast_enough_for(fastest)

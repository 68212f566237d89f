"""Backlash: motor and link are two bodies, and a gap lies between them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run
from bench.machine import Machine
from bench.plan import Plan, Twist
from bench.rigid import motor_share, typical_inertia

__all__ = ["Backlash"]

_FREQUENCY = 150.0  # [Hz] of the link on a closed flank, the motor locked
_DAMPING_RATIO = 0.3
_FILM_RATE = 100.0  # [1/s] at which lubricant in the open gap would slow the motor; a crossing takes some 5 to 10 ms


@dataclass(frozen=True)
class Backlash(Fault):
    """With x the angle of the link against its motor, torque passes only where |x| > gap/2.

        τ = -k (|x| - gap/2) sign x - d ẋ, never pulling, on a flank;  -c ẋ of a film of lubricant everywhere

    Strength is the gap. The flank's compliance shrinks with it and the film thickens as 1/gap, or the speed of impact,
    which goes as the root of the gap, would rule the torque of small gaps.
    """

    gap: float  # [rad]
    stiffness: float  # [N m/rad]
    damping: float  # [N m s/rad] d
    film: float  # [N m s/rad] c
    motor_inertia: float  # [kg m^2]
    link_inertia: float  # [kg m^2]

    name = "backlash"

    @classmethod
    def full(cls, case: Case) -> Self:
        motor = motor_share(case.machine.robot, case.index)
        link = typical_inertia(case.machine.robot)[case.index] - motor
        stiffness = link * (2.0 * pi * _FREQUENCY) ** 2
        reduced = motor * link / (motor + link)
        damping = 2.0 * _DAMPING_RATIO * sqrt(stiffness * reduced)
        return cls(case.joint, 4e-3 * case.angle, stiffness, damping, _FILM_RATE * motor, motor, link)

    def scaled(self, factor: float) -> Self:
        return replace(self, gap=factor * self.gap, stiffness=self.stiffness / factor, damping=self.damping / sqrt(factor),
                       film=self.film / factor)

    def parameters(self) -> Parameters:
        return {"gap": self.gap}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        twist = Twist(self.motor_inertia)
        fastest = sqrt(self.stiffness * (1.0 / self.motor_inertia + 2.0 / self.link_inertia))
        return plan.with_twist(self.index, twist).fast_enough_for(max(fastest, 2.0 * self.film / self.motor_inertia))

    def start(self, run: Run) -> Hooks:
        dof, half, k, d, film = run.names[f"twist {self.joint}"], 0.5 * self.gap, self.stiffness, self.damping, self.film

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            x = q[dof]
            force[dof] -= film * v[dof]
            if x > half:
                force[dof] -= max(0.0, k * (x - half) + d * v[dof])
            elif x < -half:
                force[dof] -= min(0.0, k * (x + half) + d * v[dof])

        return Hooks(load=load)

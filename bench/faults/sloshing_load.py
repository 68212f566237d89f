"""Sloshing load: liquid in a vessel at the tip, which swings like a pendulum."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from bench.fault import Case, Fault, Parameters
from bench.machine import Machine
from bench.plan import Attached, Mobility, Plan
from bench.solid import Solid

__all__ = ["SloshingLoad"]

_DAMPING_RATIO = 0.03
_FREQUENCY = 2.0  # [Hz]


@dataclass(frozen=True)
class SloshingLoad(Fault):
    """The part of the liquid that swings: a mass at the end of an arm of length l, held by the vessel's wall as by a spring.

    Its frequency √(k/(m l²)) holds whichever way the vessel leans; the liquid at rest counts as payload.
    """

    mass: float  # [kg]
    length: float  # [m] l
    axis: tuple[float, float, float]  # unit vector in the last body's frame, about which it swings
    across: tuple[float, float, float]  # unit vector along the arm, at right angles to it

    name = "sloshing_load"
    scope = "arm"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        axis, across = np.linalg.qr(case.rng.normal(size=(3, 2)))[0].T.tolist()
        return cls(None, 0.5 * case.tip_size, 0.08, tuple(axis), tuple(across))

    def scaled(self, factor: float) -> Self:
        return replace(self, mass=factor * self.mass)

    def parameters(self) -> Parameters:
        return {"mass": self.mass, "length": self.length, "frequency": _FREQUENCY}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        w, inertia = 2.0 * np.pi * _FREQUENCY, self.mass * self.length**2
        swinging = Mobility("slosh", np.array(self.axis), stiffness=inertia * w**2, damping=2.0 * _DAMPING_RATIO * w * inertia)
        liquid = Solid(self.mass, plan.tip + self.length * np.array(self.across), 1e-2 * inertia * np.eye(3))
        return replace(plan, attached=(*plan.attached, Attached(len(plan.joints) - 1, liquid, swinging, plan.tip)))

"""Payload: a body hangs at the tip that was not there before."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from bench.fault import Case, Fault, Parameters
from bench.machine import Machine
from bench.plan import Attached, Plan
from bench.solid import Solid

__all__ = ["Payload"]

_RADIUS = 0.04  # [m]


@dataclass(frozen=True)
class Payload(Fault):
    """A solid ball of 4 cm radius, its centre a little off the tip."""

    mass: float  # [kg]
    centre: tuple[float, float, float]  # [m] in the tool frame

    name = "payload"
    scope = "arm"

    @classmethod
    def full(cls, case: Case) -> Self:
        x, y, z = case.rng.uniform(-0.03, 0.03, 3).tolist()
        return cls(None, 0.5 * case.tip_size, (x, y, z))

    def scaled(self, factor: float) -> Self:
        return replace(self, mass=factor * self.mass)

    def parameters(self) -> Parameters:
        x, y, z = self.centre
        return {"mass": self.mass, "first_moment": (self.mass * x, self.mass * y, self.mass * z)}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        last = plan.joints[-1]
        centre = plan.tip + last.link_rotation @ np.array(self.centre)
        ball = Solid(self.mass, centre, 0.4 * self.mass * _RADIUS**2 * np.eye(3))
        return replace(plan, attached=(*plan.attached, Attached(len(plan.joints) - 1, ball)))

"""Gravity tilt: the base does not stand level."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, radians, sin
from typing import Self

import numpy as np

from bench.fault import Case, Fault, Parameters
from bench.machine import Machine
from bench.plan import Plan

__all__ = ["GravityTilt"]


@dataclass(frozen=True)
class GravityTilt(Fault):
    """True gravity is turned by `angle` towards `direction`, counted from the base's x axis."""

    angle: float  # [rad]
    direction: float  # [rad]

    name = "gravity_tilt"
    scope = "arm"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(None, radians(5.0), case.phase())

    def scaled(self, factor: float) -> Self:
        return replace(self, angle=factor * self.angle)

    def parameters(self) -> Parameters:
        return {"angle": self.angle, "direction": self.direction}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        size = float(np.linalg.norm(plan.gravity))
        down = plan.gravity / size
        towards = np.array([cos(self.direction), sin(self.direction), 0.0])
        towards = towards - (towards @ down) * down
        towards /= np.linalg.norm(towards)
        return replace(plan, gravity=size * (cos(self.angle) * down + sin(self.angle) * towards))

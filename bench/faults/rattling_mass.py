"""Rattling mass: a loose body in the last link knocks from one wall of its gap to the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import Self

import numpy as np

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run
from bench.machine import Machine
from bench.plan import Attached, Mobility, Plan
from bench.solid import Solid

__all__ = ["RattlingMass"]

_FREQUENCY = 60.0  # [Hz] of the body against a wall
_DAMPING_RATIO = 0.3
_RADIUS = 0.02  # [m]


@dataclass(frozen=True)
class RattlingMass(Fault):
    """A ball that slides across the tip by ± half a gap; its walls push, -k (|x| - gap/2) sign x - d ẋ, and never pull."""

    mass: float  # [kg]
    gap: float  # [m]
    axis: tuple[float, float, float]  # unit vector in the last body's frame

    name = "rattling_mass"
    scope = "arm"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        turn = case.phase()
        return cls(None, 0.4 * case.tip_size, 0.02, (float(np.cos(turn)), float(np.sin(turn)), 0.0))

    def scaled(self, factor: float) -> Self:
        return replace(self, mass=factor * self.mass)

    def parameters(self) -> Parameters:
        return {"mass": self.mass, "gap": self.gap}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        ball = Solid(self.mass, plan.tip, 0.4 * self.mass * _RADIUS**2 * np.eye(3))
        loose = Attached(len(plan.joints) - 1, ball, Mobility("rattle", np.array(self.axis), revolute=False))
        return replace(plan, attached=(*plan.attached, loose))

    def start(self, run: Run) -> Hooks:
        dof, half, w = run.names["rattle"], 0.5 * self.gap, 2.0 * pi * _FREQUENCY
        k, d = self.mass * w**2, 2.0 * _DAMPING_RATIO * w * self.mass

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            x = q[dof]
            if x > half:
                force[dof] -= max(0.0, k * (x - half) + d * v[dof])
            elif x < -half:
                force[dof] -= min(0.0, k * (x + half) + d * v[dof])

        return Hooks(load=load)

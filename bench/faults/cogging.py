"""Cogging: magnets pull the rotor into slots, and the pull is not a pure sine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sin
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["LINEAR", "Cogging"]

LINEAR = 10.0  # of a slide: a linear motor's magnets are some centimetres apart


@dataclass(frozen=True)
class Cogging(Fault):
    """τ = A (sin(k q + φ) + 0.35 sin(2 k q + φ2)), a load."""

    order: float  # [1/rev] of the joint
    amplitude: float  # [N m]
    phase: float  # [rad]
    second_phase: float  # [rad]
    second: float = 0.35  # share of the second harmonic

    name = "cogging"

    @classmethod
    def full(cls, case: Case) -> Self:
        order = float(case.rng.integers(8, 37))
        if not case.machine.robot.joints[case.index].revolute:
            order *= LINEAR
        return cls(case.joint, order, 0.4 * case.torque, case.phase(), case.phase())

    def scaled(self, factor: float) -> Self:
        return replace(self, amplitude=factor * self.amplitude)

    def parameters(self) -> Parameters:
        return {"order": self.order, "amplitude": self.amplitude, "phase": self.phase, "order_2": 2.0 * self.order,
                "amplitude_2": self.second * self.amplitude, "phase_2": self.second_phase}

    def start(self, run: Run) -> Hooks:
        dof, k, a, first, second, b = (run.dofs[self.index], self.order, self.amplitude, self.phase, self.second_phase,
                                       self.second * self.amplitude)

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            turn = k * q[dof]
            force[dof] -= a * sin(turn + first) + b * sin(2.0 * turn + second)

        return Hooks(load=load)

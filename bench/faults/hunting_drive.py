"""Hunting drive: the current loop oscillates by itself, and its rate is pulled by the torque it has to give."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sin
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["HuntingDrive"]

_PULL = 0.3  # of the rate, at the torque limit


@dataclass(frozen=True)
class HuntingDrive(Fault):
    """The motor gets u + A sin θ, dθ/dt = 2π f (1 + 0.3 u/u_max)."""

    amplitude: float  # [N m] A
    frequency: float  # [Hz] f, without torque

    name = "hunting_drive"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.4 * case.torque, float(case.rng.uniform(4.0, 7.0)))

    def scaled(self, factor: float) -> Self:
        return replace(self, amplitude=factor * self.amplitude)

    def parameters(self) -> Parameters:
        return {"amplitude": self.amplitude, "frequency": self.frequency}

    def start(self, run: Run) -> Hooks:
        j, a, turn = self.index, self.amplitude, 2.0 * pi * self.frequency * run.inner_step
        pull, angle = _PULL / run.machine.torque_limit[self.index], 0.0

        def drive(t: float, torque: Floats, q: Floats) -> None:
            nonlocal angle
            angle += turn * (1.0 + pull * torque[j])
            torque[j] += a * sin(angle)

        return Hooks(drive=drive)

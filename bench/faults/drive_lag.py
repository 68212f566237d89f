"""Drive lag: the motor's torque follows its command like a first-order filter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["DriveLag"]


@dataclass(frozen=True)
class DriveLag(Fault):
    """T dτ/dt = u - τ. Each inner step gets the mean of τ over it, which is exact for the command held over a sample."""

    time_constant: float  # [s]

    name = "drive_lag"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 5e-3)

    def scaled(self, factor: float) -> Self:
        return replace(self, time_constant=factor * self.time_constant)

    def parameters(self) -> Parameters:
        return {"time_constant": self.time_constant}

    def start(self, run: Run) -> Hooks:
        j, ratio = self.index, self.time_constant / run.inner_step
        left = exp(-1.0 / ratio) if ratio > 1e-3 else 0.0
        lagging = 0.0

        def drive(t: float, torque: Floats, q: Floats) -> None:
            nonlocal lagging
            behind = lagging - torque[j]
            lagging = torque[j] + behind * left
            torque[j] += behind * ratio * (1.0 - left)

        return Hooks(drive=drive)

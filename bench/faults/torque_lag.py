"""Torque lag: the drive is prompt, but the torque that is logged went through a low-pass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["TorqueLag"]


@dataclass(frozen=True)
class TorqueLag(Fault):
    """T dy/dt = τ - y; logged is the mean of y over the sample in which τ is held, so that T -> 0 is the command itself."""

    time_constant: float  # [s]

    name = "torque_lag"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 5e-3)

    def scaled(self, factor: float) -> Self:
        return replace(self, time_constant=factor * self.time_constant)

    def parameters(self) -> Parameters:
        return {"time_constant": self.time_constant}

    def start(self, run: Run) -> Hooks:
        j, ratio = self.index, self.time_constant / run.sample_time
        left = exp(-1.0 / ratio) if ratio > 1e-3 else 0.0
        lagging = 0.0

        def write(t: float, tau: Floats) -> None:
            nonlocal lagging
            behind = lagging - tau[j]
            lagging = tau[j] + behind * left
            tau[j] += behind * ratio * (1.0 - left)

        return Hooks(write=write)

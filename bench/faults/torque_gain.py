"""Torque gain: the motor gives more, or less, than it is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["TorqueGain"]


@dataclass(frozen=True)
class TorqueGain(Fault):
    """The motor gets (1 + ε) u, the amplifier's noise with it."""

    gain_error: float  # [1] ε

    name = "torque_gain"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.1 * case.sign())

    def scaled(self, factor: float) -> Self:
        return replace(self, gain_error=factor * self.gain_error)

    def parameters(self) -> Parameters:
        return {"gain_error": self.gain_error}

    def start(self, run: Run) -> Hooks:
        j, gain = self.index, 1.0 + self.gain_error

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] *= gain

        return Hooks(drive=drive)

"""Encoder eccentricity: the disc sits off its axis, in the loop as in the log."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, cos, sin
from typing import Self

from pipelines.bench.fault import Case, Fault, Floats, Hooks, Run

__all__ = ["EncoderEccentricity"]


@dataclass(frozen=True)
class EncoderEccentricity(Fault):
    """The head reads the angle seen from the disc's centre, e off the axis in units of the radius:

        q_measured = q + atan2(e sin(q + φ), 1 + e cos(q + φ)) ≈ q + e sin(q + φ)
    """

    amplitude: float  # [rad] e
    phase: float  # [rad]

    name = "encoder_eccentricity"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 4e-3, case.phase())

    def scaled(self, factor: float) -> Self:
        return replace(self, amplitude=factor * self.amplitude)

    def parameters(self) -> dict[str, float]:
        return {"amplitude": self.amplitude, "phase": self.phase}

    def start(self, run: Run) -> Hooks:
        j, e, phase = self.index, self.amplitude, self.phase

        def sense(t: float, measured: Floats) -> None:
            turn = measured[j] + phase
            measured[j] += atan2(e * sin(turn), 1.0 + e * cos(turn))

        return Hooks(sense=sense)

"""Encoder eccentricity: the disc sits off its axis, in the loop as in the log."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, cos, sin
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["EncoderEccentricity"]

_ITERATIONS = 8  # each leaves e times the error before


@dataclass(frozen=True)
class EncoderEccentricity(Fault):
    """The head reads the angle seen from the disc's centre, e off the axis in units of the radius:

        q_measured = q + atan2(e sin(q + φ), 1 + e cos(q + φ)) ≈ q + e sin(q + φ)

    The arm has settled where it reads its first reference. Of a slide, a wheel that rolls along it turns the disc.
    """

    amplitude: float  # [rad] e
    phase: float  # [rad]
    unit: float = 1.0  # [rad], or the [m] by which the wheel rolls for each

    name = "encoder_eccentricity"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 4e-3 * case.angle, case.phase(), case.angle)

    def scaled(self, factor: float) -> Self:
        return replace(self, amplitude=factor * self.amplitude)

    def parameters(self) -> Parameters:
        return {"amplitude": self.amplitude, "phase": self.phase}

    def start(self, run: Run) -> Hooks:
        j, e, phase, unit = self.index, self.amplitude / self.unit, self.phase, self.unit

        def error(q: float) -> float:
            turn = q / unit + phase
            return unit * atan2(e * sin(turn), 1.0 + e * cos(turn))

        def sense(t: float, measured: Floats) -> None:
            measured[j] += error(measured[j])

        position, dof = run.data.qpos, run.dofs[j]
        wanted = settled = float(position[dof])
        for _ in range(_ITERATIONS):
            settled = wanted - error(settled)
        position[dof] = settled

        return Hooks(sense=sense)

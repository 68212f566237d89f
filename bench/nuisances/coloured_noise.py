"""Coloured noise: a slow wander of the amplifier's zero."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp, pi, sqrt
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["ColouredNoise"]


@dataclass(frozen=True)
class ColouredNoise(Fault):
    """White noise through a first-order low-pass, stationary from the start, added to the torque."""

    rms: float  # [N m]
    corner_hz: float

    name = "coloured_noise"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.5 * case.machine.amplifier_noise[case.index], 3.0)

    def scaled(self, factor: float) -> Self:
        return replace(self, rms=factor * self.rms)

    def parameters(self) -> Parameters:
        return {"rms": self.rms, "corner_hz": self.corner_hz}

    def start(self, run: Run) -> Hooks:
        j, inside = self.index, max(1, round(run.sample_time / run.inner_step))
        left = exp(-2.0 * pi * self.corner_hz * run.sample_time)
        steps = (sqrt(1.0 - left**2) * self.rms * run.rng.standard_normal(round(run.duration / run.sample_time) + 1)).tolist()
        value, count = steps[0] / sqrt(1.0 - left**2), 0

        def drive(t: float, torque: Floats, q: Floats) -> None:
            nonlocal value, count
            if count % inside == 0 and count:
                value = left * value + steps[count // inside]
            count += 1
            torque[j] += value

        return Hooks(drive=drive)

"""Base resonance: the table that the arm stands on gives way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import Self

import numpy as np

from bench.fault import Case, Fault, Parameters
from bench.machine import Machine
from bench.plan import Base, Plan

__all__ = ["BaseResonance"]

_DAMPING_RATIO = 0.04


@dataclass(frozen=True)
class BaseResonance(Fault):
    """I ẍ = -k x - d ẋ - τ1 about the first joint's axis: a pole at √(k/I), a zero below it at √(k/(I + J)).

    Strength is 1/I, the frequency stays: 8, 27 and 80 kg m² at ×1, ×0.3 and ×0.1.
    """

    frequency: float  # [Hz] of the pole
    damping_ratio: float  # [1]
    inertia: float  # [kg m^2] I

    name = "base_resonance"
    scope = "arm"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(None, float(case.rng.uniform(24.0, 32.0)), _DAMPING_RATIO, 8.0 * case.size)

    def scaled(self, factor: float) -> Self:
        return replace(self, inertia=self.inertia / factor)

    def parameters(self) -> Parameters:
        return {"frequency": self.frequency, "damping_ratio": self.damping_ratio, "inertia": self.inertia}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        first, w = plan.joints[0], 2.0 * pi * self.frequency
        axis = first.rotation @ first.axis if first.revolute else np.array([0.0, 0.0, 1.0])
        base = Base(self.inertia, self.inertia * w**2, 2.0 * self.damping_ratio * w * self.inertia, axis)
        return replace(plan, bases=(base, *plan.bases))

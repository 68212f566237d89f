"""Torque saturation: the drive gives no more than its limit, and the log does not know."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run, listed

__all__ = ["TorqueSaturation"]

_SHARES = (1.0, 0.82, 0.70, 0.55)  # of the peak torque, the peak itself at no strength


@dataclass(frozen=True)
class TorqueSaturation(Fault):
    """The motor gets min(max(u, -L), L)."""

    strength: float  # [1]
    peak: float  # [N m] the most that the healthy machine asks for

    name = "torque_saturation"

    @property
    def limit(self) -> float:
        """L [N m]."""
        return self.peak * listed(self.strength, *_SHARES)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 1.0, case.peak_torque[case.index])

    def scaled(self, factor: float) -> Self:
        return replace(self, strength=factor * self.strength)

    def parameters(self) -> Parameters:
        return {"limit": self.limit}

    def start(self, run: Run) -> Hooks:
        j, limit = self.index, self.limit

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] = min(max(torque[j], -limit), limit)

        return Hooks(drive=drive)

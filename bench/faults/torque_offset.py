"""Torque offset: the amplifier's zero is off."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["TorqueOffset"]


@dataclass(frozen=True)
class TorqueOffset(Fault):
    """The motor gets u - τ0: the controller has to give τ0 more than the arm needs."""

    offset: float  # [N m] τ0

    name = "torque_offset"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, case.sign() * 0.4 * case.torque)

    def scaled(self, factor: float) -> Self:
        return replace(self, offset=factor * self.offset)

    def parameters(self) -> Parameters:
        return {"offset": self.offset}

    def start(self, run: Run) -> Hooks:
        j, offset = self.index, self.offset

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] -= offset

        return Hooks(drive=drive)

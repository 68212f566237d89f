"""Torque crosstalk: one axis' current takes from another's torque."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["TorqueCrosstalk"]


@dataclass(frozen=True)
class TorqueCrosstalk(Fault):
    """The motor of joint j gets u_j - c u_i: the controller has to give c u_i more."""

    coefficient: float  # [1] c
    from_joint: int  # i, 1-based

    name = "torque_crosstalk"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.1 * case.sign(), case.neighbour)

    def scaled(self, factor: float) -> Self:
        return replace(self, coefficient=factor * self.coefficient)

    def parameters(self) -> Parameters:
        return {"coefficient": self.coefficient, "from_joint": self.from_joint}

    def start(self, run: Run) -> Hooks:
        j, i, c = self.index, self.from_joint - 1, self.coefficient

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] -= c * torque[i]

        return Hooks(drive=drive)

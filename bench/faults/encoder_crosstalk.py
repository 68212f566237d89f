"""Encoder crosstalk: one joint's reading moves with another joint, in the loop as in the log."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["EncoderCrosstalk"]


@dataclass(frozen=True)
class EncoderCrosstalk(Fault):
    """q_j as measured = q_j + c q_i, q_i as it truly is. The arm has settled where it reads its first reference."""

    coefficient: float  # [1] c
    from_joint: int  # i, 1-based

    name = "encoder_crosstalk"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.015 * case.sign(), case.neighbour)

    def scaled(self, factor: float) -> Self:
        return replace(self, coefficient=factor * self.coefficient)

    def parameters(self) -> Parameters:
        return {"coefficient": self.coefficient, "from_joint": self.from_joint}

    def start(self, run: Run) -> Hooks:
        j, c, other, position = self.index, self.coefficient, run.dofs[self.from_joint - 1], run.data.qpos
        position[run.dofs[j]] -= c * position[other]

        def sense(t: float, measured: Floats) -> None:
            measured[j] += c * float(position[other])

        return Hooks(sense=sense)

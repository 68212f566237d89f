"""Time delay: the measured position is older than its time stamp, in the loop as in the log."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["TimeDelay"]


@dataclass(frozen=True)
class TimeDelay(Fault):
    """q_measured(t) = q(t - delay). True states are kept at every inner step; between two a cubic joins speeds too."""

    delay: float  # [s]

    name = "time_delay"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 5e-3)

    def scaled(self, factor: float) -> Self:
        return replace(self, delay=factor * self.delay)

    def parameters(self) -> Parameters:
        return {"delay": self.delay}

    def start(self, run: Run) -> Hooks:
        j, dof, h = self.index, run.dofs[self.index], run.inner_step
        whole, part = divmod(self.delay / h, 1.0)
        newer = -1 - int(whole)
        x = 1.0 - part  # of the inner step, from its older end
        kept = deque([(float(run.data.qpos[dof]), 0.0)] * (2 - newer), maxlen=2 - newer)

        def step(t: float, q: Floats, v: Floats) -> None:
            kept.append((q[dof], v[dof]))

        def sense(t: float, measured: Floats) -> None:
            (q0, v0), (q1, v1) = kept[newer - 1], kept[newer]
            old = ((1.0 + 2.0 * x) * (1.0 - x) ** 2 * q0 + x * (1.0 - x) ** 2 * h * v0
                   + x**2 * (3.0 - 2.0 * x) * q1 - x**2 * (1.0 - x) * h * v1)
            measured[j] += old - kept[-1][0]

        return Hooks(step=step, sense=sense)

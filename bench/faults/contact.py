"""Contact: something pushes against the tip for a moment."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sin
from typing import Self

import mujoco
import numpy as np

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["Contact"]


@dataclass(frozen=True)
class Contact(Fault):
    """F(t) = F sin(π (t - t0)/D) along a fixed direction while 0 ≤ t - t0 ≤ D; the joints feel Jᵀ F."""

    start_time: float  # [s] t0
    duration: float  # [s] D
    force: float  # [N] F
    direction: tuple[float, float, float]  # unit vector in the base frame, that in which the arm is pushed

    name = "contact"
    scope = "arm"

    @classmethod
    def full(cls, case: Case) -> Self:
        x, y, z = case.rng.normal(size=3).tolist()
        length = (x * x + y * y + z * z) ** 0.5
        begin, lasting = case.rng.uniform(0.2, 0.6) * case.duration, case.rng.uniform(0.1, 0.3)
        return cls(None, float(begin), float(lasting), 25.0 * case.tip_size, (x / length, y / length, z / length))

    def scaled(self, factor: float) -> Self:
        return replace(self, force=factor * self.force)

    def parameters(self) -> Parameters:
        return {"start": self.start_time, "duration": self.duration, "force": self.force}

    def start(self, run: Run) -> Hooks:
        model, data, body, tip = run.model, run.data, run.tip_body, np.array(run.tip)
        push, jacobian = self.force * np.array(self.direction), np.zeros((3, run.model.nv))

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            phase = (t - self.start_time) / self.duration
            if not 0.0 < phase < 1.0:
                return
            place = data.xpos[body] + data.xmat[body].reshape(3, 3) @ tip
            mujoco.mj_jac(model, data, jacobian, None, place, body)
            for dof, torque in enumerate((sin(pi * phase) * (push @ jacobian)).tolist()):
                force[dof] += torque

        return Hooks(load=load)

"""Load friction: teeth and bearings rub in proportion to the torque that passes them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tanh
from typing import Self

import mujoco
import numpy as np

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["LoadFriction"]


@dataclass(frozen=True)
class LoadFriction(Fault):
    """τ = µ |τ_l| tanh(w v), a load, with τ_l the torque that truly reached the bodies beyond in the inner step before.

    τ_l is MuJoCo's inverse dynamics at the motion that came about: noise, cogging and every other fault are in it.
    """

    mu: float  # [1]
    sharpness: float  # [s/rad] w

    name = "load_friction"

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.06, case.sharpness)

    def scaled(self, factor: float) -> Self:
        return replace(self, mu=factor * self.mu)

    def parameters(self) -> Parameters:
        return {"mu": self.mu}

    def start(self, run: Run) -> Hooks:
        dof, w, mu, model, data = run.dofs[self.index], self.sharpness, self.mu, run.model, run.data
        demanded, pressed = np.zeros(run.model.nv), 0.0

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal pressed
            mujoco.mj_rne(model, data, 1, demanded)
            pressed = mu * abs(float(demanded[dof]))

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= pressed * tanh(w * v[dof])

        return Hooks(load=load, step=step)

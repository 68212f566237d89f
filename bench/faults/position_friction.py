"""Position friction: bands of wear along the turn, where the joint rubs harder."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, pi, remainder, tanh
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["PositionFriction"]


@dataclass(frozen=True)
class PositionFriction(Fault):
    """τ = H ¼ (1 + cos k(q - q_w))² tanh(w v), a load: k bands of wear a turn, centred at q_w.

    ¼ (1 + cos x)² = 3/8 + ½ cos x + ⅛ cos 2x, so the main harmonic is A sin(k q + φ) with A = H/2, φ = π/2 - k q_w; a
    quarter of it is in the second, and the mean adds to Coulomb friction.
    """

    amplitude: float  # [N m] A of the main harmonic
    order: float  # [1/rev] k
    centre: float  # [rad] q_w
    sharpness: float  # [s/rad] w

    name = "position_friction"

    @classmethod
    def full(cls, case: Case) -> Self:
        order = float(case.rng.integers(1, 4))
        if not case.machine.robot.joints[case.index].revolute:
            order *= 10.0  # a slide moves by tenths of a metre
        return cls(case.joint, 0.4 * case.coulomb, order, case.phase(), case.sharpness)

    def scaled(self, factor: float) -> Self:
        return replace(self, amplitude=factor * self.amplitude)

    def parameters(self) -> Parameters:
        return {"amplitude": self.amplitude, "order": self.order,
                "phase": remainder(0.5 * pi - self.order * self.centre, 2.0 * pi)}

    def start(self, run: Run) -> Hooks:
        dof, k, centre, w, quarter = run.dofs[self.index], self.order, self.centre, self.sharpness, 0.5 * self.amplitude

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= quarter * (1.0 + cos(k * (q[dof] - centre))) ** 2 * tanh(w * v[dof])

        return Hooks(load=load)

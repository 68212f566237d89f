"""Cable hysteresis: a bundle of cables runs over two joints and rubs inside itself as it bends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run

__all__ = ["CableHysteresis"]

_BETA = 0.7  # γ = 1 - β, so that the loop closes at z = ±1


@dataclass(frozen=True)
class CableHysteresis(Fault):
    """A z on both joints, a load, with the bending x = q_i + q_j and Bouc & Wen's (1976) state of exponent 2:

        dz/dx = (1 - (β sgn(z ẋ) + γ) z²)/x_y,  β = 0.7, γ = 0.3
    """

    with_joint: int  # i, 1-based
    torque: float  # [N m] A
    bend: float  # [rad] x_y

    name = "cable_hysteresis"
    known = False

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, case.neighbour, 0.6 * case.torque, 0.4 * case.angle)

    def scaled(self, factor: float) -> Self:
        return replace(self, torque=factor * self.torque)

    def parameters(self) -> Parameters:
        return {"with_joint": self.with_joint, "torque": self.torque, "bend": self.bend}

    def start(self, run: Run) -> Hooks:
        i, j, a, bend = run.dofs[self.with_joint - 1], run.dofs[self.index], self.torque, self.bend
        z, since = 0.0, float(run.data.qpos[i] + run.data.qpos[j])

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal z, since
            bent = q[i] + q[j] - since
            halfway = z + 0.5 * bent * _slope(z, bent) / bend
            z += bent * _slope(halfway, bent) / bend
            since = q[i] + q[j]

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[i] -= a * z
            force[j] -= a * z

        return Hooks(load=load, step=step)


def _slope(z: float, way: float) -> float:
    """x_y dz/dx."""
    return 1.0 - ((_BETA if z * way > 0.0 else -_BETA) + 1.0 - _BETA) * z * z

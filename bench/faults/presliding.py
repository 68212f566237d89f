"""Presliding: before the joint slides, bristles bend."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, copysign, cos, log, pi, tanh
from typing import Self

from bench.fault import Case, Fault, Floats, Hooks, Parameters, Run, listed

__all__ = ["Presliding"]

_ELASTIC = 0.5  # of the largest bending: up to there nothing slides
_FILM = 6e-3  # [rad] presliding distance at which half of the dry friction is borne by bristles
_DISTANCES = (0.0, 3e-3, 10e-3, 30e-3)  # [rad]
_FAST = 10.0  # [rad/s] at which damping would equal the bristles' force
_STEP = 0.1  # of the largest bending: what travel is integrated in
_FAR = 8.0  # times the largest bending: whoever has come that far slides


@dataclass(frozen=True)
class Presliding(Fault):
    """LuGre bristles that do not creep (Dupont, Hayward, Armstrong & Altpeter 2002), instead of a part F of dry friction:

        τ = F (z + T_d ż)/z_s - F tanh(w v),  ż = v (1 - α(z, v) |z|/z_s),  T_d = z_s/(10 rad/s)
        α = 0 for |z| < z_s/2 or z v ≤ 0;  ½ (1 - cos 2π(|z|/z_s - ½)) up to |z| = z_s

    After a reversal the force is zero when the joint has moved by z_s = x_c ln 2, as with Dahl's model of distance x_c.
    F/Fc = x_c/(x_c + 6 mrad): where contacts hardly bend, a film keeps dry friction what it was. On a slide all lengths and
    speeds are those of its unit.
    """

    strength: float  # [1]
    dry: float  # [N m] the joint's whole dry friction Fc
    sharpness: float  # [s/rad] w
    unit: float = 1.0  # [rad], or the [m] that take its place

    name = "presliding"

    @property
    def distance(self) -> float:
        """x_c [rad]."""
        return self.unit * listed(self.strength, *_DISTANCES)

    @property
    def amplitude(self) -> float:
        """F [N m]."""
        return self.dry * self.distance / (self.distance + self.unit * _FILM)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 1.0, case.coulomb, case.sharpness, case.angle)

    def scaled(self, factor: float) -> Self:
        return replace(self, strength=factor * self.strength)

    def parameters(self) -> Parameters:
        return {"distance": self.distance, "amplitude": self.amplitude}

    def start(self, run: Run) -> Hooks:
        dof, f, w, largest = run.dofs[self.index], self.amplitude, self.sharpness, self.distance * log(2.0)
        damping = f / (self.unit * _FAST)
        bent, since, free = 0.0, float(run.data.qpos[dof]), 1.0  # z/z_s and q at the end of the last inner step, dz/dq from there

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal bent, since, free
            bent = _travelled(bent, (q[dof] - since) / largest)
            since, free = q[dof], _bending(bent, v[dof])

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            # Within the inner step the bristles go on bending with the position that each stage of RK4 tries.
            now = max(-1.0, min(1.0, bent + free * (q[dof] - since) / largest))
            force[dof] -= f * (now - tanh(w * v[dof])) + damping * free * v[dof]

        return Hooks(load=load, step=step)


def _bending(z: float, way: float) -> float:
    """dz/dq, z in units of z_s, when moving to the side of `way`."""
    size = abs(z)
    if size < _ELASTIC or z * way <= 0.0:
        return 1.0
    return 1.0 - size * 0.5 * (1.0 - cos(pi * (min(size, 1.0) - _ELASTIC) / (1.0 - _ELASTIC)))


def _travelled(z: float, way: float) -> float:
    """z after a travel `way`, both in units of z_s, by the midpoint rule."""
    if abs(way) > _FAR:
        return copysign(1.0, way)
    parts = ceil(abs(way) / _STEP)
    for _ in range(parts):
        z += way / parts * _bending(z + 0.5 * way / parts * _bending(z, way), way)
    return max(-1.0, min(1.0, z))

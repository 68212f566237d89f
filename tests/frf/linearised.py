"""The truth: MuJoCo's machine linearised at a posture and a speed, sampled, the loops of the other joints closed.

    M ẍ = F(x, ẋ) + B τ      K = -∂F/∂x, C = -∂F/∂ẋ by central differences of MuJoCo's forces and the true friction
    τ[k] = D̂ r[k],  r_i[k] = -k_p q_i[k] - k_d (q_i[k] - q_i[k-1])/T  for every joint but the one looked at

From r_j to q_j that is one discrete transfer function: its poles and zeros are the modes to find.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, expm

from bench.config import SAMPLE_TIME
from bench.dynamics import build
from bench.machine import Fault, Machine
from bench.plant import plan_with
from pipelines.io.log import Array

__all__ = ["Truth", "linearised"]

Complex = NDArray[np.complex128]
_SMALL = 1e-6


@dataclass(frozen=True, eq=False)
class Truth:
    """q_j = c (zI - A)^-1 b r_j."""

    a: Array
    b: Array
    c: Array
    delay: float  # [s] between the motion and its measurement

    def response(self, frequency: Array) -> Complex:
        """q_j/r_j (frequencies,) complex [s^2]."""
        z = np.exp(2j * np.pi * frequency * SAMPLE_TIME)
        states = np.linalg.solve(z[:, None, None] * np.eye(len(self.a)) - self.a, self.b[:, None].astype(complex))
        return np.asarray((self.c @ states)[:, 0] * np.exp(-2j * np.pi * frequency * self.delay))

    def modes(self, band: tuple[float, float] = (10.0, 200.0)) -> tuple[Array, Array]:
        """(frequency [Hz], damping ratio) of resonances (k, 2) and antiresonances (k, 2); pairs that cancel are left out."""
        n = len(self.a)
        pencil = np.block([[self.a, self.b[:, None]], [self.c[None], np.zeros((1, 1))]])
        mass = np.zeros((n + 1, n + 1))
        mass[:n, :n] = np.eye(n)
        found = np.asarray(eig(pencil, mass, right=False), dtype=np.complex128)
        poles = np.asarray(np.linalg.eigvals(self.a), dtype=np.complex128)
        return _not_cancelled(_oscillating(poles, band), _oscillating(found[np.isfinite(found)], band))


def linearised(machine: Machine, joint: int, posture: Array, speed: float, inertia: Array, gains: tuple[float, float],
               faults: Sequence[Fault] = (), delay: float = 0.0) -> Truth:
    """The plant of joint `joint` (1-based), turning with `speed` [rad/s] in `posture` (n,).

    Args:
        inertia: D̂ (n, n) [kg m^2] of the controller's model in this posture.
        gains: k_p [1/s^2] and k_d [1/s] of the controllers.
    """
    built = build(plan_with(machine, faults), SAMPLE_TIME)
    model, data, dofs = built.model, mujoco.MjData(built.model), list(built.joints)
    size, n, j = model.nv, machine.n, joint - 1
    laws = [law.law() for law in machine.friction]
    x0, v0 = np.zeros(size), np.zeros(size)
    x0[dofs] = posture
    v0[dofs[j]] = speed

    def force(x: Array, v: Array) -> Array:
        data.qpos[:], data.qvel[:] = x, v
        mujoco.mj_forward(model, data)
        total = np.asarray(data.qfrc_passive - data.qfrc_bias)
        for dof, law in zip(dofs, laws, strict=True):
            total[dof] -= law(float(v[dof]))
        return total

    def slope(at: Array, other: Array, of_speed: bool) -> Array:
        columns = np.zeros((size, size))
        for i in range(size):
            step = np.zeros(size)
            step[i] = _SMALL
            up, down = ((force(other, at + s) if of_speed else force(at + s, other)) for s in (step, -step))
            columns[:, i] = (up - down) / (2.0 * _SMALL)
        return columns

    stiffness, damping = slope(x0, v0, False), slope(v0, x0, True)
    force(x0, v0)
    mass = np.zeros((size, size))
    for row, unit in zip(mass, np.eye(size), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    solve = np.linalg.inv(mass)
    drive = np.zeros((size, n))
    drive[dofs] = inertia
    # What the model's gravity takes away again: D̂ r + ĥ(q).
    gravity = np.zeros((size, size))
    gravity[np.ix_(dofs, dofs)] = stiffness[np.ix_(dofs, dofs)]
    whole = np.block([[np.zeros((size, size)), np.eye(size)], [solve @ (stiffness - gravity), solve @ damping]])
    entry = np.vstack([np.zeros((size, n)), solve @ drive])
    sampled = expm(np.block([[whole, entry], [np.zeros((n, 2 * size + n))]]) * SAMPLE_TIME)
    a, b = sampled[:2 * size, :2 * size], sampled[:2 * size, 2 * size:]
    reads = np.zeros((n, 2 * size))
    reads[np.arange(n), dofs] = 1.0
    return _others_closed(a, b, reads, j, gains, delay)


def _others_closed(a: Array, b: Array, reads: Array, j: int, gains: tuple[float, float], delay: float) -> Truth:
    kp, kd = gains
    others = np.arange(len(reads)) != j
    back = b[:, others] @ reads[others]
    far = b[:, others]
    now, before = -(kp + kd / SAMPLE_TIME) * back, kd / SAMPLE_TIME * far
    count = int(others.sum())
    closed = np.block([[a + now, before], [reads[others], np.zeros((count, count))]])
    return Truth(closed, np.concatenate([b[:, j], np.zeros(count)]), np.concatenate([reads[j], np.zeros(count)]), delay)


def _oscillating(z: Complex, band: tuple[float, float]) -> Array:
    """(frequency [Hz], damping ratio) of the roots that swing in the band, one of each pair."""
    s = np.log(z[np.abs(z) > 1e-9]) / SAMPLE_TIME
    s = s[(s.imag > 1e-6) & (np.abs(s.imag) < 0.99 * np.pi / SAMPLE_TIME)]
    found = np.column_stack([np.abs(s) / (2.0 * np.pi), -s.real / np.abs(s)])
    kept = found[(found[:, 0] > band[0]) & (found[:, 0] < band[1]) & (np.abs(found[:, 1]) < 0.3)]
    return np.asarray(kept[np.argsort(kept[:, 0])])


def _not_cancelled(poles: Array, zeros: Array) -> tuple[Array, Array]:
    """Without the poles that have a zero at the same place: no response shows them."""
    alone_p, alone_z = np.ones(len(poles), bool), np.ones(len(zeros), bool)
    for i, pole in enumerate(poles):
        for k, zero in enumerate(zeros):
            apart = np.hypot(pole[0] - zero[0], pole[0] * (pole[1] - zero[1]))
            if alone_z[k] and apart < 0.05 * pole[1] * pole[0]:
                alone_p[i] = alone_z[k] = False
                break
    return poles[alone_p], zeros[alone_z]

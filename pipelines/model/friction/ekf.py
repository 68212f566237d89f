"""The paper's estimator of friction: an extended Kalman filter over states and parameters at once.

Kostić et al. 2004, Section IV.B, after its [22]: the states q and dq of eq. (11) and its constants 1/J, c, f_k, w_k, b are
filtered together; a further constant c' lets the equilibrium lie anywhere. It sees each sample once and forgets nothing it
was wrong about early on, so a pass ends where its start and its noise let it: several passes are made, each starting from
the constants that the last one found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.signal.extended import Advance, Extended, filter_extended

__all__ = ["EKF_NAMES", "EkfStart", "joint_step", "run_ekf"]

EKF_NAMES = ("q", "dq", "1/J", "c", "f1", "f2", "f3", "w1", "w2", "w3", "b", "c'")

_PARTS = 2  # midpoint steps a sample


@dataclass(frozen=True, eq=False)
class EkfStart:
    """Where the filter begins. In the order of EKF_NAMES; without c' eleven states."""

    mean: Array
    std: Array
    torque_noise: float  # [N m] a sample
    position_noise: float  # [rad]


def joint_step(step: float, parts: int = _PARTS) -> Advance:
    """One sample of eq. (11) and (10) by midpoint steps, and the derivatives of q and dq by every state."""
    h = step / parts

    def acceleration(x: list[float], q: float, v: float, u: float) -> tuple[float, float, float, list[float]]:
        """a, ∂a/∂q, ∂a/∂v, and ∂a/∂ of the constants."""
        theta, c, f1, f2, f3, w1, w2, w3, b = x[2:11]
        d = x[11] if len(x) > 11 else 0.0
        s, o = math.sin(q), math.cos(q)
        t1, t2, t3 = math.tanh(w1 * v), math.tanh(w2 * v), math.tanh(w3 * v)
        e1, e2, e3 = 1.0 - t1 * t1, 1.0 - t2 * t2, 1.0 - t3 * t3
        rest = u - c * s - d * o - f1 * t1 - f2 * t2 - f3 * t3 - b * v
        own = [rest, -theta * s, -theta * t1, -theta * t2, -theta * t3, -theta * f1 * e1 * v, -theta * f2 * e2 * v,
               -theta * f3 * e3 * v, -theta * v]
        if len(x) > 11:
            own.append(-theta * o)
        return (theta * rest, theta * (d * s - c * o), -theta * (f1 * w1 * e1 + f2 * w2 * e2 + f3 * w3 * e3 + b), own)

    def advance(x: Array, u: float) -> tuple[Array, Array]:
        values = x.tolist()
        n = len(values)
        q, v = values[0], values[1]
        dq, dv = np.zeros(n), np.zeros(n)
        dq[0], dv[1] = 1.0, 1.0
        change = np.zeros(n)
        for _ in range(parts):
            a, aq, av, own = acceleration(values, q, v, u)
            change[2:] = own
            q_mid, v_mid = q + 0.5 * h * v, v + 0.5 * h * a
            dq_mid = dq + (0.5 * h) * dv
            dv_mid = dv + (0.5 * h) * (aq * dq + av * dv + change)
            a, aq, av, own = acceleration(values, q_mid, v_mid, u)
            change[2:] = own
            q, v = q + h * v_mid, v + h * a
            dq, dv = dq + h * dv_mid, dv + h * (aq * dq_mid + av * dv_mid + change)
        ahead = x.copy()
        ahead[0], ahead[1] = q, v
        return ahead, np.stack([dq, dv])

    return advance


def run_ekf(y: Array, tau: Array, step: float, start: EkfStart, passes: int = 1) -> Extended:
    """Filter a log of one joint `passes` times; each pass begins with the constants of the one before, less sure of them."""
    advance = joint_step(step)
    mean, covariance = start.mean.copy(), np.diag(np.square(start.std))
    noise = start.torque_noise * step * start.mean[2]
    process = np.zeros_like(covariance)
    reach = np.array([0.5 * step * noise, noise])
    process[:2, :2] = np.outer(reach, reach)
    found = filter_extended(advance, y, tau, mean, covariance, process, start.position_noise**2)
    for _ in range(passes - 1):
        begin = start.mean.copy()
        begin[2:] = found.mean[2:]
        found = filter_extended(advance, y, tau, begin, covariance, process, start.position_noise**2)
    return found

"""Keep a motion within its limits: what they are, the tip, and a barrier for the search.

The barrier is B = -(1/n) Σ_k log(1 - g_k²), g = (y - middle)/half (Boyd & Vandenberghe 2004, ch.
11.2), continued close to the limit by a parabola, so that a step of the search may cross it. The
tip and its adjoint are

    x = tip(q),   v = J q̇,   ∂x/∂q_m = J_m,   ∂v/∂q_m = Σ_i (z_min(i,m) × J_max(i,m)) q̇_i

J_i is joint i's column of the Jacobian, z_i its axis, zero where it is prismatic: the joint nearer
to the base turns the column of the other. Siciliano et al. 2009, eq. (3.30), differentiated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.dynamics.kinematics import SerialChain, forward_kinematics
from pipelines.excitation.config import CONFIG
from pipelines.io.robot import RobotDescription

__all__ = ["Limit", "TipMotion", "barrier", "limits_of", "middle_and_half",
           "tip_motion"]

FAR = 100.0 * np.pi  # numerics: an open end of a limit, which no motion comes near to
LOOSE = 1.0 - CONFIG.corner**2


@dataclass(frozen=True)
class Limit:
    """One limit; infinite where an end is open."""

    quantity: str  # "position", "speed", "acceleration", "torque", "tip speed", "tip x", …
    joint: int | None  # counted from 1; None of the tip
    low: float
    high: float
    unit: str


def limits_of(robot: RobotDescription, *, torque: bool, torque_share: float = 1.0,
              speed_share: float = 1.0, tip_speed: float | None = None,
              tip_box: Array | None = None) -> tuple[Limit, ...]:
    """Return the limits of a description, in the order in which `signals` of a motion come.

    Args:
        torque: whether the torque is known.
        torque_share, speed_share: of these limits that a plan may use.
        tip_speed: [m/s], tip_box: (3, 2) [m] in the base frame.
    """
    found: list[Limit] = []
    kinds = [("position", "", 1.0, "rad", "m"), ("speed", "velocity", speed_share, "rad/s", "m/s"),
             ("acceleration", "acceleration", 1.0, "rad/s^2", "m/s^2"),
             ("torque", "torque", torque_share, "N m", "N")]
    for name, key, share, turning, sliding in kinds[:4 if torque else 3]:
        for j, joint in enumerate(robot.joints, 1):
            most = share * getattr(joint, key) if key else 0.0
            low, high = (-most, most) if key else joint.position
            if np.isfinite(low) or np.isfinite(high):
                unit = turning if joint.revolute else sliding
                found.append(Limit(name, j, float(low), float(high), unit))
    if tip_speed is not None:
        found.append(Limit("tip speed", None, -tip_speed, tip_speed, "m/s"))
    if tip_box is not None:
        found += [Limit(f"tip {axis}", None, float(low), float(high), "m")
                  for axis, (low, high) in zip("xyz", tip_box, strict=True)]
    return tuple(found)


def middle_and_half(limits: tuple[Limit, ...]) -> tuple[Array, Array]:
    """Return the middle and half the width of each; of the tip's speed those of its square."""
    low = np.array([x.low if np.isfinite(x.low) else min(x.high, 0.0) - FAR for x in limits])
    high = np.array([x.high if np.isfinite(x.high) else max(x.low, 0.0) + FAR for x in limits])
    square = np.array([one.quantity == "tip speed" for one in limits], dtype=bool)
    low, high = np.where(square, -high**2, low), np.where(square, high**2, high)
    return 0.5 * (low + high), 0.5 * (high - low)


def barrier(signals: Array, middle: Array, half: Array) -> tuple[float, Array, bool]:
    """Return B of signals (limits, samples), its derivative, and whether they keep the limits."""
    g = (signals - middle[:, None]) / half[:, None]
    count = signals.shape[1]
    size = np.abs(g)
    most = float(size.max(initial=0.0))
    if most < CONFIG.corner:
        slack = 1.0 - g * g
        return -float(np.log(slack).sum()) / count, g / slack * (2.0 / count / half[:, None]), True
    # log and parabola meet at g0 with equal value, slope and bend
    first, second = 2.0 * CONFIG.corner / LOOSE, 2.0 * (1.0 + CONFIG.corner**2) / LOOSE**2
    over = np.maximum(size - CONFIG.corner, 0.0)
    slack = np.where(over > 0.0, LOOSE, 1.0 - g * g)
    value = np.where(over > 0.0, first * over + 0.5 * second * over**2, 0.0) - np.log(slack)
    slope = np.where(over > 0.0, np.sign(g) * (first + second * over), 2.0 * g / slack)
    return float(value.sum()) / count, slope / (count * half[:, None]), most < 1.0


@dataclass(frozen=True, eq=False)
class TipMotion:
    """The tip along a motion."""

    position: Array  # (3, samples) [m] base frame
    velocity: Array  # (3, samples) [m/s]
    jacobian: Array  # (joints, 3, samples) [m]
    turning: Array  # (joints, 3, samples) joint axes; zero where prismatic

    def adjoint(self, dq: Array, on_position: Array, on_velocity: Array) -> tuple[Array, Array]:
        """Return the derivatives by q and dq (joints, samples) from those by the tip's motion."""
        by_q = np.einsum("jas,as->js", self.jacobian, on_position)
        for m in range(len(dq)):
            for i in range(len(dq)):
                bent = np.cross(self.turning[min(i, m)], self.jacobian[max(i, m)], axis=0)
                by_q[m] += np.einsum("as,as->s", bent, on_velocity) * dq[i]
        return by_q, np.einsum("jas,as->js", self.jacobian, on_velocity)


def tip_motion(chain: SerialChain, q: Array, dq: Array) -> TipMotion:
    """Return the motion of the tip for q, dq (joints, samples)."""
    frames = forward_kinematics(chain, q.T)
    axis = np.moveaxis(frames.axis, 0, -1)
    lever = np.moveaxis(frames.tip[:, None] - frames.anchor, 0, -1)
    revolute = np.array(chain.revolute)[:, None, None]
    jacobian = np.where(revolute, np.cross(axis, lever, axis=1), axis)
    velocity = np.einsum("jas,js->as", jacobian, dq)
    return TipMotion(frames.tip.T, velocity, jacobian, np.where(revolute, axis, 0.0))

"""Keep a motion within its limits: what they are, and a barrier for the search.

The barrier is B = -(1/n) Σ_k log(1 - g_k²), g = (y - middle)/half (Boyd & Vandenberghe 2004, ch.
11.2), continued close to the limit by a parabola, so that a step of the search may cross it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.excitation.config import CONFIG
from pipelines.io.robot import RobotDescription

__all__ = ["Limit", "barrier", "limits_of", "middle_and_half"]

FAR = 100.0 * np.pi  # numerics: an open end of a limit, which no motion comes near to
LOOSE = 1.0 - CONFIG.corner**2


@dataclass(frozen=True)
class Limit:
    """One limit; infinite where an end is open."""

    quantity: str  # "position", "speed", "acceleration", "torque", "tip x", …
    joint: int | None  # counted from 1; None of the tip
    low: float
    high: float
    unit: str


def limits_of(robot: RobotDescription, *, torque: bool, torque_share: float = 1.0,
              speed_share: float = 1.0,
              tip_box: Array | None = None) -> tuple[Limit, ...]:
    """Return the limits of a description, in the order in which `signals` of a motion come.

    Args:
        torque: whether the torque is known.
        torque_share, speed_share: of these limits that a plan may use.
        tip_box: (3, 2) [m] in the base frame.
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
    if tip_box is not None:
        found += [Limit(f"tip {axis}", None, float(low), float(high), "m")
                  for axis, (low, high) in zip("xyz", tip_box, strict=True)]
    return tuple(found)


def middle_and_half(limits: tuple[Limit, ...]) -> tuple[Array, Array]:
    """Return the middle and half the width of each."""
    low = np.array([x.low if np.isfinite(x.low) else min(x.high, 0.0) - FAR for x in limits])
    high = np.array([x.high if np.isfinite(x.high) else max(x.low, 0.0) + FAR for x in limits])
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

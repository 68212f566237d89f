"""The limits of a motion: what each is called, which joint has it, and between what it must stay.

An end that is left open lies so far away that no motion comes near it; a limit open at both ends is no limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.io.robot import RobotDescription
from pipelines.model.rigid.body import Array

__all__ = ["Limit", "Limits", "limits_of", "middle_and_half"]

_FAR = 100.0 * np.pi  # [rad, rad/s, m, …] fifty turns


@dataclass(frozen=True)
class Limit:
    """One limit."""

    quantity: str  # "position" | "speed" | "acceleration" | "torque" | "tip speed" | "tip x" | "tip y" | "tip z"
    joint: int | None  # 1-based
    low: float
    high: float
    unit: str


@dataclass(frozen=True, eq=False)
class Limits:
    """Per joint, infinite where open; of the tip, None where open."""

    position: Array  # (joints, 2) [rad]
    speed: Array  # (joints,) [rad/s]
    acceleration: Array  # (joints,) [rad/s^2]
    torque: Array  # (joints,) [N m]
    tip_speed: float | None = None  # [m/s]
    tip_box: Array | None = None  # (3, 2) [m] in the base frame
    revolute: tuple[bool, ...] = ()

    def listed(self, with_torque: bool) -> tuple[Limit, ...]:
        """Every limit, in the order in which `signals` of a motion come."""
        found: list[Limit] = []
        kinds = (("position", self.position, "rad"), ("speed", _both(self.speed), "rad/s"),
                 ("acceleration", _both(self.acceleration), "rad/s^2"), ("torque", _both(self.torque), "N m"))
        for name, ranges, unit in kinds[:4 if with_torque else 3]:
            for j, (low, high) in enumerate(ranges):
                if np.isfinite(low) or np.isfinite(high):
                    turning = not self.revolute or self.revolute[j]
                    found.append(Limit(name, j + 1, float(low), float(high),
                                       unit if turning else unit.replace("rad", "m").replace("N m", "N")))
        if self.tip_speed is not None:
            found.append(Limit("tip speed", None, -self.tip_speed, self.tip_speed, "m/s"))
        if self.tip_box is not None:
            found += [Limit(f"tip {axis}", None, float(low), float(high), "m")
                      for axis, (low, high) in zip("xyz", self.tip_box, strict=True)]
        return tuple(found)


def _both(values: Array) -> Array:
    return np.stack([-values, values], axis=1)


def middle_and_half(limits: tuple[Limit, ...]) -> tuple[Array, Array]:
    """Of each limit; an end that is open is put far away. Tip speed is bounded by its square, which is smooth at rest."""
    low = np.array([one.low if np.isfinite(one.low) else min(one.high, 0.0) - _FAR for one in limits])
    high = np.array([one.high if np.isfinite(one.high) else max(one.low, 0.0) + _FAR for one in limits])
    square = np.array([one.quantity == "tip speed" for one in limits], dtype=bool)
    low, high = np.where(square, -high**2, low), np.where(square, high**2, high)
    return 0.5 * (low + high), 0.5 * (high - low)


def limits_of(robot: RobotDescription, *, torque_share: float = 1.0, speed_share: float = 1.0, tip_speed: float | None = None,
              tip_box: Array | None = None) -> Limits:
    """The limits a description states; of torque and speed, the share that a plan may use."""
    joints = robot.joints
    return Limits(np.array([joint.position for joint in joints]), speed_share * np.array([joint.velocity for joint in joints]),
                  np.array([joint.acceleration for joint in joints]), torque_share * np.array([j.torque for j in joints]),
                  tip_speed, tip_box, robot.revolute)

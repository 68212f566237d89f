"""Random via points joined by fifth-order polynomials, each move as fast as the drives allow.

    motion = via_point_motion(robot, rng, moves=12, arm=arm)

Every move starts and ends at rest and moves all joints for the same time T:

    q = q0 + (q1 - q0)(10 r³ - 15 r⁴ + 6 r⁵),  r = t/T;    largest speed 15/8 |q1 - q0|/T,  acceleration 10/√3 |q1 - q0|/T²

Craig 2005, Section 7.3 (fifth-order polynomials). T is the shortest at which one joint reaches its limit of speed, of
acceleration or, with a model, of torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription
from pipelines.model.arm import Arm
from pipelines.model.rigid.body import Array, Motion

__all__ = ["ViaPoints", "via_point_motion", "via_points"]

_GRID = 101  # points of a move at which its torque is looked at
_HALVINGS = 40


@dataclass(frozen=True, eq=False)
class ViaPoints:
    """Postures, and how long each move from one to the next takes."""

    q: Array  # (moves + 1, joints) [rad]
    seconds: Array  # (moves,) [s]
    rest: float  # [s] at rest at each of them

    @property
    def duration(self) -> float:  # [s]
        return float(self.seconds.sum() + self.rest * len(self.q))

    def at(self, t: Array) -> Motion:
        """The motion at times t (samples,) [s], exact; at rest before and after."""
        starts = self.rest + np.concatenate([[0.0], np.cumsum(self.seconds[:-1] + self.rest)])
        k = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(self.seconds) - 1)
        T = self.seconds[k, None]
        r = np.clip((t - starts[k])[:, None] / T, 0.0, 1.0)
        return Motion(t, *_quintic(self.q[k], self.q[k + 1], r, T))


def _quintic(start: Array, end: Array, r: Array, T: Array | float) -> tuple[Array, Array, Array]:
    step = end - start
    return (start + step * r**3 * (10.0 - 15.0 * r + 6.0 * r * r), step * 30.0 * (r * (1.0 - r))**2 / T,
            step * 60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / T**2)


def via_points(robot: RobotDescription, rng: np.random.Generator, moves: int = 12, *, arm: Arm | None = None,
               authority: float = 0.95, rest: float = 0.2) -> ViaPoints:
    """Postures drawn evenly from the joints' ranges (±π where a joint turns without end), and the shortest moves between them.

    Args:
        authority: share of each limit that is used; what is left is for the controller.

    Raises:
        UsageError: a joint has neither a limit of speed nor of acceleration, or cannot carry the arm's own weight.
    """
    if moves < 1 or not 0.0 < authority <= 1.0 or not (math.isfinite(rest) and rest >= 0.0):
        raise UsageError("C02", f"{moves} moves at {authority:g} of the limits with rests of {rest:g} s", where="via points",
                         remedy="give at least one move, an authority above 0 up to 1 and a rest of at least 0 s")
    low, high = np.array([joint.position for joint in robot.joints]).T
    widest = np.where(np.array(robot.revolute), math.pi, 1.0)
    low, high = np.maximum(low, -widest), np.minimum(high, widest)
    if (low >= high).any():
        j = int(np.flatnonzero(low >= high)[0])
        raise UsageError("C02", f"the range of joint {j + 1} lies beyond a turn", where=robot.name, remedy="shift its offset")
    q = rng.uniform(low, high, (moves + 1, robot.n_joints))
    return ViaPoints(q, np.array([_shortest(robot, a, b, arm, authority) for a, b in pairwise(q)]), rest)


def via_point_motion(robot: RobotDescription, rng: np.random.Generator, moves: int = 12, *, arm: Arm | None = None,
                     authority: float = 0.95, rest: float = 0.2, sample_time: float = 1e-3) -> Motion:
    """`via_points`, sampled; the arguments and errors are the same."""
    points = via_points(robot, rng, moves, arm=arm, authority=authority, rest=rest)
    return points.at(np.arange(math.ceil(points.duration / sample_time) + 1, dtype=np.float64) * sample_time)


def _shortest(robot: RobotDescription, start: Array, end: Array, arm: Arm | None, authority: float) -> float:
    """The shortest time [s] of a move."""
    step = np.abs(end - start)
    speed, acceleration = (authority * np.array([getattr(joint, key) for joint in robot.joints])
                           for key in ("velocity", "acceleration"))
    T = float(np.maximum(15.0 / 8.0 * step / speed, np.sqrt(10.0 / math.sqrt(3.0) * step / acceleration)).max())
    if T == 0.0:
        raise UsageError("C02", "no joint has a limit of speed or acceleration", where=robot.name,
                         remedy="write velocity and acceleration into the robot description")
    return T if arm is None else _within_torque(robot, start, end, arm, authority, T)


def _within_torque(robot: RobotDescription, start: Array, end: Array, arm: Arm, authority: float, T: float) -> float:
    """The shortest time from T upwards at which no torque exceeds its limit, found by halving."""
    limit = authority * np.array([joint.torque for joint in robot.joints])
    r = np.linspace(0.0, 1.0, _GRID)[:, None]

    def fits(seconds: float) -> bool:
        return bool((np.abs(arm.torque(Motion(r[:, 0] * seconds, *_quintic(start, end, r, seconds)))) <= limit).all())

    short, long = T, T
    for _ in range(20):
        if fits(long):
            break
        short, long = long, 2.0 * long
    else:
        raise UsageError("C02", "a joint cannot carry the arm's own weight and friction within its torque limit", where=robot.name,
                         remedy="check the torque limits and the model")
    for _ in range(_HALVINGS if long > T else 0):
        middle = 0.5 * (short + long)
        short, long = (short, middle) if fits(middle) else (middle, long)
    return long

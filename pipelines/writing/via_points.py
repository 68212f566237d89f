"""Move between random postures by fifth-order polynomials, each as fast as the drives allow.

    points = via_points(robot, rng, moves=12, arm=arm)
    motion = points.sampled(1e-3)

Every move starts and ends at rest and moves all joints for the same time T:

    q = q0 + (q1 - q0)(10 r³ - 15 r⁴ + 6 r⁵),  r = t/T;
    largest speed 15/8 |q1 - q0|/T,  acceleration 10/√3 |q1 - q0|/T²

Craig 2005, Section 7.3. T is the shortest at which one joint reaches its limit of speed, of
acceleration or, with a model, of torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription
from pipelines.writing.config import CONFIG
from pipelines.writing.task import refuse_sample_time
from pipelines.writing.timing import MOST_BENT, STEEPEST, largest

__all__ = ["ViaPoints", "via_points"]

DOUBLINGS = 20  # numerics: of the time of a move, a factor of a million


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
        """Return the motion at times t (samples,) [s], exact; at rest before and after."""
        starts = self.rest + np.concatenate([[0.0], np.cumsum(self.seconds[:-1] + self.rest)])
        k = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(self.seconds) - 1)
        T = self.seconds[k, None]
        r = np.clip((t - starts[k])[:, None] / T, 0.0, 1.0)
        return _quintic(t, self.q[k], self.q[k + 1], r, T)

    def sampled(self, sample_time: float) -> Motion:
        """Return the whole motion, every `sample_time` [s]."""
        refuse_sample_time(sample_time)
        samples = math.ceil(self.duration / sample_time) + 1
        return self.at(np.arange(samples, dtype=np.float64) * sample_time)


def _quintic(t: Array, start: Array, end: Array, r: Array, T: Array | float) -> Motion:
    step = end - start
    return Motion(t, start + step * r**3 * (10.0 - 15.0 * r + 6.0 * r * r),
                  step * 30.0 * (r * (1.0 - r))**2 / T,
                  step * 60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / T**2)


def via_points(robot: RobotDescription, rng: np.random.Generator, moves: int = 12, *,
               arm: Arm | None = None, authority: float = CONFIG.authority,
               rest: float = 0.2) -> ViaPoints:
    """Draw postures evenly from the joints' ranges, ±π without one, and the shortest moves.

    Raises:
        UsageError: C02, a joint has neither a limit of speed nor of acceleration, or cannot carry
            the arm's own weight.
    """
    if moves < 1 or not 0.0 < authority <= 1.0 or not (math.isfinite(rest) and rest >= 0.0):
        raise UsageError(
            "C02", f"{moves} moves at {authority:g} of the limits with rests of {rest:g} s",
            where="via points", remedy="give at least one move, an authority above 0 up to 1 and "
            "a rest of at least 0 s")
    low, high = np.array([joint.position for joint in robot.joints]).T
    widest = np.where(np.array(robot.revolute), math.pi, 1.0)
    low, high = np.maximum(low, -widest), np.minimum(high, widest)
    if (low >= high).any():
        j = int(np.flatnonzero(low >= high)[0])
        raise UsageError("C02", f"the range of joint {j + 1} lies beyond a turn", where=robot.name,
                         remedy="shift its offset")
    q = rng.uniform(low, high, (moves + 1, robot.n_joints))
    seconds = np.array([_shortest(robot, a, b, arm, authority) for a, b in pairwise(q)])
    return ViaPoints(q, seconds, rest)


def _shortest(robot: RobotDescription, start: Array, end: Array, arm: Arm | None,
              authority: float) -> float:
    """Return the shortest time [s] of a move."""
    step = np.abs(end - start)
    speed, acceleration, limit = (
        authority * np.array([getattr(joint, key) for joint in robot.joints])
        for key in ("velocity", "acceleration", "torque"))
    T = float(np.maximum(STEEPEST * step / speed, np.sqrt(MOST_BENT * step / acceleration)).max())
    if T == 0.0:
        raise UsageError("C02", "no joint has a limit of speed or acceleration", where=robot.name,
                         remedy="write velocity and acceleration into the robot description")
    if arm is None:
        return T
    r = np.linspace(0.0, 1.0, CONFIG.move_points)[:, None]

    def fits(rate: float) -> bool:
        motion = _quintic(r[:, 0] / rate, start, end, r, 1.0 / rate)
        return bool((np.abs(arm.torque(motion)) <= limit).all())

    slow = next((rate for k in range(DOUBLINGS) if fits(rate := 0.5**k / T)), None)
    if slow is None:
        raise UsageError("C02", "a joint cannot carry the arm's own weight and friction within "
                         "its torque limit", where=robot.name,
                         remedy="check the torque limits and the model")
    return T if slow == 1.0 / T else 1.0 / largest(fits, slow, 2.0 * slow)

"""Refuse a reference motion that the arm cannot follow: position, speed, acceleration and torque of every joint."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription
from pipelines.model.arm import Arm
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Demand", "demands", "refuse_beyond_limits"]

_ROUNDING = 1e-9  # a limit is met, not exceeded, this share above it

# how a quantity shrinks when the motion is slowed down: by which power of the factor
_POWERS = {"speed": 1, "acceleration": 2}


@dataclass(frozen=True)
class Demand:
    """What a motion asks most of one joint."""

    joint: int  # counted from 1
    quantity: str  # "speed", "acceleration", "torque"
    peak: float
    limit: float
    unit: str
    sample: int

    @property
    def share(self) -> float:
        """Peak over limit."""
        return self.peak / self.limit


def demands(robot: RobotDescription, motion: Motion, arm: Arm | None = None) -> tuple[Demand, ...]:
    """The peaks of speed, acceleration and, with a model, torque of each joint, beside its limits."""
    return tuple(_demands(robot, motion, arm))


def _demands(robot: RobotDescription, motion: Motion, arm: Arm | None) -> Iterator[Demand]:
    signals: list[tuple[str, str, Array, str, str]] = [
        ("speed", "velocity", motion.dq, "rad/s", "m/s"), ("acceleration", "acceleration", motion.ddq, "rad/s^2", "m/s^2")]
    if arm is not None:
        signals.append(("torque", "torque", arm.torque(motion), "N m", "N"))
    for quantity, key, values, turning, sliding in signals:
        for j, joint in enumerate(robot.joints):
            sample = int(np.argmax(np.abs(values[:, j])))
            yield Demand(j + 1, quantity, float(abs(values[sample, j])), float(getattr(joint, key)),
                         turning if joint.revolute else sliding, sample)


def refuse_beyond_limits(robot: RobotDescription, motion: Motion, arm: Arm | None, place: Callable[[int], str]) -> None:
    """Refuse a motion beyond a limit of the description; `place` says in words where a sample is.

    Raises:
        UsageError: names the joint, the place, the limit, and what would do.
    """
    for j, joint in enumerate(robot.joints):
        low, high = joint.position
        if (outside := np.flatnonzero((motion.q[:, j] < low) | (motion.q[:, j] > high))).size:
            k = int(outside[0])
            unit = "rad" if joint.revolute else "m"
            raise UsageError("C02", f"joint {j + 1}, {joint.name}, would be at {motion.q[k, j]:.3f} {unit} at {motion.t[k]:.3f} s; "
                             f"its range is {low:.3f} to {high:.3f} {unit}", where=place(k), remedy="move the task, or shrink it")
    for quantity in ("speed", "acceleration", "torque"):
        found = [one for one in demands(robot, motion, arm) if one.quantity == quantity]
        if not found:
            continue
        worst = max(found, key=lambda one: one.share)
        if worst.share > 1.0 + _ROUNDING:
            raise UsageError("C02", f"joint {worst.joint}, {robot.joints[worst.joint - 1].name}, would need {quantity} "
                             f"{worst.peak:.4g} {worst.unit} at {motion.t[worst.sample]:.3f} s; its limit is {worst.limit:.4g} "
                             f"{worst.unit}", where=place(worst.sample), remedy=_remedy(worst))


def _remedy(worst: Demand) -> str:
    if (power := _POWERS.get(worst.quantity)) is None:
        return "slow the task down, or move it to where the arm's own weight asks for less"
    return f"slow the task down to {100.0 * worst.share**(-1.0 / power):.0f} % of its speed, or move it"

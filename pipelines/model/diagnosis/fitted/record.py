"""What the record makes of torque: as it comes out of an effect that all torque of its joint passes through.

    recorded(arm, table, motion)                  columns over a motion, by everything in `arm` that changes the record
    recorded_of(changing(arm, joint), x, motion)  the same of torque of one joint
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.rigid.body import Motion

__all__ = ["changing", "recorded", "recorded_of"]


def changing(arm: Arm, joint: int) -> tuple[Acting, ...]:
    """What in `arm` all recorded torque of `joint`, from 1, passes through, in that order."""
    return tuple(acting for acting in arm.effects if acting.effect.acts_on == "record" and (acting.effect.joint or 1) == joint)


def recorded_of(through: Sequence[Acting], x: Array, motion: Motion) -> Array:
    """Torque (…, samples) of one joint as it comes out of what it passes `through`.

    Where the log tells the torque at its start, that is no column's: each begins with nothing.
    """
    start = None if motion.logged is None else 0.0
    for acting in through:
        amplitude = float(acting.effect.amplitudes(acting.values)[0])
        x = acting.effect.passed(amplitude, x, motion.t, start, motion.since)
    return x


def recorded(arm: Arm, table: Array, motion: Motion) -> Array:
    """Torque (samples, joints) or columns (samples, joints, k) as they come out of all in `arm` that changes the record."""
    for joint in range(1, arm.n_joints + 1):
        through = changing(arm, joint)
        if through:
            own, table = np.ascontiguousarray(table[:, joint - 1].T), table.copy()
            table[:, joint - 1] = recorded_of(through, own, motion).T
    return table

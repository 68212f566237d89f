"""Pass torque through the low-pass of its record.

    recorded(arm, table, motion)
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.rigid.body import Motion
from pipelines.signal.first_order import lagging

__all__ = ["recorded"]


def recorded(arm: Arm, table: Array, motion: Motion) -> Array:
    """Return torque (samples, joints), or columns (samples, joints, k), as `arm` records them.

    Where the log tells the torque at its start, that is no column's: each begins with nothing.
    """
    start = None if motion.logged is None else 0.0
    for acting in arm.effects:
        if acting.effect.acts_on != "record":
            continue
        joint, time = (acting.effect.joint or 1) - 1, float(acting.effect.amplitudes(acting.values)[0])
        own, table = np.ascontiguousarray(table[:, joint].T), table.copy()
        table[:, joint] = lagging(own, motion.t, time, start, motion.since).T
    return table

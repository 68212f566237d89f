"""Pass torque through what changes its record, a low-pass say.

    recorded(arm, table, motion)
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.rigid.body import Motion

__all__ = ["recorded"]


def recorded(arm: Arm, table: Array, motion: Motion) -> Array:
    """Return torque (samples, joints), or columns (samples, joints, k), as `arm` records them.

    Where the log tells the torque at its start, that is no column's: each begins with nothing.
    """
    start = None if motion.logged is None else 0.0
    for acting in arm.effects:
        if acting.effect.acts_on != "record":
            continue
        joint, amplitude = (acting.effect.joint or 1) - 1, float(acting.effect.amplitudes(acting.values)[0])
        own, table = np.ascontiguousarray(table[:, joint].T), table.copy()
        table[:, joint] = acting.effect.passed(amplitude, own, motion.t, start, motion.since).T
    return table

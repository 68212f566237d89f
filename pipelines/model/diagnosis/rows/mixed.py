"""Rows of torques that drives mix at every moment.

    mixable(data)             whether the rows of M τ(t) are the rows mixed
    mixed(data, M, rows)      rows of M τ, of the rows of τ

What is done to a signal is linear, and the same for every joint: so it is the same before and after.
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.rows.data import Data

__all__ = ["mixable", "mixed"]


def mixable(data: Data) -> bool:
    """Not where rows of some joints do not count, or each joint's pass a whitening of its own."""
    return bool(data.counts.all()) and all(one.whitening is None for one in data.logs)


def mixed(data: Data, matrix: Array, rows: Array) -> Array:
    """(rows,) of (joints, joints) `matrix` times the torque that has these `rows` (rows,)."""
    return np.concatenate([(matrix @ one).ravel() for one in data.split(rows)])

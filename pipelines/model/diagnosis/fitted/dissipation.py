"""Friction takes power out of a joint: the amplitudes of its laws do not change sign in a fit.

    beta = dissipating(beta, laws)             amplitudes below zero brought there
    places = driving(beta, shift, laws)        those that a step would take below

A negative viscous friction leaves a little less where it was fitted, and is wrong at every other speed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.effects.base import Effect
from pipelines.model.effects.kinds import FrictionLaw

__all__ = ["dissipating", "driving"]


def dissipating(beta: Array, laws: Sequence[Effect]) -> Array:
    """`beta`, its last numbers the amplitudes of `laws`, with those of friction not below zero where their range begins there."""
    bound = _bounded(len(beta), laws)
    return np.where(bound, np.maximum(beta, 0.0), beta)


def driving(beta: Array, shift: Array, laws: Sequence[Effect]) -> list[int]:
    """Places of the amplitudes that `shift` (its first numbers those of `beta`) would take below zero."""
    there = beta + shift[:len(beta)]
    return np.flatnonzero(_bounded(len(beta), laws) & (there < 0.0)).tolist()


def _bounded(count: int, laws: Sequence[Effect]) -> npt.NDArray[np.bool_]:
    own = [isinstance(law, FrictionLaw) and quantity.low == 0.0
           for law in laws for quantity in law.parameters if not quantity.shape]
    return np.array([False] * (count - len(own)) + own, dtype=bool)

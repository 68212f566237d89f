"""Speed-ups that an effect may offer: without them every answer is the same, to rounding, and takes longer.

An effect that has some is a `Fast`, and overrides what it can do faster. Callers ask the functions below, which fall back on
`columns`, `torque` and `simulate` for any other effect.

    from_motion(effect)                         its columns do not depend on the arm, and can be kept for the next one
    several_columns(shapes, motion, arm)        `columns` of several shapes at once
    own_columns(shapes, motion, arm)            the same of effects on their own joint alone
    shape_slopes(effect, motion, amplitudes)    slopes by non-linear numbers in closed form
    speed_curve(effect, values)                 a torque that depends on the speed of its joint alone
    own_load(effect, values)                    the load of `simulate` as a function of its joint's angle and speed
    own_memory(effect, values)                  the same of a load with one state
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.model.effects.base import ArmModel, Effect, OwnLoad, OwnMemory, SpeedCurve, Values

__all__ = ["Fast", "from_motion", "own_columns", "own_load", "own_memory",
           "several_columns", "shape_slopes", "speed_curve"]


@dataclass(frozen=True)
class Fast(Effect):
    """An effect with speed-ups."""

    from_motion: ClassVar[bool] = False  # its columns follow from the motion alone, whatever the arm

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """Return `columns` of several shapes of itself."""
        return [shape.columns(motion, arm) for shape in shapes]

    def own_columns(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> Array:
        """Return those of shapes that act on this joint alone: (shapes, amplitudes, samples)."""
        return np.stack([shape.columns(motion, arm)[:, self._index].T for shape in shapes])

    def shape_slopes(self, motion: Motion, amplitudes: Array) -> Array | None:
        """Return slopes of its torque on its own joint by the logarithm of each non-linear number: (samples, numbers) [N m]."""
        return None

    def speed_curve(self, values: Values) -> SpeedCurve | None:
        """Return its torque as a `SpeedCurve`, where it is one and nothing else: `simulate` then is not asked."""
        return None

    def own_load(self, values: Values) -> OwnLoad | None:
        """Return the load of `simulate` as a function of angle and speed of its own joint, where it follows from these alone."""
        return None

    def own_memory(self, values: Values) -> OwnMemory | None:
        """Return the load of `simulate` where it has one state, whose rate follows from it and the speed of its own joint."""
        return None


def from_motion(effect: Effect) -> bool:
    """Return whether its columns follow from the motion alone."""
    return isinstance(effect, Fast) and effect.from_motion


def several_columns(shapes: Sequence[Effect], motion: Motion, arm: ArmModel) -> list[Array]:
    """Return `columns` of several shapes of one effect."""
    first = shapes[0]
    if isinstance(first, Fast):
        return first.several(shapes, motion, arm)  # type: ignore[arg-type]
    return [shape.columns(motion, arm) for shape in shapes]


def own_columns(shapes: Sequence[Effect], motion: Motion, arm: ArmModel) -> Array:
    """Return those of shapes of one effect that act on its joint alone: (shapes, amplitudes, samples)."""
    first = shapes[0]
    if isinstance(first, Fast):
        return first.own_columns(shapes, motion, arm)  # type: ignore[arg-type]
    return np.stack([shape.columns(motion, arm)[:, (shape.joint or 1) - 1].T for shape in shapes])


def shape_slopes(effect: Effect, motion: Motion, amplitudes: Array) -> Array | None:
    """Return slopes by the logarithm of each non-linear number; None: they are found by differences."""
    return effect.shape_slopes(motion, amplitudes) if isinstance(effect, Fast) else None


def speed_curve(effect: Effect, values: Values) -> SpeedCurve | None:
    """Return its torque as a curve of its joint's speed; None where it is more than that."""
    return effect.speed_curve(values) if isinstance(effect, Fast) else None


def own_load(effect: Effect, values: Values) -> OwnLoad | None:
    """Return the load of `simulate` in plain numbers; None where arrays are needed."""
    return effect.own_load(values) if isinstance(effect, Fast) else None


def own_memory(effect: Effect, values: Values) -> OwnMemory | None:
    """Return the load of `simulate` and its one state in plain numbers; None where arrays are needed."""
    return effect.own_memory(values) if isinstance(effect, Fast) else None

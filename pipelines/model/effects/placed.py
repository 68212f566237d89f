"""What acts at one joint: its own column among those of all joints, and how that joint moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.model.effects.terms import ArmModel, Numbered, Values

__all__ = ["Placed"]

_BEYOND = 0.1  # of the range in which it was seen: behind that nobody knows how it goes on


class Placed(Numbered):
    """Part of an effect."""

    joint: int | None
    name: ClassVar[str]

    def sharpnesses(self, motion: Motion, count: int) -> list[float]:
        """[s/rad] largest first: a geometric grid between the slowest and the fastest speeds that this motion holds."""
        speed = np.abs(self.own(motion.dq))
        moving = speed[speed > 0]
        fast, slow = (moving.max(), np.quantile(moving, 0.02)) if moving.size else (1.0, 0.01)
        return [float(w) for w in np.geomspace(1 / fast, 2 / max(slow, 1e-3 * fast), count)[::-1]]

    def own(self, signal: Array) -> Array:
        """Column of its own joint, (samples,)."""
        return np.asarray(signal[..., self._index])

    def with_own(self, numbers: tuple[float, ...], own: float) -> tuple[float, ...]:
        """`numbers` of all joints, with `own` in its own place."""
        return (*numbers[:self._index], own, *numbers[self._index + 1:])

    def goes_round(self, motion: Motion, but: float = 0.02) -> bool:
        """Whether its own joint travels all of a circle but for a fiftieth, or such a part of it: what it does there comes back to
        where it began."""
        return float(np.ptp(self.own(motion.q))) > (1.0 - but) * 2.0 * np.pi

    def goes_beyond(self, motions: Sequence[Motion], known: Sequence[Motion]) -> bool:
        """Return whether its joint leaves the range of its angles in `known` by more than a tenth."""
        now, then = (np.concatenate([self.own(motion.q) for motion in some]) for some in (motions, known))
        return bool(max(now.max() - then.max(), then.min() - now.min()) > _BEYOND * np.ptp(then))

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Return its torque (samples,) [N m] on its own joint against speed alone, at rest otherwise."""
        still = np.zeros((len(dq), arm.n_joints))
        motion = Motion(np.zeros(len(dq)), still, self.on_own_row(arm, dq)[..., 0], still)
        return self.own(self.torque(motion, arm, values))

    def on_own_row(self, arm: ArmModel, *columns: Array) -> Array:
        """`columns`, each (samples,), as (samples, joints, columns): they act on its own joint only. Samples lie side by side."""
        rows = np.zeros((arm.n_joints, len(columns), len(columns[0])))
        for k, column in enumerate(columns):
            rows[self._index, k] = column
        return rows.transpose(2, 0, 1)

    @property
    def _index(self) -> int:
        if self.joint is None:
            raise ValueError(f"{self.name} belongs to the whole arm and has no joint of its own")
        return self.joint - 1

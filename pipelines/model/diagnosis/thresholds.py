"""What a cause has to exceed before it is believed: what the twin, in which nothing is wrong, shows of it and of its like.

A threshold is three times the larger of the most that any replica gives the cause itself, and half the most that any gives any
cause at the same place. The second keeps the luck of few replicas out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.candidates import Family
from pipelines.model.diagnosis.screen import Screened, screen
from pipelines.model.diagnosis.twin import Twin

__all__ = ["Thresholds", "without_twin"]

_TIMES, _FAMILY = 3.0, 0.5
_SHARE = 0.02  # of the squared weighted residual of one joint: what is less is no finding, whatever the twin says


@dataclass(frozen=True, eq=False)
class Thresholds:
    """Gains of squared weighted residual, of families in their order, with joints weighted by `weight`."""

    gain: Array  # (families,)
    own: Array  # (families,) the most that any replica gives
    origin: str
    weight: Array  # (joints,)
    joints: tuple[int | None, ...]  # of the families

    @classmethod
    def of_twin(cls, twin: Twin, families: Sequence[Family], arm: Arm, weight: Array) -> Thresholds:
        fit, residuals = twin.weighted(weight)
        found = screen(twin.data, fit, families, arm, residuals)
        own = np.array([one.gain.max() for one in found])
        alike = {joint: max(o for o, f in zip(own, families, strict=True) if f.joint == joint)
                 for joint in {f.joint for f in families}}
        family = np.array([alike[f.joint] for f in families])
        return cls(_TIMES * np.maximum(own, _FAMILY * family), own, f"{len(twin.fits)} replicas of the twin", weight,
                   tuple(f.joint for f in families))

    def at(self, weight: Array) -> Thresholds:
        """The same with other weights: a cause acts on its joint, one of the whole arm where that counts most."""
        ratio = np.square(weight / self.weight)
        scale = np.array([ratio.max() if joint is None else ratio[joint - 1] for joint in self.joints])
        return Thresholds(scale * self.gain, scale * self.own, self.origin, weight, self.joints)


def without_twin(found: Sequence[Screened], power: float, weight: Array) -> Thresholds:
    """Where nothing can be simulated: a share of the residual."""
    gain = np.full(len(found), _SHARE * power)
    return Thresholds(gain, np.zeros(len(found)), "a share of the residual", weight, tuple(one.joint for one in found))

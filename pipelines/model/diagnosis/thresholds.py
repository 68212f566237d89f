"""What a cause has to exceed before it is believed: what the twin, in which nothing is wrong, shows of it and of its like.

A threshold is three times the largest of: the most that any replica gives the cause itself; what half the causes at the same place
get, which keeps the luck of few replicas out; and a hundredth of what is left at the joint, which is of no use to anybody.
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

_TIMES = 3.0
_USELESS = 0.01  # of the squared weighted residual of a joint of the twin
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
        once = np.array([f.event for f in families])
        joint = np.array([f.joint or 0 for f in families])
        there = [own[(joint == j) & ~once] for j in range(len(weight) + 1)]
        usual = np.array([np.median(some) if len(some) else 0.0 for some in there])
        usual[0] = max(usual[0], float(np.median(usual[1:])))
        power = np.mean(residuals**2, axis=0)
        left = np.bincount(twin.data.joint, power, minlength=len(weight))
        least = _USELESS * np.append(left.mean(), left)
        gain = _TIMES * np.max([own, np.where(once, 0.0, usual[joint]), least[joint]], axis=0)
        return cls(gain, own, f"{len(twin.fits)} replicas of the twin", weight, tuple(f.joint for f in families))

    def at(self, weight: Array) -> Thresholds:
        """The same with other weights: a cause acts on its joint, one of the whole arm where that counts most."""
        ratio = np.square(weight / self.weight)
        scale = np.array([ratio.max() if joint is None else ratio[joint - 1] for joint in self.joints])
        return Thresholds(scale * self.gain, scale * self.own, self.origin, weight, self.joints)


def without_twin(found: Sequence[Screened], power: float, weight: Array) -> Thresholds:
    """Where nothing can be simulated: a share of the residual."""
    gain = np.full(len(found), _SHARE * power)
    return Thresholds(gain, np.zeros(len(found)), "a share of the residual", weight, tuple(one.joint for one in found))

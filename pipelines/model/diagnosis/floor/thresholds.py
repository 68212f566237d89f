"""What a cause has to exceed before it is believed: what the twin, in which nothing is wrong, shows of it and of its like.

A threshold is three times the largest of: the most that any replica gives the cause itself; what half the causes at the same place
get, which keeps the luck of few replicas out; and a hundredth of what is left at the joint, of white rows a thousandth, which is of
no use to anybody. Of what happened once, which no other log bears out, twice the most that any replica gives counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.nominal import Fit
from pipelines.model.diagnosis.floor.wide import ONCE, TIMES, USELESS, Wide, median
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Family, lay_family
from pipelines.model.diagnosis.screened.screen import Screened, screen

__all__ = ["LOUDER", "OF_THE_RESIDUAL", "SHARE", "Thresholds", "without_twin"]

# Times what logs leave of a joint, that their floor is at most: of 1246 diagnoses of the bench no twin left more than 2.1 times
# that of the fitted logs, 2.3 of those held out.
LOUDER = 4.0
OF_THE_RESIDUAL = "a share of the residual"  # an origin: nobody knows what an arm in order shows
SHARE = 0.02  # of the squared residual of all joints together, each in units of its own: what is less is no finding then


@dataclass(frozen=True, eq=False)
class Thresholds:
    """Gains of squared weighted residual, of families in their order, with joints weighted by `weight`."""

    gain: Array  # (families,)
    own: Array  # (families,) the most that any replica gives
    origin: str
    weight: Array  # (joints,)
    joints: tuple[int | None, ...]  # of the families
    wide: Wide | None = None  # what those of causes that act on several joints follow from, with other weights
    several: tuple[int, ...] = ()  # which of the families these are, in the order of `wide`

    @classmethod
    def of_twin(cls, fit: Fit, residuals: Array, families: Sequence[Family], arm: Arm, useless: float = USELESS,
                replicas: int | None = None) -> Thresholds:
        """`residuals` (replicas, rows), weighted, that `fit` leaves: as `Twin.weighted` makes them; `useless`: share of the squared
        residual of a joint that is of no use to anybody; `replicas` of which they are, where there are several of each."""
        data, weight = fit.data, fit.weight
        found = screen(data, fit, families, arm, residuals)
        own = np.array([one.gain.max() for one in found])
        joints = tuple(f.joint for f in families)
        once = np.array([f.event for f in families])
        usual = np.array([median(own[[j == joint and not event for j, event in zip(joints, once, strict=True)]])
                          for joint in range(1, len(weight) + 1)])
        left = np.asarray(np.bincount(data.joint, np.mean(residuals**2, axis=0), minlength=len(weight)), dtype=np.float64)
        place = np.array([(joint or 1) - 1 for joint in joints])
        gain = TIMES * np.max([np.where(once, ONCE, 1.0) * own, np.where(once, 0.0, usual[place]), useless * left[place]], axis=0)
        several = sorted(_on_several(data, families, arm), key=lambda place: joints[place] is not None)
        wide = Wide.of_twin(fit, residuals, [families[place] for place in several], usual, useless / USELESS * left, arm)
        return cls(gain, own, f"{replicas or len(residuals)} replicas of the twin", weight, joints, wide, tuple(several))

    def at(self, weight: Array) -> Thresholds:
        """The same with other weights: a cause acts on its joint; one on several is looked for anew, or counts where most."""
        ratio = np.square(weight / self.weight)
        scale = np.array([ratio.max() if joint is None else ratio[joint - 1] for joint in self.joints])
        gain, own = scale * self.gain, scale * self.own
        if self.wide is not None and self.several:
            gain[list(self.several)], own[list(self.several)] = self.wide.at(weight)
        return replace(self, gain=gain, own=own, weight=weight)


def _on_several(data: Data, families: Sequence[Family], arm: Arm) -> Iterator[int]:
    """Which of the families act on more than one joint, or on the whole arm."""
    for place, family in enumerate(families):
        if family.joint is None:
            yield place
        elif not family.event:
            laid = next(lay_family(data, family, arm))
            if (data.joint[laid.rows] != family.joint - 1).any():
                yield place


def without_twin(found: Sequence[Screened], power: float, weight: Array) -> Thresholds:
    """Where nothing can be simulated: a share of the residual."""
    gain = np.full(len(found), SHARE * power)
    return Thresholds(gain, np.zeros(len(found)), OF_THE_RESIDUAL, weight, tuple(one.joint for one in found))

"""Say how figures moved from item to item against their own uncertainty.

A figure x of n items, each with its standard deviation s: if nothing moved,

    χ² = Σ ((xᵢ - x̄) / sᵢ)²,    x̄ = Σ (xᵢ/sᵢ²) / Σ (1/sᵢ²)

follows a χ² distribution with n - 1 degrees of freedom (Bevington and Robinson 2003, eq. (4.17) for x̄, (4.19) for its variance,
§ 4.4 for χ²). An item has moved where it lies more than 3 std from the mean of the others that have not. A residual has no std
of its own: it is judged by how much it scatters, from a median absolute deviation, where there are enough items.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.batch.parts import Part
from pipelines.batch.record import Record
from pipelines.io.experiment import Array
from pipelines.model.parameter_names import quantity_of

__all__ = ["LIMIT", "Course", "Drift", "drift_of", "from_others"]

LIMIT: Final = 3.0  # [std]
_ENOUGH = 5  # items, to judge a residual by its scatter
_MAD_TO_STD = 1.4826  # of a normal distribution (Rousseeuw and Croux 1993)


@dataclass(frozen=True)
class Course:
    """One figure through the items of one robot, in the order of their recording."""

    name: str
    unit: str
    items: tuple[str, ...]
    value: Array
    std: Array | None  # None: a residual
    away: Array  # [std] of each item from the mean of the others; of a residual from the median
    chi_square: float | None
    freedom: int | None
    probability: float | None  # of so large a χ², if nothing moved
    trend: float  # [std] from the first item to the last

    @property
    def beyond(self) -> npt.NDArray[np.bool_]:
        """Which of them are beyond the limit."""
        return np.abs(self.away) > LIMIT

    @property
    def moved(self) -> tuple[str, ...]:
        """The items beyond the limit."""
        return tuple(item for item, far in zip(self.items, self.beyond, strict=True) if far)


@dataclass(frozen=True)
class Drift:
    """Every figure that more than one item of a robot has."""

    robot: str
    figures: tuple[Course, ...]
    residuals: tuple[Course, ...]


def drift_of(records: Iterable[Record]) -> tuple[Drift, ...]:
    """The courses of every robot's figures, in the order of the names; empty for robots with a single item."""
    robots: dict[str, list[_Seen]] = {}
    seen = [_Seen(record.name, part) for record in records
            if (part := record.part) is not None and (part.figures or part.residuals)]
    for one in sorted(seen, key=lambda one: (one.part.recorded, one.name)):
        robots.setdefault(one.part.robot, []).append(one)
    return tuple(Drift(robot, _figures(done), _residuals(done)) for robot, done in sorted(robots.items()) if len(done) > 1)


@dataclass(frozen=True)
class _Seen:
    """A part by the name it has among those of all items."""

    name: str
    part: Part


def _figures(done: Sequence[_Seen]) -> tuple[Course, ...]:
    courses = []
    for name in dict.fromkeys(name for one in done for name in one.part.figures):
        having = [one for one in done if name in one.part.figures]
        figures = [one.part.figures[name] for one in having]
        if len(having) > 1 and len({unit for _, _, unit in figures}) == 1:
            value, std = np.array([x for x, _, _ in figures]), np.array([s for _, s, _ in figures])
            turned = _on_one_turn(name, value, std)
            chi_square, freedom = _chi_square(turned, std), len(having) - 1
            trend = float((turned[-1] - turned[0]) / np.hypot(std[-1], std[0]))
            courses.append(Course(name, figures[0][2], tuple(one.name for one in having), value, std, from_others(turned, std),
                                  chi_square, freedom, _probability(chi_square, freedom), trend))
    return tuple(courses)


def _on_one_turn(name: str, value: Array, std: Array) -> Array:
    """`value` as it is; of an angle on a circle by as many turns that all lie within half a one of where most of them point."""
    kind = quantity_of(name)
    if kind is None or kind.period is None:
        return value
    turn = 2j * np.pi / kind.period
    middle = float(np.angle(np.sum(np.exp(turn * value) / std**2)) / abs(turn))
    return np.asarray(middle + (value - middle + kind.period / 2.0) % kind.period - kind.period / 2.0)


def _residuals(done: Sequence[_Seen]) -> tuple[Course, ...]:
    courses = []
    for name in dict.fromkeys(name for one in done for name in one.part.residuals):
        having = [one for one in done if name in one.part.residuals]
        if len(having) > 1:
            value = np.array([one.part.residuals[name][0] for one in having])
            scatter = _scatter(value)
            away = (value - np.median(value)) / scatter if scatter > 0.0 else np.zeros(len(value))
            trend = float(value[-1] - value[0]) / (np.sqrt(2.0) * scatter) if scatter > 0.0 else 0.0
            courses.append(Course(name, having[0].part.residuals[name][1], tuple(one.name for one in having), value, None, away,
                                  None, None, None, trend))
    return tuple(courses)


def from_others(value: Array, std: Array) -> Array:
    """[std] by which each value is away from the weighted mean of the others that have not moved.

    What has moved most is taken out of the mean first, and the rest looked at anew: one that is far away would draw the mean to
    itself, and others would seem to have moved. At least half of them stay.
    """
    kept = np.ones(len(value), dtype=bool)
    while True:
        away = _from_mean(value, std, kept)
        worst = int(np.argmax(np.where(kept, np.abs(away), 0.0)))
        if abs(away[worst]) <= LIMIT or np.sum(kept) <= max(2, (len(value) + 1) // 2):
            return away
        kept[worst] = False


def _from_mean(value: Array, std: Array, kept: npt.NDArray[np.bool_]) -> Array:
    """[std] by which each value is away from the weighted mean of the other `kept` ones."""
    weight = np.where(kept, 1.0 / std**2, 0.0)
    others = _sum_of_others(weight)
    return np.asarray((value - _sum_of_others(weight * value) / others) / np.sqrt(std**2 + 1.0 / others))


def _sum_of_others(x: Array) -> Array:
    """For each the sum of all but it; summed, not subtracted: beside a sure item the others would vanish in its digits."""
    before = np.concatenate(([0.0], np.cumsum(x[:-1])))
    after = np.concatenate((np.cumsum(x[:0:-1])[::-1], [0.0]))
    return before + after


def _chi_square(value: Array, std: Array) -> float:
    weight = 1.0 / std**2
    return float(np.sum(weight * (value - np.sum(weight * value) / np.sum(weight)) ** 2))


def _probability(chi_square: float, freedom: int) -> float:
    from scipy.special import gammaincc

    return float(gammaincc(freedom / 2.0, chi_square / 2.0))


def _scatter(value: Array) -> float:
    """[unit of `value`] one standard deviation of most of them; 0 where too few tell."""
    if len(value) < _ENOUGH:
        return 0.0
    return float(_MAD_TO_STD * np.median(np.abs(value - np.median(value))))

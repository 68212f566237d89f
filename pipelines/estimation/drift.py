"""Compare the figures of one robot from session to session against their own uncertainty.

Of n values x, each with its standard deviation s, where nothing moved,

    χ² = Σ ((xᵢ - x̄) / sᵢ)²,    x̄ = Σ (xᵢ/sᵢ²) / Σ (1/sᵢ²)

follows a χ² distribution with n - 1 degrees of freedom (Bevington and Robinson 2003, eq. (4.17),
(4.19), § 4.4). A value has moved where it lies farther than the limit from the mean of the others
that have not. A residual has no std of its own: it is judged by the scatter of most of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipelines.dynamics.parameter_names import quantity_of
from pipelines.estimation.config import UncertaintyConfig
from pipelines.io.log import Array

_CONFIG = UncertaintyConfig()
_MAD_TO_STD = 1.4826  # numerics: of a normal distribution (Rousseeuw and Croux 1993)


@dataclass(frozen=True)
class Session:
    """The figures of one robot's logs of one day."""

    name: str
    robot: str = ""
    recorded: str = ""  # when; the order of the sessions
    # value, std, unit
    figures: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    residuals: Mapping[str, tuple[float, str]] = field(default_factory=dict)  # value, unit


@dataclass(frozen=True)
class DriftFigure:
    """One figure through the items, in the order of their recording."""

    name: str
    unit: str
    items: tuple[str, ...]
    value: tuple[float, ...]
    away: tuple[float, ...]  # [std] of each from the mean of those that have not moved
    trend: float  # [std] from the first item to the latest
    moved: tuple[str, ...]  # the items beyond three std
    std: tuple[float, ...] | None = None
    chi_square: float | None = None
    freedom: int | None = None
    probability: float | None = None  # of so large a χ² if nothing moved


@dataclass(frozen=True)
class RobotDrift:
    """Every figure that more than one item of a robot has."""

    robot: str
    figures: tuple[DriftFigure, ...]
    residuals: tuple[DriftFigure, ...]


def drift_of(sessions: Iterable[Session]) -> tuple[RobotDrift, ...]:
    """Return the drift of every robot with more than one session, in the order of their names."""
    robots: dict[str, list[Session]] = {}
    for session in sorted(sessions, key=lambda one: (one.recorded, one.name)):
        if session.figures or session.residuals:
            robots.setdefault(session.robot, []).append(session)
    return tuple(
        RobotDrift(
            robot,
            _series([(one.name, one.figures) for one in own]),
            _series([(one.name, one.residuals) for one in own]),
        )
        for robot, own in sorted(robots.items())
        if len(own) > 1
    )


def _series(
    sessions: Sequence[tuple[str, Mapping[str, tuple[Any, ...]]]],
) -> tuple[DriftFigure, ...]:
    """Return every figure that two sessions have in the same unit."""
    found = []
    for name in dict.fromkeys(name for _, numbers in sessions for name in numbers):
        values = {item: numbers[name] for item, numbers in sessions if name in numbers}
        units = {numbers[-1] for numbers in values.values()}
        if len(values) < 2 or len(units) > 1:
            continue
        value = np.array([numbers[0] for numbers in values.values()], dtype=np.float64)
        if all(len(numbers) > 2 for numbers in values.values()):
            std = np.array([numbers[1] for numbers in values.values()], dtype=np.float64)
            away, own = _of_figure(_on_one_turn(name, value, std), std)
        else:
            away, own = _of_residual(value)
        moved = tuple(np.array(list(values))[np.abs(away) > _CONFIG.limit].tolist())
        items, numbers = tuple(values), tuple(value.tolist())
        found.append(
            DriftFigure(name, units.pop(), items, numbers, tuple(away.tolist()), moved=moved, **own)
        )
    return tuple(found)


def _of_figure(value: Array, std: Array) -> tuple[Array, dict[str, Any]]:
    """Judge values by their own standard deviations."""
    from scipy.special import gammaincc

    weight, freedom = 1.0 / std**2, len(value) - 1
    mean = np.sum(weight * value) / np.sum(weight)
    chi_square = float(np.sum(weight * (value - mean) ** 2))
    return from_others(value, std), {
        "std": tuple(std.tolist()),
        "chi_square": chi_square,
        "freedom": freedom,
        "probability": float(gammaincc(freedom / 2.0, chi_square / 2.0)),
        "trend": float((value[-1] - value[0]) / np.hypot(std[-1], std[0])),
    }


def _of_residual(value: Array) -> tuple[Array, dict[str, Any]]:
    """Judge by the median absolute deviation, where there are enough items."""
    deviation = value - np.median(value)
    scatter = _MAD_TO_STD * float(np.median(np.abs(deviation)))
    if len(value) < _CONFIG.enough or scatter == 0.0:
        return np.zeros(len(value)), {"trend": 0.0}
    return deviation / scatter, {"trend": float(value[-1] - value[0]) / (math.sqrt(2.0) * scatter)}


def _on_one_turn(name: str, value: Array, std: Array) -> Array:
    """Return `value`; an angle on a circle within half a turn of where most of them point."""
    quantity = quantity_of(name)
    if quantity is None or quantity.period is None:
        return value
    half, turn = quantity.period / 2.0, 2j * np.pi / quantity.period
    middle = float(np.angle(np.sum(np.exp(turn * value) / std**2)) / abs(turn))
    return np.asarray(middle + (value - middle + half) % quantity.period - half)


def from_others(value: Array, std: Array) -> Array:
    """Return how far each value is from the weighted mean of the others that have not moved [std].

    What moved most leaves the mean first, and the rest is judged anew: it would draw the mean to
    itself, and others would seem to have moved. At least half of them stay.
    """
    kept = np.ones(len(value), dtype=bool)
    while True:
        weight = np.where(kept, 1.0 / std**2, 0.0) * ~np.eye(len(value), dtype=bool)
        others = weight.sum(axis=1)
        away = np.asarray((value - weight @ value / others) / np.sqrt(std**2 + 1.0 / others))
        worst = int(np.argmax(np.where(kept, np.abs(away), 0.0)))
        if abs(away[worst]) <= _CONFIG.limit or np.sum(kept) <= max(2, (len(value) + 1) // 2):
            return away
        kept[worst] = False


def is_drift(drift: RobotDrift) -> bool:
    """Return whether a robot's figures moved farther than chance moves the farthest of so many.

    χ² shows many items that moved a little, the farthest item a single one among hundreds: both
    are tested, at levels for which all tests together keep the false alarm rate (Šidák 1967).
    """
    tests = len(drift.figures), sum(len(one.items) for one in drift.figures)
    level, level_of_items = (
        -math.expm1(math.log1p(-_CONFIG.false_alarms) / (2 * max(1, count))) for count in tests
    )
    for one in drift.figures:
        farthest = math.erfc(max(map(abs, one.away)) / math.sqrt(2.0))
        if one.moved and ((one.probability or 0.0) < level or farthest < level_of_items):
            return True
    return False

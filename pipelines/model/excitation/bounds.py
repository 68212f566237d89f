"""What the torque of a motion may be where each parameter is known to lie between bounds, and no better.

    |τ - Y β| ≤ |Y| h,    β = (low + high)/2,    h = (high - low)/2

holds for any parameters between the bounds, and some of them reach it: nothing smaller is safe.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipelines.errors import UsageError
from pipelines.io.sandbox import TomlError, parse_toml
from pipelines.model.excitation.columns import ArmColumns
from pipelines.model.rigid.body import Array

__all__ = ["ParameterBounds", "parse_bounds", "spread_of_torque"]

_OFFSET = "torque_offset:"  # of no offset nothing need be said


@dataclass(frozen=True, eq=False)
class ParameterBounds:
    """Each (columns,), in the order of the equations' columns and in their units."""

    low: Array
    high: Array

    @property
    def middle(self) -> Array:
        return 0.5 * (self.low + self.high)

    @property
    def half(self) -> Array:
        return 0.5 * (self.high - self.low)

    @property
    def largest(self) -> Array:
        """What each may be at most, without its sign."""
        return np.maximum(np.abs(self.low), np.abs(self.high))


def parse_bounds(text: str, columns: ArmColumns, where: str) -> ParameterBounds:
    """Bounds written as TOML, one line a parameter: p1 = [0.2, 0.4], "coulomb:1" = [0.0, 2.0].

    Raises:
        UsageError: C02, no TOML, an unknown or a missing name, or no pair from low to high.
    """
    try:
        given = parse_toml(text)
    except TomlError as problem:
        raise UsageError("C02", f"not TOML: {problem}", where=where, remedy="write for example p1 = [0.2, 0.4]") from None
    unknown = [name for name in given if name not in columns.names]
    missing = [name for name in columns.names if name not in given and not name.startswith(_OFFSET)]
    if unknown or missing:
        said = [f"{words} {', '.join(names)}" for words, names in (("unknown:", unknown), ("missing:", missing)) if names]
        raise UsageError("C02", f"bounds of parameters, {'; '.join(said)}", where=where,
                         remedy=f"give [low, high] of {', '.join(columns.names)}")
    pairs = [_pair(name, given.get(name, [0.0, 0.0]), where) for name in columns.names]
    low, high = np.array(pairs).T
    return ParameterBounds(low, high)


def _pair(name: str, value: object, where: str) -> tuple[float, float]:
    if isinstance(value, list) and len(value) == 2 and all(isinstance(x, int | float) and math.isfinite(x) for x in value):
        low, high = float(value[0]), float(value[1])
        if low <= high:
            return low, high
    raise UsageError("C02", f"{name} has no bounds from low to high", where=where, remedy=f"write for example {name} = [0.2, 0.4]")


def spread_of_torque(columns: ArmColumns, half: Array, rows: tuple[Array, ...]) -> Array:
    """|Y| h (joints, samples): how far the torque may lie from the bounds' middle."""
    return np.stack([half[own] @ np.abs(row) for own, row in zip(columns.columns, rows, strict=True)])

"""Turn a planned motion into what a robot's controller reads: a recipe of `import`, run backwards.

    offset -> transmission -> unit -> sign -> scale        q_motor = N (q_joint - offset)

in the recipe's order of columns, at its rate. Importing the table again by the same recipe gives back the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipelines.errors import UsageError
from pipelines.log import schema
from pipelines.log.atomic import write_file
from pipelines.log.experiment import Array
from pipelines.log.recording.joint_side import drive_of, units_of_joints
from pipelines.log.recording.recipe import Numbers, Recipe, SignalSpec
from pipelines.log.robot import RobotDescription
from pipelines.log.table import csv_cell
from pipelines.log.units import to_si

__all__ = ["ControllerTable", "controller_table", "write_controller_table"]


@dataclass(frozen=True, eq=False)
class ControllerTable:
    """Named columns for a controller."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array  # (samples, columns)
    rate: float  # [Hz]


def controller_table(
    recipe: Recipe | None,
    robot: RobotDescription,
    motion: Callable[[Array], Array],
    duration: float,
    sample_time: float,
) -> ControllerTable:
    """Positions at the controller's rate, in its units and on its side of the drive.

    Args:
        recipe: how recordings of this robot are imported; None: joint side, SI, at `sample_time` [s].
        motion: q (samples, joints) [rad] at times (samples,) [s].

    Raises:
        UsageError: C02, the recipe does not say how positions are recorded, or does not fit the robot.
    """
    rate = _rate(recipe, sample_time)
    t = np.arange(round(duration * rate) + 1) / rate
    q, n = motion(t), robot.n_joints
    if recipe is None:
        units = tuple(schema.joint_unit("q", revolute) for revolute in robot.revolute)
        return _with_time(t, tuple(f"q_{j + 1}" for j in range(n)), units, q, rate)
    spec = recipe.signals.get("q")
    if spec is None:
        remedy = "give a recipe that imports positions"
        raise UsageError("C02", "the recipe has no signal q", where=recipe.where, remedy=remedy)
    units = (
        units_of_joints("q", spec, robot, recipe.where, [])
        if spec.unit
        else tuple(schema.joint_unit("q", revolute) for revolute in robot.revolute)
    )
    values = (q - _each(spec.offset, n, recipe)) if np.any(spec.offset) else q
    drive = drive_of(recipe.drive, robot, recipe.where)
    if spec.side == "motor" or (spec.side is None and recipe.drive.transmission is not None):
        if drive is None or drive.transmission is None:
            message = "signals.q is on the motor side, but there is no drive.transmission"
            remedy = "add [drive] transmission = the gear ratios"
            raise UsageError("C02", message, where=recipe.where, remedy=remedy)
        values = values @ np.array(drive.transmission).T
    values = (
        values
        / _factor(units, spec, n, recipe)
        / _each(spec.sign, n, recipe)
        / _each(spec.scale, n, recipe)
    )
    return _with_time(t, _names(spec, n), units, values, rate)


def _rate(recipe: Recipe | None, sample_time: float) -> float:
    if recipe is not None and recipe.time.rate:
        return recipe.time.rate
    return 1.0 / (
        recipe.time.sample_time if recipe is not None and recipe.time.sample_time else sample_time
    )


def _with_time(
    t: Array, names: tuple[str, ...], units: tuple[str, ...], values: Array, rate: float
) -> ControllerTable:
    return ControllerTable(("t", *names), ("s", *units), np.column_stack([t, values]), rate)


def _each(value: Numbers, n: int, recipe: Recipe) -> Array:
    if isinstance(value, tuple) and len(value) != n:
        message = f"signals.q holds {len(value)} numbers, the robot has {n} joints"
        raise UsageError("C02", message, where=recipe.where, remedy="one number, or one a joint")
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (n,))


def _factor(units: tuple[str, ...], spec: SignalSpec, n: int, recipe: Recipe) -> Array:
    """SI per recorded number of each joint."""
    if "counts" in units:
        if spec.counts_per_rev is None:
            message = "counts without counts_per_rev"
            raise UsageError("C02", message, where=recipe.where, remedy="add it to signals.q")
        turn = 2.0 * math.pi / _each(spec.counts_per_rev, n, recipe)
        return np.array(
            [
                turn[j] if unit == "counts" else to_si(unit, "position", where=recipe.where).factor
                for j, unit in enumerate(units)
            ]
        )
    return np.array([to_si(unit, "position", where=recipe.where).factor for unit in units])


def _names(spec: SignalSpec, n: int) -> tuple[str, ...]:
    """Columns as the recipe calls them; numbered where it gives none by name."""
    where = spec.where
    if (
        isinstance(where, tuple)
        and len(where) == n
        and all(isinstance(name, str) for name in where)
    ):
        return tuple(map(str, where))
    if isinstance(where, str) and "{j}" in where:
        return tuple(where.replace("{j}", str(j + 1)) for j in range(n))
    return tuple(f"q_{j + 1}" for j in range(n))


def write_controller_table(path: Path, table: ControllerTable) -> None:
    """As CSV: one header line of names, each number with all its digits."""

    def fill(draft: Path) -> None:
        with draft.open("w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(map(csv_cell, table.names)) + "\n")
            for start in range(0, len(table.values), 8192):
                file.writelines(
                    ",".join(map(repr, row)) + "\n"
                    for row in table.values[start : start + 8192].tolist()
                )

    write_file(path, fill)

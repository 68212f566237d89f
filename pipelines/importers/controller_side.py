"""Turn a planned motion into what a robot's controller reads: a recipe of `import`, run backwards.

    offset -> transmission -> unit -> sign -> scale        q_motor = N (q_joint - offset)

in the recipe's order of columns, at its rate. Importing the table by the recipe gives the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipelines.errors import UsageError
from pipelines.importers.joint_side import drive_of, per_joint, units_of_joints
from pipelines.importers.recipe import Recipe, SignalSpec
from pipelines.io import schema
from pipelines.io.atomic import write_file
from pipelines.io.experiment import Array
from pipelines.io.robot import RobotDescription
from pipelines.io.table import csv_cell
from pipelines.io.units import to_si

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
    """Return positions at the controller's rate, in its units and on its side of the drive.

    Args:
        recipe: of the robot's recordings; None: joint side, SI, at `sample_time` [s].
        motion: q (samples, joints) [rad] at times (samples,) [s].

    Raises:
        UsageError: C02, the recipe does not say how positions are recorded, or does not fit.
    """
    rate = 1.0 / sample_time
    if recipe is not None:
        rate = recipe.time.rate or 1.0 / (recipe.time.sample_time or sample_time)
    t = np.arange(round(duration * rate) + 1) / rate
    values, n = motion(t), robot.n_joints
    names = tuple(f"q_{j + 1}" for j in range(n))
    units = tuple(schema.joint_unit("q", revolute) for revolute in robot.revolute)
    if recipe is not None:
        spec, where = recipe.signals.get("q"), recipe.where
        if spec is None:
            message, remedy = "the recipe has no signal q", "give a recipe that imports positions"
            raise UsageError("C02", message, where=where, remedy=remedy)
        units = units_of_joints("q", spec, robot, where, []) if spec.unit else units
        if np.any(spec.offset):
            values = values - per_joint(spec.offset, n, "signals.q", where)
        drive = drive_of(recipe.drive, robot, where)
        motor = recipe.drive.transmission is not None if spec.side is None else spec.side == "motor"
        if motor:
            if drive is None or drive.transmission is None:
                message = "signals.q is on the motor side, but there is no drive.transmission"
                remedy = "add [drive] transmission = the gear ratios"
                raise UsageError("C02", message, where=where, remedy=remedy)
            values = values @ np.array(drive.transmission).T
        values = values / _factors(units, spec, n, where)
        values = values / per_joint(spec.sign, n, "signals.q", where)
        values = values / per_joint(spec.scale, n, "signals.q", where)
        names = _names(spec, n)
    return ControllerTable(("t", *names), ("s", *units), np.column_stack([t, values]), rate)


def _factors(units: tuple[str, ...], spec: SignalSpec, n: int, where: str) -> Array:
    """Return SI per recorded number of each joint."""
    turn = np.full(n, math.nan)
    if "counts" in units:
        if spec.counts_per_rev is None:
            remedy = "add it to signals.q"
            raise UsageError("C02", "counts without counts_per_rev", where=where, remedy=remedy)
        turn = 2.0 * math.pi / per_joint(spec.counts_per_rev, n, "signals.q", where)
    pairs = zip(units, turn.tolist(), strict=True)
    si = [
        x if unit == "counts" else to_si(unit, "position", where=where).factor for unit, x in pairs
    ]
    return np.array(si)


def _names(spec: SignalSpec, n: int) -> tuple[str, ...]:
    """Return columns as the recipe calls them; numbered where it gives none by name."""
    where = spec.where
    if isinstance(where, tuple) and len(where) == n and all(isinstance(x, str) for x in where):
        return tuple(map(str, where))
    pattern = where if isinstance(where, str) and "{j}" in where else "q_{j}"
    return tuple(pattern.replace("{j}", str(j + 1)) for j in range(n))


def write_controller_table(path: Path, table: ControllerTable) -> None:
    """Write CSV: one header line of names, each number with all its digits."""

    def fill(draft: Path) -> None:
        with draft.open("w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(map(csv_cell, table.names)) + "\n")
            for start in range(0, len(table.values), 8192):
                rows = table.values[start : start + 8192].tolist()
                file.writelines(",".join(map(repr, row)) + "\n" for row in rows)

    write_file(path, fill)

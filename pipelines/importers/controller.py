"""Write a planned motion as a robot's controller reads it: a recipe of `import`, run backwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.errors import UsageError
from pipelines.importers.recipe import Recipe
from pipelines.importers.repair import Recording
from pipelines.importers.units import declared_units, drive_of, joint_side, own_units
from pipelines.io.log import Array
from pipelines.io.output import write_file
from pipelines.io.parquet import csv_cell
from pipelines.io.robot import RobotDescription


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
    """Return positions in the recipe's columns, at its rate: importing them gives the motion.

    Args:
        recipe: of the robot's recordings; None: joint side, SI, at `sample_time` [s].
        motion: q (samples, joints) [rad] at times (samples,) [s].

    Raises:
        UsageError: C02, the recipe does not say how positions are recorded, or does not fit.
    """
    rate, n = 1.0 / sample_time, robot.n_joints
    if recipe is not None:
        rate = recipe.time.rate or 1.0 / (recipe.time.sample_time or sample_time)
    t = np.arange(round(duration * rate) + 1) / rate
    values = motion(t)
    names, units = tuple(f"q_{j + 1}" for j in range(n)), own_units("q", robot)
    if recipe is not None:
        spec = recipe.signals.get("q")
        if spec is None:
            message, remedy = "the recipe has no signal q", "give a recipe that imports positions"
            raise UsageError("C02", message, recipe.where, remedy)
        units = declared_units("q", spec, robot, recipe.where)[0] if spec.unit else units
        # q = q_recorded A + b, of which zeros and a quarter of each unit vector show b and A.
        probe = 0.25 * np.eye(n + 1, n, -1)
        rows = np.arange(n + 1)
        recorded = Recording(probe[:, 0], {"q": probe}, {"q": names}, rows, recipe.where)
        alone = replace(recipe, signals={"q": replace(spec, wrap=None)})
        drive = drive_of(recipe.drive, robot, recipe.where)
        q = joint_side(recorded, alone, {"q": units}, robot, drive).signals["q"]
        b, a = q.values[0], 4.0 * (q.values[1:] - q.values[0])
        values = np.linalg.solve(a.T, (values - b).T).T
        at = spec.where  # columns as the recipe calls them; numbered where it gives none by name
        pattern = at if isinstance(at, str) and "{j}" in at else "q_{j}"
        names = tuple(pattern.replace("{j}", str(j + 1)) for j in range(n))
        if isinstance(at, tuple) and len(at) == n and all(isinstance(x, str) for x in at):
            names = tuple(map(str, at))
    return ControllerTable(("t", *names), ("s", *units), np.column_stack([t, values]), rate)


def write_controller_table(path: Path, table: ControllerTable) -> None:
    """Write CSV: one header line of names, each number with all its digits."""

    def fill(draft: Path) -> None:
        with draft.open("w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(map(csv_cell, table.names)) + "\n")
            file.writelines(",".join(map(repr, row.tolist())) + "\n" for row in table.values)

    write_file(path, fill)

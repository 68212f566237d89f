"""Make the logs and tables of an import, by the recipe and the file's name.

Maps and calibrations without a clock are no logs: their columns become a table in SI.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from pipelines.errors import Check, InputRejected, UsageError, clean, did_you_mean
from pipelines.importers.assemble import Assembled, Material, Source
from pipelines.importers.patterns import fill
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import ControllerSpec, LogSpec, TableSpec
from pipelines.importers.units import Converted
from pipelines.io import schema
from pipelines.io.limits import FEWEST, recorded_span, shorter_than_period
from pipelines.io.log import (
    Array,
    Controller,
    Derived,
    ExperimentLog,
    created,
    refuse_unlike_format,
)
from pipelines.io.results import NOT_STORED
from pipelines.io.robot import format_robot
from pipelines.io.units import UNITS
from pipelines.quality.checks import check_log
from pipelines.quality.units import TRUSTED, degrees_or_motor

# What to do about it is in the recipe, and not in a file that is not written yet.
_IN_RECIPE = {
    "RRID-S05": 'declare the unit of tau that its numbers are in, such as unit = "N mm", or '
    "correct the torque limits of the robot",
    "RRID-S07": degrees_or_motor(np.inf, (-np.inf, np.inf)),
}
_SI = {"time": "s", "position": "rad", "velocity": "rad/s", "acceleration": "rad/s^2",
       "torque": "N m", "current": "A", "temperature": "degC"}  # fmt: skip
_METRES = {"m": "m", "mm": "m", "um": "m", "m/s": "m/s", "mm/s": "m/s", "m/s^2": "m/s^2",
           "mm/s^2": "m/s^2", "N": "N", "mN": "N", "kN": "N"}  # fmt: skip


@dataclass(frozen=True)
class SourceFile:
    """A recorded file, and the columns taken from it."""

    name: str
    sha256: str
    columns: tuple[str, ...]


def make_log(
    source: Source, material: Material, assembled: Assembled, done: Converted, number: int | None
) -> tuple[ExperimentLog, tuple[SourceFile, ...]]:
    """Return one log of converted signals, its time among them, and its files.

    Args:
        number: of a log that had to be split.

    Raises:
        InputRejected: T07 shorter than a period, T08 hardly a sample, S01 an frf log without
            excitation.
        UsageError: C02, name, experiment, role or joint cannot be read from the recipe and the
            file's name.
    """
    recipe, robot, signals = material.recipe, material.robot, done.signals
    about, t = _about(recipe.log, source, recipe.where), signals["t"].values
    name = clean(fill(about.name, source.groups, recipe.where), 200) or "log"
    used = [column for columns in assembled.columns.values() for column in columns]
    files = tuple(
        SourceFile(file, table.sha256, tuple(c for c in used if c in table.columns))
        for file, table in source.tables.items()
    )
    step = recipe.time.sample_time or 1.0 / (recipe.time.rate or 1.0)
    if recipe.resample:
        step = 1.0 / recipe.resample.rate
    elif recipe.time.column is not None:
        step = float(np.median(np.diff(t)))
    if t.size < FEWEST:
        message = f"{t.size} samples at {1 / step:g} Hz; a log needs {FEWEST}"
        remedy = "record longer, or resample faster"
        raise InputRejected("T08", message, where=source.primary, remedy=remedy)
    if about.period is not None and shorter_than_period(t, step, about.period):
        short = f"{recorded_span(t, step):.4g} s < {about.period:g} s period"
        if number is None:
            remedy = "record a whole period, or correct period"
            raise InputRejected("T07", short, where=source.primary, remedy=remedy)
        # A part of a log that had to be split need not hold a period; it is a log without one.
        about = replace(about, period=None)
        done.altered.append(f"period left out: {short}")
    if about.experiment == "frf" and "v" not in signals:
        message = "an frf log without its excitation v"
        raise InputRejected("S01", message, where=source.primary, remedy="map signals.v")
    log = ExperimentLog(
        name=f"{name}-{number}" if number else name,
        experiment=about.experiment,
        role=about.role,
        origin=about.origin,
        torque=about.torque,
        robot_name=robot.name,
        sample_time=step,
        robot_text=format_robot(robot),
        signals={key: signals[key] for key in schema.SIGNALS if key in signals},
        recorded=about.recorded,
        joint=about.joint,
        period=about.period,
        posture=None if about.posture is None else np.array(about.posture),
        controller=_controller(recipe.controller),
        derived=_derived(files, material, done, about.recorded) if done.altered else None,
    )
    return log, files


def _about(base: LogSpec, source: Source, where: str) -> LogSpec:
    """Return [log], overruled by groups of the file's name, these by its [[file]] case."""
    groups, problem = source.groups, ""
    found: dict[str, Any] = {k: groups[k] for k in ("experiment", "role", "joint") if k in groups}
    for key, known in (("experiment", schema.EXPERIMENTS), ("role", schema.ROLES)):
        if found.get(key, known[0]) not in known:
            problem = f"gives {key} '{found[key]}', must be one of {', '.join(known)}"
            remedy = f"rename the file, or write {key} = … in a [[file]] case before it"
    if not groups.get("joint", "1").isdigit():
        problem = f"gives joint '{groups['joint']}', must be a number"
        remedy = "rename the file, or take digits alone: {joint:[0-9]+}"
    elif "joint" in groups:
        found["joint"] = int(groups["joint"])
    for key in ("name", "experiment", "role", "joint", "period", "recorded", "posture"):
        value = getattr(source.case, key, None)
        found |= {} if value is None else {key: value}
    about = replace(base, **found)
    if about.experiment not in schema.ONE_JOINT:
        about = replace(about, joint=None)
    elif about.joint is None:
        problem = f"makes a {about.experiment} log without its joint"
        remedy = "write joint = … in its [[file]], or {joint} in the pattern"
    if problem:
        raise UsageError("C02", f"'{source.primary}' {problem}", where=where, remedy=remedy)
    return about


def _controller(spec: ControllerSpec | None) -> Controller | None:
    if spec is None:
        return None
    numbers = ("kp", "kd", "ki", "output_limit", "torque_resolution")
    given: dict[str, Any] = {k: x for k, x in asdict(spec).items() if x is not None}
    return Controller(**given | {key: np.array(given[key]) for key in numbers if key in given})


def _derived(
    files: tuple[SourceFile, ...], material: Material, done: Converted, recorded: str | None
) -> Derived:
    # `created` is the time of the recording where the recipe gives it. Where it does not, no honest
    # time is left: the clock on the wall and the times of files differ from one import to the next,
    # and equal inputs give equal bytes. It is then SOURCE_DATE_EPOCH, by default
    # 1970-01-01T00:00:00Z: to be read as "not known". provenance.json has the hour.
    hashes = {file.name: file.sha256 for file in files}
    record = {"recipe": material.recipe_path.name, "files": hashes}
    record |= {"converted": done.steps, "altered": done.altered}
    sha256 = files[0].sha256
    if len(files) > 1:
        sha256 = hashlib.sha256("\n".join(file.sha256 for file in files).encode()).hexdigest()
    return Derived("import", json.dumps(record, sort_keys=True), sha256, created(recorded))


def examine(log: ExperimentLog, recording: str, trust_units: bool) -> tuple[Check, ...]:
    """Return the warnings of `inspect` about a new log, so that it passes there.

    They are glitches (D06), which stay for the user of the log to decide, and time in another unit
    (S08), which can be wrong by a thousand and contradict nothing; the import has said the others.

    Raises:
        InputRejected: S20 unlike the format, and what `inspect` would reject or repair before
            use: the import should have.
    """
    refuse_unlike_format(log)  # `inspect` judges a log whose joint and gains are the robot's
    found = []
    for check in check_log(replace(log, source=recording), TRUSTED if trust_units else ()):
        kept = (check.code, check.level) == ("RRID-D06", "repair")
        if check.level in ("reject", "repair") and not kept:
            remedy = _IN_RECIPE.get(check.code, check.remedy)
            raise replace(check, remedy=remedy).as_error()
        if (check.code, check.level) == ("RRID-S08", "warn"):
            found.append(check)
        if kept:
            words = check.message.removesuffix("; left out")
            message = clean(f"{words}; kept in the log, left out of fits")
            found.append(replace(check, level="warn", message=message))
    return tuple(found)


@dataclass(frozen=True)
class ImportedTable:
    """A table in SI."""

    name: str
    file: str
    source: str
    sha256: str
    rows: int
    units: Mapping[str, str]
    data: Mapping[str, Array] = field(metadata=NOT_STORED, repr=False)


def import_table(spec: TableSpec, name: str, file: str, table: RawTable) -> ImportedTable:
    """Return the columns of a `[[table]]`, converted.

    Raises:
        InputRejected: S01, S04, S05, S12.
    """
    data: dict[str, Array] = {}
    units: dict[str, str] = {}
    for key, column in spec.columns.items():
        source = table.name_of(column.column)
        where = f"{table.source}, column '{source}'"
        unit = column.unit or table.units.get(source)
        factor, offset, units[key] = 1.0, 0.0, "1"
        if unit is None:
            remedy = 'add unit = … to the column ("1" where it has none)'
            raise InputRejected("S04", "no unit", where=where, remedy=remedy)
        if unit == "counts" and column.counts_per_rev is None:
            message, remedy = "counts without counts_per_rev", "add counts_per_rev"
            raise InputRejected("S05", message, where=where, remedy=remedy)
        if unit == "counts":
            factor, units[key] = 2.0 * math.pi / (column.counts_per_rev or 1.0), "rad"
        elif unit in UNITS:
            known = UNITS[unit]
            factor, offset = known.factor, known.offset
            units[key] = _METRES.get(unit) or _SI[known.quantity]
        elif unit != "1":
            message = f"unknown unit '{unit}'{did_you_mean(unit, UNITS)}; known are "
            message += ", ".join(UNITS)
            raise InputRejected("S05", message, where=where, remedy="declare its unit")
        data[key] = values = table.columns[source] * column.scale * factor + offset
        if not np.isfinite(values).all():
            row = table.place(int(np.flatnonzero(~np.isfinite(values))[0]))
            message, remedy = f"no number in {row}", "remove that row"
            raise InputRejected("D01", message, where=where, remedy=remedy)
    return ImportedTable(name, file, table.source, table.sha256, table.rows.size, units, data)

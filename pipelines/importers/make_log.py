"""Make the logs and tables of an import, by the recipe and the file's name.

A recording gives one log, or several where its clock was set back. Maps and calibrations without a
clock are no logs: their columns become a table in SI.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np

from pipelines.errors import Check, InputRejected, UsageError, clean, did_you_mean
from pipelines.importers.assemble import Assembled, Map, Material, Source, assemble
from pipelines.importers.config import REPAIR
from pipelines.importers.patterns import fill
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import ControllerSpec, LogSpec, ResampleSpec, TableSpec
from pipelines.importers.repair import Limits, Recording, late_intervals, repair
from pipelines.importers.units import Converted, joint_side
from pipelines.io import schema
from pipelines.io.limits import FEWEST, recorded_span, shorter_than_period
from pipelines.io.log import (
    Array,
    Controller,
    Derived,
    ExperimentLog,
    Signal,
    created,
    refuse_unlike_format,
)
from pipelines.io.results import NOT_STORED
from pipelines.io.robot import format_robot
from pipelines.io.units import UNITS
from pipelines.quality.checks import check_log
from pipelines.quality.subject import many
from pipelines.quality.units import DEGREES_OR_MOTOR, TRUSTED

Method = Literal["spline", "linear"]
# (begin, end, rate) -> the grid, and (t, values, grid, method) -> values on the grid
Resampling = tuple[
    Callable[[float, float, float], Array], Callable[[Array, Array, Array, Method], Array]
]
# What to do about it is in the recipe, and not in a file that is not written yet.
_IN_RECIPE = {
    "RRID-S05": 'declare the unit of tau that its numbers are in, such as unit = "N mm", or '
    "correct the torque limits of the robot",
    "RRID-S07": DEGREES_OR_MOTOR,
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


@dataclass(frozen=True)
class Made:
    """A log, the files it is from, and what was done to them in words."""

    log: ExperimentLog
    files: tuple[SourceFile, ...]
    done: Converted


def logs_of(
    source: Source,
    material: Material,
    mapped: Map,
    trust_units: bool,
    resampling: Resampling,
    checks: list[Check],
) -> list[Made]:
    """Return the logs of one recording; what is found and repaired goes to `checks`.

    Raises:
        InputRejected, UsageError: what cannot be repaired.
    """
    recipe = material.recipe
    resampled = recipe.resample is not None
    limits = Limits(recipe.missing.values, recipe.time.longest_gap, resampled)
    assembled = assemble(source, material, mapped)
    checks += assembled.checks
    repaired = []
    for recording in assembled.recordings:
        parts, said = repair(recording, limits)
        checks += said
        repaired.append(parts)
    if len(repaired) > 1 and any(len(parts) > 1 for parts in repaired):
        message = "gaps or steps of the clock in files with clocks of their own"
        remedy = "bring the files on one clock before the import"
        raise InputRejected("T04", message, source.primary, remedy)
    here = tuple(table.source for table in source.tables.values())
    repairs = [c for c in checks if c.level == "repair" and c.where.startswith(here)]
    made = []
    for k, parts in enumerate(zip(*repaired, strict=True), start=1):
        done = Converted([*assembled.undeclared], [f"{c.code}: {c.message}" for c in repairs])
        sides = []
        for part in parts:
            robot, drive = material.robot, material.drive
            side = joint_side(part, recipe, assembled.units, robot, drive, trust_units)
            done.steps.extend(side.steps)
            done.altered.extend(side.altered)
            checks += side.checks
            sides.append(side.signals)
        t = Signal(parts[0].t, "s", schema.SIGNALS["t"][1])
        done.signals.update({"t": t, **sides[0]})
        if recipe.resample:
            _on_one_clock(parts, sides, recipe.resample, resampling, checks, done)
        number = k if len(repaired[0]) > 1 else None
        made.append(_log(source, material, assembled, done, number))
        checks += _examine(made[-1].log, source.primary, trust_units)
    return made


def _on_one_clock(
    parts: Sequence[Recording],
    sides: Sequence[dict[str, Signal]],
    spec: ResampleSpec,
    resampling: Resampling,
    checks: list[Check],
    done: Converted,
) -> None:
    """Put the signals of a log in `done` on an even grid, its time first."""
    grid, resample = resampling
    for part in parts:
        recorded = 1.0 / float(np.median(np.diff(part.t)))
        if recorded * REPAIR.finest < spec.rate:
            message = f"resample.rate is {spec.rate:g} Hz, the recording has {recorded:.4g} Hz: "
            remedy = "choose a rate near the recorded one, or a lower one"
            raise UsageError("C02", f"{message}its samples would be invented", part.where, remedy)
    at = grid(max(float(p.t[0]) for p in parts), min(float(p.t[-1]) for p in parts), spec.rate)
    done.signals["t"] = replace(done.signals["t"], values=at)
    method = "natural cubic spline" if spec.method == "spline" else "straight lines"
    for part, side in zip(parts, sides, strict=True):
        for name, signal in side.items():
            values = resample(part.t, signal.values, at, spec.method)
            done.signals[name] = replace(signal, values=values)
        ms = 1e3 * np.diff(part.t)
        words = f"resampled from {part.t.size} samples {ms.min():.4g} to {ms.max():.4g} ms apart "
        words += f"(median {np.median(ms):.4g} ms) to {at.size} at {spec.rate:g} Hz, {method}"
        if late := late_intervals(part).size:
            words += f"; {many(late, 'interval')} of more than 1.5 times the median bridged"
        remedy = "none needed for fits; record with an even clock where frequencies near the rate"
        checks.append(part.check("T05", words, f"{remedy} matter", "warn"))
        done.altered.append(words)


def _log(
    source: Source, material: Material, assembled: Assembled, done: Converted, number: int | None
) -> Made:
    """Return one log of converted signals, its time among them.

    Args:
        number: of a log that had to be split.

    Raises:
        InputRejected: T07 shorter than a period, T08 hardly a sample, S01 an frf log without
            excitation.
        UsageError: C02, name, experiment, role or joint cannot be read from the recipe and the
            file's name.
    """
    recipe, robot, signals = material.recipe, material.robot, done.signals
    about, t, where = _about(recipe.log, source, recipe.where), signals["t"].values, source.primary
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
        raise InputRejected("T08", message, where, "record longer, or resample faster")
    if about.period is not None and shorter_than_period(t, step, about.period):
        short = f"{recorded_span(t, step):.4g} s < {about.period:g} s period"
        if number is None:
            raise InputRejected("T07", short, where, "record a whole period, or correct period")
        # A part of a log that had to be split need not hold a period; it is a log without one.
        about = replace(about, period=None)
        done.altered.append(f"period left out: {short}")
    if about.experiment == "frf" and "v" not in signals:
        raise InputRejected("S01", "an frf log without its excitation v", where, "map signals.v")
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
    return Made(log, files, done)


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
        value = getattr(source.case, key)
        found |= {} if value is None else {key: value}
    about = replace(base, **found)
    if about.experiment not in schema.ONE_JOINT:
        about = replace(about, joint=None)
    elif about.joint is None:
        problem = f"makes a {about.experiment} log without its joint"
        remedy = "write joint = … in its [[file]], or {joint} in the pattern"
    if problem:
        raise UsageError("C02", f"'{source.primary}' {problem}", where, remedy)
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
    # `created` is the time of the recording where the recipe gives it; else SOURCE_DATE_EPOCH, by
    # default 1970-01-01T00:00:00Z, to be read as "not known": equal inputs give equal bytes.
    record = {"recipe": material.recipe_path.name, "files": {f.name: f.sha256 for f in files}}
    record |= {"converted": done.steps, "altered": done.altered}
    sha256 = files[0].sha256
    if len(files) > 1:
        sha256 = hashlib.sha256("\n".join(file.sha256 for file in files).encode()).hexdigest()
    return Derived("import", json.dumps(record, sort_keys=True), sha256, created(recorded))


def _examine(log: ExperimentLog, recording: str, trust_units: bool) -> list[Check]:
    """Return the warnings of `inspect` about a new log, so that it passes there.

    They are glitches (D06), which stay for the user of the log to decide; the import has said the
    others.

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
        if kept:
            words = check.message.removesuffix("; left out")
            message = clean(f"{words}; kept in the log, left out of fits")
            found.append(replace(check, level="warn", message=message))
    return found


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
            raise InputRejected("S04", "no unit", where, remedy)
        if unit == "counts":
            if column.counts_per_rev is None:
                message = "counts without counts_per_rev"
                raise InputRejected("S05", message, where, "add counts_per_rev")
            factor, units[key] = 2.0 * math.pi / column.counts_per_rev, "rad"
        elif unit in UNITS:
            known = UNITS[unit]
            factor, offset = known.factor, known.offset
            units[key] = _METRES.get(unit) or _SI[known.quantity]
        elif unit != "1":
            message = f"unknown unit '{unit}'{did_you_mean(unit, UNITS)}; known are "
            raise InputRejected("S05", message + ", ".join(UNITS), where, "declare its unit")
        data[key] = values = table.columns[source] * column.scale * factor + offset
        if not np.isfinite(values).all():
            row = table.place(int(np.flatnonzero(~np.isfinite(values))[0]))
            raise InputRejected("D01", f"no number in {row}", where, "remove that row")
    return ImportedTable(name, file, table.source, table.sha256, table.rows.size, units, data)

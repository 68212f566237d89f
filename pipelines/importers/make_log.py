"""Make the logs of a recording, by the recipe and the file's name.

A recording gives one log, or several where its clock was set back.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np

from pipelines.errors import Check, Gathering, InputRejected, UsageError, clean
from pipelines.importers.clock import time_of
from pipelines.importers.collect import Material, Source
from pipelines.importers.config import REPAIR
from pipelines.importers.patterns import fill
from pipelines.importers.raw import RawTable, expand
from pipelines.importers.recipe import ControllerSpec, LogSpec, Recipe, ResampleSpec
from pipelines.importers.repair import Limits, Recording, repair
from pipelines.importers.units import Converted, joint_side, si_of, units_of
from pipelines.io import schema
from pipelines.io.limits import recorded_span, shorter_than_period
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
from pipelines.quality.checks import check_log
from pipelines.quality.units import DEGREES_OR_MOTOR, TRUSTED

Method = Literal["spline", "linear"]
# (begin, end, rate) -> the grid, and (t, values, grid, method) -> values on the grid
Resampling = tuple[
    Callable[[float, float, float], Array], Callable[[Array, Array, Array, Method], Array]
]
Map = Mapping[str, Mapping[int, str]]  # signal -> joint -> column
# What to do about it is in the recipe, and not in a file that is not written yet.
_IN_RECIPE = {
    "RRID-S05": 'declare the unit of tau that its numbers are in, such as unit = "N mm", or '
    "correct the torque limits of the robot",
    "RRID-S07": DEGREES_OR_MOTOR,
    "RRID-T05": "add [resample] rate = … for an even grid",
}


@dataclass(frozen=True)
class SourceFile:
    """A recorded file, and the columns taken from it."""

    name: str
    sha256: str
    columns: tuple[str, ...]


@dataclass(frozen=True)
class ImportedLog:
    """One log: what it is, where it came from, what was done to it."""

    name: str
    file: str
    experiment: str
    role: str
    joint: int | None
    samples: int
    joints: int
    sample_time: float  # [s]
    duration: float  # [s]
    sources: tuple[SourceFile, ...]
    steps: tuple[str, ...]  # units, signs, transmission
    altered: tuple[str, ...]  # repairs, unwrapping, resampling: what makes it a derived log
    log: ExperimentLog = field(metadata=NOT_STORED, repr=False)


def parse_map(entries: tuple[str, ...], recipe: Recipe, joints: int) -> Map:
    """Return the columns of --map q_1=Joint_1, named differently from the recipe.

    Raises:
        UsageError: C02, not of that form, or of a joint that the robot does not have.
    """
    found: dict[str, dict[int, str]] = {}
    for entry in entries:
        left, _, column = (part.strip() for part in entry.partition("="))
        signal, _, joint = ("t", "", "1") if left == "t" else left.rpartition("_")
        known = signal in recipe.signals or left == "t"
        if not (column and known and joint.isdecimal() and 1 <= int(joint) <= joints):
            signals = ", ".join([*recipe.signals, "t"])
            remedy = f"write --map q_1=Joint_1; signals: {signals}; joints: 1 to {joints}"
            raise UsageError("C02", f"'{entry}' is not signal_joint=column", "--map", remedy)
        found.setdefault(signal, {})[int(joint)] = column
    return found


def logs_of(
    source: Source,
    material: Material,
    mapped: Map,
    trust_units: bool,
    resampling: Resampling,
    checks: list[Check],
) -> list[ImportedLog]:
    """Return the logs of one recording; what is found and repaired goes to `checks`.

    Raises:
        InputRejected, UsageError: what cannot be repaired.
    """
    recipe, robot = material.recipe, material.robot
    limits = Limits(recipe.missing.values, recipe.time.longest_gap, recipe.resample is not None)
    recordings, units = _assemble(source, material, mapped, checks)
    repaired = []
    for recording in recordings:
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
        done = Converted(altered=[f"{c.code}: {c.message}" for c in repairs])
        done.signals["t"] = Signal(parts[0].t, "s", schema.SIGNALS["t"][1])
        sides = [joint_side(p, recipe, units, robot, material.drive, trust_units) for p in parts]
        for side in sides:
            done.steps.extend(side.steps)
            done.altered.extend(side.altered)
            done.signals.update(side.signals)
            checks += side.checks
        if recipe.resample:
            _on_one_clock(parts, sides, recipe.resample, resampling, checks, done)
        columns = [c for recording in recordings for of in recording.columns.values() for c in of]
        made.append(_log(source, material, columns, done, k if len(repaired[0]) > 1 else None))
        checks += _examine(made[-1].log, source.primary, trust_units)
    return made


def _assemble(
    source: Source, material: Material, mapped: Map, checks: list[Check]
) -> tuple[tuple[Recording, ...], dict[str, tuple[str, ...]]]:
    """Pick columns, units and time of every file of a recording, and join files of one clock.

    Raises:
        InputRejected: S01-S05, S08, S12, S16, T06.
    """
    recipe, robot, assume = material.recipe, material.robot, material.assume_units
    time = replace(recipe.time, column=mapped["t"][1]) if "t" in mapped else recipe.time
    units: dict[str, tuple[str, ...]] = {}
    recordings: list[tuple[Recording, RawTable]] = []
    problems = Gathering()
    for file, table in source.tables.items():
        checks += table.checks
        columns: dict[str, tuple[str, ...]] = {}
        for signal in (name for name, of in source.files.items() if of == file):
            with problems.part():
                spec = recipe.signals[signal]
                names = expand(table, spec.where or 1, robot.n_joints, signal, mapped.get(signal))
                columns[signal] = names
                units[signal], said = units_of(signal, spec, robot, table, names, assume)
                checks += said
        own = file == source.primary or all(
            isinstance(c, int) or c in table.columns for c, _ in time.parts
        )
        t = np.full(table.rows.size, np.nan)
        with problems.part():
            if own:
                t, said = time_of(table, time, assume)
                checks += said
        if problems.found or not (columns or file == source.primary):
            continue
        places, word = (table.rows + 1, "row") if table.lines is None else (table.lines, "line")
        part = Recording(
            t,
            {s: np.column_stack([table.columns[c] for c in of]) for s, of in columns.items()},
            columns,
            places,
            table.source,
            own and time.column is not None,
            word,
            table.breaks,
            {s: si_of(units[s], recipe.signals[s]) for s in columns},
        )
        recordings.append((part, table))
    problems.raise_all()
    parts = _joined(recordings, time.column is not None, checks)
    begin = recipe.log.begin if source.case.begin is None else source.case.begin
    for k, part in enumerate(parts if begin else ()):
        kept = ~(part.t < float(np.nanmin(part.t)) + (begin or 0.0))
        message = (
            f"the first {begin:g} s, {int(np.sum(~kept))} samples, left out as the recipe says"
        )
        checks.append(Check.of("T04", "ok", message, part.where))
        parts[k] = part.take(kept)
    if len(parts) > 1 and recipe.resample is None:
        message, where = "the files have different time stamps", ", ".join(source.tables)
        remedy = "add [resample] rate = … to bring them on one clock"
        raise InputRejected("T06", message, where, remedy)
    return tuple(parts), units


def _joined(
    recordings: list[tuple[Recording, RawTable]], clocked: bool, checks: list[Check]
) -> list[Recording]:
    """Return one recording of files whose rows belong together; others keep their own clocks.

    Raises:
        InputRejected: S16, files without clocks of their own are not of one length.
    """
    (first, of_first), *further = recordings
    rows, separate = of_first.rows, list[Recording]()
    for other, table in further:
        if clocked and other.clocked and not np.array_equal(other.t, first.t, equal_nan=True):
            separate.append(other)
            continue
        a, b = int(rows[-1]), int(table.rows[-1])
        where, counts = f"{first.where}, {other.where}", f"{a + 1} and {b + 1} samples"
        few = max(1, REPAIR.lengths * max(a, b))
        if a != b and ((clocked and not other.clocked) or abs(a - b) > few):
            remedy = "give files of the same run, or with time stamps of their own and [resample]"
            raise InputRejected("S16", f"{counts}: not of one recording", where, remedy)
        if a != b:
            message = f"{counts}; the rows both have are used, counted from the start"
            remedy = "begin and end both recordings together"
            checks.append(Check.of("T06", "warn", message, where, remedy))
        rows, at, of = np.intersect1d(rows, table.rows, assume_unique=True, return_indices=True)
        signals = {name: values[at] for name, values in first.signals.items()}
        signals |= {name: values[of] for name, values in other.signals.items()}
        first = replace(
            first,
            t=first.t[at],
            places=first.places[at],
            columns={**first.columns, **other.columns},
            breaks=tuple((np.flatnonzero(np.diff(rows) > 1) + 1).tolist()),
            si={**first.si, **other.si},
            signals=signals,
        )
    return [part for part in (first, *separate) if part.signals]


def _on_one_clock(
    parts: Sequence[Recording],
    sides: Sequence[Converted],
    spec: ResampleSpec,
    resampling: Resampling,
    checks: list[Check],
    done: Converted,
) -> None:
    """Put the signals of a log in `done` on an even grid."""
    grid, resample = resampling
    at = grid(max(float(p.t[0]) for p in parts), min(float(p.t[-1]) for p in parts), spec.rate)
    done.signals["t"] = replace(done.signals["t"], values=at)
    method = "natural cubic spline" if spec.method == "spline" else "straight lines"
    for part, side in zip(parts, sides, strict=True):
        recorded = 1.0 / float(np.median(np.diff(part.t)))
        if recorded * REPAIR.finest < spec.rate:
            message = f"resample.rate is {spec.rate:g} Hz, the recording has {recorded:.4g} Hz: "
            remedy = "choose a rate near the recorded one, or a lower one"
            raise UsageError("C02", f"{message}its samples would be invented", part.where, remedy)
        for name, signal in side.signals.items():
            values = resample(part.t, signal.values, at, spec.method)
            done.signals[name] = replace(signal, values=values)
        ms = 1e3 * np.diff(part.t)
        words = f"resampled from {part.t.size} samples {ms.min():.4g} to {ms.max():.4g} ms apart "
        words += f"(median {np.median(ms):.4g} ms) to {at.size} at {spec.rate:g} Hz, {method}"
        remedy = "none needed for fits; record with an even clock where frequencies near the rate"
        checks.append(part.check("T05", words, f"{remedy} matter", "warn"))
        done.altered.append(words)


def _log(
    source: Source, material: Material, used: list[str], done: Converted, number: int | None
) -> ImportedLog:
    """Return one log of converted signals, its time among them.

    Args:
        number: of a log that had to be split.

    Raises:
        InputRejected: S01, an frf log without excitation.
        UsageError: C02, name, experiment, role or joint cannot be read from the recipe and the
            file's name.
    """
    recipe, robot, signals = material.recipe, material.robot, done.signals
    about, t, where = _about(recipe.log, source, recipe.where), signals["t"].values, source.primary
    name = clean(fill(about.name, source.groups, recipe.where), 200) or "log"
    files = tuple(
        SourceFile(file, table.sha256, tuple(c for c in used if c in table.columns))
        for file, table in source.tables.items()
    )
    step = recipe.time.sample_time or 1.0 / (recipe.time.rate or 1.0)
    if recipe.resample:
        step = 1.0 / recipe.resample.rate
    elif recipe.time.column is not None:
        step = float(np.median(np.diff(t)))
    if number and about.period is not None and shorter_than_period(t, step, about.period):
        # A part of a log that had to be split need not hold a period; it is a log without one.
        short = f"{recorded_span(t, step):.4g} s < {about.period:g} s period"
        done.altered.append(f"period left out: {short}")
        about = replace(about, period=None)
    if about.experiment == "frf" and "v" not in signals:
        raise InputRejected("S01", "an frf log without its excitation v", where, "map signals.v")
    name = f"{name}-{number}" if number else name
    log = ExperimentLog(
        name=name,
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
    return ImportedLog(
        name=name,
        file="",  # known when all are named
        experiment=log.experiment,
        role=log.role,
        joint=log.joint,
        samples=t.size,
        joints=robot.n_joints,
        sample_time=step,
        duration=float(t[-1] - t[0]),
        sources=files,
        steps=tuple(done.steps),
        altered=tuple(done.altered),
        log=log,
    )


def _about(base: LogSpec, source: Source, where: str) -> LogSpec:
    """Return [log], overruled by groups of the file's name, these by its [[file]] case."""
    groups, problem, remedy = source.groups, "", ""
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
    record = {"recipe": material.recipe_path.name, "files": {f.name: f.sha256 for f in files}}
    record |= {"converted": done.steps, "altered": done.altered}
    sha256 = files[0].sha256
    if len(files) > 1:
        sha256 = hashlib.sha256("\n".join(file.sha256 for file in files).encode()).hexdigest()
    return Derived("import", json.dumps(record, sort_keys=True), sha256, created(recorded))


def _examine(log: ExperimentLog, recording: str, trust_units: bool) -> list[Check]:
    """Return the warnings of `inspect` about the samples of a new log, so that it passes there.

    They are lost samples (T03), uneven time (T05), and glitches (D06), which stay for the user of
    the log to decide.

    Raises:
        InputRejected: S20 unlike the format, and what `inspect` would reject or repair before
            use: the import should have.
    """
    refuse_unlike_format(log)  # `inspect` judges a log whose joint and gains are the robot's
    found = []
    for check in check_log(replace(log, source=recording), TRUSTED if trust_units else ()):
        if (check.code, check.level) == ("RRID-D06", "repair"):
            words = check.message.removesuffix("; left out")
            words = f"{words}; kept in the log, left out of fits"
            found.append(replace(check, level="warn", message=words))
        elif check.level in ("reject", "repair"):
            remedy = _IN_RECIPE.get(check.code, check.remedy)
            raise replace(check, remedy=remedy).as_error()
        elif check.level == "warn" and check.code in ("RRID-T03", "RRID-T05"):
            found.append(replace(check, remedy=_IN_RECIPE.get(check.code, check.remedy)))
    return found

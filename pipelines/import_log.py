"""Import recordings: CSV, JSON, MAT and NumPy files become logs, by a recipe.

Reads    a recipe (TOML, `pipelines.importers.recipe`) and the recorded files its patterns match
Writes   logs/<name>.h5 or .parquet, tables/<name>.parquet for maps without a clock, result.json, report.html
Source   log-format.md; transmission and torque constants as `pipelines.importers.joint_side` says

A log whose samples were altered (repaired, unwrapped, resampled) is a derived log. Its attribute `created` is the time of the
recording where the recipe says it; otherwise 1970-01-01T00:00:00Z, which means "not known": the hour of the import would make
equal inputs unequal. provenance.json has that hour.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import Check, Gathering, InputRejected, UsageError
from pipelines.importers import filenames
from pipelines.importers.assemble import Map, Material, Source, assemble, collect, parse_map
from pipelines.importers.guess import Draft, guess_recipe
from pipelines.importers.joint_side import Converted, joint_side
from pipelines.importers.make_log import ImportedTable, SourceFile, examine, import_table, make_log
from pipelines.importers.recipe import ResampleSpec
from pipelines.importers.repair import Limits, Recording, late_intervals, repair
from pipelines.io.experiment import Array, ExperimentLog, Signal
from pipelines.io.files import regular_file, write_log
from pipelines.io.option import option
from pipelines.io.results import NOT_STORED
from pipelines.io.robot import RobotDescription
from pipelines.io.table import write_table
from pipelines.model.rigid.choose import rigid_body
from pipelines.quality.subject import many
from pipelines.report.report import Figure, Report, Section, Table
from pipelines.signal.resample import grid, resample
from pipelines.stage import Inputs, Request, Stage, slug

__all__ = ["STAGE", "ImportedLog", "Result", "Settings", "compute", "draft_recipe", "read", "report"]

_PREVIEWS, _PREVIEW_POINTS = 3, 150
_FINEST = 4.0  # times the recorded rate


def draft_recipe(path: Path, robot: str | None = None) -> Draft:
    """Return the draft of a recipe for a recording; the torques are compared with the robot's links.

    Raises:
        InputRejected: the file cannot be read as a table of numbers.
    """
    regular_file(path, what="one recording, such as a CSV file")
    return guess_recipe(path, robot, _link_torque)


def _link_torque(robot: RobotDescription, q: Array, dq: Array, ddq: Array) -> Array | None:
    """Return the torques (samples, joints) [N m] of a robot's links in motion [rad], None where a link is unknown."""
    body = rigid_body(robot)
    p = body.known_parameters()
    return None if p is None else body.torque(q, dq, ddq, p)


@dataclass(frozen=True)
class Settings:
    """`recipe`: a TOML file or the name of a shipped one. `source`: folder of the recordings, default the recipe's own.
    `map`: "q_1=Joint_1", columns named differently from the recipe. `trust_units`: units are what is declared, however large
    the numbers."""

    recipe: str = option("", "Recipe: a TOML file, or the name of a shipped one.", "RECIPE")
    source: Path | None = option(None, "Folder the recordings are in. [the recipe's]")
    map: tuple[str, ...] = option((), "Column to take for a signal: q_1=Joint_1. Repeatable.")
    trust_units: bool = option(False, "Units are as declared, however large the numbers.")
    guess: Path | None = option(None, "Draft a recipe for this recording, with the evidence; print it.", option=False)


@dataclass(frozen=True)
class Preview:
    """Every Nth sample of a log, for the report's figure: numbers as one short text a column.

    A result.h5 for them would lie among logs of the same ending, and one line a number would make most of result.json.
    """

    t: str  # [s]
    q: tuple[str, ...]  # [rad] one a joint
    tau: tuple[str, ...]  # [N m] one a joint


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
    preview: Preview | None
    log: ExperimentLog = field(metadata=NOT_STORED, repr=False)


@dataclass(frozen=True)
class Result:
    """What was imported."""

    recipe: str
    robot: str
    logs: tuple[ImportedLog, ...]
    tables: tuple[ImportedTable, ...]
    ignored: tuple[str, ...]  # files below the source folder that the recipe does not speak of
    checks: tuple[Check, ...]


def read(request: Request, settings: Settings) -> Inputs:
    """The recipe, its robot and every file it matches."""
    if not settings.recipe:
        raise UsageError("C02", "no recipe", where="rrrid import", remedy="name one, or draft one with --guess FILE")
    material = collect(settings.recipe, settings.source, request.robot, request.tell)
    material = replace(material, assume_units=request.assume_units, ending=request.format)
    return Inputs(sources=material.paths, hashes=material.hashes, material=material,
                  folders=(settings.source,) if settings.source else (),
                  label=material.folder.absolute().name, robot_name=material.robot.name)


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Turn every recording of the material into one log, or several where its clock was set back.

    Raises:
        InputRejected, UsageError: what cannot be repaired, by the rows S, T and D of the table of bad inputs; all files' together.
    """
    material: Material = inputs.material
    mapped = parse_map(settings.map, material.recipe, material.robot.n_joints)
    checks: list[Check] = list(material.robot.checks)
    logs: list[ImportedLog] = []
    problems = Gathering()
    for source in material.sources:
        with problems.part():
            logs += _import(source, material, mapped, settings, checks)
    problems.raise_all()
    names = filenames.unique(item.name for item in logs)
    files = filenames.unique(slug(name) for name in names)
    logs = [replace(item, name=name, file=f"logs/{file}.{material.ending}", log=replace(item.log, name=name),
                    preview=_preview(item.log) if i < _PREVIEWS else None)
            for i, (item, name, file) in enumerate(zip(logs, names, files, strict=True))]
    tables = []
    for spec, groups, table in material.tables:
        checks += table.checks
        name = filenames.fill(spec.name, groups, material.recipe.where)
        tables.append(import_table(spec, name, f"tables/{slug(name)}.parquet", table))
    return Result(material.recipe_path.name, material.robot.name, tuple(logs), tuple(tables), material.ignored,
                  tuple(dict.fromkeys(checks)))


def _import(source: Source, material: Material, mapped: Map, settings: Settings, checks: list[Check]) -> list[ImportedLog]:
    assembled = assemble(source, material, mapped, material.assume_units)
    recipe = material.recipe
    missing, held = recipe.missing, recipe.log.torque == "held-command"
    limits = Limits(missing.values, recipe.time.longest_gap, recipe.resample is not None, missing.rows, held)
    checks += assembled.checks
    repaired = []
    for recording in assembled.recordings:
        parts, said = repair(recording, limits)
        checks += said
        repaired.append(parts)
    if len(repaired) > 1 and any(len(parts) > 1 for parts in repaired):
        raise InputRejected("T04", "gaps or steps of the clock in files with clocks of their own", where=source.primary,
                            remedy="bring the files on one clock before the import")
    repairs = tuple(f"{c.code}: {c.message}" for c in checks if c.level == "repair"
                    and any(c.where.startswith(t.source) for t in source.tables.values()))
    made = []
    for parts in zip(*repaired, strict=True):
        converted = [joint_side(part, recipe, assembled.units, material.robot, material.drive, settings.trust_units)
                     for part in parts]
        checks += [check for item in converted for check in item.checks]
        made.append(_on_one_clock(parts, converted, recipe.resample, checks))
    logs = []
    for k, (t, signals, steps, altered) in enumerate(made, start=1):
        steps, altered = (*assembled.undeclared, *steps), (*repairs, *altered)
        log, files, altered = make_log(source, material, assembled, t, signals, steps, altered, k if len(made) > 1 else None)
        checks += examine(log, source.primary, settings.trust_units)
        logs.append(ImportedLog(log.name, "", log.experiment, log.role, log.joint, log.n_samples, log.n_joints, log.sample_time,
                                float(log.t[-1] - log.t[0]), files, steps, altered, None, log))
    return logs


def _on_one_clock(parts: tuple[Recording, ...], converted: list[Converted], spec: ResampleSpec | None,
                  checks: list[Check]) -> tuple[Array, dict[str, Signal], tuple[str, ...], tuple[str, ...]]:
    """Time and signals of a log; resampled where the recipe says so."""
    steps = tuple(step for item in converted for step in item.steps)
    altered = tuple(step for item in converted for step in item.altered)
    if spec is None:
        return parts[0].t, dict(converted[0].signals), steps, altered
    for part in parts:
        if (recorded := 1.0 / float(np.median(np.diff(part.t)))) * _FINEST < spec.rate:
            raise UsageError("C02", f"resample.rate is {spec.rate:g} Hz, the recording has {recorded:.4g} Hz: "
                             "its samples would be invented", where=part.where,
                             remedy="choose a rate near the recorded one, or a lower one")
    at = grid(max(float(part.t[0]) for part in parts), min(float(part.t[-1]) for part in parts), spec.rate)
    signals: dict[str, Signal] = {}
    for part, item in zip(parts, converted, strict=True):
        signals |= {name: replace(s, values=resample(part.t, s.values, at, spec.method)) for name, s in item.signals.items()}
        interval = np.diff(part.t)
        method = "natural cubic spline" if spec.method == "spline" else "straight lines"
        late = late_intervals(part).size
        words = (f"resampled from {part.t.size} samples {1e3 * interval.min():.4g} to {1e3 * interval.max():.4g} ms apart (median "
                 f"{1e3 * float(np.median(interval)):.4g} ms) to {at.size} at {spec.rate:g} Hz, {method}"
                 + (f"; {late} interval{'s' if late != 1 else ''} of more than 1.5 times the median bridged" if late else ""))
        checks.append(Check.of("T05", "warn", words, where=part.where,
                               remedy="none needed for fits; record with an even clock where frequencies near the rate matter"))
        altered = (*altered, words)
    return at, signals, steps, altered


def _preview(log: ExperimentLog) -> Preview:
    every = max(1, -(-log.n_samples // _PREVIEW_POINTS))

    def words(values: Array, digits: int = 4) -> str:
        return " ".join(f"{x:.{digits}g}" for x in values[::every].tolist())

    return Preview(words(log.t, 6), tuple(map(words, log.q.T)), tuple(map(words, log.tau.T)))


def _numbers(texts: tuple[str, ...]) -> Array:
    return np.array([text.split() for text in texts], dtype=np.float64).T


def write(result: Result, folder: Path, request: Request) -> None:
    """Write logs and tables into `folder`."""
    for item in result.logs:
        request.tell(f"writing {item.file}")
        write_log(folder / item.file, item.log)
    for table in result.tables:
        write_table(folder / table.file, table.data, table.units)


def report(result: Result) -> Report:
    """What was written, what was done to the samples, and a look at them."""
    n, repaired = len(result.logs), [c for c in result.checks if c.level == "repair"]
    seconds = sum(item.duration for item in result.logs)
    words = f"{many(n, 'log')} of robot {result.robot} imported, {seconds:.4g} s in all"
    words += f", and {len(result.tables)} table{'s' if len(result.tables) != 1 else ''}" if result.tables else ""
    words += f"; {many(len(repaired), 'repair')}, listed below" if repaired else "; nothing had to be repaired"
    resampled = [item for item in result.logs if any(step.startswith("resampled ") for step in item.altered)]
    if resampled:
        rates = ", ".join(dict.fromkeys(f"{1.0 / item.sample_time:g} Hz" for item in resampled))
        words += f"; {'all' if len(resampled) == n > 1 else many(len(resampled), 'log')} resampled to {rates}"
    warned = sum(c.level == "warn" for c in result.checks)
    words += f"; {many(warned, 'warning')}, listed below." if warned else "."
    logs = Table(("log", "experiment", "role", "joint", "samples", "rate [Hz]", "duration [s]"),
                 tuple((i.name, i.experiment, i.role, i.joint, i.samples, 1.0 / i.sample_time, i.duration) for i in result.logs))
    drawn = f"Drawn are the first {_PREVIEWS} of {n} logs; rrrid inspect draws more."
    sections = [Section("Logs", (drawn,) if n > _PREVIEWS else (), tables=(logs,),
                        figures=tuple(_figure(item, item.preview) for item in result.logs if item.preview))]
    if result.tables:
        rows = tuple((t.name, t.source, ", ".join(f"{c} [{t.units[c]}]" for c in t.units), t.rows) for t in result.tables)
        sections.append(Section("Tables", ("Files without a clock are no logs; they are kept as tables in SI.",),
                                (Table(("table", "from", "columns", "rows"), rows),)))
    sections.append(_treatment(result))
    return Report("Import", words, "attention" if repaired or warned else "good", sections=tuple(sections))


def _treatment(result: Result) -> Section:
    """What was done to the samples, and what was found on the way."""
    done = tuple((item.name, ", ".join(s.name for s in item.sources),
                  "; ".join((*item.steps, *item.altered)) or "taken as they are") for item in result.logs)
    found = tuple((c.code, c.level, c.where, c.message, c.remedy) for c in result.checks if c.level != "ok")
    tables = [Table(("log", "from", "done to the samples"), done)]
    if found:
        tables.append(Table(("code", "level", "where", "what", "remedy"), found))
    text = [f"By recipe {result.recipe}."]
    if result.ignored:
        more = " …" if len(result.ignored) > 8 else ""
        text.append(f"The recipe does not speak of {many(len(result.ignored), 'file')}: {', '.join(result.ignored[:8])}{more}.")
    return Section("What was done to the data", tuple(text), tuple(tables))


def _figure(item: ImportedLog, preview: Preview) -> Figure:
    def draw(figure: Any) -> None:
        from pipelines.report.figures import draw_joint_signals, joint_axes

        top, bottom = figure.subfigures(1, 2)
        t = _numbers((preview.t,))[:, 0]
        draw_joint_signals(joint_axes(top, item.joints), t, _numbers(preview.q), "rad", quantity="q")
        draw_joint_signals(joint_axes(bottom, item.joints), t, _numbers(preview.tau), "N m", quantity="tau")

    return Figure(f"import-{slug(item.name)}", f"{item.name}: position and torque of each joint as they are in the log.", draw,
                  (7.2, 0.7 + 1.1 * item.joints), f"position and torque of log {item.name} against time")


STAGE = Stage("import", "Import recordings by a recipe", Settings, compute, report, read, write,
              checks=lambda result: result.checks)

"""Import recordings: CSV, JSON, MAT, NumPy and Parquet files become logs.

Reads    a recipe (TOML, `pipelines.importers.recipe`) and the recorded files its patterns match
Writes   logs/<name>.h5 or .parquet, tables/<name>.parquet (maps), result.json, report.html
Source   log-format.md; transmission and torque constants as `pipelines.importers.units` says

A log whose samples were altered (repaired, unwrapped, resampled) is a derived log. Its attribute
`created` is the time of the recording where the recipe says it; otherwise 1970-01-01T00:00:00Z,
which means "not known": the hour of the import would make equal inputs unequal. provenance.json has
that hour.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import Check, Gathering, UsageError
from pipelines.estimation.grids import grid, resample
from pipelines.importers.assemble import Material, collect, parse_map
from pipelines.importers.config import REPAIR
from pipelines.importers.guess import Draft, guess_recipe
from pipelines.importers.links import TorqueModel
from pipelines.importers.make_log import ImportedTable, Made, SourceFile, import_table, logs_of
from pipelines.importers.patterns import fill, unique
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog
from pipelines.io.option import option
from pipelines.io.parquet import write_table
from pipelines.io.results import NOT_STORED
from pipelines.io.robot import RobotDescription
from pipelines.io.sandbox import regular_file
from pipelines.io.schema import Array
from pipelines.quality.subject import many
from pipelines.report.figures import joint_signal_figure
from pipelines.report.report import Figure, Report, Section, Table
from pipelines.stage import Inputs, Request, Stage, slug


def draft_recipe(path: Path, robot: str | None = None) -> Draft:
    """Return the draft of a recipe for a recording, compared with the robot's links.

    Raises:
        InputRejected: the file cannot be read as a table of numbers.
    """

    def torque_of_links(robot: RobotDescription) -> TorqueModel | None:
        body = rigid_body(robot)
        p = body.known_parameters()
        return None if p is None else lambda q, dq, ddq: body.torque(q, dq, ddq, p)

    regular_file(path, what="one recording, such as a CSV file")
    return guess_recipe(path, robot, torque_of_links)


@dataclass(frozen=True)
class Settings:
    """The options of `rrrid import`."""

    recipe: str = option("", "Recipe: a TOML file, or the name of a shipped one.", "RECIPE")
    source: Path | None = option(None, "Folder the recordings are in. [the recipe's]")
    map: tuple[str, ...] = option((), "Column to take for a signal: q_1=Joint_1. Repeatable.")
    trust_units: bool = option(False, "Units are as declared, however large the numbers.")
    guess: Path | None = option(
        None, "Draft a recipe for this recording, with the evidence; print it.", option=False
    )


@dataclass(frozen=True)
class Preview:
    """Every Nth sample of a log, for the report's figure: one short text a column.

    In a result.h5 they would lie among logs of the same ending, and one line a number would make
    most of result.json.
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
    preview: Preview | None  # of the first logs
    log: ExperimentLog = field(metadata=NOT_STORED, repr=False)


@dataclass(frozen=True)
class Result:
    """The logs and tables of an import."""

    recipe: str
    robot: str
    logs: tuple[ImportedLog, ...]
    tables: tuple[ImportedTable, ...]
    ignored: tuple[str, ...]  # files below the source folder that the recipe does not speak of
    checks: tuple[Check, ...]


def read(request: Request, settings: Settings) -> Inputs:
    """Read the recipe, its robot and every file it matches."""
    if not settings.recipe:
        remedy = "name one, or draft one with --guess FILE"
        raise UsageError("C02", "no recipe", "rrrid import", remedy)
    material = collect(settings.recipe, settings.source, request.robot, request.tell)
    material = replace(material, assume_units=request.assume_units, ending=request.format)
    return Inputs(
        sources=material.paths,
        hashes=material.hashes,
        material=material,
        folders=(settings.source,) if settings.source else (),
        label=material.folder.absolute().name,
        robot_name=material.robot.name,
    )


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Turn every recording of the material into one log, or several where its clock was set back.

    Raises:
        InputRejected, UsageError: what cannot be repaired, by the rows S, T and D of the table of
            bad inputs; all files' together.
    """
    material: Material = inputs.material
    mapped = parse_map(settings.map, material.recipe, material.robot.n_joints)
    checks, made, problems = list(material.robot.checks), list[Made](), Gathering()
    trust = settings.trust_units
    for source in material.sources:
        with problems.part():
            made += logs_of(source, material, mapped, trust, (grid, resample), checks)
    problems.raise_all()
    names = unique(item.log.name for item in made)
    paths = unique(slug(name) for name in names)
    logs: list[ImportedLog] = []
    for item, name, stem in zip(made, names, paths, strict=True):
        log = item.log
        logs.append(
            ImportedLog(
                name=name,
                file=f"logs/{stem}.{material.ending}",
                experiment=log.experiment,
                role=log.role,
                joint=log.joint,
                samples=log.n_samples,
                joints=log.n_joints,
                sample_time=log.sample_time,
                duration=float(log.t[-1] - log.t[0]),
                sources=item.files,
                steps=tuple(item.done.steps),
                altered=tuple(item.done.altered),
                preview=_preview(log) if len(logs) < REPAIR.previews else None,
                log=replace(log, name=name),
            )
        )
    tables = []
    for spec, groups, table in material.tables:
        checks += table.checks
        name = fill(spec.name, groups, material.recipe.where)
        tables.append(import_table(spec, name, f"tables/{slug(name)}.parquet", table))
    about_recipe = (material.recipe_path.name, material.robot.name)
    said = tuple(dict.fromkeys(checks))
    return Result(*about_recipe, tuple(logs), tuple(tables), material.ignored, said)


def _preview(log: ExperimentLog) -> Preview:
    every = max(1, -(-log.n_samples // REPAIR.preview_points))

    def words(values: Array, digits: int = 4) -> str:
        return " ".join(f"{x:.{digits}g}" for x in values[::every].tolist())

    return Preview(words(log.t, 6), tuple(map(words, log.q.T)), tuple(map(words, log.tau.T)))


def write(result: Result, folder: Path, request: Request) -> None:
    """Write logs and tables into `folder`."""
    for item in result.logs:
        request.tell(f"writing {item.file}")
        write_log(folder / item.file, item.log)
    for table in result.tables:
        write_table(folder / table.file, table.data, table.units)


def report(result: Result) -> Report:
    """Report what was written and what was done to the samples."""
    logs, tables, n = result.logs, result.tables, len(result.logs)
    repaired = sum(c.level == "repair" for c in result.checks)
    warned = sum(c.level == "warn" for c in result.checks)
    resampled = [i for i in logs if any(step.startswith("resampled ") for step in i.altered)]
    words = f"{many(n, 'log')} of robot {result.robot} imported, "
    words += f"{sum(item.duration for item in logs):.4g} s in all"
    words += f", and {many(len(tables), 'table')}" if tables else ""
    words += f"; {many(repaired, 'repair')}, listed below" if repaired else ""
    words += "" if repaired else "; nothing had to be repaired"
    if resampled:
        rates = ", ".join(dict.fromkeys(f"{1.0 / item.sample_time:g} Hz" for item in resampled))
        some = "all" if len(resampled) == n > 1 else many(len(resampled), "log")
        words += f"; {some} resampled to {rates}"
    words += f"; {many(warned, 'warning')}, listed below." if warned else "."
    head = ("log", "experiment", "role", "joint", "samples", "rate [Hz]", "duration [s]")
    rows: list[tuple[Any, ...]] = [
        (i.name, i.experiment, i.role, i.joint, i.samples, 1.0 / i.sample_time, i.duration)
        for i in logs
    ]
    drawn = f"Drawn are the first {REPAIR.previews} of {n} logs; rrrid inspect draws more."
    text = (drawn,) if n > REPAIR.previews else ()
    figures = tuple(f for item in logs if item.preview for f in _figures(item, item.preview))
    sections = [Section("Logs", text, tables=(Table(head, tuple(rows)),), figures=figures)]
    if tables:
        names = ("table", "from", "columns", "rows")
        units = [", ".join(f"{c} [{unit}]" for c, unit in t.units.items()) for t in tables]
        rows = [(t.name, t.source, x, t.rows) for t, x in zip(tables, units, strict=True)]
        text = ("Files without a clock are no logs; they are kept as tables in SI.",)
        sections.append(Section("Tables", text, (Table(names, tuple(rows)),)))
    rows = []
    for item in logs:
        steps = "; ".join((*item.steps, *item.altered)) or "taken as they are"
        rows.append((item.name, ", ".join(s.name for s in item.sources), steps))
    treated = [Table(("log", "from", "done to the samples"), tuple(rows))]
    said = [c for c in result.checks if c.level != "ok"]
    if found := tuple((c.code, c.level, c.where, c.message, c.remedy) for c in said):
        treated.append(Table(("code", "level", "where", "what", "remedy"), found))
    by = [f"By recipe {result.recipe}."]
    if listed := ", ".join(result.ignored[:8]):
        more, files = " …" if result.ignored[8:] else "", many(len(result.ignored), "file")
        by.append(f"The recipe does not speak of {files}: {listed}{more}.")
    sections.append(Section("What was done to the data", tuple(by), tuple(treated)))
    said_any = repaired or warned
    return Report("Import", words, "attention" if said_any else "good", sections=tuple(sections))


def _figures(item: ImportedLog, preview: Preview) -> tuple[Figure, Figure]:
    def figure(name: str, texts: tuple[str, ...], unit: str) -> Figure:
        values = np.array([text.split() for text in (preview.t, *texts)], dtype=np.float64).T
        caption = f"{item.name}: {name} of each joint as it is in the log."
        return joint_signal_figure(
            f"{name}-{slug(item.name)}", caption, values[:, 0], values[:, 1:], f"{name} [{unit}]"
        )

    return figure("position", preview.q, "rad"), figure("torque", preview.tau, "N m")


def _checks(result: Result) -> tuple[Check, ...]:
    return result.checks


_TITLE = "Import recordings by a recipe"
STAGE = Stage("import", _TITLE, Settings, compute, report, read, write, checks=_checks)

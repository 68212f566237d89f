"""Import recordings: CSV, JSON, MAT, NumPy and Parquet files become logs.

Reads    a recipe (TOML, `pipelines.importers.recipe`) and the recorded files its patterns match
Writes   logs/<name>.h5 or .parquet, result.json, report.html
Source   log-format.md; transmission and torque constants as `pipelines.importers.units` says

A log whose samples were altered (repaired, unwrapped, resampled) is a derived log. Its attribute
`created` is the time of the recording where the recipe says it; otherwise 1970-01-01T00:00:00Z,
which means "not known": the hour of the import would make equal inputs unequal. provenance.json has
that hour.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import Check, Gathering, UsageError
from pipelines.estimation.grids import grid, resample
from pipelines.importers.collect import Material, collect
from pipelines.importers.guess import Draft, guess_recipe
from pipelines.importers.links import TorqueModel
from pipelines.importers.make_log import ImportedLog, logs_of, parse_map
from pipelines.io.files import write_log
from pipelines.io.option import option
from pipelines.io.robot import RobotDescription
from pipelines.io.sandbox import regular_file
from pipelines.quality.subject import many
from pipelines.report.report import Report, Section, Table
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
class Result:
    """The logs of an import."""

    recipe: str
    robot: str
    logs: tuple[ImportedLog, ...]
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
    checks, made, problems = list(material.robot.checks), list[ImportedLog](), Gathering()
    for source in material.sources:
        with problems.part():
            resampling = grid, resample
            made += logs_of(source, material, mapped, settings.trust_units, resampling, checks)
    problems.raise_all()
    names = _unique(item.name for item in made)
    stems = _unique(slug(name) for name in names)
    logs = tuple(
        replace(
            item, name=name, file=f"logs/{stem}.{material.ending}", log=replace(item.log, name=name)
        )
        for item, name, stem in zip(made, names, stems, strict=True)
    )
    said = tuple(dict.fromkeys(checks))
    return Result(material.recipe_path.name, material.robot.name, logs, material.ignored, said)


def _unique(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names, those that occur twice numbered."""
    taken: dict[str, None] = {}
    for name in names:
        fresh, number = name, 2
        while fresh in taken:
            fresh, number = f"{name}-{number}", number + 1
        taken[fresh] = None
    return tuple(taken)


def write(result: Result, folder: Path, request: Request) -> None:
    """Write the logs into `folder`."""
    for item in result.logs:
        request.tell(f"writing {item.file}")
        write_log(folder / item.file, item.log)


def report(result: Result) -> Report:
    """Report what was written and what was done to the samples; `rrrid inspect` draws the logs."""
    logs, n = result.logs, len(result.logs)
    repaired = sum(c.level == "repair" for c in result.checks)
    warned = sum(c.level == "warn" for c in result.checks)
    resampled = [i for i in logs if any(step.startswith("resampled ") for step in i.altered)]
    words = f"{many(n, 'log')} of robot {result.robot} imported, "
    words += f"{sum(item.duration for item in logs):.4g} s in all; "
    words += f"{many(repaired, 'repair')}, listed below" if repaired else ""
    words += "" if repaired else "nothing had to be repaired"
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
    treated = []
    for item in logs:
        steps = "; ".join((*item.steps, *item.altered)) or "taken as they are"
        treated.append((item.name, ", ".join(s.name for s in item.sources), steps))
    tables = [Table(("log", "from", "done to the samples"), tuple(treated))]
    said = [c for c in result.checks if c.level != "ok"]
    if found := tuple((c.code, c.level, c.where, c.message, c.remedy) for c in said):
        tables.append(Table(("code", "level", "where", "what", "remedy"), found))
    by = [f"By recipe {result.recipe}."]
    if listed := ", ".join(result.ignored[:8]):
        more, files = " …" if result.ignored[8:] else "", many(len(result.ignored), "file")
        by.append(f"The recipe does not speak of {files}: {listed}{more}.")
    sections = (
        Section("Logs", tables=(Table(head, tuple(rows)),)),
        Section("What was done to the data", tuple(by), tuple(tables)),
    )
    return Report("Import", words, "attention" if repaired or warned else "good", sections=sections)


def _checks(result: Result) -> tuple[Check, ...]:
    return result.checks


_TITLE = "Import recordings by a recipe"
STAGE = Stage("import", _TITLE, Settings, compute, report, read, write, checks=_checks)

"""Collect the robot and files of a recipe, and bring each recording's samples on one clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pipelines.errors import (
    Check,
    Gathering,
    InputRejected,
    NothingMatched,
    UsageError,
    did_you_mean,
)
from pipelines.importers import patterns
from pipelines.importers.clock import time_of
from pipelines.importers.config import RECIPE, REPAIR
from pipelines.importers.raw import RawTable, expand
from pipelines.importers.recipe import FileSpec, Recipe, TableSpec, find_recipe, parse_recipe
from pipelines.importers.repair import Recording
from pipelines.importers.tables import read_table
from pipelines.importers.units import drive_of, si_of, unit_declared
from pipelines.io.files import RECORDINGS
from pipelines.io.robot import Drive, RobotDescription, parse_robot, shipped, shipped_names
from pipelines.io.robot_files import load_robot, split_tip
from pipelines.io.sandbox import read_small_text

_BESIDE_USE = ("name", "gravity", "tip_link")

Map = Mapping[str, Mapping[int, str]]


@dataclass(frozen=True, eq=False)
class Source:
    """One recording: the file that a pattern matched, and the files that go with it."""

    case: FileSpec
    groups: Mapping[str, str]
    primary: str  # relative to the source folder
    tables: Mapping[str, RawTable]  # the same, of every file


@dataclass(frozen=True, eq=False)
class Material:
    """Everything `import` reads."""

    recipe: Recipe
    recipe_path: Path
    folder: Path
    robot: RobotDescription
    drive: Drive | None
    sources: tuple[Source, ...]
    tables: tuple[tuple[TableSpec, Mapping[str, str], RawTable], ...] = ()
    ignored: tuple[str, ...] = ()
    paths: tuple[Path, ...] = ()
    assume_units: bool = False
    ending: str = "h5"  # of the logs to be written: "h5" | "parquet"
    hashes: Mapping[Path, str] = field(default_factory=dict)  # SHA-256 of the bytes that were read


def collect(
    recipe_name: str, source: Path | None, robot: str | None, tell: Callable[[str], None]
) -> Material:
    """Read the recipe, its robot and every file it matches.

    Raises:
        NothingMatched: C06, no file fits.
        UsageError, InputRejected, EnvironmentFault: as the readers say.
    """
    path = find_recipe(recipe_name)
    text = read_small_text(path, what="a recipe, a TOML file")
    recipe = replace(parse_recipe(text, path), where=str(path))
    folder = _folder(path, source)
    arm, described = _robot(recipe, folder, path, robot)
    drive = drive_of(recipe.drive, arm, path)
    names = patterns.files_below(folder)
    read: dict[str, RawTable] = {}

    def table_of(name: str) -> RawTable:
        if name not in read:
            tell(f"reading {name}")
            read[name] = read_table(patterns.inside(folder, name, path), recipe.format, name)
        return read[name]

    cases = [*recipe.file, *([FileSpec(match=recipe.log.match)] if recipe.log.match else [])]
    every = [case.match for case in cases] + [spec.match for spec in recipe.table]
    fits = patterns.matches(every, names, path)
    firsts = {n: next((k for k in range(len(cases)) if n in fits[k]), None) for n in names}
    hits = {n: (cases[k], fits[k][n]) for n, k in firsts.items() if k is not None}
    hits = {n: (case, groups) for n, (case, groups) in hits.items() if not case.skip}
    files = {
        n: dict.fromkeys([n, *(_file_of(recipe, s, groups, n) for s in recipe.signals)])
        for n, (_, groups) in hits.items()
    }
    companions = {file for n, of_n in files.items() for file in of_n if file != n}
    sources, problems = [], Gathering()
    for name, (case, groups) in hits.items():
        if name in companions:
            continue
        with problems.part():
            for other in (other for other in files[name] if other not in names):
                message = f"'{other}' is missing, which belongs to '{name}'"
                message += did_you_mean(other, names)
                remedy = "copy it beside, or correct file = … in [signals]"
                raise InputRejected("S01", message, path, remedy)
            sources.append(Source(case, groups, name, {f: table_of(f) for f in files[name]}))
    problems.raise_all()
    tables = tuple(
        (spec, fit[name], table_of(name))
        for name in names
        for spec, fit in zip(recipe.table, fits[len(cases) :], strict=True)
        if name in fit
    )
    recorded = [name for name in names if Path(name).suffix.lower() in RECORDINGS]
    if not sources and not tables:
        match = ", ".join(pattern for case in cases for pattern in patterns.each(case.match))
        there = [*recorded, *(name for name in names if name not in recorded)]
        more = f" and {len(there) - RECIPE.named} more" if len(there) > RECIPE.named else ""
        lie = f"there lie{'s' * (len(there) == 1)} {', '.join(there[: RECIPE.named])}{more}"
        message = f"no file matches {match}; {lie if there else 'no file lies there'}"
        remedy = "correct match in the recipe"
        remedy += "" if source else ", or give the folder of the recordings with --source"
        raise NothingMatched("C06", message, folder, remedy)
    return Material(
        recipe,
        path,
        folder,
        replace(arm, drive=drive),
        drive,
        tuple(sources),
        tables,
        tuple(name for name in recorded if name not in read),
        (path, *described, *(folder / name for name in read)),
        hashes={folder / name: table.sha256 for name, table in read.items()},
    )


def _file_of(recipe: Recipe, signal: str, groups: Mapping[str, str], primary: str) -> str:
    template = recipe.signals[signal].file
    if template is None:
        return primary
    return (Path(primary).parent / patterns.fill(template, groups, recipe.where)).as_posix()


def _folder(recipe: Path, source: Path | None) -> Path:
    """Return the folder of the recordings: --source, or that of a recipe of one's own."""
    if source is None:
        if recipe.stem in shipped_names("recipes") and recipe == shipped("recipes", recipe.stem):
            message = f"the shipped recipe '{recipe.stem}' does not say where the recordings lie"
            remedy = "give their folder with --source FOLDER"
            raise UsageError("C04", message, "rrrid import", remedy)
        return recipe.parent
    if not source.is_dir():
        message = "is not a folder" if source.exists() else "no such folder"
        raise UsageError("C04", message, source, "give the folder of the recordings with --source")
    return source


def _robot(
    recipe: Recipe, folder: Path, path: Path, override: str | None
) -> tuple[RobotDescription, tuple[Path, ...]]:
    """Return the robot of [robot], and its file.

    It is a file with the data or the recipe, a shipped one, or written out in the recipe.
    """
    if override:
        return load_robot(override), ()
    table = dict(recipe.robot)
    use = table.pop("use", None)
    if use is None:
        import tomli_w

        return parse_robot(tomli_w.dumps(table), where=path), ()
    for key in table:
        if key not in _BESIDE_USE:
            message = f"'robot.{key}' beside 'robot.use'{did_you_mean(key, _BESIDE_USE)}"
            remedy = f"beside use, {', '.join(_BESIDE_USE)} can be given; write the rest in the "
            raise UsageError("C01", message, path, f"{remedy}description")
    tip, gravity = table.get("tip_link"), table.get("gravity", [0.0, 0.0, 0.0])
    numbers = isinstance(gravity, list) and all(isinstance(g, int | float) for g in gravity)
    for key, value, right, what in (
        ("use", use, isinstance(use, str) and bool(use.strip()), "a description, URDF, or robot"),
        ("tip_link", tip, isinstance(tip, str | None), 'a link: tip_link = "last link"'),
        ("gravity", gravity, numbers and len(gravity) == len("xyz"),
         "three numbers [m/s^2]: gravity = [0.0, 0.0, -9.81]"),
    ):  # fmt: skip
        if not right:
            message = f"'robot.{key}' is {value!r}, must be {what}"
            raise UsageError("C02", message, path, "correct the value")
    use, after_colon = split_tip(use)
    places = dict.fromkeys((folder, path.parent))
    found = next((place / use for place in places if (place / use).is_file()), None)
    if found is None and Path(use).suffix and use not in shipped_names("robots"):
        nowhere = " nor ".join(f"in {place}" for place in places)
        lies = f"lies neither {nowhere}" if folder != path.parent else f"does not lie {nowhere}"
        message = f"the robot '{use}' that the recipe names {lies}"
        remedy = "copy it to the recordings, give their folder with --source, or another robot"
        raise UsageError("C04", message, path, f"{remedy} with --robot")
    robot = load_robot(found if found is not None else use, tip or after_colon)
    x, y, z = map(float, gravity if "gravity" in table else robot.gravity)
    robot = replace(robot, name=str(table.get("name", robot.name)), gravity=(x, y, z))
    return robot, () if found is None else (found,)


def parse_map(entries: tuple[str, ...], recipe: Recipe, joints: int) -> Map:
    """Return the columns of --map q_1=Joint_1, named differently from the recipe.

    Raises:
        UsageError: C02, not of that form, or of a joint that the robot does not have.
    """
    found: dict[str, dict[int, str]] = {}
    for entry in entries:
        left, _, column = entry.partition("=")
        signal, _, joint = left.strip().rpartition("_")
        signal, joint = ("t", "1") if left.strip() == "t" else (signal, joint)
        known = signal == "t" == left.strip() or (joint.isdecimal() and signal in recipe.signals)
        if not column.strip() or not known:
            signals = ", ".join([*recipe.signals, "t"])
            remedy = f"write --map q_1=Joint_1; signals: {signals}"
            raise UsageError("C02", f"'{entry}' is not signal_joint=column", "--map", remedy)
        if not 1 <= int(joint) <= joints:
            message = f"'{entry}' speaks of joint {joint}, the robot has joints 1 to {joints}"
            raise UsageError("C02", message, "--map", "joints count from 1")
        found.setdefault(signal, {})[int(joint)] = column.strip()
    return found


@dataclass(frozen=True, eq=False)
class Assembled:
    """A recording before any repair: one part a clock, units as declared, columns as used."""

    recordings: tuple[Recording, ...]
    units: Mapping[str, tuple[str, ...]]  # one a joint
    columns: Mapping[str, tuple[str, ...]]
    checks: tuple[Check, ...]
    undeclared: tuple[str, ...] = ()  # units that the recipe leaves open and their source, in words


def assemble(source: Source, material: Material, mapped: Map) -> Assembled:
    """Pick columns, units and time of every file of a recording, and join files of one clock.

    Raises:
        InputRejected: S01-S05, S08, S12, S16, T06.
    """
    recipe, assume = material.recipe, material.assume_units
    time = replace(recipe.time, column=mapped["t"][1]) if "t" in mapped else recipe.time
    checks = [check for table in source.tables.values() for check in table.checks]
    units: dict[str, tuple[str, ...]] = {}
    columns: dict[str, tuple[str, ...]] = {}
    recordings: list[tuple[Recording, RawTable]] = []
    undeclared: list[str] = []
    problems = Gathering()
    for file, table in source.tables.items():
        here = [s for s in recipe.signals
                if _file_of(recipe, s, source.groups, source.primary) == file]  # fmt: skip
        for signal in here:
            with problems.part():
                spec, robot = recipe.signals[signal], material.robot
                names = expand(table, spec.where or 1, robot.n_joints, signal, mapped.get(signal))
                columns[signal] = names
                units[signal], said = unit_declared(signal, spec, table, names, robot, assume)
                checks += said
                if spec.unit is None:
                    header = any(name in table.units for name in names)
                    origin = "from the header" if header else "assumed, as --assume-units says"
                    listed = ", ".join(dict.fromkeys(units[signal]))
                    undeclared.append(f"{signal}: unit {listed} {origin}")
        own = file == source.primary or all(
            isinstance(c, int) or c in table.columns for c, _ in time.parts
        )
        t = np.full(table.rows.size, np.nan)
        with problems.part():
            if own:
                if time.unit is None and len(time.parts) == 1:
                    of_t = table.units.get(table.name_of(time.parts[0][0], "t"))
                    undeclared += [f"t: unit {of_t} from the header"] if of_t else []
                t, said = time_of(table, time, assume)
                checks += said
        if problems.found or not (here or file == source.primary):
            continue
        x = {s: np.column_stack([table.columns[name] for name in columns[s]]) for s in here}
        si = {s: si_of(units[s], recipe.signals[s]) for s in here}
        places, word = (table.rows + 1, "row") if table.lines is None else (table.lines, "line")
        clocked, of_file = own and time.column is not None, {s: columns[s] for s in here}
        part = Recording(t, x, of_file, places, table.source, clocked, word, table.breaks, si)
        recordings.append((part, table))
    problems.raise_all()
    parts = _joined(recordings, time.column is not None, checks)
    begin = recipe.log.begin if source.case.begin is None else source.case.begin
    if begin:
        parts = tuple(_begun(part, begin, checks) for part in parts)
    if len(parts) > 1 and recipe.resample is None:
        message, where = "the files have different time stamps", ", ".join(source.tables)
        remedy = "add [resample] rate = … to bring them on one clock"
        raise InputRejected("T06", message, where, remedy)
    return Assembled(parts, units, columns, tuple(checks), tuple(undeclared))


def _begun(part: Recording, begin: float, checks: list[Check]) -> Recording:
    """Return a recording without its first `begin` [s]."""
    kept = ~(part.t < float(np.nanmin(part.t)) + begin)
    message = f"the first {begin:g} s, {int(np.sum(~kept))} samples, left out as the recipe says"
    checks.append(Check.of("T04", "ok", message, part.where))
    return part.take(kept)


def _joined(
    recordings: list[tuple[Recording, RawTable]], clocked: bool, checks: list[Check]
) -> tuple[Recording, ...]:
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
    return tuple(part for part in (first, *separate) if part.signals)

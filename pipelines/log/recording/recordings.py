"""Gather what a recipe speaks of: its robot, its files, and the samples of each recording on one clock."""

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
from pipelines.log.experiment import Array
from pipelines.log.files import RECORDINGS
from pipelines.log.recording import filenames
from pipelines.log.recording.clock import time_of
from pipelines.log.recording.joint_side import drive_of, si_of, unit_declared
from pipelines.log.recording.raw import RawTable, expand
from pipelines.log.recording.recipe import FileSpec, Recipe, SignalSpec, TableSpec
from pipelines.log.recording.recipe_reader import find_recipe, parse_recipe
from pipelines.log.recording.repair import Recording
from pipelines.log.recording.sources import read_table
from pipelines.log.robot import Drive, RobotDescription, parse_robot
from pipelines.log.robot_files import load_robot, split_tip
from pipelines.log.shipped import shipped, shipped_names
from pipelines.log.text import read_small_text

__all__ = ["Assembled", "Map", "Material", "Source", "assemble", "collect", "parse_map"]

_BESIDE_USE = ("name", "gravity", "tip_link")

Map = Mapping[str, Mapping[int, str]]


@dataclass(frozen=True, eq=False)
class Source:
    """One recording: the file that a pattern matched, and the files that go with it."""

    case: FileSpec | None
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
    recipe_name: str | Path, source: Path | None, robot: str | None, tell: Callable[[str], None]
) -> Material:
    """Read the recipe, its robot and every file it matches.

    Raises:
        NothingMatched: C06, no file fits. UsageError, InputRejected, EnvironmentFault: as the readers say.
    """
    path = find_recipe(recipe_name)
    recipe = replace(
        parse_recipe(read_small_text(path, what="a recipe, a TOML file"), path), where=str(path)
    )
    folder = _folder(path, source)
    arm, described = _robot(recipe, folder, path, robot)
    drive = drive_of(recipe.drive, arm, path)
    names = filenames.files_below(folder)
    cases = [*recipe.file, *([FileSpec(recipe.log.match)] if recipe.log.match else [])]
    read: dict[str, RawTable] = {}

    def table_of(name: str) -> RawTable:
        if name not in read:
            tell(f"reading {name}")
            read[name] = read_table(filenames.inside(folder, name, path), recipe.format, name)
        return read[name]

    fits = filenames.matches(
        [*(case.match for case in cases), *(spec.match for spec in recipe.table)], names, path
    )
    hits = {name: hit for name in names if (hit := _case(cases, fits, name)) is not None}
    companions = {
        other
        for name, (_, groups) in hits.items()
        for other in _files_of(recipe, groups, name, path)
        if other != name
    }
    sources, problems = [], Gathering()
    for name, (case, found) in hits.items():
        with problems.part():
            sources += (
                []
                if name in companions
                else [_source(case, found, name, recipe, table_of, names, path)]
            )
    problems.raise_all()
    tables = [
        (spec, fit[name], table_of(name))
        for name in names
        for spec, fit in zip(recipe.table, fits[len(cases) :], strict=True)
        if name in fit
    ]
    if not sources and not tables:
        patterns = ", ".join(
            p
            for case in cases
            for p in ((case.match,) if isinstance(case.match, str) else case.match)
        )
        there = filenames.lying_there(names, RECORDINGS)
        message = f"no file matches {patterns}; {there}"
        remedy = "correct match in the recipe" + (
            "" if source else ", or give the folder of the recordings with --source"
        )
        raise NothingMatched("C06", message, where=folder, remedy=remedy)
    return Material(
        recipe,
        path,
        folder,
        replace(arm, drive=drive),
        drive,
        tuple(sources),
        tuple(tables),
        tuple(
            name for name in names if name not in read and Path(name).suffix.lower() in RECORDINGS
        ),
        (path, *described, *(folder / name for name in read)),
        hashes={folder / name: table.sha256 for name, table in read.items()},
    )


def _folder(recipe: Path, source: Path | None) -> Path:
    """Where the recordings lie: --source, or beside a recipe of one's own; a shipped recipe has none beside it.

    Raises:
        UsageError: C04, no such folder, or none was given.
    """
    if source is None:
        if recipe.stem in shipped_names("recipes") and recipe == shipped("recipes", recipe.stem):
            message = f"the shipped recipe '{recipe.stem}' does not say where the recordings lie"
            remedy = "give their folder with --source FOLDER"
            raise UsageError("C04", message, where="rrrid import", remedy=remedy)
        return recipe.parent
    if not source.is_dir():
        message = "is not a folder" if source.exists() else "no such folder"
        remedy = "give the folder of the recordings with --source"
        raise UsageError("C04", message, where=source, remedy=remedy)
    return source


def _case(
    cases: list[FileSpec], fits: list[dict[str, dict[str, str]]], name: str
) -> tuple[FileSpec, dict[str, str]] | None:
    for case, fit in zip(cases, fits, strict=False):
        if name in fit:
            return None if case.skip else (case, fit[name])
    return None


def _source(
    case: FileSpec,
    groups: dict[str, str],
    name: str,
    recipe: Recipe,
    table_of: Callable[[str], RawTable],
    names: tuple[str, ...],
    where: Path,
) -> Source:
    wanted = _files_of(recipe, groups, name, where)
    for other in wanted:
        if other not in names:
            message = f"'{other}' is missing, which belongs to '{name}'{did_you_mean(other, names)}"
            remedy = "copy it beside, or correct file = … in [signals]"
            raise InputRejected("S01", message, where=where, remedy=remedy)
    return Source(
        case, groups, name, {file: table_of(file) for file in dict.fromkeys([name, *wanted])}
    )


def _file_of(
    recipe: Recipe, signal: str, groups: Mapping[str, str], primary: str, where: object
) -> str:
    template = recipe.signals[signal].file
    if template is None:
        return primary
    beside = Path(primary).parent / filenames.fill(template, groups, where)
    return beside.as_posix()


def _files_of(recipe: Recipe, groups: Mapping[str, str], primary: str, where: object) -> list[str]:
    return [_file_of(recipe, signal, groups, primary, where) for signal in recipe.signals]


def _robot(
    recipe: Recipe, folder: Path, path: Path, override: str | None
) -> tuple[RobotDescription, tuple[Path, ...]]:
    """The robot of [robot]: a file beside the data or the recipe, a shipped one, or written out in the recipe; and its file."""
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
            remedy = f"beside use, {', '.join(_BESIDE_USE)} can be given; write the rest in the description"
            raise UsageError("C01", message, where=path, remedy=remedy)
    tip = table.get("tip_link")
    if not isinstance(tip, str | None):
        remedy = 'write tip_link = "last link"'
        raise UsageError("C02", "'robot.tip_link' must name a link", where=path, remedy=remedy)
    if not isinstance(use, str) or not use.strip():
        message = "'robot.use' must name a robot description, a URDF, or a shipped robot"
        raise UsageError("C02", message, where=path, remedy="fill it in")
    use, after_colon = split_tip(use)
    found = next((place / use for place in (folder, path.parent) if (place / use).is_file()), None)
    if found is None and Path(use).suffix and use not in shipped_names("robots"):
        places = " nor ".join(dict.fromkeys((f"in {folder}", f"in {path.parent}")))
        message = (
            f"the robot '{use}' that the recipe names lies neither {places}"
            if folder != path.parent
            else f"the robot '{use}' that the recipe names does not lie in {folder}"
        )
        remedy = "copy it to the recordings, give their folder with --source, or another robot with --robot"
        raise UsageError("C04", message, where=path, remedy=remedy)
    robot = load_robot(found if found is not None else use, tip or after_colon)
    files = () if found is None else (found,)
    if "name" in table:
        robot = replace(robot, name=str(table["name"]))
    gravity = table.get("gravity")
    if gravity is None:
        return robot, files
    if not (
        isinstance(gravity, list | tuple)
        and len(gravity) == 3
        and all(isinstance(g, int | float) for g in gravity)
    ):
        message = f"'robot.gravity' is {gravity}, must be three numbers [m/s^2]"
        raise UsageError("C02", message, where=path, remedy="write gravity = [0.0, 0.0, -9.81]")
    return replace(robot, gravity=(float(gravity[0]), float(gravity[1]), float(gravity[2]))), files


def parse_map(entries: tuple[str, ...], recipe: Recipe, joints: int) -> Map:
    """--map q_1=Joint_1: single columns named differently from the recipe.

    Raises:
        UsageError: C02, not of that form, or of a joint that the robot does not have.
    """
    found: dict[str, dict[int, str]] = {}
    for entry in entries:
        left, equals, column = entry.partition("=")
        signal, _, joint = left.strip().rpartition("_")
        if left.strip() == "t":
            signal, joint = "t", "1"
        elif not joint.isdecimal() or signal not in recipe.signals:
            signal = ""
        if not equals or not column.strip() or not signal:
            known = ", ".join([*recipe.signals, "t"])
            message = f"'{entry}' is not signal_joint=column"
            remedy = f"write --map q_1=Joint_1; signals: {known}"
            raise UsageError("C02", message, where="--map", remedy=remedy)
        if not 1 <= int(joint) <= joints:
            message = f"'{entry}' speaks of joint {joint}, the robot has joints 1 to {joints}"
            raise UsageError("C02", message, where="--map", remedy="joints count from 1")
        found.setdefault(signal, {})[int(joint)] = column.strip()
    return found


@dataclass(frozen=True, eq=False)
class Assembled:
    """A recording before any repair: one part a clock, units as declared, columns as used."""

    recordings: tuple[Recording, ...]
    units: Mapping[str, tuple[str, ...]]  # one a joint
    columns: Mapping[str, tuple[str, ...]]
    checks: tuple[Check, ...]
    undeclared: tuple[
        str, ...
    ] = ()  # units that the recipe leaves open and where they come from, in words


def assemble(
    source: Source, material: Material, mapped: Map, assume_units: bool = False
) -> Assembled:
    """Pick columns, units and time of every file of a recording, and bring files of one clock together.

    Raises:
        InputRejected: S01-S05, S08, S12, S16, T06.
    """
    recipe, n = material.recipe, material.robot.n_joints
    time = replace(recipe.time, column=mapped["t"][1]) if "t" in mapped else recipe.time
    checks: list[Check] = [check for table in source.tables.values() for check in table.checks]
    units: dict[str, tuple[str, ...]] = {}
    columns: dict[str, tuple[str, ...]] = {}
    recordings: list[Recording] = []
    undeclared: list[str] = []
    problems = Gathering()
    for file, table in source.tables.items():
        here = [
            s
            for s in recipe.signals
            if _file_of(recipe, s, source.groups, source.primary, recipe.where) == file
        ]
        for signal in here:
            with problems.part():
                columns[signal] = expand(
                    table, recipe.signals[signal].where or 1, n, signal, mapped.get(signal)
                )
                units[signal] = unit_declared(
                    signal,
                    recipe.signals[signal],
                    table,
                    columns[signal],
                    material.robot,
                    assume_units,
                    checks,
                )
                undeclared += _undeclared(
                    signal, recipe.signals[signal], units[signal], columns[signal], table
                )
        if not here and file != source.primary:
            continue
        own_clock = file == source.primary or all(
            isinstance(c, int) or c in table.columns for c, _ in time.parts
        )
        t: Array = np.full(table.rows.size, np.nan)
        said: list[Check] = []
        with problems.part():
            if (
                own_clock
                and time.unit is None
                and len(time.parts) == 1
                and (header := table.units.get(table.name_of(time.parts[0][0], "t")))
            ):
                undeclared.append(f"t: unit {header} from the header")
            if own_clock:
                t, said = time_of(table, time, assume_units)
        checks += said
        if problems.found:
            continue
        signals: dict[str, Array] = {
            s: np.column_stack([table.columns[c] for c in columns[s]]) for s in here
        }
        places = table.rows + 1 if table.lines is None else table.lines
        recordings.append(
            Recording(
                t,
                signals,
                {s: columns[s] for s in here},
                places,
                table.source,
                time.column is not None and own_clock,
                "row" if table.lines is None else "line",
                table.breaks,
                {s: si_of(units[s], recipe.signals[s]) for s in here},
            )
        )
    problems.raise_all()
    begin = (
        recipe.log.begin if source.case is None or source.case.begin is None else source.case.begin
    )
    joined = tuple(
        _begun(one, begin, checks)
        for one in _joined(
            recordings, list(source.tables.values()), time.column is not None, checks
        )
    )
    if len(joined) > 1 and recipe.resample is None:
        message = "the files have different time stamps"
        remedy = "add [resample] rate = … to bring them on one clock"
        raise InputRejected("T06", message, where=", ".join(source.tables), remedy=remedy)
    return Assembled(joined, units, columns, tuple(checks), tuple(undeclared))


def _undeclared(
    signal: str, spec: SignalSpec, units: tuple[str, ...], columns: tuple[str, ...], table: RawTable
) -> list[str]:
    """Say where the unit of a signal comes from that the recipe leaves open."""
    if spec.unit is not None:
        return []
    origin = (
        "from the header"
        if any(c in table.units for c in columns)
        else "assumed, as --assume-units says"
    )
    return [f"{signal}: unit {', '.join(dict.fromkeys(units))} {origin}"]


def _begun(one: Recording, begin: float | None, checks: list[Check]) -> Recording:
    """Without what was recorded before `begin` [s], as the recipe asks."""
    if not begin:
        return one
    kept = ~(one.t < float(np.nanmin(one.t)) + begin)
    message = f"the first {begin:g} s, {int(np.sum(~kept))} samples, left out as the recipe says"
    checks.append(Check.of("T04", "ok", message, where=one.where))
    return one.take(kept)


def _joined(
    recordings: list[Recording], tables: list[RawTable], clocked: bool, checks: list[Check]
) -> tuple[Recording, ...]:
    """Files whose rows belong together become one recording; files with clocks of their own stay apart."""
    first, rows = recordings[0], tables[0].rows
    apart: list[Recording] = []
    for other, table in zip(recordings[1:], tables[1:], strict=True):
        if (
            clocked
            and other.clocked
            and not (
                other.t.shape == first.t.shape and np.array_equal(other.t, first.t, equal_nan=True)
            )
        ):
            apart.append(other)
            continue
        _refuse_unequal(
            first, other, int(rows[-1]), int(table.rows[-1]), clocked and not other.clocked, checks
        )
        common, a, b = np.intersect1d(rows, table.rows, assume_unique=True, return_indices=True)
        breaks = tuple((np.flatnonzero(np.diff(common) > 1) + 1).tolist())
        first = replace(
            first,
            t=first.t[a],
            places=first.places[a],
            columns={**first.columns, **other.columns},
            breaks=breaks,
            si={**first.si, **other.si},
            signals={
                **{k: v[a] for k, v in first.signals.items()},
                **{k: v[b] for k, v in other.signals.items()},
            },
        )
        rows = common
    kept = [r for r in (first, *apart) if r.signals]
    return tuple(kept)


def _refuse_unequal(
    first: Recording, other: Recording, a: int, b: int, one_clock: bool, checks: list[Check]
) -> None:
    """S16: files without clocks of their own belong together row by row, so they must be equally long."""
    if a == b:
        return
    where = f"{first.where}, {other.where}"
    if one_clock or abs(a - b) > max(1, 1e-3 * max(a, b)):
        message = f"{a + 1} and {b + 1} samples: not of one recording"
        remedy = "give files of the same run, or files with time stamps of their own and [resample]"
        raise InputRejected("S16", message, where=where, remedy=remedy)
    message = f"{a + 1} and {b + 1} samples; the rows both have are used, counted from the start"
    remedy = "begin and end both recordings together"
    checks.append(Check.of("T06", "warn", message, where=where, remedy=remedy))

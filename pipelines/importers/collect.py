"""Collect what an import reads: the recipe, its robot, and every file that its patterns match."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pipelines.errors import Gathering, InputRejected, NothingMatched, UsageError, did_you_mean
from pipelines.importers import patterns
from pipelines.importers.config import RECIPE
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import FileSpec, Recipe, find_recipe, parse_recipe
from pipelines.importers.tables import read_table
from pipelines.importers.units import drive_of
from pipelines.io.files import RECORDINGS
from pipelines.io.robot import Drive, RobotDescription, parse_robot, shipped, shipped_names
from pipelines.io.robot_files import load_robot, split_tip
from pipelines.io.sandbox import read_small_text

_BESIDE_USE = ("name", "gravity", "tip_link")


@dataclass(frozen=True, eq=False)
class Source:
    """One recording: the file that a pattern matched, and the files that go with it."""

    case: FileSpec
    groups: Mapping[str, str]
    primary: str  # relative to the source folder
    tables: Mapping[str, RawTable]  # the same, of every file
    files: Mapping[str, str]  # signal -> its file


@dataclass(frozen=True, eq=False)
class Material:
    """Everything `import` reads."""

    recipe: Recipe
    recipe_path: Path
    folder: Path
    robot: RobotDescription
    drive: Drive | None
    sources: tuple[Source, ...]
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
    cases = [*recipe.file, *([FileSpec(match=recipe.log.match)] if recipe.log.match else [])]
    hits = _hits(recipe, cases, names, path)
    companions = {
        file for name, (*_, files) in hits.items() for file in files.values() if file != name
    }
    read: dict[str, RawTable] = {}
    sources, problems = list[Source](), Gathering()
    for name, (case, groups, files) in hits.items():
        if name in companions:
            continue
        with problems.part():
            for file in dict.fromkeys([name, *files.values()]):
                if file not in names:
                    message = f"'{file}' is missing, which belongs to '{name}'"
                    message += did_you_mean(file, names)
                    remedy = "copy it beside, or correct file = … in [signals]"
                    raise InputRejected("S01", message, path, remedy)
                if file not in read:
                    tell(f"reading {file}")
                    inside = patterns.inside(folder, file, path)
                    read[file] = read_table(inside, recipe.format, file)
            tables = {file: read[file] for file in dict.fromkeys([name, *files.values()])}
            sources.append(Source(case, groups, name, tables, files))
    problems.raise_all()
    recorded = [name for name in names if Path(name).suffix.lower() in RECORDINGS]
    if not sources:
        match = ", ".join(pattern for case in cases for pattern in patterns.each(case.match))
        there = ", ".join(([*recorded] or [*names])[: RECIPE.named])
        message = f"no file matches {match}; there lies {there or 'no file'}"
        remedy = "correct match in the recipe, or give the folder of the recordings with --source"
        raise NothingMatched("C06", message, folder, remedy)
    return Material(
        recipe,
        path,
        folder,
        replace(arm, drive=drive),
        drive,
        tuple(sources),
        tuple(name for name in recorded if name not in read),
        (path, *described, *(folder / name for name in read)),
        hashes={folder / name: table.sha256 for name, table in read.items()},
    )


def _hits(
    recipe: Recipe, cases: Sequence[FileSpec], names: Sequence[str], path: Path
) -> Mapping[str, tuple[FileSpec, Mapping[str, str], dict[str, str]]]:
    """Return the files that are recordings: the first case of each, its groups and its files."""
    fits = patterns.matches([case.match for case in cases], names, path)
    hits = dict[str, tuple[FileSpec, Mapping[str, str], dict[str, str]]]()
    for name in names:
        first = next((k for k, fit in enumerate(fits) if name in fit), None)
        if first is not None and not cases[first].skip:
            groups = fits[first][name]
            hits[name] = cases[first], groups, _files_of(recipe, groups, name)
    return hits


def _files_of(recipe: Recipe, groups: Mapping[str, str], primary: str) -> dict[str, str]:
    """Return the file of each signal of a recording."""
    beside = Path(primary).parent
    return {
        signal: (beside / patterns.fill(spec.file, groups, recipe.where)).as_posix()
        if spec.file is not None
        else primary
        for signal, spec in recipe.signals.items()
    }


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
    if not numbers or len(gravity) != len("xyz"):
        message, remedy = f"'robot.gravity' is {gravity!r}", "write gravity = [0.0, 0.0, -9.81]"
        raise UsageError("C02", message, path, remedy)
    if not (isinstance(use, str) and use.strip() and isinstance(tip, str | None)):
        message = f"'robot.use' is {use!r}, 'robot.tip_link' is {tip!r}: not both names"
        remedy = "write the file of a description or URDF, or a shipped robot; and a link"
        raise UsageError("C02", message, path, remedy)
    use, after_colon = split_tip(use)
    places = dict.fromkeys((folder, path.parent))
    found = next((place / use for place in places if (place / use).is_file()), None)
    if found is None and Path(use).suffix and use not in shipped_names("robots"):
        message = (
            f"the robot '{use}' that the recipe names is not in {' or '.join(map(str, places))}"
        )
        remedy = "copy it to the recordings, give their folder with --source, or another robot"
        raise UsageError("C04", message, path, f"{remedy} with --robot")
    robot = load_robot(found if found is not None else use, tip or after_colon)
    x, y, z = map(float, gravity if "gravity" in table else robot.gravity)
    robot = replace(robot, name=str(table.get("name", robot.name)), gravity=(x, y, z))
    return robot, () if found is None else (found,)

"""Options of the command line, made of dataclasses: names, help, defaults and kinds of values.

A field declared by `pipelines.io.option.option` is an option of its stage's command; any other is
set by --set or --config alone. typer gets every value as text, and `converted` makes it what the
field holds.
"""

from __future__ import annotations

import types
import typing
from collections.abc import Iterable, Mapping
from dataclasses import Field, dataclass, fields
from importlib import import_module
from importlib.util import find_spec
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from pipelines.errors import UsageError, clean, did_you_mean
from pipelines.io.option import option
from pipelines.io.sandbox import TomlError, parse_toml, read_small_text

S = TypeVar("S")
# In the order in which they are needed.
COMMANDS = ["run", "batch", "demo", "inspect", "import", "convert", "design-excitation"]
COMMANDS += ["fit-friction", "reconstruct", "estimate-bps", "validate-writing", "frf", "simulate"]
COMMANDS += ["diagnose", "extend", "export", "compare", "report", "schema", "doctor"]
STAGES = tuple(name for name in COMMANDS if name not in ("batch", "report", "schema", "doctor"))
# What a stage reads by itself. Within `run` it has logs and models from the run, unless the field
# says `in_run`.
OWN_INPUTS = ("identify", "validate", "reference", "model", "text", "recipe")
# What options of earlier versions are called now.
RENAMED = {
    "--after": "--prior-logs",
    "--allow-mismatch": "--skip-sanity-checks",
    "--allow-same": "--allow-overlap",
    "--filter": "--cutoff-hz",
    "--for": "--experiment",
    "--fresh": "--no-cache",
    "--keep-out": "--stop-band",
    "--like": "--replay",
    "--most": "--max-causes",
    "--seconds": "--time-limit",
    "--tell-apart": "--discriminate",
    "--without": "--exclude",
}
# kind -> its name on the command line, in words, an example
KINDS: dict[Any, tuple[str, str, str]] = {
    int: ("NUMBER", "whole number", "4"),
    float: ("NUMBER", "number", "0.5"),
    bool: ("", "truth value", "true"),
    str: ("TEXT", "text", '"a"'),
    Path: ("PATH", "path", '"a/b"'),
}


@dataclass(frozen=True)
class Common:
    """Options of every command."""

    out: Path | None = option(None, "Folder for the output.")
    json: bool = option(False, "Print result.json on standard output, and nothing else there.")
    strict: bool = option(False, "A repair of the data is an error (exit 3).")
    check: bool = option(False, "Exit 1 where a gate failed or something was found.")
    robot: str | None = option(None, "Robot description to use instead of the logs' own.")
    assume_units: bool = option(False, "Take signals without units as SI.")
    format: str = option("h5", "Container of the logs that are written: h5 or parquet.")
    config: Path | None = option(None, "TOML file of settings, one table a stage.")
    set: tuple[str, ...] = option((), "One setting: STAGE.OPTION=VALUE; the names are below.")
    no_report: bool = option(False, "Leave report and figures out.")
    force: bool = option(False, "Replace files that were changed as well.")
    quiet: bool = option(False, "Print nothing but errors.", "-q", "--quiet")
    verbose: bool = option(False, "Verbose progress.", "-v", "--verbose")
    debug: bool = option(False, "Show the traceback of an internal error.")

    def __post_init__(self) -> None:
        if self.quiet and self.verbose:
            raise UsageError("C02", "-q and -v contradict each other", "-q, -v", "give one of them")
        if self.format not in ("h5", "parquet"):
            message = f"'{self.format}' is no container"
            raise UsageError("C02", message, "--format", "give h5 or parquet")


def module_of(command: str) -> str:
    """Return the module of a command's stage; `import` is a word of the language."""
    own = {"import": "import_log", "export": "export_model"}  # `export` is a package
    return f"pipelines.{own.get(command, command.replace('-', '_'))}"


def stage_of(command: str) -> Any:
    """Return the stage of a command."""
    return import_module(module_of(command)).STAGE


def stage_file(command: str) -> Path:
    """Return the file of a command's stage, which is not imported."""
    return Path(str(getattr(find_spec(module_of(command)), "origin", "")))


def parameters(
    kind: type[Any], only: Iterable[str] | None = None, required: Iterable[str] = (), **texts: str
) -> list[Parameter]:
    """Return the typer parameters of a dataclass's options.

    Args:
        only: fields that are offered; None: all.
        required: fields that must be given.
        texts: field -> other help.
    """
    found, hints = [], typing.get_type_hints(kind)
    for field in _options(kind):
        if only is not None and field.name not in only:
            continue
        value, many = _kind(hints[field.name])
        taken: Any = bool if value is bool else list[str] if many else str
        metavar = KINDS[value][0] or None
        if field.metadata.get("pair"):
            taken, metavar = tuple[str, str], f"{metavar} {metavar}"
        flags = _flags(field)
        text = texts.get(field.name, field.metadata["help"])
        default: Any = field.default
        if default not in (None, False, True, (), "", Path()) and not text.endswith("]"):
            text += f" [{','.join(map(str, default)) if many else default}]"
        about: Any = typer.Argument(help=text, metavar=flags[0], show_default=False)
        if flags[0].startswith("-"):
            about = typer.Option(*flags, help=text, metavar=metavar)
        must = field.name in required
        shape: Any = taken if must else taken | None
        start, noted = Parameter.empty if must else None, Annotated[shape, about]
        name = _key(kind, field)
        found.append(Parameter(name, Parameter.KEYWORD_ONLY, default=start, annotation=noted))
    return found


def _options(kind: type[Any]) -> list[Field[Any]]:
    return [field for field in fields(kind) if "help" in field.metadata]


def _flags(field: Field[Any]) -> tuple[str, ...]:
    return field.metadata["flags"] or (f"--{field.name.replace('_', '-')}",)


def _key(kind: type[Any], field: Field[Any]) -> str:
    """Return the name of an option among those of all dataclasses of a command."""
    return f"{kind.__name__.lower()}_{field.name}"


def _kind(hint: Any) -> tuple[Any, bool]:
    """Return the kind of a value, and if there may be several: tuple[int, ...] gives int, True."""
    while typing.get_origin(hint) in (typing.Union, types.UnionType):
        hint = typing.get_args(hint)[0]
    return (typing.get_args(hint)[0], True) if typing.get_origin(hint) is tuple else (hint, False)


def read(kind: type[S], given: Mapping[str, Any]) -> S:
    """Return a dataclass filled in from the command line."""
    return kind(**read_values(kind, given))


def read_values(kind: type[Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was given of the options of a dataclass, each as the kind of its field.

    Raises:
        UsageError: C02, no number where the option takes one.
    """
    hints, found = typing.get_type_hints(kind), dict[str, Any]()
    for field in _options(kind):
        value, flag = given.get(_key(kind, field)), _flags(field)[0]
        if value is None:
            continue
        if isinstance(value, bool) and "/" not in flag:
            value = not field.default
        found[field.name] = _converted(hints[field.name], value, flag)
    return found


def _converted(hint: Any, value: Any, where: str) -> Any:
    """Return a text of the command line, or a value of TOML, as a field of that type holds it.

    A text is a list of one; of numbers, "1,3" is a list of two.

    Raises:
        UsageError: C02, it is of another kind.
    """
    kind, many = _kind(hint)
    items = list(value) if isinstance(value, list | tuple) else [value]
    if many and kind in (int, float):
        texts = (item.split(",") if isinstance(item, str) else [item] for item in items)
        items = [item for parts in texts for item in parts]
    try:
        found = tuple(_one(kind, item) for item in items)
    except (ValueError, OverflowError):
        found = ()
    if len(found) != len(items) or (not many and (len(found) != 1 or isinstance(value, list))):
        _, words, example = KINDS[kind]
        words = f"list of {words}s" if many else words
        shown = f"'{value}'" if isinstance(value, str) else repr(value)
        message, remedy = f"{clean(shown, 60)} is no {words}", f"give a {words}, such as {example}"
        raise UsageError("C02", message, where, remedy)
    return found if many else found[0]


def _one(kind: Any, item: Any) -> Any:
    """Return one value as `kind`; ValueError, OverflowError where it is none."""
    if isinstance(item, bool) or kind is bool:
        if kind is bool and isinstance(item, bool):
            return item
    elif isinstance(item, str) or (kind is float and isinstance(item, int | float)):
        value = kind(item)
        if kind is not int or abs(value) < 1 << 63:
            return value
    elif kind is int and isinstance(item, int) and abs(item) < 1 << 63:
        return item
    raise ValueError


def settable(command: str) -> dict[str, list[str]]:
    """Return what --set takes for a command: stage -> names; for `run` those of all its stages."""
    if command != "run":
        return {command: _names(stage_of(command).settings)}
    kinds = {stage: stage_of(stage).settings for stage in _run_stages()}
    return {
        stage: [name for name in _names(kind) if not _is_own(kind, name)]
        for stage, kind in kinds.items()
    }


def _names(kind: type[Any]) -> list[str]:
    return [field.name for field in fields(kind) if field.metadata.get("option", True)]


def _is_own(kind: type[Any], name: str) -> bool:
    able = {field.name for field in fields(kind) if field.metadata.get("in_run")}
    return name in OWN_INPUTS and name not in able


def _run_stages() -> list[str]:
    from pipelines.run import STEPS

    return [module.replace("_", "-") for module in STEPS]


def make_settings(
    stage: str, config: Path | None, sets: Iterable[str], given: Mapping[str, Any]
) -> Any:
    """Return settings of a file, then --set, then the command's own options: the last one counts.

    Args:
        stage: the command's name. Its table of the file is used; the others are checked all the
            same, and `run` hands them to its stages.
        given: the command's own options, of those that were given.

    Raises:
        UsageError: C01, an unknown stage or option; C02, a value of the wrong kind or range; C04,
            no such file.
    """
    chosen: dict[str, dict[str, Any]] = {stage: {}}
    for where, name, options in (*_from_file(config), *map(_from_set, sets)):
        if name not in STAGES:
            message = f"'{name}' is no stage{did_you_mean(name, STAGES)}"
            raise UsageError("C01", message, where, "write STAGE.OPTION")
        if not isinstance(options, Mapping):
            message = f"'{name}' is a stage, not an option"
            raise UsageError("C01", message, where, f"write a table [{name}]")
        owner = stage_of(name).settings
        hints, known = typing.get_type_hints(owner), _names(owner)
        for key, value in options.items():
            place = f"{where}, {name}.{key}"
            if stage == "run" and name in _run_stages() and _is_own(owner, key):
                message = f"{name}.{key} has no place in a run, whose stages share logs and models"
                remedy = f"give it to rrrid {name}; run takes --identify, --validate, --reference"
                raise UsageError("C02", message, where, remedy)
            if key not in known:
                message = f"no such option{did_you_mean(key, known)}"
                raise UsageError("C01", message, place, f"there are: {', '.join(known) or 'none'}")
            chosen.setdefault(name, {})[key] = _converted(hints[key], value, place)
    own = chosen.pop(stage) | dict(given)
    if stage == "run":
        own["stages"] = {name: stage_of(name).settings(**values) for name, values in chosen.items()}
    return stage_of(stage).settings(**own)


def _from_file(path: Path | None) -> list[tuple[str, str, Any]]:
    """Return (where, stage, options) of each table of a TOML file."""
    if path is None:
        return []
    try:
        tables = parse_toml(read_small_text(path, what="a TOML file of settings"))
    except TomlError as problem:
        remedy = "settings are TOML; YAML is not read"
        raise UsageError("C03", f"not valid TOML: {problem}", path, remedy) from None
    return [(str(path), stage, options) for stage, options in tables.items()]


def _from_set(text: str) -> tuple[str, str, Any]:
    """Return (where, stage, options) of STAGE.OPTION=VALUE."""
    name, equals, value = text.partition("=")
    stage, dot, key = name.strip().partition(".")
    if not (equals and dot and key):
        message = f"'{text}' is not STAGE.OPTION=VALUE"
        raise UsageError("C01", message, "--set", "write convert.to=csv, say")
    try:
        parsed = parse_toml(f"x = {value}")["x"]
    except TomlError:
        parsed = value.strip()  # a bare word is a text
    return "--set", stage, {key: parsed}

"""The options that every command shares, written once and put behind each command's own."""

from __future__ import annotations

import copy
import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from pipelines.errors import UsageError
from rrrid_cli.conversion import plainly

__all__ = ["CauseCommand", "Common", "LogPaths", "Roles", "SomeLogs", "StageCommand", "StageGroup", "numbers", "whole_numbers",
           "with_common", "with_common_but"]

LogPaths = Annotated[list[Path], typer.Argument(help="Logs, or folders of logs.", show_default=False, metavar="LOGS",
                                                  readable=False)]  # rrrid says it better: exit 6, RRID-F13
SomeLogs = Annotated[list[Path] | None, typer.Argument(help="Logs, or folders of logs.", show_default=False, metavar="LOGS",
                                                       readable=False)]  # of commands that take --identify in their place


@dataclass(frozen=True)
class Roles:
    """Logs named for a role, instead of the logs' own roles."""

    identify: tuple[str, ...] = ()
    validate: tuple[str, ...] = ()
    reference: tuple[str, ...] = ()

    @property
    def named(self) -> dict[str, tuple[str, ...]]:
        """Role -> paths, of those that were given."""
        return {role: paths for role in ("identify", "validate", "reference") if (paths := getattr(self, role))}


@dataclass(frozen=True)
class Common:
    """Values of the shared options."""

    out: Path | None
    json: bool
    strict: bool
    check: bool
    robot: str | None
    assume_units: bool
    format: str | None
    config: Path | None
    set: list[str]
    no_report: bool
    force: bool
    quiet: bool
    verbose: bool
    debug: bool
    joints: tuple[int, ...] = ()
    session: str = ""


def _joints(text: str | None) -> tuple[int, ...]:
    """"1,3" as joints, counted from 1."""
    parts = text.split(",") if text is not None else []
    if not all(part.strip().isascii() and part.strip().isdigit() and len(part.strip()) < 5 for part in parts):
        raise UsageError("C02", f"'{text}' is no list of joints", where="--joints", remedy="write for example 1,3")
    return tuple(int(part) for part in parts)


def numbers(texts: list[str] | None, where: str) -> tuple[float, ...] | None:
    """"1,2,3", or an option given several times, as numbers; None where it was not given."""
    if not texts:
        return None
    try:
        return tuple(float(part) for text in texts for part in text.split(","))
    except ValueError:
        raise UsageError("C02", f"'{','.join(texts)}' is no list of numbers", where=where,
                         remedy="write for example 50,60,70") from None


def whole_numbers(texts: list[str] | None, where: str) -> tuple[int, ...] | None:
    """The same for whole numbers."""
    found = numbers(texts, where)
    if found is not None and any(not value.is_integer() or abs(value) > 1e9 for value in found):
        raise UsageError("C02", f"'{','.join(texts or ())}' is no list of whole numbers", where=where,
                         remedy="write for example 20,20,10")
    return None if found is None else tuple(map(int, found))


def _flag(words: str, *names: str) -> Any:
    return typer.Option(*names, help=words)


def _path(words: str, *names: str) -> Any:
    return typer.Option(*names, help=words, readable=False)


_ORDER = ("run", "batch", "demo", "inspect", "import", "convert", "design-excitation", "fit-friction", "reconstruct",
          "estimate-bps", "validate-writing", "frf", "simulate", "diagnose", "extend", "compare", "report", "schema", "doctor")


class StageGroup(typer.core.TyperGroup):
    """All commands together, with --help and --version, in the order in which they are needed."""

    def list_commands(self, ctx: Any) -> list[str]:
        return sorted(super().list_commands(ctx), key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))

    def get_params(self, ctx: Any) -> list[Any]:
        return plainly(super().get_params(ctx))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Every command with its whole sentence: it is wrapped, where the parser's own list would cut it."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [(name, " ".join((command.help or "").split("\n\n")[0].split())) for name, command in commands if command]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


class StageCommand(typer.core.TyperCommand):
    """A command whose help ends in what --set takes. The stage is imported for its own help alone."""

    def get_params(self, ctx: Any) -> list[Any]:
        return plainly(super().get_params(ctx))

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        from rrrid_cli.settings import known_options

        for stage, names in known_options(str(self.name)).items():
            formatter.write_paragraph()
            formatter.write_text(f"--set {stage}.OPTION=VALUE, options: {', '.join(names) or 'none'}.")


class CauseCommand(StageCommand):
    """A command that takes causes: its help ends in all of them, each with a few words."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        from pipelines.model.effects import all_effects

        super().format_epilog(ctx, formatter)
        for scope, title in (("joint", "Causes at one joint"), ("arm", "Causes of the whole arm")):
            with formatter.section(title):
                formatter.write_dl([(effect.name, effect.words.title) for effect in all_effects() if effect.scope == scope])


_OUT = "Folder for everything the command leaves"
_KEPT = "an earlier result of another command is kept"
_SHARED: tuple[tuple[str, Any, Any], ...] = (
    ("out", Annotated[Path | None, _path(f"{_OUT}; {_KEPT}. [runs/ROBOT/FOLDER/COMMAND]", "--out")], None),
    ("json", Annotated[bool, _flag("Print result.json on standard output, and nothing else there.", "--json")], False),
    ("strict", Annotated[bool, _flag("A repair of the data is an error (exit 3).", "--strict")], False),
    ("check", Annotated[bool, _flag("Exit 1 where a gate failed or something was found.", "--check")], False),
    ("robot", Annotated[str | None, _flag("Robot description to use instead of the logs' own.", "--robot")], None),
    ("assume_units", Annotated[bool, _flag("Take signals without units as SI.", "--assume-units")], False),
    ("format", Annotated[str | None, _flag("Container of the logs that are written: h5 or parquet. [h5]", "--format")], None),
    ("config", Annotated[Path | None, _path("TOML file of settings, one table a stage.", "--config")], None),
    ("set", Annotated[list[str], _flag("One setting: STAGE.OPTION=VALUE. Repeatable; the names are listed below.", "--set")], []),
    ("no_report", Annotated[bool, _flag("Leave report and figures out.", "--no-report")], False),
    ("force", Annotated[bool, _flag("Replace rrrid's own earlier output, files that were changed as well, and keep none.",
                                     "--force")], False),
    ("quiet", Annotated[bool, _flag("Print nothing but errors.", "-q", "--quiet")], False),
    ("verbose", Annotated[bool, _flag("Verbose progress.", "-v", "--verbose")], False),
    ("debug", Annotated[bool, _flag("Show the traceback of an internal error.", "--debug")], False),
)


# Of the commands that read logs.
_JOINTS = ("joints", Annotated[str | None, _flag("Joints to take of every log: 1,3. With --robot, where it is another arm.",
                                                  "--joints")], None)


# Of the commands that read logs by their roles.
_ROLES: tuple[tuple[str, Any, Any], ...] = tuple((role, Annotated[list[str], _flag(words, f"--{role}")], []) for role, words in (
    ("identify", "Identification logs, instead of the logs' own roles. Repeatable."), ("validate", "Validation logs. Repeatable."),
    ("reference", "Reference logs, of the arm as it was before. Repeatable.")))

# Of the commands that read logs, except `batch`, which takes all sessions.
_SESSION = ("session", Annotated[str, _flag("Of several robots or days take this: 'ROBOT', or "
                                            "'ROBOT 2026-05-18'. [several are refused]", "--session")], "")
_LOGS = {"logs", "replay", "prior_logs"}


def _but(kind: Any, **said: Any) -> Any:
    """An option of which help says other things."""
    typed, option = get_args(kind)
    other = copy.copy(option)
    vars(other).update(said)
    return Annotated[typed, other]


def with_common_but(*idle: str, out: str = "") -> Callable[[Callable[..., None]], Callable[..., None]]:
    """`with_common` of a command on which the options `idle` have no effect: they are taken, and its help is silent about them.

    Args:
        out: where its output goes by default, if not where that of others goes.
    """
    return lambda command: _with_common(command, idle, out)


def with_common(command: Callable[..., None]) -> Callable[..., None]:
    """`command(own options…, common)` as a command that takes the shared options as well; with `roles`, those too."""
    return _with_common(command, (), "")


def _with_common(command: Callable[..., None], idle: tuple[str, ...], out: str) -> Callable[..., None]:
    words: dict[str, dict[str, Any]] = {name: {"hidden": True} for name in idle}
    if out:
        words["out"] = {"help": f"{_OUT}. [{out}]"}
    own = inspect.signature(command, eval_str=True)
    by_role = _ROLES if "roles" in own.parameters else ()
    options = [*by_role, *_SHARED]
    if own.parameters.keys() & _LOGS:
        options.append(_SESSION)
    if own.parameters.keys() & {"logs", "root"}:
        options.append(_JOINTS)
    shared = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=_but(kind, **words.get(name, {})), default=default)
              for name, kind, default in options]
    kept = [p for p in own.parameters.values() if p.name not in ("common", "roles")]

    @functools.wraps(command)
    def run(**given: Any) -> None:
        said = {name: given.pop(name) for name, _, _ in options}
        if said["quiet"] and said["verbose"]:
            raise UsageError("C02", "-q and -v ask for opposite things", where="-q, -v", remedy="give one of them")
        if by_role:
            given["roles"] = Roles(**{role: tuple(said.pop(role) or ()) for role, _, _ in by_role})
        command(**given, common=Common(**(said | {"joints": _joints(said.get("joints"))})))

    parameters = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in kept] + shared
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run

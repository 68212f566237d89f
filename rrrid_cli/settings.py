"""Make a stage's settings of its defaults, a configuration file, --set, and the command's own options, in this order."""

from __future__ import annotations

import dataclasses
import sys
import types
import typing
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from pipelines.errors import UsageError, clean, did_you_mean
from pipelines.io.text import read_small_text
from pipelines.io.toml_text import TomlError, parse_toml

__all__ = ["known_options", "make_settings", "stage_of"]

S = TypeVar("S")

# What a stage's own reader needs; within `run` a stage gets its logs and models from the run.
_KINDS: dict[Any, str] = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}
_READ = ("identify", "validate", "reference", "model", "text", "via_points", "recipe")


def make_settings(kind: type[S], stage: str, stages: Iterable[str], config: Path | None, sets: Iterable[str],
                  given: Mapping[str, Any], fallback: Mapping[str, Any] | None = None) -> S:
    """`kind` filled in; the last word has what was given on the command line.

    Args:
        stage: the command's name. Its table of the configuration is used; the others are checked all the same, and
            `run` hands them to its stages.
        stages: every known name, for a hint where one is misspelt.
        given: the command's own options; None means: not given. Of `run` also "STAGE.OPTION".
        fallback: what holds where nothing else was said; None means: nothing.

    Raises:
        UsageError: C01, an unknown stage or option; C02, a value of the wrong kind or range; C04, no such file.
    """
    chosen: dict[str, dict[str, Any]] = {}
    for where, table in (*_from_file(config), *_from_sets(sets)):
        for name, options in table.items():
            if name not in stages:
                raise UsageError("C01", f"'{name}' is no stage{did_you_mean(name, stages)}", where=where,
                                 remedy="write STAGE.OPTION")
            if not isinstance(options, Mapping):
                raise UsageError("C01", f"'{name}' is a stage, not an option", where=where,
                                 remedy=f"write [{name}] and its options below")
            if stage == "run" and name in _run_stages() and (read := next(filter(_of_reader(name).__contains__, options), None)):
                raise UsageError("C02", f"{name}.{read} has no place in a run, whose stages take logs and models from each other",
                                 where=where, remedy=f"give it to rrrid {name}; 'rrrid run' takes --identify, --validate, "
                                 "--reference for all")
            owner = kind if name == stage else _settings_of(name)
            chosen.setdefault(name, {}).update(
                {key: _value(owner, key, value, f"{where}, {name}.{key}") for key, value in options.items()})
    own = _said(fallback or {}) | chosen.pop(stage, {})
    for name, value in _said(given).items():
        if type(value) is int and not _as_kind(int, value)[0]:
            raise UsageError("C02", "more digits than a whole number has here", where=f"--{name.replace('_', '-')}",
                             remedy="correct the value")
        of, dot, option = name.rpartition(".")
        (chosen.setdefault(of, {}) if dot else own)[option] = value
    if stage == "run":
        own["stages"] = {name: _settings_of(name)(**options) for name, options in chosen.items()}
    return kind(**own)


def known_options(command: str) -> dict[str, list[str]]:
    """What --set takes for `command`: stage -> its options. For `run` those of every stage it runs."""
    if command != "run":
        return {command: _options_of(_settings_of(command))}
    return {stage: [name for name in _options_of(_settings_of(stage)) if name not in _of_reader(stage)] for stage in _run_stages()}


def _of_reader(stage: str) -> tuple[str, ...]:
    """Its options that have no place in a run."""
    able = {field.name for field in dataclasses.fields(_settings_of(stage)) if field.metadata.get("in_run")}
    return tuple(name for name in _READ if name not in able)


def _run_stages() -> list[str]:
    from pipelines.run import STEPS

    return [module.replace("_", "-") for module in STEPS]


def _options_of(kind: type[Any]) -> list[str]:
    return [field.name for field in dataclasses.fields(kind) if field.metadata.get("option", True)]


def _said(options: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in options.items() if value is not None}


def _settings_of(stage: str) -> type[Any]:
    """The settings of a stage by its command's name."""
    kind: type[Any] = stage_of(stage).settings
    return kind


def stage_of(command: str) -> Any:
    """The stage of a command."""
    module = "import_log" if command == "import" else command.replace("-", "_")  # `import` is a word of the language
    return import_module(f"pipelines.{module}").STAGE


def _from_file(path: Path | None) -> list[tuple[str, dict[str, Any]]]:
    if path is None:
        return []
    text = read_small_text(path, what="a TOML file of settings")
    try:
        return [(str(path), parse_toml(text))]
    except TomlError as problem:
        raise UsageError("C03", f"not valid TOML: {problem}", where=path, remedy="settings are TOML; YAML is not read") from None


def _from_sets(sets: Iterable[str]) -> list[tuple[str, dict[str, Any]]]:
    found = []
    for text in sets:
        name, equals, value = text.partition("=")
        stage, dot, option = name.strip().partition(".")
        if not (equals and dot and option):
            raise UsageError("C01", f"'{text}' is not STAGE.OPTION=VALUE", where="--set", remedy="write for example convert.to=csv")
        try:
            parsed: Any = parse_toml(f"x = {value}")["x"]
        except TomlError:
            parsed = value.strip()  # a bare word is a text
        found.append(("--set", {stage: {option: parsed}}))
    return found


def _value(kind: type[Any], name: str, value: Any, where: str) -> Any:
    hints = typing.get_type_hints(kind)
    known = _options_of(kind)
    if name not in known:
        raise UsageError("C01", f"no such option{did_you_mean(name, known)}", where=where,
                         remedy=f"there are: {', '.join(known) or 'none'}")
    wanted = hints[name]
    options = typing.get_args(wanted) if typing.get_origin(wanted) in (typing.Union, types.UnionType) else (wanted,)
    for option in options:
        fits, converted = _as_kind(option, value)
        if fits:
            return converted
    listed = typing.get_origin(options[0]) is tuple
    what = "a list" if listed else _KINDS.get(options[0], f"a {getattr(options[0], '__name__', options[0])}")
    raise UsageError("C02", f"{clean(repr(value), 60)} is not {what}", where=where, remedy="correct the value")


def _as_kind(kind: Any, value: Any) -> tuple[bool, Any]:
    if kind is bool or isinstance(value, bool):
        return kind is bool and isinstance(value, bool), value
    if kind is float:
        # Integers have no bound in TOML, floats do.
        fits = isinstance(value, int | float) and -sys.float_info.max <= value <= sys.float_info.max
        return fits, float(value) if fits else value
    if kind is int:
        return isinstance(value, int) and abs(value) < 1 << 63, value
    if kind is str:
        return isinstance(value, str), value
    if kind is Path:
        return isinstance(value, str), Path(str(value))
    if typing.get_origin(kind) is tuple and isinstance(value, str):
        value = [value]  # one stands for a list of one, as it does on the command line
    if typing.get_origin(kind) is tuple and isinstance(value, list):
        inner = [_as_kind(typing.get_args(kind)[0], item) for item in value]
        return all(fits for fits, _ in inner), tuple(item for _, item in inner)
    return kind is type(None) and value is None, value

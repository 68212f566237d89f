"""Say what is wrong with a command line as every other error is said: one line with a code, a place and a remedy."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import typer

from pipelines.errors import RrridError, UsageError, did_you_mean

__all__ = ["WrongUsage", "as_error", "as_given"]

# typer has carried its own copy of click since 0.26: the class is asked of typer, whichever copy that uses.
WrongUsage: Final[Any] = typer.BadParameter.__mro__[1]


def as_error(problem: Any, called: str = "rrrid") -> UsageError:
    """The parser's complaint in rrrid's words.

    Args:
        problem: a `WrongUsage`.
        called: the command that was called: of an option without its argument the parser does not say whose it is.
    """
    context = problem.ctx
    command = context.command_path if context is not None else called
    remedy = f"see '{command} --help'"
    option = getattr(problem, "option_name", None)
    if type(problem).__name__ == "NoSuchOption":
        known = [name for parameter in context.command.get_params(context) for name in parameter.opts] if context else []
        return UsageError("C01", f"no such option '{option}'{did_you_mean(str(option), known)}", where=command, remedy=remedy)
    commands = getattr(context.command, "commands", {}) if context is not None else {}
    words = problem.format_message().splitlines()[0].rstrip(".")
    if words.startswith("No such command"):
        word = words.split("'")[1]
        return UsageError("C01", f"no such command '{word}'{did_you_mean(word, commands)}", where=command, remedy=remedy)
    return UsageError("C02", f"{words[:1].lower()}{words[1:]}", where=command, remedy=remedy)


def as_given(problem: RrridError, words: Iterable[str]) -> RrridError:
    """`problem` with every path that one of the `words` of the command line gave relative written as it was given there.

    Stages work with absolute paths, so that no other working folder changes what they mean.
    """
    from pipelines.io.places import renamed

    try:
        os.getcwd()
    except FileNotFoundError:  # relative paths mean nothing
        return problem
    names: dict[str, str] = {}
    for text in (part for word in words for part in (word, word.partition("=")[2]) if part and not part.startswith("-")):
        path = Path(text)
        for one in () if path.is_absolute() else (path, *path.parents):
            if one == path or one != Path():
                names.setdefault(str(one.absolute()), str(one))
                names.setdefault(os.path.abspath(one), str(one))
    for each in (problem, *problem.others):
        each.where, each.message, each.remedy = (renamed(text, names) for text in (each.where, each.message, each.remedy))
    return problem

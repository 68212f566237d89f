"""Take texts, paths and numbers as the command line gives them, without a schema.

typer makes a pydantic schema of every option, given or not, and loads pydantic for it: 75 ms of CPU, more than numpy. A text
is a text without one, a path that nobody asks to exist is a path, and Python reads numbers: what is none is refused here, for
typer has pydantic's words for it. Whatever else was given still goes typer's way.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from pipelines.errors import UsageError

__all__ = ["plainly"]

_PLAIN: dict[Any, Any] = {str: str, list[str]: str, Path: Path, list[Path]: Path, int: int, float: float}
_NAMES: dict[Any, str] = {str: "TEXT", list[str]: "TEXT", Path: "PATH", list[Path]: "PATH", int: "NUMBER", float: "NUMBER"}
_NUMBERS: dict[Any, tuple[str, str]] = {int: ("whole number", "4"), float: ("number", "0.5")}


class _Plainly:
    """What typer asks to convert one option's value: in place of `get_runtime_param`, and of what that returns."""

    def __init__(self, kind: Any, typers_own: Any) -> None:
        self.plain, self.typers_own = _PLAIN.get(kind), typers_own

    def __call__(self) -> _Plainly:
        return self

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """`value`, which is None where the option was not given, as the type that the command wants.

        Raises:
            UsageError: C02, it is no number where the option takes one.
        """
        many = param.multiple or param.nargs == -1
        if value is None:
            return () if many else None
        if self.plain is not None:
            with contextlib.suppress(ValueError):
                return [self.plain(item) for item in value] if many else self.plain(value)
        if self.plain in _NUMBERS:
            kind, example = _NUMBERS[self.plain]
            raise UsageError("C02", f"'{value}' is no {kind}", where=param.opts[0], remedy=f"give a {kind}, such as {example}")
        return self.typers_own().coerce(value, param=param, ctx=ctx)


def plainly(parameters: list[Any]) -> list[Any]:
    """`parameters`, each of which converts by itself what needs no schema; with a typer that makes none, nothing changes there.

    In help an option's value has a plain name, where typer would print Python's type.
    """
    for parameter in parameters:
        described, typers_own = (getattr(parameter, name, None) for name in ("type_descriptor", "get_runtime_param"))
        if described is not None and typers_own is not None and not isinstance(typers_own, _Plainly):
            parameter.get_runtime_param = _Plainly(described.annotation, typers_own)
        if described is not None and parameter.metavar is None and parameter.param_type_name == "option":
            parameter.metavar = _NAMES.get(described.annotation)
    return parameters

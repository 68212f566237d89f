"""What an attribute of a log may be: a text, one of several words, a number within its bounds, a list of numbers.

    value = kind(found)      the value in its own type, or `WrongKind` with the words of what it should be
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from datetime import datetime
from typing import Any

import numpy as np

from pipelines.io.experiment import Array

__all__ = ["Kind", "WrongKind", "among", "instant", "integer", "json_words", "limits", "printable", "reals", "seconds", "text",
           "texts", "words"]

Kind = Callable[[object], Any]

# JSON carries no infinite number: `canonical` writes them as these texts.
_SPECIAL = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}
_INSTANT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|\+00:00)")
_SHORTEST, _LONGEST = 1e-12, 1e12  # [s]; beyond them a rate or a number of samples is no longer a number


class WrongKind(ValueError):
    """The value is not what the message names."""


def printable(value: str) -> bool:
    """Return whether both containers can carry `value`: UTF-8 has no lone surrogates, and a C text ends at its first NUL."""
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return "\0" not in value


def text(value: object) -> str:
    if not isinstance(value, str):
        raise WrongKind("a text")
    if not printable(value):
        raise WrongKind("a text in UTF-8 without NUL")
    return value


def words(value: object) -> str:
    if not text(value).strip():
        raise WrongKind("a text that is not empty")
    return str(value)


def json_words(value: object) -> str:
    try:
        json.loads(text(value))
    except (ValueError, RecursionError):
        raise WrongKind("a JSON text") from None
    return str(value)


def instant(value: object) -> str:
    """A moment that exists: no 99th month."""
    found = text(value)
    try:
        if _INSTANT.fullmatch(found):
            datetime.fromisoformat(found)
            return found
    except ValueError:
        pass
    raise WrongKind("ISO 8601 in UTC, like 2004-05-17T09:30:00Z")


def among(*choices: str | int) -> Kind:
    def kind(value: object) -> str | int:
        for choice in choices:
            if not isinstance(value, bool) and value == choice:
                return choice  # 1.0 is 1: programs that know only doubles (MATLAB) write that
        raise WrongKind(f"one of {', '.join(map(str, choices))}")

    return kind


def integer(value: object) -> int:
    # Programs that know only doubles (MATLAB) write 2.0 where 2 is meant.
    if isinstance(value, bool) or not isinstance(value, int | float) or not -1e15 < value < 1e15 or value != int(value):
        raise WrongKind("an integer")
    return int(value)


def _real(value: object) -> float:
    if isinstance(value, str) and value in _SPECIAL:
        return _SPECIAL[value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise WrongKind("a real number")
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        raise WrongKind("a real number that a float can hold") from None


def seconds(value: object) -> float:
    number = _real(value)
    if not _SHORTEST <= number <= _LONGEST:
        raise WrongKind(f"a positive number of seconds, {_SHORTEST:g} to {_LONGEST:g}")
    return number


def _list(value: object) -> Array:
    if not isinstance(value, list):
        raise WrongKind("a list of real numbers")
    rows = [[_real(x) for x in row] if isinstance(row, list) else _real(row) for row in value]
    if len({len(row) if isinstance(row, list) else -1 for row in rows}) > 1:
        raise WrongKind("a list of real numbers, its rows of one length")
    return np.array(rows, dtype=np.float64)


def reals(value: object) -> Array:
    array = _list(value)
    if not np.isfinite(array).all():
        raise WrongKind("a list of finite numbers")
    return array


def limits(value: object) -> Array:
    """Positive numbers; infinite where there is no limit."""
    array = _list(value)
    if not (array > 0.0).all():
        raise WrongKind("a list of limits above 0")
    return array


def texts(*choices: str) -> Kind:
    one = among(*choices)

    def kind(value: object) -> tuple[str, ...]:
        if not isinstance(value, list | tuple):
            raise WrongKind("a list of texts")
        return tuple(one(item) for item in value)

    return kind

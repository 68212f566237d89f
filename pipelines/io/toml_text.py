"""Parse TOML text within bounds: every description, recipe, configuration and model is parsed here.

A TOML parser may need time and memory far beyond the length of its text: a key of 50,000 dotted
parts takes gigabytes. The bounds are checked by one pass over the text, before it is parsed.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from typing import Any, Final

__all__ = ["TomlBounds", "TomlError", "parse_toml"]


class TomlError(ValueError):
    """The text is not TOML, or exceeds the bounds."""


@dataclass(frozen=True)
class TomlBounds:
    """Bounds of a TOML text. Descriptions and recipes stay a factor of ten below them."""

    characters: int = 4 << 20  # a description with the embedded URDF of a thousand links has 0.4 MB
    lines: int = 20_000  # outside multi-line texts; 5,000 files of a recipe
    parts: int = 6  # names in a dotted key; a configuration has two
    key: int = 1000  # characters from one delimiter to the next: a key, or a bare value
    depth: int = 32  # arrays and inline tables in each other
    values: int = 200_000  # separated by commas or brackets; a transmission of 100 joints has 10,000


# An unterminated string reaches to the end of its line or of the text, so that one pass is enough.
_STRING_OR_COMMENT: Final = re.compile(
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:"""|\Z)'
    r"|'''(?:[^']++|'(?!''))*+(?:'''|\Z)"
    r'|"(?:[^"\\\n]++|\\[^\n])*+"?'
    r"|'[^'\n]*+'?"
    r"|\#[^\n]*+", re.DOTALL)
_DELIMITER: Final = re.compile(r"[=\n,{}\[\]]")
_LEVEL: Final = {"[": 1, "{": 1, "]": -1, "}": -1}


def parse_toml(text: str, bounds: TomlBounds = TomlBounds()) -> dict[str, Any]:
    """Return the table that `text` holds.

    Raises:
        TomlError: it is not TOML, or longer, wider or deeper than `bounds`.
    """
    _check_bounds(text, bounds)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as problem:
        raise TomlError(str(problem)) from None


def _check_bounds(text: str, bounds: TomlBounds) -> None:
    if len(text) > bounds.characters:
        raise TomlError(f"longer than {bounds.characters} characters")
    bare = _STRING_OR_COMMENT.sub(_shortened, text.replace("\r\n", "\n"))
    if bare.count("\n") > bounds.lines:
        raise TomlError(f"more than {bounds.lines} lines")
    pieces = _DELIMITER.split(bare)
    if len(pieces) > bounds.values:
        raise TomlError(f"more than {bounds.values} values")
    for piece in pieces:
        if len(piece) > bounds.key:
            raise TomlError(f"a key or a value of more than {bounds.key} characters, '{piece[:30]}…'")
        if piece.count(".") >= bounds.parts:
            raise TomlError(f"a key of more than {bounds.parts} parts, '{piece.strip()[:30]}…'")
    depth = 0
    for bracket in re.findall(r"[\[\]{}]", bare):
        depth += _LEVEL[bracket]
        if depth > bounds.depth:
            raise TomlError(f"arrays or tables nested more than {bounds.depth} deep")


def _shortened(found: re.Match[str]) -> str:
    """Return a placeholder for a string or a comment, without any character of structure."""
    return "" if found[0].startswith("#") else '""'

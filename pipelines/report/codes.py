"""Name every code in a few words, those of codes.toml; a code never changes its meaning."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Final

from pipelines.errors import Check, Level
from pipelines.io.sandbox import parse_toml, read_small_text

__all__ = ["codes", "first_to_read", "title_of"]

_WORST_FIRST: Final[tuple[Level, ...]] = ("reject", "repair", "warn", "ok")


@cache
def codes() -> dict[str, str]:
    """Return the words of every code."""
    return parse_toml(read_small_text(Path(__file__).with_name("codes.toml")))


def first_to_read(check: Check) -> tuple[bool, bool, int, int]:
    """Return what findings are sorted by, the first to read first.

    Columns in the wrong place, unit or time explain what else is found; what is said of a
    container spoils no fit.
    """
    code = check.code.removeprefix("RRID-")
    rank = 0 if code.startswith("S") or code == "T06" else 1 if code[:1] in ("T", "D") else 2
    return check.level != "reject", not check.gate, rank, _WORST_FIRST.index(check.level)


def title_of(code: str) -> str:
    """Return a few words for a code, with or without its prefix; "" for an unknown one."""
    return codes().get(code.removeprefix("RRID-"), "")

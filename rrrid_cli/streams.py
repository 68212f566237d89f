"""Make standard input, output and error usable, whatever the shell gave: closed, or in an encoding without our signs."""

from __future__ import annotations

import codecs
import os
import sys
import unicodedata
from typing import Final

__all__ = ["prepare_streams"]

_PLAIN: Final = {"→": "->", "…": "...", "·": "-", "−": "-", "×": "x", "≤": "<=", "≥": ">=", "±": "+-", "∞": "inf",
                 "τ": "tau", "Φ": "Phi", "“": '"', "”": '"', "’": "'"}


def prepare_streams(as_json: bool) -> None:
    """Open a closed standard stream on nothing, and let no character fail.

    A character that the encoding lacks becomes \\uXXXX in JSON, which means the same, and elsewhere what
    looks like it.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(_nowhere(number), "r" if number == 0 else "w", encoding="utf-8"))  # noqa: SIM115
    codecs.register_error("rrrid-json", _as_json)
    codecs.register_error("rrrid-ascii", _as_ascii)
    for stream, errors in ((sys.stdout, "rrrid-json" if as_json else "rrrid-ascii"), (sys.stderr, "rrrid-ascii")):
        if (change := getattr(stream, "reconfigure", None)) is not None:
            change(errors=errors)


def _nowhere(number: int) -> int:
    """Return a handle of the null device, with that number where it is free: a later file must not take it."""
    handle = os.open(os.devnull, os.O_RDWR)
    if handle != number:
        try:
            os.fstat(number)
        except OSError:
            os.dup2(handle, number)
            os.close(handle)
            return number
    return handle


def _lacking(problem: UnicodeError) -> tuple[str, int]:
    if not isinstance(problem, UnicodeEncodeError):
        raise problem
    return problem.object[problem.start:problem.end], problem.end


def _as_json(problem: UnicodeError) -> tuple[str, int]:
    text, end = _lacking(problem)
    units = text.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[k:k + 4]}" for k in range(0, len(units), 4)), end


def _as_ascii(problem: UnicodeError) -> tuple[str, int]:
    text, end = _lacking(problem)
    return "".join(_PLAIN.get(sign) or unicodedata.normalize("NFKD", sign).encode("ascii", "ignore").decode() or "?"
                   for sign in text), end

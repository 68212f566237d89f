"""Say what is wrong, where, and what to do about it: one family of errors with stable codes.

Every error a user can meet is one of four kinds, and the kind decides the exit code (cli-contract):
wrong usage (2), rejected input (3), nothing matched (5), environment (6). The code names the row of
the table of bad inputs, so that a message can be searched for and a test can ask for exactly it.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

__all__ = [
    "Check",
    "EnvironmentFault",
    "Gathering",
    "InputRejected",
    "Interrupted",
    "Level",
    "NothingMatched",
    "RrridError",
    "UsageError",
    "clean",
    "did_you_mean",
    "escaped",
]

Level = Literal["ok", "warn", "repair", "reject"]

# C0 and C1 control characters, tab and newline apart: a terminal obeys them, so no text of a log
# may carry them out.
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")


def clean(text: object, limit: int | None = 400) -> str:
    """Return `text` in a printable line without control characters.

    Args:
        limit: characters at most; None: all of it.
    """
    line = " ".join(_CONTROL.sub("", str(text).encode("utf-8", "replace").decode("utf-8")).split())
    if limit is None or len(line) <= limit:
        return line
    # no word is cut, but one that is half of the text
    words, _, last = line[: limit - 1].rpartition(" ")
    return f"{words} …" if len(last) < limit // 2 else f"{line[: limit - 1]}…"


def escaped(path: object) -> str:
    """`path` as one printable line that still names it: control characters as \\x1b."""
    text = str(path).encode("utf-8", "backslashreplace").decode("utf-8")
    signs = rf"{_CONTROL.pattern}|[\t\n]"
    return re.sub(signs, lambda found: found[0].encode("unicode_escape").decode(), text)


def did_you_mean(word: str, known: Iterable[str], most: int = 1, near_by: float = 0.6) -> str:
    """Return a hint such as ", did you mean 'torque'?", empty where nothing known is near.

    Args:
        near_by: ratio of Ratcliff and Obershelp from which a name is near; 1: the same word.
    """
    # what every option begins with makes no two of them alike
    bare = {name.lstrip("-"): name for name in known}
    found = difflib.get_close_matches(word.lstrip("-"), list(bare), n=most, cutoff=near_by)
    if not found:
        return ""
    *others, last = (f"'{bare[name]}'" for name in found)
    return f", did you mean {', '.join(others)}{' or ' if others else ''}{last}?"


class RrridError(Exception):
    """An error with a stable code, a place and a remedy.

    Args:
        code: row of the table of bad inputs, without the prefix: "F01".
        message: what is wrong, one sentence without a full stop.
        where: file, dataset, sample or option the message is about; may be empty.
        remedy: what to do; may be empty.
    """

    exit_code = 70

    def __init__(self, code: str, message: str, where: object = "", remedy: str = "") -> None:
        self.code = f"RRID-{code}"
        self.message = clean(message)
        self.where = clean(where)
        self.remedy = clean(remedy)
        # of the same work, found in parts that do not depend on this one
        self.others: tuple[RrridError, ...] = ()
        super().__init__(str(self))

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        remedy = f" {_sentence(_capital(self.remedy))}" if self.remedy else ""
        return f"{self.code} {place}{_sentence(self.message)}{remedy}"

    def __reduce__(self) -> tuple[object, ...]:
        return (_rebuild, (type(self), self.code, self.message, self.where, self.remedy))

    def as_dict(self) -> dict[str, Any]:
        return {
            "code": self.code,
            "where": self.where,
            "message": self.message,
            "remedy": self.remedy,
        }


def _sentence(text: str) -> str:
    """`text` with one mark at its end: its own question mark, else a full stop."""
    return text if text.endswith("?") else f"{text.rstrip('.')}."


def _capital(text: str) -> str:
    """`text` with a capital, unless its first word is a name, an option or a value: h5, --out."""
    first = text.split()[0].rstrip(",.:;")
    if first == "rrrid" or not (first.isalpha() and first.islower()):
        return text
    return text[0].upper() + text[1:]


def _rebuild(
    kind: type[RrridError], code: str, message: str, where: str, remedy: str
) -> RrridError:
    return kind(code.removeprefix("RRID-"), message, where=where, remedy=remedy)


@dataclass(frozen=True)
class Check:
    """One named check of an input and what it found, in the words of an error; the work goes on.

    "warn" continues, "repair" continues on repaired data (an error under --strict),
    "reject" is what the same input costs when a stage other than `inspect` meets it. `gate` marks
    what --check answers with exit 1.
    """

    code: str  # with prefix: "RRID-T05"
    level: Level
    message: str
    where: str = ""
    remedy: str = ""
    gate: bool = False

    @staticmethod
    def of(
        code: str,
        level: Level,
        message: str,
        where: object = "",
        remedy: str = "",
        *,
        gate: bool = False,
    ) -> Check:
        """Return a check of a bare row name ("T05"), its texts made printable."""
        return Check(f"RRID-{code}", level, clean(message), clean(where), clean(remedy), gate)

    def as_dict(self) -> dict[str, object]:
        return {
            "code": self.code,
            "level": self.level,
            "where": self.where,
            "message": self.message,
            "remedy": self.remedy,
            "gate": self.gate,
        }

    def as_error(self) -> InputRejected:
        return InputRejected(
            self.code.removeprefix("RRID-"), self.message, where=self.where, remedy=self.remedy
        )


class UsageError(RrridError):
    """The command line or a configuration is wrong."""

    exit_code = 2


class InputRejected(RrridError):
    """A log, a recording or a model cannot be used as it is."""

    exit_code = 3


class NothingMatched(RrridError):
    """No input fits what the command reads."""

    exit_code = 5


class EnvironmentFault(RrridError):
    """A fault of the machine: disk full, no permission, a lock."""

    exit_code = 6


class Gathering:
    """Collect the errors of independent parts, and raise the first with the others."""

    def __init__(self) -> None:
        self.found: list[RrridError] = []

    @contextmanager
    def part(self) -> Iterator[None]:
        """Keep an error of usage or input instead of raising it; any other ends the work."""
        try:
            yield
        except (UsageError, InputRejected) as problem:
            self.found += [problem, *problem.others]
            problem.others = ()

    def raise_all(self) -> None:
        """Raise the errors, each text once."""
        if self.found:
            first, *others = {str(problem): problem for problem in self.found}.values()
            first.others = tuple(others)
            raise first


class Interrupted(KeyboardInterrupt):
    """A signal ended the work; nothing half written is left.

    Not of the family above: who catches an RrridError, to note what is wrong with one file and go
    on, must not catch the user's wish to stop.
    """

    def __init__(self, signal_number: int) -> None:
        super().__init__(signal_number)
        self.exit_code = 128 + signal_number

    def as_error(self) -> RrridError:
        """Return the same in the words of every other error."""
        told = RrridError(
            "P06", "interrupted", remedy="run the same command again; nothing was half written"
        )
        told.exit_code = self.exit_code
        return told

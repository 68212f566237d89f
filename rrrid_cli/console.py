"""What the user sees on the terminal: one line of progress, then a verdict, then where everything lies.

Results go to standard output, everything else to standard error, so that `--json` can be piped.
"""

from __future__ import annotations

import re
import sys
import textwrap
import threading
import time
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from pipelines.errors import Check, RrridError, clean, escaped

if TYPE_CHECKING:
    from pipelines.report.report import Report, Table
    from pipelines.stage import Outcome

__all__ = ["Teller", "say_checks", "say_error", "say_error_object", "say_outcome", "say_table", "say_verdict"]

_SIGNS = {"ok": "·", "warn": "!", "repair": "~", "reject": "x"}
_MOST = 12  # remarks
_SILENT = 20.0  # [s] without a line in a pipe
_LONG = 5.0  # [s] on one step, before a terminal is told how long
_TICK = 1.0  # [s]
_OTHERS = 12  # errors beside the first
_LOGS = 30  # named for one remark
_NUMBERS = re.compile(r"(?<![A-Za-z_])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![A-Za-z_])")  # values; p3 and q_1 are names
_HEADS = (12, 8, 6)  # characters: a heading is broken into lines no shorter than that; shorter ones where the table is too wide
_WIDE = 80  # characters of the narrowest terminal that tables are made for


class Teller:
    """Progress: one line that is written over on a terminal, every step with -v, else a line now and then, that whoever reads a
    pipe or the output of CI knows that something is done. A step that takes long is told again, with its seconds. With -q nothing.
    """

    def __init__(self, quiet: bool, verbose: bool) -> None:
        self.live = sys.stderr.isatty() and not quiet and not verbose
        self.verbose, self.quiet = verbose, quiet
        self.width = 0
        self.last = self.begun = time.monotonic()
        self.words = ""
        self._over = threading.Event()
        self._clock: threading.Thread | None = None

    def __call__(self, words: str) -> None:
        self.words, self.begun = clean(words, 100), time.monotonic()
        if self.live:
            self._over_write(self.words)
        elif self.verbose or (not self.quiet and self.begun - self.last > _SILENT):
            self._say(self.words)
        if self._clock is None and not self.quiet:
            self._over.clear()
            self._clock = threading.Thread(target=self._remind, daemon=True)
            self._clock.start()

    def still(self) -> None:
        """The step that is being done once more, where nothing was said for long."""
        now = time.monotonic()
        line = f"{self.words}, {now - self.begun:.0f} s"
        if self.live and now - self.begun >= _LONG:
            self._over_write(line)
        elif not self.live and now - self.last > _SILENT:
            self._say(line)

    def done(self) -> None:
        self._over.set()
        if self._clock is not None:
            self._clock.join()
            self._clock = None
        if self.live and self.width:
            _write("\r" + " " * self.width + "\r")
            self.width = 0

    def _remind(self) -> None:
        while not self._over.wait(_TICK):
            self.still()

    def _over_write(self, line: str) -> None:
        _write("\r" + line.ljust(self.width))
        self.width = len(line)

    def _say(self, line: str) -> None:
        _write(f"{line}\n")
        self.last = time.monotonic()


def _write(text: str) -> None:
    """In one piece: two threads tell of the progress."""
    sys.stderr.write(text)
    sys.stderr.flush()


def say_outcome(outcome: Outcome[Any], *, as_json: bool, quiet: bool, verbose: bool) -> None:
    """The verdict, the key figures, what is not in order, and the folder; where `as_json` leaves room."""
    if as_json:
        from pipelines.io.results import json_text

        sys.stdout.write(json_text(outcome.json))
    if quiet:
        return
    stream = sys.stderr if as_json else sys.stdout
    say_verdict(outcome.report, stream)
    if outcome.report.key_figures is not None:
        _say_table(outcome.report.key_figures, stream)
    for line in outcome.report.basis:
        print(f"  {clean(line, 400)}", file=stream)
    say_checks(outcome.checks, verbose, stream)
    report = outcome.folder / "report.html"
    print(f"→ {escaped(report if report.exists() else outcome.folder)}", file=stream)


def say_verdict(report: Report, stream: Any = None) -> None:
    """The sentence, and what to look at on the machine; on standard output where nothing else is said."""
    for line in (report.verdict, *report.advice):
        print(clean(line, None), file=stream)


def _say_table(table: Table, stream: Any) -> None:
    """The rows of a table; its head as well, where a row is more than a name and a figure."""
    from pipelines.report.report import column_texts, filled
    from pipelines.report.style import format_number, format_unit

    table = filled(table)
    if len(table.columns) <= 2:  # a figure is not like the one below it
        say_table((), [[clean(c, 60) if isinstance(c, str) else format_number(c) for c in row] for row in table.rows], stream)
    elif table.rows:
        columns = [column_texts(cells, lambda text: clean(text, 60)) for cells in zip(*table.rows, strict=True)]
        parts = (name.rpartition("[") for name in table.columns)
        head = [f"{name}{bracket}{format_unit(unit) if bracket else unit}" for name, bracket, unit in parts]
        say_table(head, list(zip(*columns, strict=True)), stream)


def say_table(head: Sequence[str], rows: Sequence[Sequence[str]], stream: Any = None) -> None:
    """Words in columns, numbers to the right where there is a head; on standard output where nothing else is said."""
    from pipelines.report.report import are_numbers

    columns = [[clean(cell, 200) for cell in column] for column in zip(*rows, strict=True)]
    heads, widths = _laid_out(head if rows else (), [max(map(len, column)) for column in columns])
    right = [bool(head) and are_numbers(column) for column in columns]
    deep = max(map(len, heads), default=0)
    above = [[""] * (deep - len(lines)) + lines for lines in heads]
    for row in (*zip(*above, strict=True), *zip(*columns, strict=True)):
        cells = (cell.rjust(width) if number else cell.ljust(width) for cell, width, number in zip(row, widths, right, strict=True))
        print("  " + "  ".join(cells).rstrip(), file=stream)


def _laid_out(head: Sequence[str], cells: Sequence[int]) -> tuple[list[list[str]], list[int]]:
    """The headings in lines, and the widths of the columns whose cells need `cells`: no wider together than a terminal where
    breaking headings brings that about, else as they read best."""
    tried = []
    for least in _HEADS if head else ():
        heads = [_heading(words, max(width, least), least < _HEADS[0]) for words, width in zip(head, cells, strict=True)]
        tried.append((heads, [max(width, *map(len, lines)) for width, lines in zip(cells, heads, strict=True)]))
    fitting = (one for one in tried if sum(one[1]) + 2 * len(cells) <= _WIDE)
    return next(fitting, tried[0] if tried else ([], list(cells)))


def _heading(words: str, width: int, tight: bool) -> list[str]:
    """A heading in lines, its unit in one of them; where it is `tight`, the unit is broken as well."""
    if len(words) <= width:
        return [words]
    name, bracket, unit = words.partition("[")
    units = textwrap.wrap(bracket + unit, width, break_long_words=False) if tight else [bracket + unit] * bool(bracket)
    return [*textwrap.wrap(name, width, break_long_words=False), *units]


def say_checks(checks: Iterable[Check], verbose: bool = False, stream: Any = None) -> None:
    """What was found, what explains the most first; what differs in numbers alone, of several joints or logs, once.

    Before all of it where an earlier result lies now: no report has that.
    """
    from pipelines.io.codes import first_to_read

    alike: dict[tuple[str, str], list[Check]] = {}
    for check in sorted(dict.fromkeys(checks), key=lambda check: (check.code != "RRID-C05", *first_to_read(check))):
        if verbose or check.level != "ok":
            alike.setdefault((check.code, _NUMBERS.sub("#", check.message)), []).append(check)
    for group in list(alike.values())[:_MOST]:
        check = group[0]
        place = f"{check.where}: " if check.where else ""
        remedy = f" ({check.remedy})" if check.remedy else ""
        print(f"  {_SIGNS[check.level]} {check.code} {place}{check.message}{remedy}", file=stream)
        if len(group) > 1:
            print(f"      {_likewise(group)}", file=stream)
    if len(alike) > _MOST:
        print(f"  … {len(alike) - _MOST} more in the report", file=stream)


def _likewise(group: Sequence[Check]) -> str:
    """Where else a finding was made: "alike 5 times in all, in a.h5, b.h5; joints 1, 2"."""
    logs = list(dict.fromkeys(check.where.split(", ")[0] for check in group if check.where))
    joints = sorted({int(number) for check in group for number in re.findall(r", joint (\d+)", check.where)})
    named = ", ".join(logs[:_LOGS]) + (f" and {len(logs) - _LOGS} more" if len(logs) > _LOGS else "")
    where = f", in {named}" if logs else ""
    return f"alike {len(group)} times in all{where}" + (f"; joints {', '.join(map(str, joints))}" if len(joints) > 1 else "")


def say_error(problem: RrridError) -> None:
    """Print one line on standard error for each error."""
    print(f"rrrid: {problem}", file=sys.stderr)
    for other in problem.others[:_OTHERS]:
        print(f"rrrid: {other}", file=sys.stderr)
    if (more := len(problem.others) - _OTHERS) > 0:
        print(f"rrrid: and {more} more", file=sys.stderr)


def say_error_object(problem: RrridError) -> None:
    """Print the error as a JSON object on standard output."""
    from pipelines.io.results import json_text

    others = {"others": [other.as_dict() for other in problem.others]} if problem.others else {}
    sys.stdout.write(json_text({"error": problem.as_dict(), "exit": problem.exit_code, **others}))

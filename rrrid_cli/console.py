"""What the user sees on the terminal: one line of progress, then a verdict, then where everything lies.

Results go to standard output, everything else to standard error, so that `--json` can be piped.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from pipelines.errors import Check, RrridError, clean

if TYPE_CHECKING:
    from pipelines.report.report import Table
    from pipelines.stage import Outcome

__all__ = ["Teller", "say_error", "say_outcome", "say_table"]

_SIGNS = {"ok": "·", "warn": "!", "repair": "~", "reject": "x"}
_MOST = 12


class Teller:
    """Progress: one line that is written over on a terminal, every step with -v, else nothing."""

    def __init__(self, quiet: bool, verbose: bool) -> None:
        self.live = sys.stderr.isatty() and not quiet and not verbose
        self.verbose = verbose
        self.width = 0

    def __call__(self, words: str) -> None:
        line = clean(words, 100)
        if self.live:
            sys.stderr.write("\r" + line.ljust(self.width))
            sys.stderr.flush()
            self.width = len(line)
        elif self.verbose:
            print(line, file=sys.stderr)

    def done(self) -> None:
        if self.live and self.width:
            sys.stderr.write("\r" + " " * self.width + "\r")
            sys.stderr.flush()
            self.width = 0


def say_outcome(outcome: Outcome[Any], *, as_json: bool, quiet: bool, verbose: bool) -> None:
    """The verdict, the key figures, what is not in order, and the folder."""
    if as_json:
        from pipelines.log.results import json_text

        sys.stdout.write(json_text(outcome.json))
    if quiet:
        return
    stream = sys.stderr if as_json else sys.stdout
    print(clean(outcome.report.verdict, 1000), file=stream)
    if outcome.report.key_figures is not None:
        _say_table(outcome.report.key_figures, stream)
    _say_checks(outcome.checks, verbose, stream)
    report = outcome.folder / "report.html"
    print(f"→ {report if report.exists() else outcome.folder}", file=stream)


def _say_table(table: Table, stream: Any) -> None:
    """The rows of a table; its head as well, where a row is more than a name and a figure."""
    from pipelines.report.style import format_number

    head = table.columns if len(table.columns) > 2 and table.rows else ()
    say_table(head, [[format_number(c) if isinstance(c, float) else clean("–" if c is None else c, 60) for c in row]
                     for row in table.rows], stream)


def say_table(head: Sequence[str], rows: Iterable[Sequence[str]], stream: Any = None) -> None:
    """Words in columns, on standard output where nothing else is said."""
    cells = [[clean(cell, 200) for cell in row] for row in (*((head,) if head else ()), *rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))] if cells else []
    for row in cells:
        print("  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip(), file=stream)


def _say_checks(checks: Iterable[Check], verbose: bool, stream: Any) -> None:
    shown = [check for check in dict.fromkeys(checks) if verbose or check.level != "ok"]
    seen: dict[tuple[str, str], int] = {}
    for check in shown:
        seen[check.code, check.message] = seen.get((check.code, check.message), 0) + 1
    once = list({(check.code, check.message): check for check in shown}.values())
    for check in once[:_MOST]:
        more = seen[check.code, check.message] - 1
        place = f"{check.where}{f' and {more} more' if more else ''}: " if check.where else ""
        remedy = f" ({check.remedy})" if check.remedy else ""
        print(f"  {_SIGNS[check.level]} {check.code} {place}{check.message}{remedy}", file=stream)
    if len(once) > _MOST:
        print(f"  … {len(once) - _MOST} more in the report", file=stream)


def say_error(problem: RrridError, *, as_json: bool) -> None:
    """One line on standard error; with --json the same as an object on standard output."""
    print(f"rrrid: {problem}", file=sys.stderr)
    if as_json:
        from pipelines.log.results import json_text

        sys.stdout.write(json_text({"error": problem.as_dict(), "exit": problem.exit_code}))

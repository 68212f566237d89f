"""Print what the user sees: progress, the verdict, the key figures, findings, errors.

Results go to standard output, everything else to standard error, so that `--json` can be piped.
"""

from __future__ import annotations

import io
import re
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from pipelines.errors import Check, RrridError, clean, escaped

if TYPE_CHECKING:
    from pipelines.report.report import Report, Table
    from pipelines.stage import Outcome
    from rrrid_cli.options import Common

SIGNS = {"ok": "·", "warn": "!", "repair": "~", "reject": "x", "bad": "x"}
# Values; p3 and q_1 are names.
VALUES = re.compile(r"(?<![A-Za-z_])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![A-Za-z_])")


class Progress:
    """Report the step that is being done on standard error, inside a `with` block.

    One line with the step's seconds on a terminal, every step with -v, else a line now and then, so
    that the reader of a pipe or of the output of CI sees that something is done. With -q nothing.
    """

    def __init__(self, options: Common, silence: float = 20.0) -> None:
        self.quiet, self.verbose = options.quiet or options.json, options.verbose
        self.silence = silence  # [s] between two lines in a pipe
        self.step, self.begun = "", time.monotonic()
        self.bar: Any = None  # of rich, on a terminal
        self.clock: threading.Thread | None = None  # elsewhere
        self.over = threading.Event()

    def __enter__(self) -> None:
        if self.quiet:
            return
        if not sys.stderr.isatty() or self.verbose:
            self.over.clear()
            self.clock = threading.Thread(target=self._repeat, daemon=True)
            self.clock.start()
            return
        from rich.console import Console
        from rich.progress import Progress as Bar
        from rich.progress import TextColumn, TimeElapsedColumn

        columns = (TextColumn("{task.description}", markup=False), TimeElapsedColumn())
        console = Console(stderr=True)
        self.bar = Bar(*columns, console=console, transient=True, refresh_per_second=2)
        self.task = self.bar.add_task(self.step, total=None)
        self.bar.start()

    def __call__(self, step: str) -> None:
        self.step, self.begun = clean(step, 100), time.monotonic()
        if self.bar is not None:
            self.bar.reset(self.task, description=self.step)
        elif self.verbose:
            print(self.step, file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        self.over.set()
        if self.clock is not None:
            self.clock.join()
        if self.bar is not None:
            self.bar.stop()
            self.bar = None

    def _repeat(self) -> None:
        while not self.over.wait(self.silence):
            seconds = time.monotonic() - self.begun
            print(f"{self.step}, {seconds:.0f} s", file=sys.stderr, flush=True)


def print_outcome(outcome: Outcome[Any], options: Common) -> None:
    """Print verdict, key figures, findings and folder; with --json result.json on stdout."""
    if options.json:
        from pipelines.io.results import json_text

        sys.stdout.write(json_text(outcome.json))
    if options.quiet:
        return
    stream = sys.stderr if options.json else sys.stdout
    print_verdict(outcome.report, stream)
    if outcome.report.key_figures is not None:
        _print_key_figures(outcome.report.key_figures, stream)
    for line in outcome.report.basis if options.verbose else ():
        print(f"  {clean(line, 400)}", file=stream)
    print_checks(outcome.checks, options.verbose, stream)
    report = outcome.folder / "report.html"
    print(f"→ {escaped(report if report.exists() else outcome.folder)}", file=stream)


def print_verdict(report: Report, stream: TextIO | None = None) -> None:
    """Print the verdict, and what to look at on the machine."""
    for line in (*report.verdict.split("\n"), *report.advice):
        print(clean(line, None), file=stream)


def _print_key_figures(table: Table, stream: TextIO | None) -> None:
    """Print a table of the report, with its head where a row is more than a name and a figure."""
    from pipelines.report.report import column_texts, filled
    from pipelines.report.style import format_number, format_unit

    table = filled(table)
    if len(table.columns) <= 2:  # a figure is not like the one below it  # noqa: PLR2004
        rows = [[c if isinstance(c, str) else format_number(c) for c in row] for row in table.rows]
        print_table([], [[clean(cell, 60) for cell in row] for row in rows], stream)
        return
    head = []
    for name in table.columns:
        title, bracket, unit = name.rpartition("[")
        head.append(f"{title}[{format_unit(unit)}" if bracket else unit)
    cells = zip(*table.rows, strict=True)
    columns = [column_texts(own, lambda text: clean(text, 60)) for own in cells]
    print_table(head, list(zip(*columns, strict=True)), stream)


def print_table(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    stream: TextIO | None = None,
    width: int = 80,
) -> None:
    """Print words in columns, numbers to the right where there is a head.

    A long heading takes several lines, a cell never does.

    Args:
        width: characters of the narrowest terminal that tables are made for.
    """
    if not rows:
        return
    from rich.console import Console
    from rich.table import Table

    from pipelines.report.report import are_numbers

    table = Table(box=None, pad_edge=False, show_header=bool(head), header_style="none")
    columns = [[clean(cell, 200) for cell in column] for column in zip(*rows, strict=True)]
    names = list(head) or [""] * len(columns)
    each = zip(names, columns, strict=True)
    least = [max(map(len, (*cells, *name.split()))) for name, cells in each]
    rooms = [max(len(name), room) for name, room in zip(names, least, strict=True)]
    rooms = rooms if sum(rooms) + 2 * len(rooms) <= width else least  # long headings break
    for name, cells, room in zip(names, columns, rooms, strict=True):
        side: Any = "right" if head and are_numbers(cells) else "left"
        table.add_column(name, justify=side, vertical="bottom", width=room)
    for row in zip(*columns, strict=True):
        table.add_row(*row)
    lines = Console(
        file=io.StringIO(), width=sum(rooms) + 2 * len(rooms), markup=False, highlight=False
    )
    with lines.capture() as drawn:
        lines.print(table)
    for line in drawn.get().splitlines():
        print(f"  {line}".rstrip(), file=stream)


def print_checks(
    checks: Iterable[Check], verbose: bool = False, stream: TextIO | None = None, most: int = 12
) -> None:
    """Print findings, what explains the most first; findings that differ in numbers alone once."""
    from pipelines.report.codes import first_to_read

    alike: dict[tuple[str, str], list[Check]] = {}
    for check in sorted(dict.fromkeys(checks), key=first_to_read):
        if verbose or check.level != "ok":
            alike.setdefault((check.code, VALUES.sub("#", check.message)), []).append(check)
    for check, *others in list(alike.values())[:most]:
        place = f"{check.where}: " if check.where else ""
        remedy = f" ({check.remedy})" if check.remedy else ""
        print(f"  {SIGNS[check.level]} {check.code} {place}{check.message}{remedy}", file=stream)
        if others:
            places = dict.fromkeys(one.where.split(", ")[0] for one in (check, *others))
            told = f", in {', '.join(places)}" if 1 < len(places) <= most else ""
            print(f"      alike {len(others) + 1} times in all{told}", file=stream)
    if len(alike) > most:
        print(f"  … {len(alike) - most} more in the report", file=stream)


def print_error(problem: RrridError, most: int = 12) -> None:
    """Print one line on standard error for each error."""
    for one in (problem, *problem.others[:most]):
        print(f"rrrid: {one}", file=sys.stderr)
    if len(problem.others) > most:
        print(f"rrrid: and {len(problem.others) - most} more", file=sys.stderr)

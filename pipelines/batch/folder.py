"""The output folder of a batch: whose it is, what stands where, and how each part is replaced.

    items/SLUG/         what the item's own command would have written
    ledger/SLUG.json    what became of it
    batch.json          that the folder is a batch's, and what of
    report.html, figures/, summary.parquet, junit.xml, result.json, and last of all provenance.json
"""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from pipelines import __version__
from pipelines.batch.items import Item
from pipelines.batch.junit import junit_xml
from pipelines.batch.lock import LOCK
from pipelines.batch.plan import Plan
from pipelines.batch.record import Ledger, Record
from pipelines.batch.summary import KINDS, Summary, rows_of
from pipelines.errors import UsageError
from pipelines.io.atomic import environment_faults, staging_folder, sweep, write_file
from pipelines.io.files import PROVENANCE, hash_file
from pipelines.io.places import tilde, written_by
from pipelines.io.results import json_text
from pipelines.io.table import write_rows
from pipelines.report.report import Report

__all__ = ["BatchFolder"]

_MARK: Final = "batch.json"
_OURS: Final = {"items", "ledger", "crashes", "figures", _MARK, "report.html", "summary.parquet", "junit.xml", "result.json",
                PROVENANCE, LOCK}
_DRAFT: Final = ".rrrid-tmp-"


class BatchFolder:
    """One output folder."""

    def __init__(self, out: Path) -> None:
        self.out, self.items = out, out / "items"
        self.ledger = Ledger(out / "ledger")

    def claim(self) -> None:
        """Make sure that the folder is new, empty, or an earlier batch's, and that it is there.

        Raises:
            UsageError: C05, it is anything else.
            EnvironmentFault: it cannot be made.
        """
        out, elsewhere = self.out, "choose another folder with --out"
        if out.is_symlink() or (out.exists() and not out.is_dir()):
            raise UsageError("C05", "is not a folder", where=out, remedy=elsewhere)
        with environment_faults(out):
            out.mkdir(parents=True, exist_ok=True)
            there = {path.name for path in out.iterdir() if not path.name.startswith(_DRAFT)}
        if not there - {LOCK}:
            return
        if not self.about():
            words = f"holds the result of '{command}'" if (command := written_by(out)) else "holds files that no batch wrote there"
            raise UsageError("C05", words, where=out, remedy=elsewhere)
        if foreign := sorted(there - _OURS):
            raise UsageError("C05", f"holds files that rrrid did not write there: {', '.join(foreign[:3])}", where=out,
                             remedy=f"{elsewhere}, or move them")

    def about(self) -> dict[str, Any]:
        """What the batch here says of itself; empty where none is."""
        try:
            about = json.loads((self.out / _MARK).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return {}
        return about if isinstance(about, dict) and about.get("tool") == "rrrid" and about.get("command") == "batch" else {}

    def begin(self, plan: Plan, items: Iterable[Item]) -> None:
        """Mark the folder as one that is being worked on, and drop what belongs to none of `items`, or to another stage."""
        slugs = set[str]()
        if self.about().get("stage", plan.stage) == plan.stage:
            slugs = {one.slug for item in items for one in (item, *self._sessions(item))}
        about = {"tool": "rrrid", "command": "batch", "version": __version__, "stage": plan.stage}
        write_file(self.out / _MARK, lambda draft: _text(draft, json_text(about)))
        with environment_faults(self.out):
            (self.out / PROVENANCE).unlink(missing_ok=True)
            self.items.mkdir(exist_ok=True)
            self.clean()
            for path in self.items.iterdir():
                if path.name not in slugs and not path.name.startswith("."):
                    self.discard(path.name)
            for path in self.ledger.folder.glob("*.json"):
                if path.stem not in slugs:
                    self.ledger.forget(path.stem)

    def _sessions(self, item: Item) -> tuple[Item, ...]:
        """What the last batch divided the item into."""
        record = self.ledger.get(item)
        return () if record is None else item.divided(record.sessions)

    def clean(self) -> None:
        """Sweep away the drafts of processes that are dead."""
        for folder in (self.out, self.items):
            sweep(folder)
        for draft in self.ledger.folder.glob(f"{_DRAFT}*"):  # nobody else writes there: the lock is ours
            draft.unlink(missing_ok=True)

    def discard(self, slug: str) -> None:
        """Remove an item's result, if it is one of rrrid's, in one step for whoever looks."""
        folder = self.items / slug
        if not folder.is_dir() or folder.is_symlink() or not written_by(folder):
            return
        aside = staging_folder(folder)  # swept away by the next one where this process is killed
        with environment_faults(folder):
            os.replace(folder, aside)
            shutil.rmtree(aside)

    def traced(self, record: Record) -> Record:
        """The record without the trace of its internal error, which goes to a file of its own."""
        path = self.out / "crashes" / f"{record.slug}.txt"
        with environment_faults(path):
            path.unlink(missing_ok=True)
        if record.trace:
            write_file(path, lambda draft: _text(draft, record.trace))
        return dataclasses.replace(record, trace="")

    def finish(self, summary: Summary, json_: Mapping[str, Any], report: Report | None, check: bool,
               about: Mapping[str, Any]) -> None:
        """Write the summary in all its forms, and provenance.json as the last of them."""
        out = self.out
        with environment_faults(out):
            self.clean()
            if (out / "crashes").is_dir() and not any((out / "crashes").iterdir()):
                (out / "crashes").rmdir()
            shutil.rmtree(out / "figures", ignore_errors=True)
            (out / "report.html").unlink(missing_ok=True)
        write_rows(out / "summary.parquet", rows_of(summary), KINDS)
        write_file(out / "junit.xml", lambda draft: _text(draft, tilde(junit_xml(summary, check))))
        if report is not None:
            from pipelines.report.render import write_report

            write_report(report, out, {"command": "rrrid batch", "version": __version__, "stage": summary.stage})
        write_file(out / "result.json", lambda draft: _text(draft, json_text(json_)))
        apart = {"items", "ledger", "crashes"}
        files = [path for path in sorted(out.rglob("*")) if path.is_file() and path.name != LOCK
                 and path.relative_to(out).parts[0] not in apart]
        whole = {"tool": "rrrid", "version": __version__, **about,
                 "outputs": {path.relative_to(out).as_posix(): hash_file(path) for path in files},
                 "items": {record.slug: record.provenance for record in summary.records if record.provenance}}
        write_file(out / PROVENANCE, lambda draft: _text(draft, json_text(tilde(whole))))


def _text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")

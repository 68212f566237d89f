"""Draw the page of a batch again, of its result and the ledger: nothing is computed, and no item is touched.

    report = redraw_batch(folder)       in its place; with `out` elsewhere
"""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipelines import __version__
from pipelines.batch.drift import drift_of
from pipelines.batch.folder import BatchFolder
from pipelines.batch.items import Item
from pipelines.batch.lock import locked
from pipelines.batch.record import Record
from pipelines.batch.summary import Summary, summary_report
from pipelines.errors import Check, InputRejected, UsageError
from pipelines.io.atomic import environment_faults, write_file
from pipelines.io.files import PROVENANCE, hash_file
from pipelines.io.places import keep_apart, tilde
from pipelines.io.results import json_text
from pipelines.io.stored_result import read_result
from pipelines.report.render import write_report
from pipelines.report.report import Report

__all__ = ["redraw_batch"]

_AGAIN = "run 'rrrid batch' again with --resume"


def redraw_batch(folder: Path, out: Path | None = None) -> Report:
    """The page of the batch in `folder`, written there or to `out`, an empty folder or a new one. The baseline's band is not in it.

    Raises:
        UsageError: C04, no batch there; C05, files that rrrid did not write, or an output that is not free.
        InputRejected: F05, S20, result or ledger are not as they were written.
        EnvironmentFault: P08, a batch is at work there; disk full, no permission.
    """
    stored, place = read_result(folder), BatchFolder(folder)
    place.claim()
    try:
        summary = _summary(stored.object, place)
    except (KeyError, TypeError, ValueError) as problem:
        raise InputRejected("S20", f"does not hold what this version draws ({type(problem).__name__}: {problem})",
                            where=stored.path, remedy=f"it was written by another version; {_AGAIN}") from problem
    report: Report = tilde(summary_report(summary))
    footer = {"command": "rrrid batch", "version": __version__, "stage": summary.stage}
    if out is not None:
        keep_apart(out, (), (folder,))
        with environment_faults(out):
            out.mkdir(parents=True, exist_ok=True)
            if any(out.iterdir()):
                raise UsageError("C05", "is not empty", where=out, remedy="choose another folder with --out")
        write_report(report, out, footer)
        return report
    with locked(folder):
        shutil.rmtree(folder / "figures", ignore_errors=True)
        drawn = write_report(report, folder, footer)
        _tell(folder, {path.relative_to(folder).as_posix(): hash_file(path) for path in drawn})
    return report


def _summary(result: Mapping[str, Any], place: BatchFolder) -> Summary:
    """What the batch knew when it ended: the ledger's figures under the statuses that its result has them in."""
    records = tuple(_record(item, place) for item in result["items"])
    checks = tuple(Check(**one) for one in result["checks"])
    return Summary(str(result["stage"]), records, drift_of(records), checks, interrupted=any(map(_unreached, records)))


def _unreached(record: Record) -> bool:
    """Return whether the batch was interrupted before the item."""
    error = record.error or {}
    return error.get("code") == "RRID-P06" and "interrupted" in error.get("message", "")


def _record(item: Mapping[str, Any], place: BatchFolder) -> Record:
    known = Item(item["name"], (), ())
    record = place.ledger.get(known) or Record(item["name"], known.slug, item["status"], item["exit"])
    return dataclasses.replace(record, status=item["status"], verdict=item["verdict"], error=item["error"])


def _tell(folder: Path, drawn: Mapping[str, str]) -> None:
    """Put what was drawn into provenance.json, in the place of what was drawn before."""
    try:
        about = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
        others = {name: sha for name, sha in about["outputs"].items() if name != "report.html" and not name.startswith("figures/")}
    except (OSError, ValueError, KeyError, AttributeError, RecursionError):
        raise InputRejected("F05", "has no provenance.json that says what it is", where=folder, remedy=_AGAIN) from None
    whole = json_text(about | {"outputs": others | dict(drawn)})
    write_file(folder / PROVENANCE, lambda draft: _text(draft, whole))


def _text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")

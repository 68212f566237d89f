"""Draw the report of a stored result again; nothing is computed.

report = rerender(folder)       in its place; with `out` elsewhere
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from importlib import import_module
from pathlib import Path, PurePath
from typing import Any

from pipelines import __version__
from pipelines.batch import claim
from pipelines.cache import locked
from pipelines.errors import InputRejected, RrridError, UsageError
from pipelines.io.output import (
    PROVENANCE,
    environment_faults,
    hash_file,
    provenance_of,
    refuse_foreign,
    refuse_place,
    remove_folder,
    staging_folder,
    tilde,
    write_text,
)
from pipelines.io.results import (
    StoredResult,
    decode,
    headed,
    json_text,
    read_foreign_series,
    read_result,
)
from pipelines.report.batch_report import Result as BatchResult
from pipelines.report.batch_report import batch_report
from pipelines.report.render import write_report
from pipelines.report.report import Report
from pipelines.stage import Stage, footer_of, result_type

_AGAIN = "run the command again"


def rerender(folder: Path, out: Path | None = None, force: bool = False) -> Report:
    """Draw the report of the result in `folder`, there or in `out`.

    Raises:
        UsageError: C04, no result there; C02, a result without a report; C05, files that rrrid did
            not write, or another command's result in `out`.
        InputRejected: F05, it is not as it was written; S01, its series are missing; S20, it is of
            another version.
        EnvironmentFault: disk full, no permission; P08, a batch is at work there.
    """
    stored = read_result(folder)
    home, is_batch = stored.path.parent, stored.command == "batch"
    if out is not None:
        refuse_place(out, (stored.path,), (home,))
        refuse_foreign(out, force, command="report")
    elif is_batch:
        claim(home, str(stored.object.get("stage")))
    else:
        refuse_foreign(home, force)
    report: Report = tilde(_report(stored))
    about = provenance_of(home)
    outputs, inputs, stage = (about.get(name, {}) for name in ("outputs", "inputs", "stage"))
    known = isinstance(outputs, dict) and isinstance(inputs, dict) and "outputs" in about
    if (
        not known
        or (is_batch and not isinstance(stage, str))
        or any(".." in PurePath(name).parts or name.startswith("/") for name in outputs)  # X11
    ):
        raise InputRejected("F05", "has no provenance.json that says what it is", home, _AGAIN)
    footer = footer_of(stored.command, inputs)
    if is_batch:
        footer = {"command": "rrrid batch", "version": __version__, "stage": stage}
    with locked(home / "ledger", home) if is_batch else contextlib.nullcontext():
        drawn = _draw(report, out or home, footer)
        if out is None:
            others = {name: sha for name, sha in outputs.items() if not _is_drawn(name)}
            about = about | {"outputs": others | drawn}
        else:
            about = {"tool": "rrrid", "version": __version__, "command": "report"}
            about |= {"inputs": {str(stored.path): hash_file(stored.path)}, "outputs": drawn}
        write_text((out or home) / PROVENANCE, json_text(tilde(about)))
    return report


def _is_drawn(name: str) -> bool:
    return name == "report.html" or name.startswith("figures/")


def _draw(report: Report, folder: Path, footer: dict[str, str]) -> dict[str, str]:
    """Draw beside the folder, move it all there, and return the files with their SHA-256."""
    with environment_faults(folder):
        folder.mkdir(parents=True, exist_ok=True)
        staging = staging_folder(folder)
    try:
        write_report(report, staging, footer)
        with environment_faults(folder):
            shutil.rmtree(folder / "figures", ignore_errors=True)
            for path in sorted(staging.iterdir()):
                os.replace(path, folder / path.name)
    finally:
        remove_folder(staging)
    files = [folder / "report.html", *sorted((folder / "figures").glob("*"))]
    return {path.relative_to(folder).as_posix(): hash_file(path) for path in files}


def _report(stored: StoredResult) -> Report:
    """Return the report as the stage draws it of what was stored."""
    object_ = {key: value for key, value in stored.object.items() if key not in headed("", {})}
    own = {"import": "import_log", "export": "export_model"}
    module = own.get(stored.command, stored.command.replace("-", "_"))
    try:
        if stored.command == "batch":
            return batch_report(decode(BatchResult, object_, {}))
        stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
        if stored.command == "run":
            from pipelines.run import restored

            return stage.report(restored(stored.path.parent, stored.object))
        return stage.report(decode(result_type(stage), object_, _series(stored)))
    except RrridError:
        raise
    except ImportError:
        words = f"a result of {stored.command} has no report to draw again"
        raise UsageError("C02", words, where=stored.path, remedy=_AGAIN) from None
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as problem:
        words = f"does not hold what this version draws ({type(problem).__name__}: {problem})"
        raise InputRejected("S20", words, where=stored.path, remedy=_AGAIN) from problem


def _series(stored: StoredResult) -> dict[str, Any]:
    """Return the long series that figures are drawn of, as they were written."""
    if '"$series"' not in json.dumps(stored.object):
        return {}
    file = stored.series
    if not file.is_file():
        words = "the series that its figures are drawn of are missing"
        raise InputRejected("S01", words, where=file, remedy=_AGAIN)
    outputs = provenance_of(file.parent).get("outputs")
    listed = outputs.get(file.name) if isinstance(outputs, dict) else None
    if listed not in (None, hash_file(file)):
        words = "sha256 differs from provenance.json: it was changed since it was written"
        raise InputRejected("F05", words, where=file, remedy=_AGAIN)
    return read_foreign_series(file)

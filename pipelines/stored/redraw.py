"""Draw the report of a stored result again: by newer code, where it was left out, or where it was lost. Nothing is computed.

A figure of a run that lies there as this very code has drawn it of this very result is not drawn once more.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path, PurePath
from typing import Any

from pipelines import __version__
from pipelines.errors import Check, InputRejected, RrridError, UsageError
from pipelines.io.output import (
    PROVENANCE,
    environment_faults,
    hash_file,
    keep_apart,
    refuse_foreign,
    replace_folder,
    staging_folder,
    tilde,
)
from pipelines.io.results import (
    StoredResult,
    decode,
    headed,
    json_text,
    listed_outputs,
    read_foreign_series,
    read_result,
)
from pipelines.recall.pictures import DRAWING, pictures_of, with_pictures, write_drawing
from pipelines.recall.store import CACHE
from pipelines.report.render import write_report
from pipelines.report.report import Report
from pipelines.stage import Stage, footer_of, result_type

__all__ = ["redraw"]

_AGAIN = "run the command again"


def redraw(folder: Path, out: Path | None = None, force: bool = False) -> tuple[Report, Path, tuple[Check, ...]]:
    """Draw the report of the result in `folder`, there or in `out`; the report, and where it lies.

    Raises:
        UsageError: C04, no result there; C02, a result that has no report of its own; C05, files that rrrid did not write.
        InputRejected: F05, result or series are not as they were written; S01, the series are missing; S20, another version's.
        EnvironmentFault: disk full, no permission.
    """
    stored = read_result(folder)
    home = stored.path.parent
    if out is not None:
        keep_apart(out, (stored.path,), (home,))
    refuse_foreign(home if out is None else out, force, command=stored.command if out is None else "report")
    report = tilde(_report(stored))
    about = _provenance(home)
    report = _with_figures(report, stored, about)
    target = home if out is None else out
    staging = staging_folder(target)
    try:
        if out is None:
            _keep(home, staging, (name for name in about.get("outputs", {}) if not _drawn(name)))
            if stored.command == "run":
                write_drawing(staging, _run_modules())
        write_report(report, staging, footer_of(stored.command, about.get("inputs", {})))
        outputs = {path.relative_to(staging).as_posix(): hash_file(path) for path in sorted(staging.rglob("*")) if path.is_file()}
        told = about | {"outputs": outputs} if out is None else {
            "tool": "rrrid", "version": __version__, "command": "report", "inputs": {str(stored.path): hash_file(stored.path)},
            "outputs": outputs}
        with environment_faults(staging):
            (staging / PROVENANCE).write_text(json_text(tilde(told)), encoding="utf-8")
        replace_folder(staging, target)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return report, target, ()


def _report(stored: StoredResult) -> Report:
    """The report as the stage draws it of what was stored."""
    module = "import_log" if stored.command == "import" else stored.command.replace("-", "_")
    try:
        stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
    except (ImportError, AttributeError):
        raise UsageError("C02", f"a result of {stored.command} has no report to draw again", where=stored.path,
                         remedy=_AGAIN) from None
    try:
        return stage.report(_result(stage, stored))
    except RrridError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as problem:
        raise InputRejected("S20", f"does not hold what this version draws ({type(problem).__name__}: {problem})",
                            where=stored.path, remedy=f"it was written by another version; {_AGAIN}") from problem


def _with_figures(report: Report, stored: StoredResult, about: Mapping[str, Any]) -> Report:
    """`report` with the figures that a run has left there, where they are of what it stored and were drawn by this code."""
    if stored.command != "run":
        return report
    home = stored.path.parent
    listed = about.get("outputs", {}).items()
    of = {name: sha for name, sha in listed if name.startswith(f"{CACHE}/") and not name.endswith(DRAWING)}
    if not of or any(not (home / name).is_file() or hash_file(home / name) != sha for name, sha in of.items()):
        return report
    return with_pictures(report, pictures_of(home, _run_modules()))


def _result(stage: Stage[Any, Any], stored: StoredResult) -> Any:
    if stored.command == "run":
        from pipelines.run import restored

        return restored(stored.path.parent, stored.object)
    object_ = {key: value for key, value in stored.object.items() if key not in headed("", {})}
    return decode(result_type(stage), object_, _series(stored))


def _series(stored: StoredResult) -> dict[str, Any]:
    """The long series that figures are drawn of, as they were written."""
    if not _refers(stored.object):
        return {}
    if not stored.series.is_file():
        raise InputRejected("S01", "the series that its figures are drawn of are missing", where=stored.series, remedy=_AGAIN)
    expected = listed_outputs(stored.path.parent).get(stored.series.name)
    if expected is not None and expected != hash_file(stored.series):
        raise InputRejected("F05", "sha256 differs from provenance.json: it was changed since it was written", where=stored.series,
                            remedy=_AGAIN)
    return read_foreign_series(stored.series)


def _refers(value: Any) -> bool:
    """Return whether a JSON object names a series."""
    if isinstance(value, dict):
        return "$series" in value or any(map(_refers, value.values()))
    return isinstance(value, list) and any(map(_refers, value))


def _run_modules() -> tuple[str, ...]:
    from pipelines.run import MODULES

    return MODULES


def _provenance(folder: Path) -> dict[str, Any]:
    try:
        about: dict[str, Any] = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
        dict(about.get("inputs", {})).items()
        if any(".." in PurePath(name).parts or PurePath(name).is_absolute() for name in about.get("outputs", {})):
            raise ValueError  # X11: nothing is written beside the folder
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise InputRejected("F05", "has no provenance.json that says what it is", where=folder, remedy=_AGAIN) from None
    return about


def _drawn(name: str) -> bool:
    return name == "report.html" or name.startswith("figures/")


def _keep(home: Path, staging: Path, names: Iterable[str]) -> None:
    """Every other file of the result, by a second name where the file system has that."""
    for name in names:
        if not (home / name).is_file():  # taken away since, and no report is drawn of it
            continue
        with environment_faults(home / name):
            (staging / name).parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(home / name, staging / name)
            except OSError:
                shutil.copyfile(home / name, staging / name)

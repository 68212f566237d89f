"""Read what a stage of a run has found: it has no result.json of its own, for that of the run holds it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pipelines.errors import InputRejected, UsageError
from pipelines.log.places import slug
from pipelines.log.stored_result import StoredResult, read_result

__all__ = ["read_any_result"]


def read_any_result(path: Path) -> StoredResult:
    """As `read_result`; and the result of a stage, where `path` is its folder within that of a run.

    The folder need not be there: a stage that writes no files has none.

    Raises:
        UsageError: C04, there is none, or the run has passed the stage over.
        InputRejected: as `read_result`.
    """
    if not path.is_file() and not (path / "result.json").is_file():
        for run in path.parents[:2]:
            if (run / "result.json").is_file() and (found := _within(run, path)) is not None:
                return found
    return read_result(path)


def _within(run: Path, path: Path) -> StoredResult | None:
    """Of a result that can be read: what somebody else left beside a folder that is not there is none of its faults."""
    try:
        return _stage_of(read_result(run), path)
    except InputRejected as problem:
        if problem.code == "RRID-F17":
            raise
        return None


def _stage_of(run: StoredResult, path: Path) -> StoredResult | None:
    within = path.relative_to(run.path.parent).parts
    step = next((one for place, one in _steps(run) if place == within), None)
    if step is None:
        return None
    if step["result"] is None:
        raise UsageError("C04", f"the run has no result of {path.name}: it was passed over, or refused", where=path,
                         remedy="its report says why")
    return StoredResult(run.path, path.name, {"command": path.name, **step["result"]}, "/".join(within))


def _steps(run: StoredResult) -> Iterator[tuple[tuple[str, ...], Mapping[str, Any]]]:
    """Every stage with the folder it has there: below that of its robot and day, where there are several."""
    if run.command == "run":
        yield from (((one["name"],), one) for one in run.object.get("stages") or ())
        yield from (((slug(part["name"]), one["name"]), one) for part in run.object.get("runs") or () for one in part["stages"])

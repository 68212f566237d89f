"""Read what a stage of a run has found: it has no result.json of its own, for that of the run holds it."""

from __future__ import annotations

from pathlib import Path

from pipelines.errors import InputRejected, UsageError
from pipelines.io.stored_result import StoredResult, read_result

__all__ = ["read_any_result"]


def read_any_result(path: Path) -> StoredResult:
    """As `read_result`; and the result of a stage, where `path` is its folder within that of a run.

    The folder need not be there: a stage that writes no files has none.

    Raises:
        UsageError: C04, there is none, or the run has passed the stage over.
        InputRejected: as `read_result`.
    """
    run = path.parent
    if not path.is_file() and not (path / "result.json").is_file() and (run / "result.json").is_file():
        found = _within(run, path.name)
        if found is not None:
            return found
    return read_result(path)


def _within(run: Path, name: str) -> StoredResult | None:
    """Of a result that can be read: what somebody else left beside a folder that is not there is none of its faults."""
    try:
        return _stage_of(read_result(run), name)
    except InputRejected as problem:
        if problem.code == "RRID-F17":
            raise
        return None


def _stage_of(run: StoredResult, name: str) -> StoredResult | None:
    stages = (run.object.get("stages") or ()) if run.command == "run" else ()
    step = next((one for one in stages if one["name"] == name), None)
    if step is None:
        return None
    if step["result"] is None:
        raise UsageError("C04", f"the run has no result of {name}: it was passed over, or refused",
                         where=run.path.parent / name, remedy="its report says why")
    return StoredResult(run.path, name, {"command": name, **step["result"]}, name)

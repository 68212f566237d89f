"""Read what a log's file holds, in the child that is kept for it.

    log, digest = read_guarded(path, container, only, sound)
    end_reader()                     whatever child is kept; the next file is read by a fresh one
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, Final

from pipelines.errors import InputRejected
from pipelines.io import canonical
from pipelines.io.experiment import ExperimentLog
from pipelines.io.guard import Answer, Guard
from pipelines.io.guard_answer import Garbled

__all__ = ["end_reader", "read_guarded"]

_READS_IT: Final = {"hdf5": "h5py", "parquet": "pyarrow.parquet"}


def read_guarded(path: Path, container: str, only: Collection[str] | None,
                 sound: Callable[[], None]) -> tuple[ExperimentLog, str | None]:
    """The log in `path` as it is written there, and the digest that it carries, held against it where all of it was read.

    Args:
        container: "hdf5" or "parquet"; the library that reads it is imported already, for every child to have it.
        only: the signals to read; None: all.
        sound: raises where the file has changed while it was read: that is told before anything that its content is blamed for.

    Raises:
        InputRejected: the file is damaged, hostile or not a log; F04, its content does not fit its digest.
    """

    def taken(answer: Answer) -> tuple[tuple[ExperimentLog, str | None], bool]:
        sound()
        text, digest = answer.about.get("text"), answer.about.get("digest")
        if not isinstance(text, str) or not isinstance(digest, str | None):
            raise Garbled("no log")
        log = canonical.parse_log_text(text, answer.arrays, where=str(path))
        if only is not None or digest is None:
            return (log, digest), False
        if digest != canonical.digest_of(log):
            raise InputRejected("F04", "checksum mismatch: the content does not fit its digest", where=path,
                                remedy="copy the file again from where it was recorded; if it was edited on purpose, delete its "
                                "attribute digest, which may be left out")
        return (log, digest), True

    try:
        return _guard.ask([str(path), container, None if only is None else sorted(only)], path, _READS_IT[container], taken)
    except InputRejected:
        sound()
        raise


def end_reader() -> None:
    """End the child that this thread keeps: what this process changes from now on, the next child has as well."""
    _guard.let_go()


def _read(words: Any) -> Answer:
    """In the guarded child: the log of `words`, [path, container, the signals to read or null for all]."""
    path, container, only = Path(words[0]), words[1], words[2]
    if container == "hdf5":
        from pipelines.io.hdf5 import read_parts
    else:
        from pipelines.io.parquet import read_parts
    log, digest = read_parts(path, None if only is None else {"t", "q", "tau", *only})
    return Answer({"text": canonical.log_text(log), "digest": digest}, {name: s.values for name, s in log.signals.items()})


_guard = Guard(_read)

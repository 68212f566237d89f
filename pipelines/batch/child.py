"""A warm worker as a child process that speaks JSON: what a cluster's worker keeps, so that a crash does not take it along.

    child = Child(plan_text, key)
    record = child.attempt(item, seconds)      a child that crashed or hung is replaced by the next call
    child.end()

Workers of a cluster may not start processes by `multiprocessing`, and must not die of one item: theirs are this.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import select
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from pipelines.batch.items import Item
from pipelines.batch.plan import Plan, read_plan
from pipelines.batch.pool import crashed, timed_out
from pipelines.batch.process import one_thread
from pipelines.batch.record import Record, read_record
from pipelines.batch.work import attempt, begin, undone
from pipelines.errors import EnvironmentFault

__all__ = ["Child", "item_of", "serve", "words_of"]


class Child:
    """One process, started when it is needed."""

    def __init__(self, text: str, key: str) -> None:
        self.text, self.key = text, key
        self.plan: Plan = read_plan(text)
        self.process: subprocess.Popen[bytes] | None = None

    def attempt(self, item: Item, seconds: float | None) -> Record:
        """The item's record, within `seconds`."""
        if self.process is None:
            self.process = self._start()
        process = self.process
        line = _asked(process, words_of(item), seconds)
        if line is None:
            self.end()
            return undone(item, timed_out(seconds), self.plan, self.key)
        if not line:
            exit_code = process.wait()
            self.end()
            return undone(item, crashed(exit_code), self.plan, self.key)
        return read_record(json.loads(line))

    def _start(self) -> subprocess.Popen[bytes]:
        """A new process, warm. One that ends at its beginning shows with its first item."""
        one_thread()
        process = subprocess.Popen([sys.executable, "-m", "pipelines.batch.child"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                   env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
        _asked(process, [self.text, self.key, os.getpid()], None)
        return process

    def end(self) -> None:
        """Kill the process; what it was writing does not take its place."""
        if self.process is not None:
            self.process.kill()
            for pipe in (self.process.stdin, self.process.stdout):
                if pipe is not None:
                    with contextlib.suppress(OSError):
                        pipe.close()
            self.process.wait()
            self.process = None


def _asked(process: subprocess.Popen[bytes], words: Any, seconds: float | None) -> bytes | None:
    """The answer to `words`; empty where the process ended, None where the time ran out."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(words).encode() + b"\n")
        process.stdin.flush()
    except BrokenPipeError:
        return b""
    return _line(process.stdout.fileno(), seconds)


def _line(handle: int, seconds: float | None) -> bytes | None:
    """The next line; empty where the writer ended before its end, None where the time ran out."""
    deadline = None if seconds is None else time.monotonic() + seconds
    parts: list[bytes] = []
    while not (parts and parts[-1].endswith(b"\n")):
        left = None if deadline is None else max(0.0, deadline - time.monotonic())
        if not select.select([handle], [], [], left)[0]:
            return None
        parts.append(os.read(handle, 1 << 20))
        if not parts[-1]:
            return b""
    return b"".join(parts)


def words_of(item: Item) -> dict[str, Any]:
    """An item as JSON."""
    fault = None if item.fault is None else item.fault.as_dict()
    return {"name": item.name, "paths": list(map(str, item.paths)), "logs": list(map(str, item.logs)), "fault": fault,
            "session": item.session}


def item_of(words: dict[str, Any]) -> Item:
    """The item that `words_of` made them of."""
    fault = words["fault"] and EnvironmentFault(words["fault"]["code"].removeprefix("RRID-"), words["fault"]["message"],
                                                where=words["fault"]["where"], remedy=words["fault"]["remedy"])
    return Item(words["name"], tuple(map(Path, words["paths"])), tuple(map(Path, words["logs"])), fault,
                words["session"])


def serve() -> None:
    """The child: a plan, then an item a line; each answered by its record on one line."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    text, key, parent = json.loads(sys.stdin.buffer.readline())
    begin(text, key)
    if os.getppid() != parent:  # it was killed before
        return
    answers.write(b"ready\n")
    answers.flush()
    for line in sys.stdin.buffer:
        answers.write(json.dumps(dataclasses.asdict(attempt(item_of(json.loads(line))))).encode() + b"\n")
        answers.flush()


if __name__ == "__main__":
    serve()

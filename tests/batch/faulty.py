"""A stage that does what its logs tell it to: end well, find something, crash, hang, eat memory, fill the disk.

A log is a text file of words such as "value 1.0 std 0.1", "crash", "sleep 0.2"; nothing is read but that.
"""

from __future__ import annotations

import errno
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.io.output import write_file
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage


def leave(plan: object) -> None:
    """Begin as no worker should."""
    os._exit(3)


@dataclass(frozen=True)
class Settings:
    """One that changes the result."""

    factor: float = 1.0


@dataclass(frozen=True)
class Number:
    """A fitted figure."""

    name: str
    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class Result:
    """What the words made of it."""

    words: str
    found: bool
    parameters: tuple[Number, ...]
    torque_rms: tuple[float, ...]


def read(request: Request, settings: object) -> Inputs:
    """The logs' words."""
    logs = [file for path in request.paths for file in (sorted(path.glob("*.h5")) if path.is_dir() else [path])]
    words = " ".join(log.read_text() for log in logs)
    if "reject" in words:
        raise InputRejected("F02", "truncated", where=logs[0], remedy="copy it again")
    return Inputs(sources=tuple(logs), material=words, robot_name="rrr-tue")


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Obey."""
    words = str(inputs.material).split()
    said = dict(zip(words, [*words[1:], ""], strict=True))
    if "started" in said:
        Path(said["started"]).touch()
    if "sleep" in said:
        time.sleep(float(said["sleep"]))
    if "crash" in said:
        os.kill(os.getpid(), signal.SIGSEGV)
    if "leave" in said:
        os._exit(0)
    if "memory" in said:
        np.ones(int(4e9 / 8))
    if "bug" in said:
        raise ZeroDivisionError("nobody foresaw it")
    numbers = (Number("p1", settings.factor * float(said["value"]), float(said["std"]), "kg m^2"),) if "value" in said else ()
    return Result(str(inputs.material), "found" in said, numbers, (float(said["rms"]),) if "rms" in said else ())


def report(result: Result) -> Report:
    """The words."""
    return Report("Obeyed", f"It said: {result.words}.", "attention" if result.found else "good")


def write(result: Result, folder: Path, request: Request) -> None:
    """A file; the disk is full where the log says so."""
    def fill(draft: Path) -> None:
        if "full" in result.words:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(draft))
        if "unreadable" in result.words:
            raise OSError(errno.EIO, os.strerror(errno.EIO), str(draft))
        draft.write_text(result.words)

    write_file(folder / "words.txt", fill)


def checks(result: Result) -> tuple[Check, ...]:
    return ()


STAGE = Stage("faulty", "Obey", Settings, compute, report, read, write, lambda result, check: int(result.found and check), checks)

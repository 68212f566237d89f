"""Convert logs from one container to the other, or to flat CSV for other viewers.

Reads    any logs
Writes   logs/<name>.h5 or .parquet, each read back and compared before it counts; csv/<name>.csv; result.json, report.html
Source   log-format.md: a log read from either container and written to the other is equal, bit for bit
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from pipelines.errors import InputRejected, UsageError
from pipelines.io.canonical import digest_of
from pipelines.io.experiment import ExperimentLog
from pipelines.io.files import open_log, write_log
from pipelines.io.option import option
from pipelines.io.results import NOT_STORED
from pipelines.io.table import write_csv
from pipelines.report.report import Report, Section, Table
from pipelines.stage import Inputs, Request, Stage, read_logs, slug

__all__ = ["STAGE", "Converted", "Result", "Settings", "compute", "report"]

_OTHER = {"hdf5": "parquet", "parquet": "h5"}


@dataclass(frozen=True)
class Settings:
    """`to`: "h5", "parquet" or "csv"; empty: the container that the log is not in."""

    to: str = option("", "h5, parquet or csv; goes before --format. [what the log is not in]")


@dataclass(frozen=True)
class Converted:
    """One log and the file it became."""

    name: str
    source: str
    file: str  # relative to the output folder
    samples: int
    joints: int
    digest: str  # equal digests are equal logs, whatever the container
    log: ExperimentLog = field(metadata=NOT_STORED, repr=False)


@dataclass(frozen=True)
class Result:
    """What was converted."""

    logs: tuple[Converted, ...]


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Choose the container and a file name for each log.

    Raises:
        UsageError: C02, `to` names no container.
    """
    if settings.to not in ("", "h5", "parquet", "csv"):
        raise UsageError("C02", f"'{settings.to}' is no container", where="--to", remedy="one of h5, parquet, csv")
    taken: set[str] = set()
    converted = []
    for opened in inputs.logs:
        ending = settings.to or _OTHER[opened.container]
        stem = _unused(slug(opened.path.stem), ending, taken)
        file = f"{'csv' if ending == 'csv' else 'logs'}/{stem}.{ending}"
        converted.append(Converted(opened.log.name, opened.path.name, file, opened.log.n_samples, opened.log.n_joints,
                                   digest_of(opened.log), opened.log))
    return Result(tuple(converted))


def _unused(stem: str, ending: str, taken: set[str]) -> str:
    """`stem`, or `stem-2` and so on where a file of that name is there already."""
    number = 1
    while (name := stem if number == 1 else f"{stem}-{number}") + f".{ending}" in taken:
        number += 1
    taken.add(f"{name}.{ending}")
    return name


def write(result: Result, folder: Path, request: Request) -> None:
    """Write every converted log into `folder`, and read each back."""
    for item in result.logs:
        request.tell(f"writing {item.file}")
        target = folder / item.file
        if target.suffix == ".csv":
            write_csv(target, item.log)
            continue
        write_log(target, item.log)
        if open_log(target).log != item.log:
            raise InputRejected("F04", "what was written does not read back the same", where=item.file, remedy="check the disk")


def report(result: Result) -> Report:
    """A table of what became what."""
    n = len(result.logs)
    words = ("Each was read back after writing and is equal to its source, sample for sample and attribute for attribute.",
             "Numbers are written with all their digits.")
    table = Table(("log", "from", "to", "samples", "joints"),
                  tuple((c.name, c.source, c.file, c.samples, c.joints) for c in result.logs),
                  caption=words[any(c.file.startswith("csv") for c in result.logs)])
    verdict = f"{n} log{'s' if n != 1 else ''} converted."
    return Report("Convert", verdict, "good", sections=(Section("Logs", tables=(table,)),))


STAGE = Stage("convert", "Convert logs from one container to the other", Settings, compute, report, read_logs, write,
              sessions="folder")

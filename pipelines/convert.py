"""Convert logs from one container to the other, or to flat CSV for other viewers.

Reads    any logs
Writes   logs/<name>.h5 or .parquet, each read back and compared; csv/<name>.csv; result.json
Source   log-format.md: a log read from either container and written to the other is equal
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from pipelines.errors import InputRejected, UsageError
from pipelines.io.files import open_log, write_csv, write_log
from pipelines.io.log import ExperimentLog, digest_of
from pipelines.io.option import option
from pipelines.io.results import NOT_STORED
from pipelines.quality.subject import many
from pipelines.report.report import Report, Section, Table
from pipelines.stage import Inputs, Request, Stage, read_logs, slug

__all__ = ["STAGE", "Converted", "Result", "Settings", "compute", "report"]

_OTHER = {"hdf5": "parquet", "parquet": "h5"}


@dataclass(frozen=True)
class Settings:
    """Set the container that is written."""

    to: str = option("", "h5, parquet or csv; goes before --format. [what the log is not in]")


@dataclass(frozen=True)
class Converted:
    """One log and the file it became."""

    name: str
    source: str
    file: str  # relative to the output folder
    samples: int
    joints: int
    digest: str  # equal digests are equal logs in any container
    log: ExperimentLog = field(metadata=NOT_STORED, repr=False)


@dataclass(frozen=True)
class Result:
    """All logs, converted."""

    logs: tuple[Converted, ...]


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Choose the container and a file name for each log.

    Raises:
        UsageError: C02, `to` names no container.
    """
    if settings.to not in ("", "h5", "parquet", "csv"):
        raise UsageError(
            "C02",
            f"'{settings.to}' is no container",
            where="--to",
            remedy="one of h5, parquet, csv",
        )
    taken: set[str] = set()
    converted = []
    for opened in inputs.logs:
        log, ending = opened.log, settings.to or _OTHER[opened.container]
        folder, stem = "csv" if ending == "csv" else "logs", slug(opened.path.stem)
        file, number = f"{folder}/{stem}.{ending}", 1
        while file in taken:
            number += 1
            file = f"{folder}/{stem}-{number}.{ending}"
        taken.add(file)
        sizes, source = (log.n_samples, log.n_joints), opened.path.name
        converted.append(Converted(log.name, source, file, *sizes, digest_of(log), log))
    return Result(tuple(converted))


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
            words = "the log that was written is another when it is read back"
            raise InputRejected("F04", words, where=item.file, remedy="check the disk")


def report(result: Result) -> Report:
    """Return a table of sources and files."""
    caption = "Each was read back after writing and is equal to its source, sample for sample."
    if any(item.file.startswith("csv") for item in result.logs):
        caption = "Numbers are written with all their digits."
    rows = tuple((c.name, c.source, c.file, c.samples, c.joints) for c in result.logs)
    table = Table(("log", "from", "to", "samples", "joints"), rows, caption=caption)
    verdict = f"{many(len(rows), 'log')} converted."
    return Report("Convert", verdict, "good", sections=(Section("Logs", tables=(table,)),))


STAGE = Stage(
    "convert",
    "Convert logs from one container to the other",
    Settings,
    compute,
    report,
    read_logs,
    write,
    sessions="folder",
)

"""What became of one item, and the ledger that remembers it: a small file an item, so that those of shards can be laid together.

    ledger.put(record)
    ledger.get(item)                      None where nothing, or nothing readable, is known
    fresh(record, item, plan, key)        may it stand as it is? Asked of contents, never of times
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pipelines.batch.items import Item
from pipelines.batch.parts import Part, read_part
from pipelines.errors import RrridError
from pipelines.io.atomic import environment_faults
from pipelines.io.files import PROVENANCE, hash_file

__all__ = ["Ledger", "Record", "Status", "fresh", "intact", "relative"]

Status = Literal["ok", "found", "rejected", "failed"]


@dataclass(frozen=True)
class Record:
    """One item, done or not."""

    name: str
    slug: str  # of its folder
    status: Status
    exit: int  # what the stage's own command would have ended in, with --check
    error: dict[str, str] | None = None  # code, where, message, remedy
    verdict: str = ""
    robot: str = ""
    recorded: str = ""  # the earliest of its logs
    part: Part | None = None  # what its result says; None without one
    accepts: bool = False  # the diagnoses' causes are all that kept it from "ok"
    inputs: Mapping[str, str] = field(default_factory=dict)  # file, relative to the root where it lies below -> SHA-256
    logs: tuple[str, ...] = ()
    provenance: str = ""  # SHA-256 of the item's provenance.json
    key: str = ""  # of the plan
    seconds: float = 0.0
    trace: str = ""  # of an internal error
    stops: bool = False  # the output itself cannot be written: the next item would fare no better
    sessions: tuple[str, ...] = ()  # its logs are of so many robots or days, and each is an item of its own


class Ledger:
    """The records of a batch, in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, slug: str) -> Path:
        return self.folder / f"{slug}.json"

    def put(self, record: Record) -> None:
        """Write it in one step. Not flushed to the disk: what a power cut loses is done again.

        Figures keep their order, which is that of a run's stages: of one that several stages fit, the last counts.
        """
        path = self.path(record.slug)
        draft = path.with_name(f".rrrid-tmp-{path.name}"[:250])
        with environment_faults(path):
            self.folder.mkdir(parents=True, exist_ok=True)
            draft.write_text(json.dumps(dataclasses.asdict(record), indent=1) + "\n", encoding="ascii")
            os.replace(draft, path)

    def get(self, item: Item) -> Record | None:
        try:
            return read_record(json.loads(self.path(item.slug).read_text(encoding="ascii")))
        except (OSError, ValueError, KeyError, TypeError):
            return None  # never begun, or torn by a power cut

    def forget(self, slug: str) -> None:
        with environment_faults(self.folder):
            self.path(slug).unlink(missing_ok=True)


def read_record(about: dict[str, Any]) -> Record:
    """The record that was written as JSON."""
    part = None if about["part"] is None else read_part(about["part"])
    lists = {name: tuple(about[name]) for name in ("logs", "sessions")}
    return Record(**(about | {"part": part} | lists))


def relative(path: Path, root: Path) -> str:
    """`path` as a record names it."""
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else str(path)


def fresh(record: Record, item: Item, root: Path, key: str) -> bool:
    """Return whether what was recorded still holds: same logs, same bytes, same settings and code, and it ended as it should.

    What was rejected without a result is done again: the reason may have lain in the moment, and it costs little.
    """
    if record.key != key or not record.provenance or sorted(record.logs) != sorted(relative(log, root) for log in item.logs):
        return False
    try:
        return all(hash_file(root / name) == sha256 for name, sha256 in record.inputs.items())
    except RrridError:
        return False


def intact(record: Record, folder: Path) -> bool:
    """Return whether the item's folder holds exactly what was written there (P10)."""
    try:
        if hash_file(folder / PROVENANCE) != record.provenance:
            return False
        outputs: dict[str, str] = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["outputs"]
        there = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir() or path.is_symlink()}
        return there == {*outputs, PROVENANCE} and all(hash_file(folder / name) == value for name, value in outputs.items())
    except (RrridError, ValueError, KeyError, TypeError):
        return False

"""Items of a batch as they are known when they are done."""

from __future__ import annotations

from typing import Any

from pipelines.batch.parts import Part
from pipelines.batch.record import Record, Status

STD = 0.02


def item_of(name: str, status: Status = "ok", accepts: bool = False, **known: Any) -> Record:
    """An item of one robot, of which `known` is known."""
    return Record(name, name, status, int(status == "found"), part=Part(**known), accepts=accepts)

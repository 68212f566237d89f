"""Sessions of a robot as they are known when their items are done."""

from __future__ import annotations

from typing import Any

from pipelines.estimation.drift import Session

STD = 0.02


def item_of(name: str, **known: Any) -> Session:
    """An item of one robot, of which `known` is known."""
    return Session(name, **known)

"""What several tests share."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from tests.rows.commanded import command

__all__ = ["command"]

_REPO = Path(__file__).resolve().parents[1]


_FIRST = ("test_mutation.py", "test_hidden_effects.py")


def pytest_configure() -> None:
    """One processor for each worker: what shares its work out among two has the other one's in its way, and forks for nothing.
    Nobody waits for the disk: no test ends by a loss of power."""
    os.fsync = lambda handle: None
    worker = os.environ.get("PYTEST_XDIST_WORKER", "")
    if worker and hasattr(os, "sched_setaffinity"):
        there = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {there[int(worker.removeprefix("gw")) % len(there)]})


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The sealed cases early: they take minutes, in which the other workers would have nothing left to do. Before them what forks,
    for children have the memory of their worker, which the mutations bound."""
    items.sort(key=lambda item: _FIRST.index(item.path.name) if item.path.name in _FIRST else len(_FIRST))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference material beside the repository. Without it a test fails, it does not skip."""
    folder = _REPO.parent / "shared"
    assert folder.is_dir(), f"{folder} is missing: these tests compare with the reference material there"
    return folder


@pytest.fixture(scope="session")
def vectors(shared: Path) -> dict[str, Any]:
    """reference_vectors.json: what independent programs computed for the RRR arm."""
    content: dict[str, Any] = json.loads((shared / "reference" / "reference_vectors.json").read_text())
    return content


@pytest.fixture(scope="session")
def samples() -> Path:
    """The sample logs of the repository."""
    return _REPO / "sample_logs"

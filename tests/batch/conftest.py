"""What the tests of batches share."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipelines.batch import run_batch
from pipelines.executor import Plan
from pipelines.report.batch_report import Result
from pipelines.stage import Outcome, Request
from tests.batch.faulty import Settings

Lay = Callable[[Mapping[str, str]], Path]

QUIET = Request((), no_report=True)


@pytest.fixture
def lay(tmp_path: Path) -> Lay:
    """Make a root of items: name -> what its log says."""

    def make(items: Mapping[str, str]) -> Path:
        for name, words in items.items():
            (tmp_path / "root" / name).mkdir(parents=True, exist_ok=True)
            (tmp_path / "root" / name / "log.h5").write_text(words)
        return tmp_path / "root"

    return make


def obey(root: Path, factor: float = 1.0, request: Request = QUIET, check: bool = False, **wanted: Any) -> Outcome[Result]:
    """A batch of `tests.batch.faulty` on `root`, into `out` beside it where nothing else is said."""
    request = replace(request, check=check)
    return run_batch(Plan("tests.batch.faulty", Settings(factor), request, root, **{"out": root.parent / "out", **wanted}))


def statuses(outcome: Outcome[Result]) -> dict[str, str]:
    """Name -> status, and the error's code where there is one, as result.json has them."""
    stored = json.loads((outcome.folder / "result.json").read_text())
    assert stored == outcome.json
    codes = {item["name"]: (item["error"] or {}).get("code", "") for item in stored["items"]}
    return {item["name"]: f"{item['status']} {codes[item['name']]}".strip() for item in stored["items"]}


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a batch by its place, but what may differ: provenance, and the ledger's times."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and path.name != "provenance.json" and "ledger" not in path.relative_to(folder).parts}

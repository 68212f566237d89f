"""The whole workflow, diagnosis and extension included, in every way that a batch knows: the same bytes (P12).

Run by name: pytest -m slow tests/batch/test_whole_run.py
"""

from __future__ import annotations

import json
import shutil
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from pipelines import run
from pipelines.batch import run_batch
from pipelines.executor import Plan
from pipelines.stage import Request, run_stage
from tests.batch.conftest import QUIET, contents
from tests.batch.test_cluster import Cluster

SAMPLES = Path(__file__).parents[2] / "sample_logs"
FOLDERS = {
    "changed": ("rrr-changed", ("excitation-3", "excitation-4", "free-3", "free-4", "friction-1-3", "friction-2-3",
                                "friction-3-3")),
    "closed-form": ("rrr-closed-form", ("excitation-1", "excitation-2", "free-1"))}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Two folders of logs: one arm with a cause to name, one that has none."""
    for name, (folder, logs) in FOLDERS.items():
        (tmp_path / "root" / name).mkdir(parents=True)
        for log in logs:
            shutil.copy(SAMPLES / folder / f"{log}.h5", tmp_path / "root" / name)
    return tmp_path / "root"


def _batch(root: Path, name: str, **wanted: Any) -> Path:
    outcome = run_batch(Plan("pipelines.run", run.Settings(), QUIET, root, root.parent / name, **wanted))
    assert outcome.exit_code == 0
    return outcome.folder


@pytest.mark.row("P12")
@pytest.mark.slow
def test_every_way_gives_the_bytes_of_a_single_run(root: Path, tmp_path: Path) -> None:
    """P12: `rrrid run` of each folder, one process, two, a Dask cluster, four shards laid together."""
    single = {}
    for name in FOLDERS:
        outcome = run_stage(run.STAGE, Request((root / name,), tmp_path / "single" / name, no_report=True), run.Settings())
        assert outcome.json["findings"] if name == "changed" else outcome.json["stages"]
        single |= {f"items/{name}/{place}": content for place, content in contents(outcome.folder).items()}
    ways = {"one": contents(_batch(root, "one")), "two": contents(_batch(root, "two", jobs=2))}
    with ExitStack() as stack:
        cluster = Cluster(tmp_path, stack)
        ways["cluster"] = contents(_batch(root, "cluster", backend=cluster.address))
    for number in range(1, 5):
        shutil.copytree(_batch(root, f"shard{number}", shard=(number, 4)), tmp_path / "together", dirs_exist_ok=True)
    together = _batch(root, "together", resume=True)
    assert json.loads((together / "provenance.json").read_text())["kept"] == 2
    ways["four shards"] = contents(together)
    for way, found in ways.items():
        items = {place: content for place, content in found.items() if place.startswith("items/")}
        assert set(items) == set(single), way
        assert [place for place in items if items[place] != single[place]] == [], way
        assert found["result.json"] == ways["one"]["result.json"], way

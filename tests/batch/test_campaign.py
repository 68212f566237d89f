"""Long campaigns: killed at 200 random points, one bad item among 1000 (P01, P11). Run by name: pytest -m slow tests/batch."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipelines.batch import find_items, is_intact, read_ledger
from pipelines.io.output import hash_file
from tests.batch.conftest import Lay, contents, obey, statuses
from tests.batch.test_command import nobody_left
from tests.cli.commands import REPO

KILLS = 200
DRIVER = """
import sys
from pathlib import Path
from tests.batch.conftest import obey
if __name__ == "__main__":
    print("begun", flush=True)
    obey(Path(sys.argv[1]), factor=float(sys.argv[2]), resume=True, jobs=2)
    print("ended", flush=True)
"""


def _complete(folder: Path) -> None:
    """Every item's folder holds exactly what its provenance says; every record that says "done" is of such a folder."""
    for path in (folder / "items").glob("[!.]*"):
        outputs = json.loads((path / "provenance.json").read_text())["outputs"]
        files = [p for p in path.rglob("*") if p.is_file() and p.name != "provenance.json"]
        assert {p.relative_to(path).as_posix(): hash_file(p) for p in files} == outputs
    for name in ("result.json", "summary.parquet", "junit.xml", "batch.json"):
        assert not (folder / name).exists() or (folder / name).stat().st_size > 0
    if (folder / "provenance.json").exists():
        for name, sha256 in json.loads((folder / "provenance.json").read_text())["outputs"].items():
            assert hash_file(folder / name) == sha256


@pytest.mark.row("P01")
@pytest.mark.slow
def test_killed_at_200_random_points(lay: Lay, tmp_path: Path) -> None:
    """P01, P07: what is there is old or complete new, no process stays; gone on with, it ends with the bytes of a clean run."""
    root = lay({f"{i:02d}": f"value {i} std 0.1 sleep 0.02" for i in range(24)})
    items = find_items(root)[0]
    (tmp_path / "driver.py").write_text(DRIVER)
    clean = {factor: contents(obey(root, out=tmp_path / f"clean{factor}", factor=factor, jobs=2).folder) for factor in (1.0, 2.0)}
    environment = os.environ | {"PYTHONPATH": str(REPO)}
    when, factor, killed, ended, redone = random.Random(20041), 1.0, 0, 0, 0
    while killed < KILLS:
        with subprocess.Popen([sys.executable, str(tmp_path / "driver.py"), str(root), str(factor)], env=environment, text=True,
                              stdout=subprocess.PIPE, start_new_session=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "begun\n"
            time.sleep(when.uniform(0.0, 2.5))
            os.kill(process.pid, signal.SIGKILL)
            done = process.stdout.read() == "ended\n"
        killed += not done
        assert nobody_left(process.pid)
        _complete(tmp_path / "out")
        ledger = read_ledger(tmp_path / "out")
        for item in items:  # nothing is believed to be done that is not
            record = ledger.get(item.slug)
            if record is not None and not is_intact(record, tmp_path / "out/items" / item.slug):
                redone += 1
        if done:
            ended += 1
            assert contents(tmp_path / "out") == clean[factor]
            factor = 3.0 - factor
    outcome = obey(root, factor=factor, resume=True, jobs=2)
    assert outcome.exit_code == 0
    assert contents(outcome.folder) == clean[factor]
    assert not list((tmp_path / "out").rglob(".rrrid-*"))
    print(f"{killed} killed, {ended} came to their end meanwhile, {redone} items replaced before their record")


@pytest.mark.row("P11")
@pytest.mark.slow
@pytest.mark.parametrize("bad", ["crash", "reject", "sleep 60", "bug"])
def test_one_bad_among_1000(lay: Lay, tmp_path: Path, bad: str) -> None:
    """P11: exit 4, and 999 results equal to a clean run's."""
    items = {f"{i:03d}": f"value {i} std 0.1" for i in range(1000)}
    clean = contents(obey(lay(items), jobs=2, timeout=5.0, out=tmp_path / "clean").folder)
    outcome = obey(lay({"500": bad}), jobs=2, timeout=5.0)
    assert outcome.exit_code == 4
    assert [name for name, status in statuses(outcome).items() if status != "ok"] == ["500"]
    mine = {place: text for place, text in contents(outcome.folder).items() if place.startswith("items/")}
    others = {place: text for place, text in clean.items() if place.startswith("items/")}
    assert mine == {place: text for place, text in others.items() if not place.startswith("items/500/")}
    assert len({place.split("/")[1] for place in mine}) == 999

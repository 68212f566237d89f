"""One batch at a time in one folder, and no folder that is another's (P08, C05)."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines.cache import locked
from pipelines.errors import EnvironmentFault, UsageError
from tests.batch.conftest import QUIET, Lay, obey
from tests.cli.commands import REPO

HOLD = """
import sys
from pathlib import Path
from pipelines.cache import locked
with locked(Path(sys.argv[1]) / "ledger", Path(sys.argv[1])):
    print("mine", flush=True)
    sys.stdin.readline()
"""


@pytest.mark.row("P08")
def test_the_second_batch_is_told_who_has_the_folder(lay: Lay, tmp_path: Path) -> None:
    """P08: exit 6 with process and host; when that process is killed, the next batch goes on at once."""
    root = lay({"a": "fine"})
    out = obey(root).folder
    before = (out / "provenance.json").read_bytes()
    with subprocess.Popen([sys.executable, "-c", HOLD, str(out)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                          env=os.environ | {"PYTHONPATH": str(REPO)}) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "mine\n"
        with pytest.raises(EnvironmentFault) as refused:
            obey(root)
        holder.kill()
    assert (refused.value.code, refused.value.exit_code) == ("RRID-P08", 6)
    assert refused.value.message == f"locked by process {holder.pid} on {platform.node()}"
    assert (out / "provenance.json").read_bytes() == before
    assert obey(root, resume=True).exit_code == 0


def test_a_lock_that_was_left_behind_locks_nobody_out(tmp_path: Path) -> None:
    """Whatever a dead process's file says, even the number of one that lives: the kernel knows better."""
    (tmp_path / "lock").write_text(f"process {os.getppid()} on {platform.node()}")
    with locked(tmp_path, tmp_path):
        assert (tmp_path / "lock").read_text() == f"process {os.getpid()} on {platform.node()}"


@pytest.mark.row("C05")
@pytest.mark.parametrize("what", ["foreign", "other", "link", "inside"])
def test_a_folder_that_is_not_a_batchs_is_refused(lay: Lay, tmp_path: Path, what: str) -> None:
    """C05: somebody's files, another command's result, a link, a place in the input."""
    root, out = lay({"a": "fine"}), tmp_path / "out"
    if what == "foreign":
        out.mkdir()
        (out / "thesis.tex").write_text("x")
    if what == "other":
        out.mkdir()
        (out / "provenance.json").write_text(json.dumps({"tool": "rrrid", "command": "inspect", "outputs": {}}))
    if what == "link":
        (tmp_path / "there").mkdir()
        out.symlink_to(tmp_path / "there")
    with pytest.raises(UsageError) as refused:
        obey(root, out=root / "a/out" if what == "inside" else out)
    assert (refused.value.code, refused.value.exit_code) == ("RRID-C05", 2)
    assert not (root / "a/out").exists()


def test_a_batch_of_another_stage_is_refused_and_replaced_with_force(lay: Lay, tmp_path: Path) -> None:
    """C05: with a hint; with --force nothing of it is left, beyond the shard neither."""
    root = lay({"a": "value 1.0 std 0.1", "b": "fine"})
    out = obey(root).folder
    about = json.loads((out / "batch.json").read_text())
    (out / "batch.json").write_text(json.dumps(about | {"stage": "inspect"}))
    with pytest.raises(UsageError, match=r"C05.*a batch of inspect.*--force"):
        obey(root, resume=True)
    assert (out / "items/b/result.json").exists()
    obey(root, request=replace(QUIET, force=True), shard=(1, 2))
    assert [path.name for path in (out / "items").iterdir()] == ["a"]

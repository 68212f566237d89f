"""The F rows of the table of bad inputs, and D14, as a user of `rrrid inspect` meets them: exit code and code in --json."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import pyarrow.parquet as pq
import pytest

from pipelines.io.files import write_log
from tests.cli.commands import rrrid
from tests.healthy import good_log
from tests.io.logs import small_log
from tests.rows.commanded import Command


def _bytes(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        path.write_bytes(change(path.read_bytes()))

    return spoil


def _flip_sample(path: Path) -> None:
    with h5py.File(path) as file:
        at = file["signals/q"].id.get_chunk_info(0).byte_offset
    _bytes(lambda data: data[:at + 20] + bytes([data[at + 20] ^ 1]) + data[at + 21:])(path)


def _killed_writer(path: Path) -> None:
    code = ("import h5py, numpy as np, os, sys\n"
            "f = h5py.File(sys.argv[1], 'w', libver='latest'); f['x'] = np.zeros(10); f.flush()\n"
            "os.kill(os.getpid(), 9)")
    subprocess.run([sys.executable, "-c", code, path], check=False)


def _manifest(path: Path) -> None:
    (path.parent / "SHA256SUMS").write_text(f"{hashlib.sha256(b'other').hexdigest()}  {path.name}\n")


def _attribute(name: str, value: object) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        with h5py.File(path, "a") as file:
            file.attrs[name] = value

    return spoil


def _fifo(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _flip_page(path: Path) -> None:
    chunk = pq.ParquetFile(path).metadata.row_group(0).column(1)
    at = chunk.data_page_offset + chunk.total_compressed_size // 2
    _bytes(lambda data: data[:at] + bytes([data[at] ^ 1]) + data[at + 1:])(path)


ROWS: tuple[tuple[str, str, Callable[[Path], None]], ...] = (
    ("F02", ".h5", _bytes(lambda data: data[:len(data) // 2])), ("F04", ".parquet", _flip_page), ("F05", ".h5", _manifest),
)


@pytest.mark.parametrize(("row", "ending", "spoil"), ROWS, ids=[f"{row}{ending}" for row, ending, _ in ROWS])
def test_a_spoilt_file_is_exit_3_with_its_code(row: str, ending: str, spoil: Callable[[Path], None], tmp_path: Path,
                                                command: Command) -> None:
    """Beside a good log: the doctor names the bad one, looks at the good one, and ends in 3."""
    write_log(tmp_path / "logs/good.h5", good_log())
    write_log(tmp_path / f"logs/bad{ending}", small_log(name="bad"))
    spoil(tmp_path / f"logs/bad{ending}")
    done = command("inspect", "logs", "--no-report", "--out", "out")
    assert done.exit == 3, done.err
    result = done.object
    rejected = [check for check in result["checks"] if check["level"] == "reject"]
    assert [check["code"] for check in rejected] == [f"RRID-{row}"]
    assert all(check["where"].startswith(f"bad{ending}") and check["remedy"] for check in rejected)
    assert result["rejected"] == [f"bad{ending}"]
    assert [log["name"] for log in result["logs"]] == ["excitation-0"]


def test_a_pipe_as_a_log_is_exit_3_at_once(tmp_path: Path) -> None:
    """F12: named on the command line, it is refused before anything waits for it."""
    write_log(tmp_path / "a.h5", small_log())
    _fifo(tmp_path / "a.h5")
    done = rrrid("inspect", "a.h5", "--json", "--out", "out", cwd=tmp_path)
    assert done.returncode == 3
    assert json.loads(done.stdout)["error"]["code"] == "RRID-F12"


@pytest.mark.row("D14")
def test_one_recording_for_fit_and_validation(tmp_path: Path) -> None:
    """D14: the same samples as "identify" and "validate" are a leak, exit 3; --allow-overlap vouches for it."""
    write_log(tmp_path / "logs/a.h5", good_log())
    write_log(tmp_path / "logs/b.h5", replace(good_log(), role="validate", name="other"))
    for options, exit_code, codes in (((), 3, {"RRID-D14"}), (("--allow-overlap",), 0, set())):
        done = rrrid("inspect", "logs", "--json", "--no-report", "--out", "out", *options, cwd=tmp_path)
        assert done.returncode == exit_code, done.stderr
        assert {c["code"] for c in json.loads(done.stdout)["checks"] if c["level"] == "reject"} == codes

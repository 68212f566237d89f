"""The F rows of the table of bad inputs, and D14, as a user of `rrrid inspect` meets them: exit code and code in --json."""

from __future__ import annotations

import hashlib
import json
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


def _flip_page(path: Path) -> None:
    chunk = pq.ParquetFile(path).metadata.row_group(0).column(1)
    at = chunk.data_page_offset + chunk.total_compressed_size // 2
    _bytes(lambda data: data[:at] + bytes([data[at] ^ 1]) + data[at + 1:])(path)


@pytest.mark.row("D14")
def test_one_recording_for_fit_and_validation(tmp_path: Path) -> None:
    """D14: the same samples as "identify" and "validate" are a leak, exit 3; --allow-overlap vouches for it."""
    write_log(tmp_path / "logs/a.h5", good_log())
    write_log(tmp_path / "logs/b.h5", replace(good_log(), role="validate", name="other"))
    for options, exit_code, codes in (((), 3, {"RRID-D14"}), (("--allow-overlap",), 0, set())):
        done = rrrid("inspect", "logs", "--json", "--no-report", "--out", "out", *options, cwd=tmp_path)
        assert done.returncode == exit_code, done.stderr
        assert {c["code"] for c in json.loads(done.stdout)["checks"] if c["level"] == "reject"} == codes

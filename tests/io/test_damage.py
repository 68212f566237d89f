"""Damage is noticed: flipped bytes, cut files, killed writers. Never other numbers without an error."""

from __future__ import annotations

import os
import signal
import time
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.io.files import find_logs, open_log, write_log
from pipelines.io.log import ExperimentLog
from tests.io.logs import small_log

# Whole campaigns are slow; CI takes a part of each.
FLIPS = [8, pytest.param(1000, marks=pytest.mark.slow)]
KILLS = [5, pytest.param(100, marks=pytest.mark.slow)]


def _data_ranges(path: Path) -> list[tuple[int, int]]:
    """Where the stored samples lie in the file: (offset, size) of every chunk."""
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            signals = [dataset.id for dataset in file["signals"].values()]
            chunks = [signal.get_chunk_info(i) for signal in signals for i in range(signal.get_num_chunks())]
        return [(chunk.byte_offset, chunk.size) for chunk in chunks]
    footer = int.from_bytes(path.read_bytes()[-8:-4], "little") + 8
    return [(4, path.stat().st_size - footer - 4)]


def _places(path: Path, flips: int, rng: np.random.Generator) -> list[int]:
    """Half of the flips in samples, half in metadata."""
    size = path.stat().st_size
    in_data = np.zeros(size, dtype=bool)
    for offset, length in _data_ranges(path):
        in_data[offset:offset + length] = True
    data, metadata = np.flatnonzero(in_data), np.flatnonzero(~in_data)
    return [int(i) for i in (*rng.choice(data, flips // 2), *rng.choice(metadata, flips // 2))]


@pytest.mark.parametrize("flips", FLIPS)
@pytest.mark.parametrize("ending", [".h5", ".parquet"])
def test_a_flipped_byte_never_gives_another_log(tmp_path: Path, ending: str, flips: int) -> None:
    """Of many single-byte flips, half in metadata, each is an error or changes nothing at all."""
    log, rng = small_log(samples=400), np.random.default_rng(20)
    path = tmp_path / f"a{ending}"
    write_log(path, log)
    good = path.read_bytes()
    noticed = harmless = 0
    for place in _places(path, flips, rng):
        bad = bytearray(good)
        bad[place] ^= int(rng.integers(1, 256))
        path.write_bytes(bad)
        try:
            found = open_log(path).log
        except InputRejected:
            noticed += 1
            continue
        assert found == log, f"byte {place} of {len(good)} changed the log unnoticed"
        harmless += 1
    assert noticed + harmless == flips
    # Every flip in the samples themselves must be noticed: without checksums this count would fall by half.
    assert noticed >= flips // 2


def _write_for_ever(path: Path, logs: tuple[ExperimentLog, ExperimentLog]) -> int:
    """A child that replaces the log without end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # a fork beside threads: this child leaves by the kill
        child = os.fork()
    if child == 0:
        while True:
            for log in logs:
                write_log(path, log)
    return child


@pytest.mark.row("P01")
@pytest.mark.parametrize("kills", KILLS)
@pytest.mark.parametrize("ending", [".h5", ".parquet"])
def test_a_killed_writer_leaves_the_old_log_or_the_new_one(tmp_path: Path, ending: str, kills: int) -> None:
    """P01: SIGKILL at random points of writing: the old log or the new one, nothing else."""
    path, rng = tmp_path / f"a{ending}", np.random.default_rng(5)
    old, new = small_log(samples=8000), small_log(samples=8000, name="new")
    write_log(path, old)
    seen, drafts = [], 0
    for k in range(kills):
        both = (new, old) if k % 2 == 0 else (old, new)
        first, child = path.stat().st_ino, _write_for_ever(path, both)
        while path.stat().st_ino == first:  # until it has written one of them
            time.sleep(1e-4)
        while len(list(tmp_path.iterdir())) == 1:
            time.sleep(1e-4)
        time.sleep(float(rng.uniform(0.0, 0.01)))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        found = open_log(path).log
        assert found in (old, new)
        seen.append(found.name)
        drafts += any(p != path for p in tmp_path.iterdir())
    assert min(seen.count("small"), seen.count("new")) >= kills // 10
    assert drafts >= kills // 10, "no kill hit a write: the test proves nothing"
    assert find_logs([tmp_path])[0] == (path,), "a draft must never be taken for a log"
    write_log(path, old)
    assert list(tmp_path.iterdir()) == [path], "the next writer sweeps up what the killed ones left"

"""Damage is noticed: flipped bytes, cut files, killed writers. Never other numbers without an error."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

from pipelines.errors import EnvironmentFault, InputRejected, RrridError
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


@pytest.mark.parametrize("ending", [".h5", ".parquet"])
def test_any_prefix_of_a_log_is_truncated(tmp_path: Path, ending: str) -> None:
    """F01, F02, F07: cut anywhere, a log is refused, and where it is cut is said where the container knows."""
    path = tmp_path / f"a{ending}"
    write_log(path, small_log(samples=400))
    good = path.read_bytes()
    for size in {0, 1, 7, 100, *np.linspace(1, len(good) - 1, 15, dtype=int).tolist()}:
        path.write_bytes(good[:size])
        with pytest.raises(InputRejected) as caught:
            open_log(path)
        magic = 8 if ending == ".h5" else 4
        code = "F01" if size == 0 else "F06" if size < magic else "F02" if ending == ".h5" else "F07"
        assert caught.value.code == f"RRID-{code}", size
        assert caught.value.remedy
    if ending == ".h5":
        path.write_bytes(good[:len(good) // 2])
        with pytest.raises(InputRejected, match=f"truncated: {len(good) // 2} of {len(good)} bytes"):
            open_log(path)


@pytest.mark.parametrize("ending", [".h5", ".parquet"])
def test_a_flipped_byte_of_the_samples_is_a_checksum_mismatch(tmp_path: Path, ending: str) -> None:
    """F04, whichever sample it hits; in HDF5 with the signal's name."""
    path, rng = tmp_path / f"a{ending}", np.random.default_rng(4)
    write_log(path, small_log(samples=400))
    good = path.read_bytes()
    for offset, length in _data_ranges(path):
        bad = bytearray(good)
        bad[offset + int(rng.integers(length))] ^= 0x10
        path.write_bytes(bad)
        with pytest.raises(InputRejected) as caught:
            open_log(path)
        assert caught.value.code == "RRID-F04"
        assert "/signals/" in caught.value.where or ending == ".parquet"


@pytest.mark.parametrize("options", ["libver='latest'", ""])
def test_a_killed_hdf5_writer_leaves_a_file_that_is_named_so(tmp_path: Path, options: str) -> None:
    """F03: another program's writer was killed before it had flushed; the message says so and what to try."""
    path = tmp_path / "a.h5"
    flushed = "f.flush(); " if options else ""  # older formats are whole once flushed, newer ones are marked as open
    code = ("import h5py, numpy as np, os, signal, sys\n"
            f"f = h5py.File(sys.argv[1], 'w', {options}); f['x'] = np.zeros(10); {flushed}"
            "f.create_dataset('y', data=np.arange(100000.0)); os.kill(os.getpid(), signal.SIGKILL)")
    subprocess.run([sys.executable, "-c", code, path], check=False)
    with pytest.raises(InputRejected, match="RRID-F03 .*not closed properly.*h5clear -s"):
        open_log(path)


def test_a_log_being_written_is_in_use(tmp_path: Path) -> None:
    """F15: exit 6 at once, while another process holds the file open for writing."""
    path = tmp_path / "a.h5"
    code = ("import h5py, sys, time\n"
            "f = h5py.File(sys.argv[1], 'w', locking=True); f.attrs['a'] = 1; f.flush(); print('open', flush=True); time.sleep(60)")
    writer = subprocess.Popen([sys.executable, "-c", code, path], stdout=subprocess.PIPE)
    try:
        assert writer.stdout is not None
        writer.stdout.readline()
        began = time.monotonic()
        with pytest.raises(EnvironmentFault, match=r"RRID-F15 .*in use by another process") as caught:
            open_log(path)
        assert caught.value.exit_code == 6
        assert time.monotonic() - began < 10
    finally:
        writer.kill()
        writer.communicate()


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


@pytest.mark.row("P02")
def test_a_failing_write_leaves_no_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """P02: the disk is full in the middle of writing: exit 6, the old log stands, nothing partial lies about."""
    path = tmp_path / "a.h5"
    write_log(path, small_log())

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(EnvironmentFault, match=r"RRID-P02 .*no space left") as caught:
        write_log(path, small_log(name="new"))
    assert caught.value.exit_code == 6
    monkeypatch.undo()
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]
    assert open_log(path).log == small_log()


@pytest.mark.parametrize("ending", [".h5", ".parquet"])
def test_arbitrary_bytes_are_refused(tmp_path: Path, ending: str) -> None:
    """Whatever stands behind the magic bytes, the answer is an error of ours."""
    rng = np.random.default_rng(3)
    path = tmp_path / f"a{ending}"
    magic = b"\x89HDF\r\n\x1a\n" if ending == ".h5" else b"PAR1"
    for size in (1, 30, 200, 5000):
        path.write_bytes(magic + rng.bytes(size) + magic[:4])
        with pytest.raises(RrridError) as caught:
            open_log(path)
        assert caught.value.exit_code == 3

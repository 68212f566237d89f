"""Chunks that rrrid packs itself: HDF5 unpacks them, checks them, and they are no larger than its own."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from pipelines.io.chunks import fletcher32, packed, store

FILTERS = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}


def _signals(samples: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng([11, samples])
    t = 1e-3 * np.arange(samples)
    return {"clock": t, "encoder": 1e-5 * np.rint(1e5 * np.sin(t)), "noise": rng.standard_normal(samples),
            "constant": np.full(samples, 0.1), "zero": np.zeros(samples), "smooth": np.exp(np.sin(t)),
            "period": np.tile(rng.standard_normal(-(-samples // 4)), 4)[:samples],
            "odd": np.where(rng.random(samples) < 0.1, np.nan, np.inf)}


@pytest.mark.parametrize("samples", [1, 2, 3, 1000, 65536])
def test_hdf5_reads_what_was_packed(tmp_path: Path, samples: int) -> None:
    """Bit for bit, through its own shuffle, deflate and checksum, whatever the signal."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, column in _signals(samples).items():
            dataset = file.create_dataset(name, shape=(samples,), dtype="<f8", chunks=(samples,), **FILTERS)
            dataset.id.write_direct_chunk((0,), packed(column))
    with h5py.File(tmp_path / "a.h5") as file:
        for name, column in _signals(samples).items():
            assert file[name][()].tobytes() == column.tobytes()


def test_a_flipped_bit_is_noticed(tmp_path: Path) -> None:
    """In deflated and in stored bytes alike."""
    column = _signals(4000)["smooth"]
    whole = packed(column)
    for place in np.linspace(0, len(whole) - 1, 40).astype(int):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            dataset = file.create_dataset("x", shape=column.shape, dtype="<f8", chunks=column.shape, **FILTERS)
            dataset.id.write_direct_chunk((0,), whole[:place] + bytes([whole[place] ^ 16]) + whole[place + 1:])
            with pytest.raises(OSError, match=r"checksum|filter"):
                dataset[()]


def test_the_checksum_is_hdf5s(tmp_path: Path) -> None:
    """Of even and odd numbers of bytes, of zeros and of the sums at which its carry turns over."""
    rng = np.random.default_rng(12)
    data = [rng.integers(0, 256, size, dtype=np.uint8) for size in (1, 2, 7, 720, 721, 100001)]
    data += [np.zeros(6, np.uint8), np.full(2, 255, np.uint8), np.full(3000, 255, np.uint8)]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k, values in enumerate(data):
            dataset = file.create_dataset(str(k), data=values, chunks=values.shape, fletcher32=True)
            file.flush()
            _, stored = dataset.id.read_direct_chunk((0,))
            assert fletcher32(stored[:-4]) == int.from_bytes(stored[-4:], "little")


def test_packed_is_as_small(tmp_path: Path) -> None:
    """Within 4 % of what HDF5 makes of the same signal: stored digits of noise cost nothing."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, column in _signals(20000).items():
            theirs = file.create_dataset(name, data=column, chunks=column.shape, **FILTERS).id.get_storage_size()
            assert len(packed(column)) < 1.04 * theirs + 40, name


@pytest.mark.parametrize(("shape", "chunk"), [((10,), (10,)), ((10,), (4,)), ((70000, 2), (65536, 1)), ((7, 5, 3), (2, 5, 3)),
                                              ((5, 4), (3, 3))])
def test_every_chunk_finds_its_place(tmp_path: Path, shape: tuple[int, ...], chunk: tuple[int, ...]) -> None:
    """Chunks that do not divide the array, of any number of dimensions, of arrays in either order of memory."""
    values = np.random.default_rng(13).standard_normal(shape)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        store(file, "c", values, chunk)
        store(file, "fortran", np.asfortranarray(values), chunk)
    with h5py.File(tmp_path / "a.h5") as file:
        assert np.array_equal(file["c"][()], values)
        assert np.array_equal(file["fortran"][()], values)
        assert (file["c"].chunks, file["c"].shuffle, file["c"].fletcher32, file["c"].compression_opts) == (chunk, True, True, 1)

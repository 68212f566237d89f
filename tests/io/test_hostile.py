"""Files made to mislead: nothing they point at is opened, nothing they declare is allocated, nothing they hold is run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipelines.errors import InputRejected
from pipelines.io.files import open_log, write_log
from tests.io.logs import small_log


def _edited(tmp_path: Path, edit: Callable[[h5py.File], None]) -> Path:
    path = tmp_path / "a.h5"
    write_log(path, small_log())
    with h5py.File(path, "a") as file:
        del file.attrs["digest"]  # or every edit would be found by it, and nothing else would be tested
        edit(file)
    return path


def _replace_q(file: h5py.File, put: Callable[[h5py.Group], object]) -> None:
    del file["signals/q"]
    put(file["signals"])
    if "q" in file["signals"] and file["signals"].get("q", getlink=True).__class__ is h5py.HardLink:
        file["signals/q"].attrs["units"], file["signals/q"].attrs["long_name"] = "rad", "position"


def _foreign_filter(group: h5py.Group) -> None:
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((2000, 3))
    properties.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, ())
    space = h5py.h5s.create_simple((2000, 3))
    h5py.h5d.create(group.id, b"q", h5py.h5t.IEEE_F64LE, space, properties)


def test_hostile_json_in_parquet(tmp_path: Path) -> None:
    """Deep nesting, wrong kinds and repeated columns in Parquet are errors of ours."""
    path = tmp_path / "a.parquet"
    write_log(path, small_log())
    good = pq.read_table(path)
    about = json.loads(good.schema.metadata[b"rrrid"])
    for text in ("[" * 100_000, "[]", "null", json.dumps(about | {"controller": 3}), json.dumps(about | {"sample_time": "soon"}),
                 json.dumps(about | {"robot": "["}), json.dumps(about | {"joint": 1e400})):
        pq.write_table(good.replace_schema_metadata({b"rrrid": text.encode()}), path)
        with pytest.raises(InputRejected):
            open_log(path)
    twice = pa.table([good.column("t"), good.column("q_1"), good.column("q_1")], names=["t", "q_1", "q_1"])
    pq.write_table(twice.replace_schema_metadata(good.schema.metadata), path)
    with pytest.raises(InputRejected, match="RRID-S03 .*two columns are called 'q_1'"):
        open_log(path)

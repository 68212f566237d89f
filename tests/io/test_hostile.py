"""Files made to mislead: nothing they point at is opened, nothing they declare is allocated, nothing they hold is run."""

from __future__ import annotations

import json
import os
import pickle
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
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


def _refused(path: Path, code: str, words: str) -> None:
    began = time.monotonic()
    with pytest.raises(InputRejected, match=f"RRID-{code} .*{words}") as caught:
        open_log(path)
    assert caught.value.exit_code == 3
    assert str(path) in caught.value.where
    assert time.monotonic() - began < 2.0


def _replace_q(file: h5py.File, put: Callable[[h5py.Group], object]) -> None:
    del file["signals/q"]
    put(file["signals"])
    if "q" in file["signals"] and file["signals"].get("q", getlink=True).__class__ is h5py.HardLink:
        file["signals/q"].attrs["units"], file["signals/q"].attrs["long_name"] = "rad", "position"


def test_an_external_link_is_refused(tmp_path: Path) -> None:
    """X01: a link to another file is not followed, though the file is there and fits."""
    write_log(tmp_path / "secret.h5", small_log())
    path = _edited(tmp_path, lambda f: _replace_q(f, lambda g: g.__setitem__("q", h5py.ExternalLink("secret.h5", "/signals/q"))))
    _refused(path, "X01", "external link 'q'")


def test_external_raw_storage_is_never_opened(tmp_path: Path) -> None:
    """X02: a data set that stores its bytes in another file. That file is a FIFO: opening it would hang."""
    os.mkfifo(tmp_path / "pipe")
    path = _edited(tmp_path, lambda f: _replace_q(f, lambda g: g.create_dataset(
        "q", (2000, 3), "f8", external=[(str(tmp_path / "pipe"), 0, 48000)])))
    _refused(path, "X02", "external raw storage")


def test_virtual_data_do_not_read_as_zeros(tmp_path: Path) -> None:
    """X03: the source of a virtual data set is missing; HDF5 alone would answer with zeros."""
    layout = h5py.VirtualLayout((2000, 3), "f8")
    layout[:] = h5py.VirtualSource("missing.h5", "q", (2000, 3))
    path = _edited(tmp_path, lambda f: _replace_q(f, lambda g: g.create_virtual_dataset("q", layout)))
    _refused(path, "X03", "virtual data")


def test_soft_links_and_strange_members_are_refused(tmp_path: Path) -> None:
    """X04: a soft-link loop, and groups the format does not have."""
    path = _edited(tmp_path, lambda f: _replace_q(f, lambda g: g.__setitem__("q", h5py.SoftLink("/signals/q"))))
    _refused(path, "X04", "soft link 'q'")
    _refused(_edited(tmp_path, lambda f: f.create_group("/".join("d" * 500))), "X04", "group 'd' is not in format")


class _Bomb:
    def __reduce__(self) -> tuple[object, ...]:
        return os.system, ("touch /tmp/rrrid-was-here",)


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    """X07: a pickle under a log's name, and bytes of one inside an attribute, run nothing."""
    path = tmp_path / "a.h5"
    path.write_bytes(pickle.dumps(_Bomb()))
    _refused(path, "F06", "neither HDF5 nor Parquet")
    path = _edited(tmp_path, lambda f: f.attrs.__setitem__("name", np.void(pickle.dumps(_Bomb()))))
    _refused(path, "S12", "neither text nor number")
    assert not Path("/tmp/rrrid-was-here").exists()


@pytest.mark.parametrize(("values", "words"), [
    (np.array([[b"a"] * 3] * 2000), "type"), (np.zeros((2000, 3), complex), "complex"),
    (np.full((2000, 3), 2**60), "beyond 2"), (np.zeros((2000, 3), "f2,f2"), "type"),
])
def test_types_that_are_not_samples_are_refused(tmp_path: Path, values: np.ndarray, words: str) -> None:
    """S12: text, complex, compound numbers, and integers that float64 cannot hold."""
    _refused(_edited(tmp_path, lambda f: _replace_q(f, lambda g: g.create_dataset("q", data=values))), "S12", words)


def test_a_missing_filter_is_named(tmp_path: Path) -> None:
    """F10: data compressed by a plug-in that is not installed: which one, and what to install."""
    path = _edited(tmp_path, lambda f: _replace_q(f, lambda g: _foreign_filter(g)))
    _refused(path, "F10", "HDF5 filter 32015 .*hdf5plugin")


def _foreign_filter(group: h5py.Group) -> None:
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((2000, 3))
    properties.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, ())
    space = h5py.h5s.create_simple((2000, 3))
    h5py.h5d.create(group.id, b"q", h5py.h5t.IEEE_F64LE, space, properties)


def test_not_regular_files_are_refused_without_a_hang(tmp_path: Path) -> None:
    """F12: a FIFO nobody writes to, a device that never ends, a folder."""
    os.mkfifo(tmp_path / "pipe.h5")
    for path in (tmp_path / "pipe.h5", Path("/dev/zero"), tmp_path):
        _refused(path, "F12", "not a regular file")


def test_a_log_under_a_wrong_name_is_read_by_its_content(tmp_path: Path) -> None:
    """F06: Parquet called .h5 is read, with a word."""
    write_log(tmp_path / "a.parquet", small_log())
    (tmp_path / "a.parquet").rename(tmp_path / "a.h5")
    opened = open_log(tmp_path / "a.h5")
    assert opened.log == small_log()
    assert [(c.code, c.level) for c in opened.checks] == [("RRID-F06", "warn")]


def test_control_characters_never_reach_a_message(tmp_path: Path) -> None:
    """X09: an escape sequence in an attribute's name is taken out of the error."""
    path = _edited(tmp_path, lambda f: f.attrs.__setitem__("\x1b]0;owned\x07[/bold]$a_{", 1))
    with pytest.raises(InputRejected) as caught:
        open_log(path)
    assert "\x1b" not in str(caught.value)
    assert "[/bold]$a_{" in str(caught.value)


def test_wrong_structure_is_named(tmp_path: Path) -> None:
    """S01, S02, S05, S06, S11, S04: what is missing, turned round or in another unit is said with its place."""
    for edit, code, words in (
        (lambda f: f["signals"].move("tau", "tua"), "S01", "signal tau missing, did you mean 'tua'"),
        (lambda f: f.__delitem__("robot"), "S01", "robot"),
        (lambda f: f.attrs.__delitem__("role"), "S01", "'role' is missing"),
        (lambda f: f.attrs.__setitem__("role", "test"), "S20", "identify, validate, reference"),
        (lambda f: f.attrs.__setitem__("perjod", 1.0), "S19", "'perjod' is not in format version 1, did you mean 'period'"),
        (lambda f: f["signals/tau"].attrs.__setitem__("units", "V"), "S05", "unknown unit 'V'; torque needs one of N m"),
        (lambda f: f["signals/tau"].attrs.__setitem__("units", "rad"), "S05", "unit of position"),
        (lambda f: f["signals/q"].attrs.__setitem__("units", ""), "S04", "no units.*assume-units"),
        (lambda f: _replace_q(f, lambda g: g.create_dataset("q", data=np.zeros((2000, 6)))), "S02", "6 columns for a robot of 3"),
        (lambda f: _replace_q(f, lambda g: g.create_dataset("q", data=np.zeros((7, 9)))), "S11", r"\(7, 9\)"),
    ):
        _refused(_edited(tmp_path, edit), code, words)


def test_degrees_and_turned_arrays_are_read_right(tmp_path: Path) -> None:
    """S06, S11: declared degrees are converted, an array stored (joints, samples) is turned; both are said."""
    log = small_log(controller=None)

    def edit(file: h5py.File) -> None:
        del file.attrs["digest"]
        _replace_q(file, lambda g: g.create_dataset("q", data=np.rad2deg(log.q).T))
        file["signals/q"].attrs["units"] = "deg"

    path = tmp_path / "a.h5"
    write_log(path, log)
    with h5py.File(path, "a") as file:
        edit(file)
    opened = open_log(path)
    np.testing.assert_allclose(opened.log.q, log.q, rtol=1e-15)
    assert opened.log.signals["q"].units == "rad"
    assert {c.code for c in opened.checks} == {"RRID-F05", "RRID-S06", "RRID-S11"}


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

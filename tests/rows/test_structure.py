"""Rows S of a log's own structure: what is missing, of another unit, turned round. Each through a command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipelines.io.files import open_log, write_log
from tests.io.logs import small_log
from tests.io.test_hostile import _replace_q
from tests.rows.commanded import Command

row = pytest.mark.row
Edit = Callable[[h5py.File], object]


def _put(values: np.ndarray) -> Edit:
    return lambda file: _replace_q(file, lambda group: group.create_dataset("q", data=values))


def _edited(tmp_path: Path, edit: Edit) -> None:
    """a.h5, changed, without the digest that would notice any change."""
    write_log(tmp_path / "a.h5", small_log(controller=None))
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file.attrs["digest"]
        edit(file)


CASES: dict[str, tuple[str, Edit, str, str]] = {
    "signal missing": ("S01", lambda f: f["signals"].move("tau", "tua"), "a.h5", "tau missing, did you mean 'tua'"),
    "robot missing": ("S01", lambda f: f.__delitem__("robot"), "a.h5", "robot"),
    "six joints": ("S02", _put(np.zeros((2000, 6))), "a.h5", "6 columns for a robot of 3 joints"),
    "no units": ("S04", lambda f: f["signals/q"].attrs.__setitem__("units", ""), "signal q", "--assume-units"),
    "volts": ("S05", lambda f: f["signals/tau"].attrs.__setitem__("units", "V"), "signal tau", "torque needs one of N m"),
    "an angle for a torque": ("S05", lambda f: f["signals/tau"].attrs.__setitem__("units", "rad"), "signal tau", "position"),
    "neither side is time": ("S11", _put(np.zeros((7, 9))), "q", "(7, 9)"),
    "text": ("S12", _put(np.array([[b"a"] * 3] * 2000)), "/signals/q", "not real numbers"),
    "complex": ("S12", _put(np.zeros((2000, 3), complex)), "/signals/q", "complex"),
    "too large an integer": ("S12", _put(np.full((2000, 3), 2**60)), "/signals/q", "2^53"),
}


@pytest.mark.parametrize("name", [pytest.param(name, marks=row(case[0])) for name, case in CASES.items()])
def test_a_log_of_another_structure_is_refused(name: str, command: Command, tmp_path: Path) -> None:
    code, edit, where, says = CASES[name]
    _edited(tmp_path, edit)
    done = command("convert", "a.h5", "--out", "out")
    done.refused(code, 3, where, says)
    assert "--joints" in done.error["remedy"] or code != "S02"
    assert not (tmp_path / "out").exists()


@row("S03")
def test_two_columns_of_one_name_are_named(command: Command, tmp_path: Path) -> None:
    write_log(tmp_path / "a.parquet", small_log())
    good = pq.read_table(tmp_path / "a.parquet")
    twice = pa.table([good.column("t"), good.column("q_1"), good.column("q_1")], names=["t", "q_1", "q_1"])
    pq.write_table(twice.replace_schema_metadata(good.schema.metadata), tmp_path / "a.parquet")
    command("convert", "a.parquet").refused("S03", 3, "a.parquet", "two columns are called 'q_1'")


@row("S04")
def test_units_that_are_assumed_are_recorded(command: Command, tmp_path: Path) -> None:
    _edited(tmp_path, lambda f: f["signals/q"].attrs.__setitem__("units", ""))
    done = command("inspect", "a.h5", "--assume-units", "--no-report", "--out", "out")
    assert [(c["level"], "signal q" in c["where"]) for c in done.told("S04")] == [("warn", True)]
    assert '"assume_units": true' in (tmp_path / "out/provenance.json").read_text()


@row("S06", "S11")
def test_degrees_and_a_turned_array_are_mended_and_recorded(command: Command, tmp_path: Path) -> None:
    log = small_log(controller=None)

    def edit(file: h5py.File) -> None:
        _replace_q(file, lambda group: group.create_dataset("q", data=np.rad2deg(log.q).T))
        file["signals/q"].attrs["units"] = "deg"

    _edited(tmp_path, edit)
    done = command("convert", "a.h5", "--out", "out", as_json=False)
    assert done.exit == 0
    assert "RRID-S06 a.h5" in done.out + done.err
    assert "RRID-S11 a.h5" in done.out + done.err
    np.testing.assert_allclose(open_log(tmp_path / "out/logs/a.parquet").log.q, log.q, rtol=1e-15)
    looked = command("inspect", "a.h5", "--no-report", "--out", "looked")
    for code in ("S06", "S11"):
        (check,) = looked.told(code)
        assert check["where"].startswith("a.h5")
        assert check["message"]

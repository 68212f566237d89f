"""Convert: the same log in the other container, and a flat table that loses no digit."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipelines import convert
from pipelines.io.files import open_log, write_log
from pipelines.io.parquet import csv_cell
from pipelines.stage import Request, run_stage
from tests.io.logs import random_log, small_log


def _convert(path: Path, out: Path, to: str = "") -> Path:
    return run_stage(convert.STAGE, Request((path,), out=out), convert.Settings(to)).folder


def test_there_and_back_gives_the_same_bytes(tmp_path: Path) -> None:
    """A folder converted twice holds the files it began with, to the byte."""
    rng = np.random.default_rng(1)
    for i in range(5):
        write_log(tmp_path / f"in/log {i}.h5", random_log(rng))
    back = _convert(_convert(tmp_path / "in", tmp_path / "p"), tmp_path / "h")
    for i in range(5):
        (twin,) = (p for p in (back / "logs").iterdir() if p.read_bytes() == (tmp_path / f"in/log {i}.h5").read_bytes())
        assert open_log(twin).log == open_log(tmp_path / f"in/log {i}.h5").log


def test_csv_keeps_every_digit(tmp_path: Path) -> None:
    """Reading the CSV back gives the same float64 numbers; the header names signal, joint and unit."""
    log = small_log()
    write_log(tmp_path / "in/a.h5", log)
    path = _convert(tmp_path / "in", tmp_path / "out", "csv") / "csv/a.csv"
    header = path.read_text().splitlines()[0].split(",")
    assert header[:3] == ["t [s]", "q_1 [rad]", "q_2 [rad]"]
    numbers = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.array_equal(numbers[:, 1:4], log.q)
    assert np.array_equal(numbers[:, 4:7], log.tau)


def test_two_logs_of_one_name_both_survive(tmp_path: Path) -> None:
    """Same file name in two folders: two files come out."""
    for i, folder in enumerate(("monday", "friday")):
        write_log(tmp_path / f"in/{folder}/a.h5", small_log(seed=i))
    out = _convert(tmp_path / "in", tmp_path / "out")
    assert sorted(path.name for path in (out / "logs").iterdir()) == ["a-2.parquet", "a.parquet"]


def test_a_cell_is_no_formula() -> None:
    """X10: text that a spreadsheet would run is quoted; plain text stays plain."""
    assert csv_cell("=cmd|' /C calc'!A0").startswith("\"'=")
    assert csv_cell("@x") == "\"'@x\""
    assert csv_cell("q_1 [rad]") == "q_1 [rad]"

"""Every S, T and D row of the table of bad inputs that `inspect` can meet, each from one good log, through the command."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipelines.io.files import write_log
from tests.fault_table import FAULTS, Fault
from tests.healthy import good_log
from tests.rows.commanded import Command

_FIRST = {fault.code: fault for fault in reversed(FAULTS)}  # of every row the first case


def _marks(fault: Fault) -> list[pytest.MarkDecorator]:
    """Its row; further cases of a row are run by name."""
    return [pytest.mark.row(fault.row[:3]), *([] if fault is _FIRST[fault.code] else [pytest.mark.slow])]


@pytest.mark.parametrize("fault", [pytest.param(f, marks=_marks(f), id=f.row.replace(" ", "-")) for f in FAULTS])
def test_every_fault_is_named_placed_and_answered(fault: Fault, tmp_path: Path, command: Command) -> None:
    """Code, level, place, a number or a word of what is wrong, a remedy, the exit code; and nothing else is claimed.

    Of warnings the exit code is that of --check.
    """
    write_log(tmp_path / "log.h5", fault.make(good_log()))
    asked = ("--check",) if fault is _FIRST[fault.code] and fault.level == "warn" else ()
    done = command("inspect", "log.h5", "--no-report", "--out", "out", *asked)
    found = [c for c in done.object["checks"] if c["level"] != "ok"]
    assert done.exit == (3 if fault.level == "reject" else int(bool(asked) and any(c["gate"] for c in found))), done.err
    mine = done.told(fault.code.removeprefix("RRID-"))
    assert mine, f"not found; found were {found}"
    assert all(c["level"] == fault.level for c in mine)
    assert any(part in c["message"] for c in mine for part in fault.says.split("|")), mine
    assert all(c["where"].startswith("log.h5") and c["remedy"] for c in mine)
    assert any(fault.where in c["where"] for c in mine), mine
    if fault.gate is not None:
        assert any(c["gate"] == fault.gate for c in mine), mine
    assert {c["code"] for c in found} <= {fault.code, *fault.also}
    if fault is _FIRST[fault.code] and fault.level == "repair":
        command("inspect", "log.h5", "--no-report", "--out", "out", "--strict").refused(fault.code[-3:], 3, "log.h5")


def test_the_good_log_itself_is_in_order(tmp_path: Path, command: Command) -> None:
    write_log(tmp_path / "log.h5", good_log())
    done = command("inspect", "log.h5", "--no-report", "--out", "out", "--check", "--strict")
    assert (done.exit, {c["level"] for c in done.object["checks"]}) == (0, {"ok"})


@pytest.mark.parametrize(("signal", "unit"), [("tau", "N mm"), ("q", "deg")])
def test_the_repair_that_is_named_is_one(signal: str, unit: str, tmp_path: Path, command: Command) -> None:
    """S05, S07: with the unit written to the file, and without the digest, the log is in order."""
    fault = next(f for f in FAULTS if f.row == {"tau": "S05", "q": "S07"}[signal])
    write_log(tmp_path / "log.h5", fault.make(good_log()))
    with h5py.File(tmp_path / "log.h5", "r+") as file:
        file[f"signals/{signal}"].attrs["units"] = unit
        del file.attrs["digest"]
    done = command("inspect", "log.h5", "--no-report", "--out", "out")
    assert done.exit == 0
    assert {c["code"] for c in done.object["checks"] if c["level"] != "ok"} == {"RRID-F05", "RRID-S06"}


def test_the_repair_of_a_parquet_log_is_one(tmp_path: Path, command: Command) -> None:
    """S05: with the unit written to the columns, and without the digest, the log is in order."""
    fault = next(f for f in FAULTS if f.row == "S05")
    write_log(tmp_path / "log.parquet", fault.make(good_log()))
    refused = command("inspect", "log.parquet", "--no-report", "--out", "out")
    assert any("tau_1, tau_2, … (Parquet)" in check["remedy"] for check in refused.told("S05"))
    table = pq.read_table(tmp_path / "log.parquet")
    about = json.loads(table.schema.metadata[b"rrrid"])
    del about["digest"]
    columns = [field.with_metadata({**field.metadata, b"units": b"N mm"}) if field.name.startswith("tau_") else field
               for field in table.schema]
    pq.write_table(table.cast(pa.schema(columns, {b"rrrid": json.dumps(about).encode()})), tmp_path / "log.parquet")
    done = command("inspect", "log.parquet", "--no-report", "--out", "out")
    assert done.exit == 0
    assert {c["code"] for c in done.object["checks"] if c["level"] != "ok"} == {"RRID-F05", "RRID-S06"}


def test_trusted_units_are_not_doubted(tmp_path: Path, command: Command) -> None:
    """--trust-units: whoever says that 90 is 90 rad is believed; what follows from it is then said."""
    fault = next(f for f in FAULTS if f.row == "S07")
    write_log(tmp_path / "log.h5", fault.make(good_log()))
    done = command("inspect", "log.h5", "--no-report", "--out", "out", "--trust-units")
    assert not done.told("S07")
    assert done.told("D12")

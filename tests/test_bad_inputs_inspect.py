"""Every S, T and D row of the table of bad inputs that `inspect` can meet, each from one good log."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines import inspect
from pipelines.log.files import write_log
from pipelines.stage import Request
from tests.fault_table import FAULTS, Fault
from tests.healthy import good_log


def examine(*paths: Path, **settings: bool) -> inspect.Result:
    wanted = inspect.Settings(**settings)
    return inspect.compute(inspect.read(Request(paths), wanted), wanted)


@pytest.mark.parametrize("fault", FAULTS, ids=[f.row.replace(" ", "-") for f in FAULTS])
def test_every_fault_is_named_placed_and_answered(fault: Fault, tmp_path: Path) -> None:
    """Code, level, place, a number or a word of what is wrong, and a remedy; and nothing else is claimed."""
    path = tmp_path / "log.h5"
    write_log(path, fault.make(good_log()))
    found = [c for c in examine(path).checks if c.level != "ok"]
    mine = [c for c in found if c.code == fault.code]
    assert mine, f"not found; found were {found}"
    assert all(c.level == fault.level for c in mine)
    assert any(part in c.message for c in mine for part in fault.says.split("|")), mine
    assert all(c.where.startswith(str(path)) and c.remedy for c in mine)
    assert any(fault.where in c.where for c in mine), mine
    if fault.gate is not None:
        assert any(c.gate == fault.gate for c in mine), mine
    assert {c.code for c in found} <= {fault.code, *fault.also}


def test_the_good_log_itself_is_in_order(tmp_path: Path) -> None:
    write_log(tmp_path / "log.h5", good_log())
    result = examine(tmp_path / "log.h5")
    assert {c.level for c in result.checks} == {"ok"}


def test_trusted_units_are_not_doubted(tmp_path: Path) -> None:
    """--trust-units: whoever says that 90 is 90 rad is believed; what follows from it is then said."""
    fault = next(f for f in FAULTS if f.row == "S07")
    write_log(tmp_path / "log.h5", fault.make(good_log()))
    codes = {c.code for c in examine(tmp_path / "log.h5", trust_units=True).checks if c.level != "ok"}
    assert "RRID-S07" not in codes
    assert "RRID-D12" in codes

"""What the time of a recording is: seconds from a column of any unit, or from a declared rate; nothing is guessed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.importers.clock import time_of
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import TimeSpec
from tests.importers.good import Array, good


def table(t: Array, **units: str) -> RawTable:
    return RawTable("run.csv", {"t": t}, np.arange(t.size), units=units)


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_s08_the_unit_of_time_is_detected_from_the_declared_rate(unit: str, factor: float) -> None:
    t, checks = time_of(table(good()["t"] * factor), TimeSpec(column="t", rate=1000.0))
    assert np.allclose(t, good()["t"], atol=1e-9)
    assert f"{unit} fits the declared rate of 1000 Hz" in checks[0].message
    assert checks[0].code == "RRID-S08"


def test_s08_an_open_unit_is_refused_with_what_it_could_be() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S08.*could be: ms \(.*us \(.*Add unit or rate"):
        time_of(table(good()["t"] * 2e4), TimeSpec(column="t"))


def test_s08_a_unit_that_contradicts_the_rate_is_refused() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S08.*time in s makes 1 Hz, but 1000 Hz is declared; in ms it would fit"):
        time_of(table(good()["t"] * 1e3), TimeSpec(column="t", unit="s", rate=1000.0))


def test_s08_an_absurd_rate_is_refused() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S08.*ms looks right|RRID-S08.*us or ns|RRID-S08.*us"):
        time_of(table(good()["t"] * 1e6), TimeSpec(column="t", unit="s"))


def test_an_epoch_in_nanoseconds_keeps_its_digits() -> None:
    t, _ = time_of(table(1.7e18 + np.arange(1200) * 1024000.0), TimeSpec(column="t", unit="ns"))
    assert np.allclose(np.diff(t), 1.024e-3, rtol=1e-9)


def test_s08_a_header_that_contradicts_the_recipe_is_refused() -> None:
    """Seconds read as milliseconds make a log a thousand times too fast that nothing else needs to notice."""
    with pytest.raises(InputRejected, match=r"RRID-S08.*the header says 's', the recipe says 'ms'"):
        time_of(replace(table(good()["t"]), units={"t": "s"}), TimeSpec(column="t", unit="ms"))

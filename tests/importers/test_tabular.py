"""Text files are read for what they are; damage is counted and named; spreadsheet remains are refused."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipelines.errors import InputRejected
from pipelines.importers.raw import RawTable, table_of
from pipelines.importers.tables import read_json
from pipelines.importers.text import read_text
from tests.importers.good import good, lines, text


def parse(content: str | bytes) -> RawTable:
    return read_text(content.encode() if isinstance(content, str) else content, "run.csv")


def levels(table: RawTable) -> dict[str, str]:
    return {check.code.removeprefix("RRID-"): check.level for check in table.checks}


def equal(table: RawTable, rows: slice = slice(None)) -> bool:
    return all(np.array_equal(table.columns[name], values[rows]) for name, values in good().items())


def test_every_digit_of_a_plain_file_is_read() -> None:
    table = parse(text(good()))
    assert equal(table)
    assert not table.checks
    assert table.place(0) == "line 2"


def with_commas(content: str) -> str:
    return content.replace(",", ";").replace(".", ",")


DIALECTS: dict[str, Callable[[str], bytes]] = {
    "semicolon and decimal comma": lambda s: with_commas(s).encode(),
    "tab": lambda s: s.replace(",", "\t").encode(),
    "tab and decimal comma": lambda s: s.replace(",", "\t").replace(".", ",").encode(),
    "blanks": lambda s: s.replace(",", "   ").encode(),
    "bar": lambda s: s.replace(",", "|").encode(),
    "byte order mark": lambda s: b"\xef\xbb\xbf" + s.encode(),
    "UTF-16 with mark": lambda s: s.encode("utf-16"),
    "UTF-16 without mark": lambda s: s.encode("utf-16-le"),
    "windows line ends": lambda s: s.replace("\n", "\r\n").encode(),
    "old mac line ends": lambda s: s.replace("\n", "\r").encode(),
    "quotes": lambda s: "\n".join(",".join(f'"{c}"' for c in line.split(",")) for line in s.splitlines()).encode() + b"\n",
    "comments above": lambda s: b"# robot 7\n# 2024\n" + s.encode(),
    "header in a comment": lambda s: b"# " + s.encode(),
    "words above the table": lambda s: b"Exported by LoggerPro\n\n" + s.encode(),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_f16_a_dialect_is_found_out(name: str) -> None:
    """F16: the same numbers in any dialect are the same samples."""
    assert equal(parse(DIALECTS[name](text(good()))))


@pytest.mark.parametrize("name", ["semicolon and decimal comma", "byte order mark", "UTF-16 with mark", "UTF-16 without mark",
                                  "words above the table"])
def test_f16_an_unusual_dialect_is_said(name: str) -> None:
    assert levels(parse(DIALECTS[name](text(good())))).get("F16") == "warn"


def test_f16_comma_as_delimiter_and_decimal_is_refused() -> None:
    with pytest.raises(InputRejected, match=r"RRID-F16.*line 2 has 4 cells under 2 names.*semicolon"):
        parse("t,q\n" + "0,001,1,5\n" * 30)


def test_f16_a_nul_byte_is_refused_with_its_line() -> None:
    content = text(good()).encode()
    with pytest.raises(InputRejected, match=r"RRID-F16.*NUL byte in line 2\b"):
        parse(content[:100] + b"\0" + content[100:])


@pytest.mark.parametrize("cell", ["#REF!", "#DIV/0!", "#N/A", "=A2+1", "@SUM(A1)"])
def test_f16_a_spreadsheet_error_is_refused_with_its_line(cell: str) -> None:
    rows = lines()
    cells = rows[41].split(",")
    rows[41] = ",".join([*cells[:2], cell, *cells[3:]])
    with pytest.raises(InputRejected, match=r"RRID-F16.*line 42.*in column 'q_2'.*spreadsheet"):
        parse("\n".join(rows) + "\n")


def test_f09_a_cut_last_line_is_left_out() -> None:
    content = text(good())
    table = parse(content[:-60])
    assert levels(table) == {"F09": "repair"}
    assert "line 1201" in table.checks[0].message
    assert equal(table, slice(0, -1))


def test_f09_a_last_line_without_line_end_is_not_trusted() -> None:
    """Cut inside the last number, the line still has all its cells: a wrong number must not come through."""
    table = parse(text(good())[:-4])
    assert levels(table) == {"F09": "warn"}
    assert equal(table, slice(0, -1))


@given(cut=st.integers(200, len(text(good())) - 1))
@settings(max_examples=40, deadline=None)
def test_f09_no_cut_gives_a_wrong_number(cut: int) -> None:
    table = parse(text(good())[:cut])
    assert equal(table, slice(0, table.rows.size))


def test_f09_a_line_out_of_step_is_left_out_and_named() -> None:
    rows = lines()
    rows[500] = rows[500].rsplit(",", 2)[0]
    table = parse("\n".join(rows) + "\n")
    assert levels(table) == {"F09": "repair"}
    assert "line 501 (5 cells, not 7)" in table.checks[0].message
    assert table.rows.size == 1199
    assert table.breaks == (499,)
    assert table.rows[499] == 500


def test_f09_much_damage_is_refused() -> None:
    rows = lines()
    for k in range(100, 130):
        rows[k] = rows[k].rsplit(",", 1)[0]
    with pytest.raises(InputRejected, match=r"RRID-F09.*30 of 1200 lines.*line 101 \(6 cells.*Export"):
        parse("\n".join(rows) + "\n")


def test_s03_two_columns_of_one_name_are_both_named() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S03.*line 1.*columns 2, 3 are all named 'q_1'"):
        parse(text(good()).replace("q_2", "q_1", 1))


def test_a_column_of_words_is_kept_apart() -> None:
    rows = lines()
    table = parse("\n".join([rows[0] + ",state", *(row + ",RUN" for row in rows[1:])]) + "\n")
    assert equal(table)
    assert table.text == {"state": "RUN"}
    with pytest.raises(InputRejected, match="RRID-S12.*'state'.*RUN"):
        table.name_of("state")


def test_units_in_the_header_are_found() -> None:
    table = parse(text(good()).replace("t,q_1", "t [ms],q_1 (deg)", 1))
    assert table.units == {"t": "ms", "q_1": "deg"}
    below = lines()
    table = parse("\n".join([below[0], "s,rad,rad,rad,Nm,Nm,Nm", *below[1:]]) + "\n")
    assert table.units["tau_3"] == "Nm"
    assert equal(table)


def test_f16_a_further_table_below_the_first_is_refused_with_its_line() -> None:
    """Its numbers would go on under the names of the first."""
    rows = lines()
    names = ",".join(f"other_{k}" for k in range(7))
    with pytest.raises(InputRejected, match=r"RRID-F16.*line 602.*a further table begins, of other_0.*file of its own"):
        parse("\n".join([*rows[:601], names, *rows[601:]]) + "\n")


@pytest.mark.parametrize(("first", "second", "seconds"), [
    ("2024-05-17T23:59:59.5Z", "2024-05-19T00:00:00.25Z", 86400.75),
    ("2024-10-27T02:59:59+02:00", "2024-10-27T02:00:00+01:00", 1.0),
    ("31.05.2024 23:59:59", "01.06.2024 00:00:00", 1.0),
    ("05/31/2024 11:59:59 PM", "06/01/2024 12:00:00 AM", 1.0),
    ("Fri May 17 23:59:59 2024", "Sat May 18 00:00:01 2024", 2.0),
    ("0 days 00:00:00.010000", "1 days 00:00:00.020000", 86400.01),
    ("12:59:59 PM", "1:30:00 PM", 1801.0),
    ("23:59:59,5", "00:00:00,5", 1.0),
])
def test_dates_and_times_of_day_are_seconds(first: str, second: str, seconds: float) -> None:
    """Days between two dates count, halves of a day too; times without a date go on over midnight."""
    table = parse("t;q\n" + f"{first};1.0\n" * 10 + f"{second};2.0\n" * 10)
    assert np.ptp(table.columns["t"]) == pytest.approx(seconds, abs=1e-9)
    assert table.units["t"] == "s"


@pytest.mark.parametrize("spoilt", [{}, {"q": None}, {"q": [1.0]}], ids=["lacking", "null", "ragged"])
@pytest.mark.parametrize("at", [0, 7])
def test_a_list_that_a_frame_lacks_is_a_missing_sample(spoilt: dict[str, object], at: int) -> None:
    frames: list[dict[str, object]] = [{"t": 0.01 * k, "q": [1.0 * k, 2.0 * k]} for k in range(30)]
    frames[at] = {"t": 0.01 * at} | spoilt
    table = table_of(read_json(json.dumps(frames).encode(), "run.json"), "run.json")
    assert list(table.columns) == ["t", "q[0]", "q[1]"]
    for j in range(2):
        expected = np.where(np.arange(30) == at, np.nan, (j + 1.0) * np.arange(30))
        assert np.array_equal(table.columns[f"q[{j}]"], expected, equal_nan=True)


def test_a_list_of_lists_that_a_frame_lacks_is_a_missing_sample() -> None:
    frames: list[dict[str, object]] = [{"t": 0.01 * k, "x": [[1.0 * k, 2.0], [3.0, 4.0]]} for k in range(30)]
    del frames[7]["x"]
    table = table_of(read_json(json.dumps(frames).encode(), "run.json"), "run.json")
    assert list(table.columns) == ["t", "x[0][0]", "x[0][1]", "x[1][0]", "x[1][1]"]
    assert np.flatnonzero(np.isnan(table.columns["x[0][0]"])).tolist() == [7]


def test_s03_a_name_twice_in_a_frame_is_refused() -> None:
    frames = [{"t": 0.01 * k, "a": {"q": 1.0}, "a.q": 2.0} for k in range(30)]
    with pytest.raises(InputRejected, match=r"RRID-S03.*'a\.q'"):
        read_json(json.dumps(frames).encode(), "run.json")

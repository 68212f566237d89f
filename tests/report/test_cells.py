"""Tables as they are shown: a figure that no row has takes no room, on the page and on a terminal alike."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipelines.report.render import render_report
from pipelines.report.report import Report, Table, column_texts, filled
from pipelines.report.style import format_number, three_digits
from pipelines.stage import Outcome
from rrrid_cli.console import print_outcome
from rrrid_cli.options import Common

TABLE = Table(("joint", "torque [N m]", "torque [% of rated]", "gravity [N m]", "note"),
              (("waist", 0.042, None, "", "in order"), ("elbow", None, math.nan, " ", "")), "Held out.")


def test_a_column_that_is_empty_in_every_row_is_left_out() -> None:
    """One that a single row fills stays, and so does every row."""
    assert filled(TABLE) == replace(TABLE, columns=("joint", "torque [N m]", "note"),
                                    rows=(("waist", 0.042, "in order"), ("elbow", None, "")))


@pytest.mark.parametrize("table", [
    replace(TABLE, keeps_empty=True), replace(TABLE, rows=()), Table(("what", "figure"), (("condition number", None),)),
    Table(("figure", "a", "b"), (("mass", "–", "1.2"),)), Table(("joint", "samples", "found"), ((1, 0, False),))])
def test_what_is_an_answer_stays(table: Table) -> None:
    """Joints of which nothing is known, figures beside their names, a dash that was written, nought and no."""
    assert filled(table) == table


def test_page_and_terminal_leave_it_out(capsys: pytest.CaptureFixture[str]) -> None:
    report = Report("t", "v", key_figures=TABLE)
    page = render_report(report, {})["report.html"].decode()
    outcome: Outcome[Any] = Outcome(None, {}, report, Path("out"), 0, ())
    print_outcome(outcome, Common())
    for shown in (re.sub(r"<[^>]+>", " ", page), capsys.readouterr().out):
        assert "in order" in shown
        assert "gravity" not in shown
        assert "rated" not in shown


def test_a_column_is_filled_up_with_digits_that_are_known() -> None:
    """Three digits are enough of each, and five decimals for the smallest: what stands there of the others is theirs, no zeros."""
    known = (0.9958993, 0.9250412, 0.06190177, 0.001234)
    cells = [three_digits(x) for x in known]
    assert [format_number(cell) for cell in cells] == ["0.996", "0.925", "0.0619", "0.00123"]
    assert column_texts(cells) == ["0.99590", "0.92504", "0.06190", "0.00123"]
    assert three_digits(math.nan) is None

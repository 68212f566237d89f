"""The report of a run can be read to its end: it draws a few logs, lists all, and counts each gain from a line that is shown."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from pipelines.diagnosis.result import Diagnosis, ResidualRms
from pipelines.errors import Check
from pipelines.report.report import Figure, Report, Section, Table
from pipelines.report.run_report import Result, Step, run_report


def of_logs(count: int, figures: int) -> Report:
    """A stage that shows each of `count` logs in a table and some figures."""
    return Report("Motion", "Known.", "good", sections=tuple(
        Section(f"Log {k}", (), (Table(("joint",), ((1,),)),), folded=True, figures=tuple(Figure(f"{name}-{k}", "", lambda drawing: None)
                                                                   for name in "abcdefgh"[:figures])) for k in range(count)))


def test_forty_logs_make_no_report_of_a_hundred_pages() -> None:
    """The first logs are drawn, the tables of all are there, and where a figure is missing stands what draws it."""
    steps = tuple(Step(name, 0, object(), of_logs(40, 4), ()) for name in ("inspect", "reconstruct"))
    for name in ("inspect", "reconstruct"):
        (own,) = (list(s.parts) for s in run_report(Result(steps)).sections if s.title == name)
        drawn = [section for section in own if section.figures]
        assert (len(own), drawn) == (40, own[:len(drawn)])
        assert 1 <= len(drawn) <= 4
        assert all(section.tables for section in own)
        assert all(f"rrrid {name}" in " ".join(section.text) for section in own[len(drawn):])


NOMINAL, RIPPLED, CARRYING, BARE = (np.array([error, 0.1]) for error in (0.5, 0.2, 0.18, 0.9))


def test_a_log_that_cannot_be_used_is_named_before_the_answer() -> None:
    """Nothing is wrong, as far as the other logs say."""
    check = Check.of("T01", "reject", "its clock runs backwards", where="a.h5", remedy="record again")
    empty = {field.name: None for field in fields(Diagnosis)} | {"findings": (), "residual_rms": ResidualRms(*[NOMINAL] * 3), "after_rms": ResidualRms(*[NOMINAL] * 3)}
    bare = Diagnosis(**empty)  # type: ignore[arg-type]
    steps = (Step("inspect", 3, object(), Report("Log doctor", "The log cannot be used.", "bad"), (check,)),
             Step("diagnose", 0, bare, Report("Diagnosis", "Nothing is wrong.", "good"), ()))
    assert run_report(Result(steps)).verdict.startswith("Left out as unusable: a.h5 (its clock runs backwards).\nNothing is wrong.")

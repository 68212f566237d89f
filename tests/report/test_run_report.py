"""The report of a run can be read to its end: it draws a few logs, and tells of all."""

from __future__ import annotations

from pipelines.report.report import Figure, Report, Section, Table
from pipelines.report.run_report import run_report
from pipelines.report.run_result import Result, Step


def of_logs(count: int, figures: int) -> Report:
    """A stage that shows each of `count` logs in a table and some figures."""
    return Report("Motion", "Known.", "good", sections=tuple(
        Section(f"Log {k}", (), (Table(("joint",), ((1,),)),), tuple(Figure(f"{name}-{k}", "", lambda drawing: None)
                                                                   for name in "abcdefgh"[:figures])) for k in range(count)))


def test_forty_logs_make_no_report_of_a_hundred_pages() -> None:
    """The first logs are drawn, the tables of all are there, and where a figure is missing stands what draws it."""
    steps = tuple(Step(name, 0, object(), of_logs(40, 4), ()) for name in ("inspect", "reconstruct"))
    for name in ("inspect", "reconstruct"):
        own = [s for s in run_report(Result(steps)).sections if s.title.startswith(f"{name}: Log")]
        drawn = [section for section in own if section.figures]
        assert (len(own), drawn) == (40, own[:len(drawn)])
        assert 1 <= len(drawn) <= 4
        assert all(section.tables for section in own)
        assert all(f"rrrid {name}" in " ".join(section.text) for section in own[len(drawn):])


def test_a_stage_asked_for_alone_shows_all_it_has() -> None:
    """One stage, by --skip of the others: nothing is left out; nor is a first log with many figures."""
    alone = run_report(Result((Step("reconstruct", 0, object(), of_logs(8, 4), ()),)))
    assert sum(len(section.figures) for section in alone.sections) == 32
    steps = tuple(Step(name, 0, object(), of_logs(1, 8), ()) for name in ("inspect", "reconstruct"))
    assert sum(len(section.figures) for section in run_report(Result(steps)).sections) == 16

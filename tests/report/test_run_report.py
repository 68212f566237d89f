"""The report of a run can be read to its end: it draws a few logs, lists all, and counts each gain from a line that is shown."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from pipelines.diagnosis.result import Diagnosis, Extension, Finding, Gain, ResidualRms
from pipelines.errors import Check
from pipelines.estimation.model_fit import TorqueGain
from pipelines.report.report import Figure, Report, Section, Table
from pipelines.report.run_report import Result, Step, run_report, stage_lines, stages_section


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


NOMINAL, RIPPLED, CARRYING, BARE = (np.array([error, 0.1]) for error in (0.5, 0.2, 0.18, 0.9))


def gained(before: np.ndarray, after: np.ndarray) -> Gain:
    return Gain(TorqueGain(before, after, np.tile([-0.4, -0.2], (2, 1))), None, "none", None)


def finding(cause: str, joint: int | None, origin: str, before: np.ndarray, after: np.ndarray) -> Finding:
    return Finding(cause, joint, cause, {}, 0.9, 0.9, (), None, gained(before, after), origin, 0.1, 0.01, None)  # type: ignore[arg-type]


def told(*findings: Finding, was: np.ndarray = NOMINAL, now: np.ndarray = CARRYING) -> tuple[Step, ...]:
    """A run whose diagnosis found these, and whose extension has them all."""
    bare = {field.name: None for field in fields(Diagnosis)}
    rms = ResidualRms(NOMINAL, NOMINAL, NOMINAL)
    diagnosed = Diagnosis(**(bare | {"findings": findings, "residual_rms": rms}))  # type: ignore[arg-type]
    blank = {field.name: None for field in fields(Extension)}
    extended = Extension(**(blank | {"findings": findings, "gain": gained(was, now), "revolute": (),  # type: ignore[arg-type]
                                     "residual_rms": ResidualRms(was, was, was), "after_rms": ResidualRms(now, now, now)}))
    return tuple(Step(name, 0, result, Report("", ""), ()) for name, result in (("diagnose", diagnosed), ("extend", extended)))


RIPPLE = finding("cogging", 2, "residual", NOMINAL, RIPPLED)
DRAG = finding("quadratic_drag", 1, "residual", RIPPLED, CARRYING)
LOAD = finding("payload", None, "base parameters", BARE, CARRYING)


def test_every_gain_counts_from_a_line_above_it() -> None:
    """A load's is that over the arm of the reference logs, not over a rigid body that holds it already, in any order."""
    for findings, was in (((RIPPLE,), NOMINAL), ((LOAD,), BARE), ((LOAD, RIPPLE), BARE), ((RIPPLE, DRAG), NOMINAL),
                          ((DRAG, RIPPLE), NOMINAL), ((RIPPLE, LOAD), 2.0 * BARE)):
        lines = stage_lines(told(*findings, was=was))
        for k, line in enumerate(lines):
            assert line.before is None or any(np.allclose(line.before, above.rms) for above in lines[:k])
        assert [line.step.startswith("+") for line in lines].count(True) == len(findings)


def test_what_a_gain_is_a_share_of_stands_above_it() -> None:
    """Of the error here, of its square in the ledger of hypotheses: a reader lays the two side by side."""
    (section,) = stages_section(stage_lines(told(RIPPLE)))
    assert "gain in rms [%]" in section.tables[0].columns
    assert "in the square" in section.text[0]


def refused(stage: str, remedy: str) -> Step:
    """A stage that a swapped log stopped."""
    check = Check.of("S13", "reject", "columns 1,2 fit swapped", where="a.h5", remedy=remedy, gate=True)
    return Step(stage, 3, None, Report(stage, f"Not done: {check.message}. {remedy}.", "bad"), (check,))


def test_each_refusal_is_told_once_and_nothing_that_follows_from_it() -> None:
    """The headline names the stages that one reason stopped, with one thing to do; the table of stages has the rest."""
    steps = (Step("inspect", 1, object(), Report("Log doctor", "All should be looked at.", "attention"), ()),
             Step("fit-friction", 0, object(), Report("Friction", "A law. " * 20, "bad"), ()),
             *(refused(name, f"correct the map; if it is right, say --set {name}.skip_sanity_checks=true") for name in
               ("estimate-bps", "diagnose")),
             Step("frf", 5, None, Report("Responses", "Passed over: no frf log. Record one.", "neutral"),
                  (Check.of("C06", "warn", "no frf log", remedy="record one"),)))
    said = run_report(Result(steps))
    assert said.verdict == "Not done (estimate-bps, diagnose): columns 1,2 fit swapped. Correct the map."
    assert [row[0] for row in next(s for s in said.sections if s.title == "Stages").tables[0].rows] == [s.name for s in steps]


def test_a_log_that_cannot_be_used_is_named_before_the_answer() -> None:
    """Nothing is wrong, as far as the other logs say."""
    check = Check.of("T01", "reject", "its clock runs backwards", where="a.h5", remedy="record again")
    empty = {field.name: None for field in fields(Diagnosis)} | {"findings": (), "residual_rms": ResidualRms(*[NOMINAL] * 3)}
    bare = Diagnosis(**empty)  # type: ignore[arg-type]
    steps = (Step("inspect", 3, object(), Report("Log doctor", "The log cannot be used.", "bad"), (check,)),
             Step("diagnose", 0, bare, Report("Diagnosis", "Nothing is wrong.", "good"), ()))
    assert run_report(Result(steps)).verdict.startswith("Left out as unusable: a.h5 (its clock runs backwards).\nNothing is wrong.")

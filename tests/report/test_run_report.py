"""The report of a run can be read to its end: it draws a few logs, lists all, and counts each gain from a line that is shown."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing

from pipelines.diagnosis.result import Diagnosis, Extension, Finding, Gain, ResidualRms, TipError
from pipelines.errors import Check
from pipelines.estimation.model_fit import TorqueGain
from pipelines.io.model_file import ModelFile
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


def test_a_stage_asked_for_alone_shows_all_it_has() -> None:
    """One stage, by --skip of the others: nothing is left out; nor is a first log with many figures."""
    alone = run_report(Result((Step("reconstruct", 0, object(), of_logs(8, 4), ()),)))
    assert sum(len(section.figures) for section in alone.sections) == 32
    steps = tuple(Step(name, 0, object(), of_logs(1, 8), ()) for name in ("inspect", "reconstruct"))
    assert sum(len(section.figures) for section in run_report(Result(steps)).sections) == 16


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


def test_a_load_alone_is_told_beside_the_arm_without_it() -> None:
    """The model fitted to the loaded arm is no step towards the load: it is no line of the ledger."""
    bare, load, extended = stage_lines(told(LOAD, was=BARE))
    assert bare.step.endswith("without payload at the tip")
    assert (bare.rms, load.before, extended.before) == (tuple(BARE),) * 3


def test_findings_that_build_on_one_another_stand_in_that_order() -> None:
    """The drag was found beside the cogging, and is the stronger: the cogging comes first all the same."""
    steps = [line.step for line in stage_lines(told(DRAG, RIPPLE))]
    assert steps[:3] == ["rigid body and friction, as diagnose fits them", "+ cogging at joint 2", "+ quadratic drag at joint 1"]


def test_no_line_joins_the_steps_of_two_stages() -> None:
    """The model of extend without its cause is no step back from what diagnose found."""
    lines = stage_lines(told(RIPPLE, was=2.0 * NOMINAL))
    (section,) = stages_section(lines)
    drawing = Drawing()
    section.figures[0].draw(drawing)
    for drawn in drawing.axes[0].lines:
        heights = np.asarray(drawn.get_ydata(), dtype=np.float64)
        joined = [(int(a), int(b)) for a, b in itertools.pairwise(heights) if np.isfinite(a + b)]
        assert joined == [(k - 1, k) for k in range(1, len(lines)) if lines[k].stage == lines[k - 1].stage]


def test_what_a_gain_is_a_share_of_stands_above_it() -> None:
    """Of the error here, of its square in the ledger of hypotheses: a reader lays the two side by side."""
    (section,) = stages_section(stage_lines(told(RIPPLE)))
    assert "gain in rms [%]" in section.tables[0].columns
    assert "in the square" in section.text[0]


def test_the_ledger_writes_the_tip_as_the_verdict_does() -> None:
    """0.125 mm is 0.125 mm in every line, not 0.13 in one and 0.12 in the next."""
    tips = dataclasses.replace(RIPPLE.gain, tip_error_rms=TipError(1.2509e-4, 1.86e-5))
    (section,) = stages_section(stage_lines(told(dataclasses.replace(RIPPLE, gain=tips))))
    assert "0.125 → 0.0186" in [row[-1] for row in section.tables[0].rows]


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


def test_what_is_not_in_order_is_told_where_nothing_was_refused() -> None:
    steps = (Step("inspect", 1, object(), Report("Log doctor", "All should be looked at.", "attention"), ()),
             Step("reconstruct", 0, object(), Report("Motion", "Known.", "good"), ()))
    assert run_report(Result(steps)).verdict == "All should be looked at."


def test_a_log_that_cannot_be_used_is_named_before_the_answer() -> None:
    """Nothing is wrong, as far as the other logs say."""
    check = Check.of("T01", "reject", "its clock runs backwards", where="a.h5", remedy="record again")
    empty = {field.name: None for field in fields(Diagnosis)} | {"findings": (), "residual_rms": ResidualRms(*[NOMINAL] * 3)}
    bare = Diagnosis(**empty)  # type: ignore[arg-type]
    steps = (Step("inspect", 3, object(), Report("Log doctor", "The log cannot be used.", "bad"), (check,)),
             Step("diagnose", 0, bare, Report("Diagnosis", "Nothing is wrong.", "good"), ()))
    assert run_report(Result(steps)).verdict.startswith("Left out as unusable: a.h5 (its clock runs backwards). Nothing is wrong.")


@pytest.mark.parametrize(("stages", "said"), [
    ({"inspect": "attention"}, "With remarks: inspect; see the stages."),
    ({"inspect": "attention", "fit-friction": "bad", "frf": "attention"},
     "Not in order: fit-friction; see the stages. With remarks: inspect and frf; see the stages.")])
def test_beside_a_diagnosis_the_other_stages_are_named_alone(stages: dict[str, Any], said: str) -> None:
    """The headline is about the arm; their verdicts are in the table of stages."""
    rms = ResidualRms(NOMINAL, NOMINAL, NOMINAL)
    empty = {field.name: None for field in fields(Diagnosis)} | {"findings": (), "residual_rms": rms}
    bare = Diagnosis(**empty)  # type: ignore[arg-type]
    steps = (*(Step(name, 0, object(), Report(name, "Waist: a long story.", tone), ()) for name, tone in stages.items()),
             Step("reconstruct", 0, object(), Report("Motion", "Known.", "good"), ()),
             Step("diagnose", 0, bare, Report("Diagnosis", "Cogging.", "bad"), ()))
    told = run_report(Result(steps))
    assert told.verdict == f"Cogging. {said}"
    table = next(section for section in told.sections if section.title == "Stages").tables[0]
    assert "Waist: a long story." in [row[1] for row in table.rows]


def test_the_extended_model_of_the_key_figures_is_told_from_the_file() -> None:
    """They are those of diagnose; the residual of extend's model.json is stated below, where there is one."""
    table = Table(("joint", "torque error now [N m]", "extended [N m]"), ((1, 0.5, 0.18), (2, 0.1, 0.1)), "Of what was held out.")
    diagnosed, extended = told(RIPPLE)
    diagnosed = dataclasses.replace(diagnosed, report=Report("", "", key_figures=table))
    assert run_report(Result((diagnosed, extended))).key_figures == table
    model = ModelFile("arm", "", ())
    anew = dataclasses.replace(extended, result=dataclasses.replace(extended.result, model=model, joints=("a", "b")))
    shown = run_report(Result((diagnosed, anew))).key_figures
    assert shown is not None
    assert (shown.rows, shown.caption.startswith("Of what was held out. ")) == (table.rows, True)
    assert "that of extend, in its model.json, leaves 0.18, 0.1 N m" in shown.caption

"""The report of a run: the verdict, the model and what it is worth, then the stages, folded."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pipelines.diagnosis.result import Diagnosis, Extension, Gain
from pipelines.diagnosis.result import Result as Diagnosed
from pipelines.errors import Check, NothingMatched
from pipelines.estimation.checks.boundary import Boundary
from pipelines.estimation.result import Result as Estimate
from pipelines.io.output import slug
from pipelines.io.results import FLAT, NOT_STORED
from pipelines.report import words
from pipelines.report.diagnosis_report import tip_errors
from pipelines.report.document import document
from pipelines.report.finding_words import beyond_chance
from pipelines.report.report import Figure, Report, Section, Tone
from pipelines.report.sections import CARD, boundary_card

_WORST: tuple[Tone, ...] = ("neutral", "good", "attention", "bad")
# whose main sections are on the first pages, in the order of these
_FIRST = ("diagnose", "estimate-bps", "fit-friction", "validate-writing", "frf", "inspect")
_FIGURES = 6  # numerics: of one stage: ten logs drawn four times each are for who runs that stage
_NAMED = 3  # numerics: logs that are left out


@dataclass(frozen=True)
class Step:
    """One stage's outcome: its exit code under --check, and its result."""

    name: str
    exit: int
    result: Any
    report: Report = field(metadata=NOT_STORED, repr=False)
    checks: tuple[Check, ...] = field(metadata=NOT_STORED, repr=False)
    kept: Any = field(default=None, metadata=NOT_STORED, repr=False)  # where its files lie


@dataclass(frozen=True)
class Result:
    """The stages of a run, on the logs of one robot and one day."""

    stages: tuple[Step, ...]
    runs: tuple[Any, ...] = ()  # one for each of several sessions; empty, for those are refused
    boundary: Boundary | None = None  # what the logged torque is, also where no arm is diagnosed
    diagnosis: Diagnosis | None = field(default=None, metadata=FLAT, repr=False)


@dataclass(frozen=True)
class Line:
    """One step of the model: its held-out torque error, joint by joint, and that before it."""

    step: str
    stage: str  # that computed it
    rms: tuple[float, ...]  # [N m] held-out torque error with this step
    before: tuple[float, ...] | None = None  # without it, on the same equations; None: the first
    sure: bool | None = None  # whether the gain is beyond its bootstrap interval; None: not known
    tip: tuple[str, str] | None = None  # [mm] simulated tip error before and after

    @property
    def gain(self) -> float | None:
        """[%] of the error of all joints together that it takes away."""
        if self.before is None:
            return None
        before = math.hypot(*self.before)
        return 100.0 * (1.0 - math.hypot(*self.rms) / before) if before > 0.0 else None


def run_report(result: Result) -> Report:
    """The answer before its sources."""
    steps = result.stages
    if len(steps) == 1:
        return steps[0].report
    answers = [step for step in steps if isinstance(step.result, Diagnosis)]
    lines = stage_lines(steps)
    joints = len(lines[0].rms) if lines else 0
    own = document(
        "run",
        max((step.report.tone for step in steps), key=_WORST.index),
        title=_title(steps),
        left_out=_left_out(steps) if answers else [],
        most=_NAMED,
        answers=[line for step in answers for line in step.report.verdict.split("\n")],
        not_accepted=[s.report.verdict for s in steps
                      if isinstance(s.result, Extension) and not s.result.accepted],
        refusals=_refusals(steps),
        steps=steps,
        others=[step for step in steps if not isinstance(step.result, Diagnosis)],
        advice=[line for step in steps for line in step.report.advice],
        lines=lines,
        columns=[*(f"joint {j + 1} [N m]" for j in range(joints)), "gain in rms [%]",
                 "beyond chance", "simulated tip [mm]"],
        lacking=[(s.name, c.message, c.remedy) for s in steps
                 if s.exit == NothingMatched.exit_code for c in s.checks],
    )  # fmt: skip
    shown = {step.name: _parts(step) for step in steps}
    front = [part for name in _FIRST[:1] for part in shown.get(name, ()) if not part.folded]
    model = [part for name in _FIRST[1:] for part in shown.get(name, ()) if not part.folded]
    chain, rest = own.sections[: bool(lines)], own.sections[bool(lines) :]
    card = boundary_card(result.boundary)
    sections = [*(c for c in card if not c.folded), *front, *chain, *model, *rest]
    sections += [c for c in card if c.folded]
    for step in steps:
        parts = tuple(part for part in shown[step.name] if part.folded)
        if parts:
            said = tuple(step.report.verdict.split("\n"))
            sections.append(Section(step.name, said, folded=True, parts=parts))
    key = answers[0].report.key_figures if len(answers) == 1 else None
    return replace(own, key_figures=key, sections=tuple(sections))


def _title(steps: Iterable[Step]) -> str:
    """With the robot, where a diagnosis knows it."""
    robots = {step.result.robot for step in steps if isinstance(step.result, Diagnosed)} - {""}
    return f"Run: {robots.pop()}" if len(robots) == 1 else "Run"


def _left_out(steps: Iterable[Step]) -> list[str]:
    checks = (check for step in steps if step.name == "inspect" for check in step.checks)
    return [f"{check.where} ({check.message})" for check in checks if check.level == "reject"]


def _refusals(steps: Iterable[Step]) -> list[tuple[list[str], str, str]]:
    """Why stages were not done, each reason once: (stages it stopped, message, remedy)."""
    reasons: dict[tuple[str, str], tuple[list[str], str, str]] = {}
    for step in steps:
        if step.result is None and step.exit != NothingMatched.exit_code:
            for check in step.checks:
                key, remedy = (check.code, check.message), check.remedy.split("; ")[0]
                reasons.setdefault(key, ([], check.message, remedy))[0].append(step.name)
    return list(reasons.values())


def _parts(step: Step) -> list[Section]:
    """The sections of a stage with its first figures; the words say what draws the others."""
    parts: list[Section] = []
    drawn = 0
    for section in step.report.sections:
        if section.title == CARD:  # it is shown once for all stages
            continue
        figures: tuple[Figure, ...] = tuple(
            replace(one, name=f"{slug(step.name)}-{one.name}") for one in section.figures
        )
        drawn += len(figures)
        if drawn > _FIGURES and len(figures) < drawn:
            drawn -= len(figures)
            note = f"Figures: rrrid {step.name}, on the same logs, draws them." if figures else ""
            section = replace(section, text=tuple(filter(None, (*section.text, note))))
            figures = ()
        parts.append(replace(section, figures=figures))
    return parts


def stage_lines(stages: Sequence[Step]) -> tuple[Line, ...]:
    """Every step of the model that was judged on held-out logs, in the order in which it grows."""
    return tuple(line for step in stages for line in _of(step.result, step.name))


def _of(result: Any, stage: str) -> Iterator[Line]:
    if isinstance(result, Estimate):
        before = result.torque_signal_rms["validate"]
        yield Line("no model: the torque itself", stage, before)
        if result.rigid_body_alone is not None:
            yield Line("rigid body", stage, result.rigid_body_alone, before)
            before = result.rigid_body_alone
        friction = (
            "given friction" if result.friction == "given" else "Coulomb and viscous friction"
        )
        yield Line(f"+ {friction}", stage, result.torque_rms["validate"], before)
    elif isinstance(result, Diagnosis):
        before, after = (_floats(x.validate) for x in (result.residual_rms, result.after_rms))
        yield Line("rigid body and friction, fitted by diagnose", stage, before)
        if result.findings and np.isfinite(after).all():
            causes = ", ".join(what for _, what in words.together(result.findings))
            sure = any(map(beyond_chance, result.findings))
            tip = tip_errors(result.findings[0].gain) if len(result.findings) == 1 else None
            yield Line(f"+ {causes}", stage, after, before, sure, tip)
    elif isinstance(result, Extension) and result.gain is not None and result.findings:
        before, after = (_floats(x.validate) for x in (result.residual_rms, result.after_rms))
        if np.isfinite((*before, *after)).all():
            line = "the extended model, everything refitted"
            yield Line(line, stage, after, before, _sure(result.gain), tip_errors(result.gain))


def _floats(values: Any) -> tuple[float, ...]:
    return tuple(map(float, values))


def _sure(gain: Gain) -> bool:
    return bool((gain.validate_torque_rms.ci95[:, 1] < 0.0).any())

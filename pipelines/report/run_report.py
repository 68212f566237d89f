"""The report of a run: the verdict, the ledger of all steps, what the logs lack, what diagnosis says, then every other stage."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

from pipelines.diagnosis.result import Diagnosis, Extension
from pipelines.diagnosis.result import Result as Diagnosed
from pipelines.errors import NothingMatched
from pipelines.log.places import slug
from pipelines.report.boundary_card import CARD, boundary_card
from pipelines.report.joint_units import units_in
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.run_ledger import ledger_lines, ledger_section
from pipelines.report.run_result import Result, Step
from pipelines.report.style import format_number

__all__ = ["run_report"]

_WORST: tuple[Tone, ...] = ("neutral", "good", "attention", "bad")
_FIGURES = 12  # of one stage: ten logs drawn four times each are for who asks for that stage


def run_report(result: Result) -> Report:
    """The answer before its sources."""
    steps = result.stages
    tone = max((step.report.tone for step in steps), key=_WORST.index)
    advice = tuple(line for step in steps for line in step.report.advice)
    if len(steps) == 1:
        sections = list(steps[0].report.sections)
    else:
        sections = [*boundary_card(result.boundary), *filter(None, (
            ledger_section(ledger_lines(steps)), _stages(steps), _lacking(steps)))]
        for step in sorted(steps, key=lambda step: not isinstance(step.result, Diagnosis)):
            sections += _titled(_fewer(step.report.sections, step.name), step.name)
    return Report(_title(steps), " ".join(_verdicts(steps)), tone, _key_figures(steps), tuple(sections), advice)


def _title(steps: Iterable[Step]) -> str:
    """With the robot, where a diagnosis knows it."""
    robots = {step.result.robot for step in steps if isinstance(step.result, Diagnosed)} - {""}
    return f"Run: {robots.pop()}" if len(robots) == 1 else "Run"


def _verdicts(steps: Sequence[Step]) -> list[str]:
    """Return the logs left out, the answer of the diagnosis, that of the extended model. Then the refusals, each reason once;
    without any, the stages with remarks, or their verdicts where there is no answer. Without all that, the last verdict.
    """
    done = [step for step in steps if step.result is not None]
    answers = [step for kind in (Diagnosis, Extension) for step in done if isinstance(step.result, kind)]
    refused = _refusals(steps)
    others = [step for step in steps if step not in answers and step.report.tone in ("attention", "bad")]
    bad = [f"{check.where} ({check.message})" for step in steps if step.name == "inspect" and answers
           for check in step.checks if check.level == "reject"]
    more = f" and {len(bad) - 3} more" if len(bad) > 3 else ""
    left_out = [f"Left out as unusable: {'; '.join(bad[:3])}{more}."] if bad else []
    told = _look_at(others) if answers else [step.report.verdict for step in others]
    said = [*left_out, *(step.report.verdict for step in answers), *(refused or told)]
    return said or [step.report.verdict for step in done[-1:]]


def _look_at(steps: Sequence[Step]) -> list[str]:
    """Return their names by gravity: their verdicts are in the table of stages, and concern the logs more than the arm."""
    found = []
    for tone, words in (("bad", "Not in order"), ("attention", "With remarks")):
        names = [step.name for step in steps if step.report.tone == tone]
        if names:
            *first, last = names
            found.append(f"{words}: {', '.join(first)}{' and ' if first else ''}{last}; see the stages.")
    return found


def _refusals(steps: Iterable[Step]) -> list[str]:
    """Why stages were not done: one sentence for each reason and one for what to do, with the stages it stopped."""
    reasons: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for step in steps:
        if step.result is None and step.exit != NothingMatched.exit_code:
            for check in step.checks:
                reasons.setdefault((check.code, check.message), []).append((step.name, check.remedy))
    found = []
    for (_, message), stopped in reasons.items():
        remedy = stopped[0][1].split("; ")[0]
        found.append(f"Not done ({', '.join(name for name, _ in stopped)}): {message}. {remedy[:1].upper()}{remedy[1:]}.")
    return found


def _key_figures(steps: Sequence[Step]) -> Table | None:
    """Those of the diagnosis, where there is one alone; of a single stage its own.

    Its extended model is not the one in the folder of `extend`, which fits everything again: what that leaves is said below.
    """
    found = [step for step in steps if isinstance(step.result, Diagnosis)] if len(steps) > 1 else steps
    table = found[0].report.key_figures if len(found) == 1 else None
    anew = next((step.result for step in steps if isinstance(step.result, Extension) and step.result.model is not None), None)
    if table is None or anew is None or len(steps) == 1:
        return table
    left = ", ".join(format_number(float(x), 3) for x in anew.after_rms.validate)
    said = f"What is called extended is as diagnosed; that of extend, in its model.json, leaves {left} {units_in(anew).torque}."
    return dataclasses.replace(table, caption=f"{table.caption} {said}")


def _stages(steps: Iterable[Step]) -> Section:
    table = Table(("stage", "verdict"), tuple((step.name, step.report.verdict) for step in steps),
                  caption="Each stage in the order it was run.", tones=tuple(step.report.tone for step in steps))
    return Section("Stages", tables=(table,))


def _lacking(steps: Iterable[Step]) -> Section | None:
    """Return the stages that lack a recording, and the recording that each needs."""
    rows = tuple((step.name, check.message, check.remedy) for step in steps
                 if step.exit == NothingMatched.exit_code for check in step.checks)
    if not rows:
        return None
    return Section("What these logs lack", (), (Table(("stage", "why it was passed over", "what to record"), rows),))


def _fewer(sections: Iterable[Section], stage: str) -> list[Section]:
    """`sections` of one stage with its first figures; where others are left out, the words say what draws them."""
    kept, drawn = list[Section](), 0
    for section in sections:
        if section.title == CARD:  # it is at the top, once for all stages
            continue
        if drawn + len(section.figures) > _FIGURES and drawn:
            told = f"Not drawn here, for the length of this report: rrrid {stage}, on the same logs, draws {_these(section)}."
            section = dataclasses.replace(section, text=(*section.text, told), figures=())
        drawn += len(section.figures)
        kept.append(section)
    return kept


def _these(section: Section) -> str:
    return "the figure that belongs here" if len(section.figures) == 1 else f"the {len(section.figures)} figures that belong here"


def _titled(sections: Iterable[Section], prefix: str) -> list[Section]:
    """`sections`, with titles and figures named after their stage."""
    return [dataclasses.replace(
        section, title=f"{prefix}: {section.title}",
        figures=tuple(dataclasses.replace(f, name=f"{slug(prefix)}-{f.name}") for f in section.figures))
        for section in sections]

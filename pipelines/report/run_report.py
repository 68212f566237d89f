"""The report of a run: the verdict, error by model stage, what the logs lack, then every stage."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

from pipelines.diagnosis.result import Diagnosis, Extension
from pipelines.diagnosis.result import Result as Diagnosed
from pipelines.errors import NothingMatched
from pipelines.log.places import slug
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.run_stages import Result, Step, stage_lines, stages_section
from pipelines.report.sections import CARD, boundary_card
from pipelines.report.sentences import sentence
from pipelines.report.words import units_in

_WORST: tuple[Tone, ...] = ("neutral", "good", "attention", "bad")
_FIGURES = 12  # of one stage: ten logs drawn four times each are for who asks for that stage
_NAMED = 3  # logs that are left out

_say = partial(sentence, "run")


def run_report(result: Result) -> Report:
    """The answer before its sources."""
    steps = result.stages
    tone = max((step.report.tone for step in steps), key=_WORST.index)
    advice = tuple(line for step in steps for line in step.report.advice)
    if len(steps) == 1:
        sections = list(steps[0].report.sections)
    else:
        sections = [*boundary_card(result.boundary), *stages_section(stage_lines(steps))]
        sections += [_stages(steps), *_lacking(steps)]
        for step in sorted(steps, key=lambda step: not isinstance(step.result, Diagnosis)):
            sections += _titled(_fewer(step.report.sections, step.name), step.name)
    key, verdict = _key_figures(steps), " ".join(_verdicts(steps))
    return Report(_title(steps), verdict, tone, key, tuple(sections), advice)


def _title(steps: Iterable[Step]) -> str:
    """With the robot, where a diagnosis knows it."""
    robots = {step.result.robot for step in steps if isinstance(step.result, Diagnosed)} - {""}
    return f"Run: {robots.pop()}" if len(robots) == 1 else "Run"


def _verdicts(steps: Sequence[Step]) -> list[str]:
    """The logs left out, the answer of the diagnosis, that of the extended model, the refusals.

    Without a refusal, the stages with remarks, or their verdicts where there is no answer. Without
    all that, the last verdict.
    """
    answers = [s for kind in (Diagnosis, Extension) for s in steps if isinstance(s.result, kind)]
    said = [_left_out(steps)] if answers else []
    said += [step.report.verdict for step in answers]
    others = [step for step in steps if step not in answers]
    bad, attention = ([s for s in others if s.report.tone == t] for t in ("bad", "attention"))
    if refusals := _refusals(steps):
        said += refusals
    elif answers:
        said.append(_say("remarks", [s.name for s in bad], [s.name for s in attention]))
    else:
        said += [step.report.verdict for step in others if step in bad or step in attention]
    done = [step.report.verdict for step in steps if step.result is not None]
    return [words for words in said if words] or done[-1:]


def _left_out(steps: Iterable[Step]) -> str:
    checks = (check for step in steps if step.name == "inspect" for check in step.checks)
    bad = [f"{check.where} ({check.message})" for check in checks if check.level == "reject"]
    return _say("left_out", bad[:_NAMED], len(bad) - _NAMED)


def _refusals(steps: Iterable[Step]) -> list[str]:
    """Why stages were not done: one sentence for each reason, with the stages it stopped."""
    reasons: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for step in steps:
        if step.result is None and step.exit != NothingMatched.exit_code:
            for check in step.checks:
                stopped = reasons.setdefault((check.code, check.message), [])
                stopped.append((step.name, check.remedy.split("; ")[0]))
    return [
        _say("refusal", [name for name, _ in stopped], message, stopped[0][1])
        for (_, message), stopped in reasons.items()
    ]


def _key_figures(steps: Sequence[Step]) -> Table | None:
    """Those of the diagnosis, where there is one alone; of a single stage its own.

    Its extended model is not the one in the folder of `extend`, which fits everything again: what
    that leaves is said below.
    """
    if len(steps) == 1:
        return steps[0].report.key_figures
    tables = [s.report.key_figures for s in steps if isinstance(s.result, Diagnosis)]
    table = tables[0] if len(tables) == 1 else None
    extensions = (s.result for s in steps if isinstance(s.result, Extension))
    anew = next((found for found in extensions if found.model is not None), None)
    if table is None or anew is None:
        return table
    said = _say("extended", anew.after_rms.validate.tolist(), units_in(anew).torque)
    return replace(table, caption=f"{table.caption} {said}")


def _stages(steps: Iterable[Step]) -> Section:
    rows = tuple((step.name, step.report.verdict) for step in steps)
    tones = tuple(step.report.tone for step in steps)
    table = Table(("stage", "verdict"), rows, "Each stage in the order it was run.", tones)
    return Section("Stages", tables=(table,))


def _lacking(steps: Iterable[Step]) -> list[Section]:
    """The stages that lack a recording, and the recording that each needs."""
    lacking = [step for step in steps if step.exit == NothingMatched.exit_code]
    rows = tuple((s.name, check.message, check.remedy) for s in lacking for check in s.checks)
    table = Table(("stage", "why it was passed over", "what to record"), rows)
    return [Section("What these logs lack", tables=(table,))] if rows else []


def _fewer(sections: Iterable[Section], stage: str) -> list[Section]:
    """`sections` of one stage with its first figures; the words say what draws the others."""
    kept: list[Section] = []
    drawn = 0
    for section in sections:
        if section.title == CARD:  # it is at the top, once for all stages
            continue
        if drawn + len(section.figures) > _FIGURES and drawn:
            words = _say("not_drawn", stage, len(section.figures))
            section = replace(section, text=(*section.text, words), figures=())
        drawn += len(section.figures)
        kept.append(section)
    return kept


def _titled(sections: Iterable[Section], prefix: str) -> list[Section]:
    """`sections`, with titles and figures named after their stage."""
    return [
        replace(
            section,
            title=f"{prefix}: {section.title}",
            figures=tuple(replace(f, name=f"{slug(prefix)}-{f.name}") for f in section.figures),
        )
        for section in sections
    ]

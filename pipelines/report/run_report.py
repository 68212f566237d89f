"""The report of a run: the verdict, one table of all stages, what diagnosis says, then every other stage's report."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from pipelines.log.places import slug
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.run_result import Group, Result

__all__ = ["run_report"]

_WORST: tuple[Tone, ...] = ("neutral", "good", "attention", "bad")


def run_report(result: Result) -> Report:
    """The worst verdict first, one table of all stages, what diagnosis says, then every other stage's report."""
    steps = [(group.name, step) for group in result.groups for step in group.stages]
    tone = max((step.report.tone for _, step in steps), key=_WORST.index)
    verdicts = [text for group in result.groups for text in _verdicts(group)]
    table = Table(("logs", "stage", "verdict"), tuple((name or "all", step.name, step.report.verdict) for name, step in steps),
                  caption="Each stage in the order it was run.", tones=tuple(step.report.tone for _, step in steps))
    single = len(steps) == 1
    sections = [Section("Stages", tables=(table,))] if not single else []
    for name, step in sorted(steps, key=lambda one: not isinstance(one[1].result, Diagnosis)):  # the answer before its sources
        sections += _titled(step.report.sections, "" if single else " · ".join(filter(None, (name, step.name))))
    return Report("Run", " ".join(verdicts), tone, steps[0][1].report.key_figures if single else None, tuple(sections))


def _verdicts(group: Group) -> list[str]:
    """What the last stage that had a result says, after whatever is not in order before it."""
    last = max((i for i, step in enumerate(group.stages) if step.result is not None), default=-1)
    shown = [step for i, step in enumerate(group.stages) if i == last or step.report.tone in ("attention", "bad")]
    return [f"{group.name}: {step.report.verdict}" if group.name else step.report.verdict for step in shown]


def _titled(sections: Iterable[Section], prefix: str) -> list[Section]:
    """`sections`, their titles and figures told apart from those of other stages."""
    return [dataclasses.replace(
        section, title=f"{prefix}: {section.title}" if prefix else section.title,
        figures=tuple(dataclasses.replace(f, name=f"{slug(prefix)}-{f.name}" if prefix else f.name) for f in section.figures))
        for section in sections]

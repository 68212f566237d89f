"""Sections that several reports share: the checks of a log, and what its torque is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pipelines.errors import Check, Level
from pipelines.estimation.checks.boundary import Boundary
from pipelines.report.codes import title_of
from pipelines.report.document import sections_of
from pipelines.report.report import Report, Section, Table, Tone

NO_COLLISION_CHECK = (
    "Self-collision is not checked, nor is collision with anything around the robot."
)
CARD = "What the logged torque is"

_LEVELS: dict[Level, tuple[str, Tone]] = {  # the worst first
    "reject": ("not usable", "bad"),
    "repair": ("repaired", "attention"),
    "warn": ("warning", "attention"),
    "ok": ("passed", "good"),
}


def level_tone(levels: Iterable[Level]) -> Tone:
    """The tone of the worst of several checks."""
    return _LEVELS[min(levels, key=list(_LEVELS).index, default="ok")][1]


def checks_table(checks: Iterable[Check], *, as_given: bool = False) -> Table:
    """Return the table of checks, the worst first, or `as_given`."""
    found = list(checks)
    if not as_given:
        found.sort(key=lambda check: list(_LEVELS).index(check.level))
    rows = []
    for c in found:
        code = f"{c.code} {title_of(c.code)}".strip()
        rows.append((_LEVELS[c.level][0], c.message, c.where, c.remedy, code))
    tones = tuple(_LEVELS[c.level][1] for c in found)
    return Table(("result", "finding", "where", "what to do", "code"), tuple(rows), tones=tones)


def boundary_card(boundary: Boundary | None) -> tuple[Section, ...]:
    """Return the card of the logged torque; nothing where no log moves the arm enough.

    It is open where the torque contradicts the description of the robot.
    """
    if boundary is None:
        return ()
    parts = {
        "its sign": boundary.sign,
        "gravity": boundary.gravity.present,
        "gravity's direction": boundary.direction.vector,
        "friction": boundary.friction.present,
        "the order of the joints": None if boundary.order.reason else boundary.order.columns,
    }
    if boundary.gravity.present is False:
        parts["gravity's direction"] = ()
    unknown = [name for name, value in parts.items() if value is None]
    context = {"boundary": boundary, "unknown": unknown, "known": len(unknown) < len(parts)}
    (card,) = sections_of("boundary", title=CARD, **context)
    bad = "bad" in card.tables[0].tones
    return (replace(card, folded=not bad),)


def with_card(report: Report, boundary: Boundary | None, first: bool = False) -> Report:
    """Return the report with the card, before all sections where it is open or `first`."""
    card = boundary_card(boundary)
    front = first or any(not section.folded for section in card)
    sections = (*card, *report.sections) if front else (*report.sections, *card)
    return replace(report, sections=sections)

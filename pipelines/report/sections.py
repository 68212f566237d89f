"""Sections that several reports share: the checks of a log, and what its torque is."""

from __future__ import annotations

import math
from collections.abc import Iterable

from pipelines.errors import Check, Level
from pipelines.estimation.checks.boundary import Boundary
from pipelines.report.codes import title_of
from pipelines.report.report import Section, Table, Tone
from pipelines.report.sentences import as_sentence, paragraphs, sentence

NO_COLLISION_CHECK = (
    "Self-collision is not checked, nor is collision with anything around the robot."
)
CARD = "What the logged torque is"

_TONES: dict[Level, Tone] = {
    "ok": "good",
    "warn": "attention",
    "repair": "attention",
    "reject": "bad",
}
_RESULTS: dict[Level, str] = {
    "ok": "passed",
    "warn": "warning",
    "repair": "repaired",
    "reject": "not usable",
}
_ORDER: tuple[Level, ...] = ("reject", "repair", "warn", "ok")
_LISTED = 40  # numerics: logs
_UNKNOWN = "not identifiable"

Row = tuple[str, str, str, Tone]  # quantity, estimate, meaning, tone


def level_tone(levels: Iterable[Level]) -> Tone:
    """The tone of the worst of several checks."""
    worst: Level = min(levels, key=_ORDER.index, default="ok")
    return _TONES[worst]


def checks_table(checks: Iterable[Check], *, as_given: bool = False) -> Table:
    """Return the table of checks, the worst first, or `as_given`."""
    found = list(checks) if as_given else sorted(checks, key=lambda c: _ORDER.index(c.level))
    return Table(
        ("result", "finding", "where", "what to do", "code"),
        tuple(
            (
                _RESULTS[c.level],
                c.message,
                c.where,
                c.remedy,
                f"{c.code} {title_of(c.code)}".strip(),
            )
            for c in found
        ),
        tones=tuple(_TONES[c.level] for c in found),
    )


def data_quality(checks: Iterable[Check]) -> tuple[Section, ...]:
    """The section of the checks of the logs, where there are any."""
    found = tuple(checks)
    return (Section("Data quality", tables=(checks_table(found),)),) if found else ()


def further_logs(names: Iterable[str]) -> tuple[Section, ...]:
    """The section of the logs that have no figures, where there are any."""
    listed = ", ".join(list(names)[:_LISTED])
    text = f"Their figures are in result.json alone: {listed}."
    return (Section("Further logs", (text,)),) if listed else ()


def boundary_card(boundary: Boundary | None) -> tuple[Section, ...]:
    """Return the card of the logged torque: verdict, a row a quantity, what is not identifiable.

    Nothing where no log moves the arm enough.
    """
    if boundary is None:
        return ()
    rows = [_sign(boundary), _gravity(boundary), _direction(boundary), _friction(boundary)]
    rows += [_order(boundary)]
    table = Table(
        ("quantity", "estimate ± standard deviation", "meaning"),
        tuple(row[:3] for row in rows),
        tones=tuple(row[3] for row in rows),
    )
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
    text = paragraphs("boundary", "text", boundary, unknown, len(unknown) < len(parts))
    leads = any(row[3] != "neutral" for row in rows)
    return (Section(CARD, text, (table,), leads=leads, folded=not leads),)


def _sign(boundary: Boundary) -> Row:
    names = {"magnitude": "none", None: _UNKNOWN}
    tone: Tone = "bad" if boundary.sign == "magnitude" else "neutral"
    meaning = sentence("boundary", "sign", boundary.sign)
    return "sign", names.get(boundary.sign, "signed"), meaning, tone


def _number(value: float | None, std: float | None) -> str:
    if value is None or std is None or not math.isfinite(std):
        return _UNKNOWN
    digits = max(2, min(4, 1 - math.floor(math.log10(std)))) if std > 0.0 else 4
    return f"{value + 0.0:.{digits}f} ± {std:.{digits}f}"


def _gravity(boundary: Boundary) -> Row:
    share = boundary.gravity
    tone: Tone = "bad" if boundary.without_gravity else "neutral"
    meaning = sentence("boundary", "gravity", share)
    return "share of gravity", _number(share.share, share.std), meaning, tone


def _direction(boundary: Boundary) -> Row:
    direction = boundary.direction
    tone: Tone = "bad" if boundary.turned else "neutral"
    if direction.vector is None or direction.std is None or direction.angle is None:
        return "gravity vector [m/s²]", _UNKNOWN, as_sentence(direction.reason), tone
    vector = ", ".join(f"{round(x, 2) + 0.0:.2f}" for x in direction.vector)
    angle, std = math.degrees(direction.angle), math.degrees(direction.std)
    meaning = f"{angle:.1f}° from the description."
    return "gravity vector [m/s²]", f"[{vector}] ± {std:.1f}°", meaning, tone


def _friction(boundary: Boundary) -> Row:
    share = boundary.friction
    meaning = sentence("boundary", "friction", share, boundary.side)
    return "friction, share of the torque", _number(share.share, share.std), meaning, "neutral"


def _order(boundary: Boundary) -> Row:
    order = boundary.order
    tone: Tone = "bad" if order.signal else "neutral"
    estimate = _UNKNOWN if order.columns is None else ", ".join(map(str, order.columns))
    if order.columns is not None and not order.signal:
        estimate += ", as logged"
    return "order of the joints", estimate, sentence("boundary", "order", order), tone

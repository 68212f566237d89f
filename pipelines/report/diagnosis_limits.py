"""What logs can and cannot tell: the smallest of each cause that would have been found, and what to record for the others."""

from __future__ import annotations

from collections.abc import Mapping

from pipelines.diagnosis.result import DetectionLimit, Diagnosis, Value
from pipelines.model.effects import find_effect
from pipelines.report.diagnosis_words import spoken, title_of, told_value, unit_or_dash, without_keys
from pipelines.report.report import Section, Table
from pipelines.report.style import format_number, format_unit

__all__ = ["limits_sections"]

_AT = {  # what of a cause's shape a technician can use; the rest is the form of its law
    "order": "{size} waves {per}", "from_joint": "from joint {size}", "with_joint": "with joint {size}", "link": "of link {size}",
    "speed": "speed {size} {unit}", "distance": "travel {size} {unit}", "time_constant": "time constant {size} {unit}",
    "duration": "lasting {size} {unit}", "frequency": "{size} {unit}", "gap": "free play {size} {unit}",
    "limit": "at {size} {unit}"}
_FOUND = ("With 95 %, had it been there, by the power of the test; nothing smaller can be excluded. "
          "Cannot be seen: nothing that is physically likely would show.")


def limits_sections(result: Diagnosis) -> list[Section]:
    """What these logs can and cannot tell."""
    sections = []
    if result.detection_limits:
        rows = tuple((title_of(one.cause), one.joint, spoken(one.parameter), *_smallest(one)) for one in result.detection_limits)
        sections.append(Section("What would have been found", (_FOUND,),
                                (Table(("cause", "joint", "parameter", "smallest", "unit", "at"), rows),)))
    if result.not_identifiable:
        hidden = tuple((title_of(one.cause), one.joint, without_keys(one.reason), without_keys(one.record))
                       for one in result.not_identifiable)
        sections.append(Section("What these logs cannot tell", ("Neither found nor excluded.",),
                                (Table(("cause", "joint", "why", "what to record"), hidden),)))
    if result.without_limit:
        rest = tuple((title_of(one.cause), without_keys(one.reason)) for one in result.without_limit)
        sections.append(Section("Without a size to tell", ("Of these no smallest size that would have been found is known.",),
                                (Table(("cause", "what is known of it"), rest),)))
    return sections


def _shape(at: Mapping[str, Value]) -> str:
    """For which waves, joint, speed or time it is, in words."""
    return ", ".join(_AT[name].format(size=format_number(value.value, 3), unit=format_unit(value.unit),
                                      per="a turn" if value.unit == "1/rev" else "in 2π m")
                     for name, value in at.items() if name in _AT and isinstance(value.value, int | float))


def _smallest(one: DetectionLimit) -> tuple[str, ...]:
    """Value, unit, and for what it is; words where nothing that is expected in either direction would show."""
    value = one.minimum.value
    ends = [abs(end) for q in find_effect(one.cause).parameters if q.name == one.parameter for end in (q.low, q.high) if end]
    expected = [] if one.or_less else ends
    if isinstance(value, float) and expected and value >= min(expected):
        return "cannot be seen", "", ""
    told = format_number(value, 2) if isinstance(value, float) else told_value(one.minimum)
    return told, unit_or_dash(one.minimum.unit), "this or less" if one.or_less else _shape(one.at)

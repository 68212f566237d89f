"""Words of a diagnosis that several of its sections use."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from pipelines.diagnosis.result import Finding, Rejected, Value
from pipelines.model.effects import effect_names, find_effect
from pipelines.model.parameter_names import numbered, part_of
from pipelines.model.words import within
from pipelines.report.finding_words import other_joint
from pipelines.report.joint_units import Units
from pipelines.report.style import format_number, format_unit, unit_in_words, with_std

__all__ = ["as_sentence", "at_places", "cause_at", "in_order", "is_cause", "meaning_of", "named", "spoken",
           "title_of", "together", "told_value", "told_values", "torque_of", "unit_or_dash", "without_keys"]

_COUNTED = ("second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
_KEY = re.compile(r"\b([a-z]+(?:_[a-z]+)*)(?::(\d+)(?::([a-z]+(?:_[a-z]+)*))?)?\b")


def cause_at(cause: str, joint: int | None) -> str:
    """As causes are written on the command line."""
    return cause if joint is None else f"{cause}:{joint}"


def is_cause(name: str) -> bool:
    """Return whether it is something that may be wrong, and no law of friction that every nominal model may have."""
    return name in effect_names() and find_effect(name).evidence != "none"


def title_of(cause: str) -> str:
    """Plain words for a cause."""
    return find_effect(cause).words.title if cause in effect_names() else cause


def named(cause: str, joint: int | None) -> str:
    """A cause and its joint within a sentence: "cogging at joint 2"; as it is typed it is `cause_at`."""
    title = title_of(cause)
    words = within(title)
    return words if joint is None else f"{words} at joint {joint}"


def together(found: Iterable[Finding | Rejected]) -> list[tuple[str, str]]:
    """(cause, words) of each cause once with all its joints: "Stribeck friction at joints 1 and 3"."""
    return at_places((one.cause, f"{one.joint or ''}{f' ({other})' if other else ''}") for one in found
                     for other in (other_joint(one.parameters) if isinstance(one, Finding) else "",))


def at_places(places: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The same of (cause, joint in words) each; of the whole arm the joint is ""."""
    joints: dict[str, list[str]] = {}
    for cause, joint in places:
        joints.setdefault(cause, []).append(joint)
    return [(cause, _at_joints(cause, own)) for cause, own in joints.items()]


def _at_joints(cause: str, joints: Sequence[str]) -> str:
    *first, last = [joint for joint in joints if joint] or [""]
    if not last:
        return named(cause, None)
    at = f"at joints {', '.join(first)} and {last}" if first else f"at joint {last}"
    return f"{named(cause, None)} {at}{' and at all joints together' if '' in joints else ''}"


def torque_of(one: Finding, units: Units) -> str:
    """Of its own joint, or of the largest."""
    return f"{format_number(one.torque_rms, 2)} {units.at(one.joint).torque}"


def as_sentence(text: str) -> str:
    """It begins large and ends in a full stop."""
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")


def spoken(parameter: str) -> str:
    """A parameter's key in words: "second amplitude" for "amplitude_2", "gain error" for "gain_error"."""
    name, number = numbered(parameter)
    return (name if number < 2 else f"{_counted(number)} {name}").replace("_", " ")


def _counted(number: int) -> str:
    """"second", "third", … "11th", from 2 on."""
    if number < len(_COUNTED) + 2:
        return _COUNTED[number - 2]
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th") if number % 100 not in (11, 12, 13) else "th"
    return f"{number}{ending}"


def meaning_of(cause: str, parameter: str) -> str:
    """What a parameter of an effect stands for, as the effect says; "" where it does not."""
    known = find_effect(cause).parameters if cause in effect_names() else ()
    own, which = part_of(cause, parameter)
    meaning = next((q.meaning for q in known if q.name == own), "")
    if meaning and which > 1:
        meaning = f"{meaning}; of the {_counted(which)} one at this joint"
    for q in known:
        meaning = meaning.replace(q.name, spoken(q.name)) if "_" in q.name else meaning
    return meaning


def without_keys(text: str) -> str:
    """A stored reason as people read it: "cogging at joint 2" for "cogging:2", "torque offset" for "torque_offset".

    A parameter behind them stands before: "level of Coulomb friction at joint 1" for "coulomb:1:level".
    """
    def in_words(found: re.Match[str]) -> str:
        cause, joint = found[1], found[2]
        if cause not in effect_names() or (joint is None and "_" not in cause):
            return found[0]
        place = named(cause, None if joint is None else int(joint))
        return f"{spoken(found[3])} of {place}" if found[3] else place

    return _KEY.sub(in_words, text)


def told_value(value: Value) -> str:
    """"0.102 ± 0.003", or three of them."""
    values = value.value if isinstance(value.value, tuple | list) else (value.value,)
    stds = value.std if isinstance(value.std, tuple | list) else (value.std,) * len(values)
    return ", ".join(with_std(x, s) if s is not None else format_number(x) for x, s in zip(values, stds, strict=True))


def told_values(named: Iterable[tuple[str, Value]]) -> str:
    """"order 18 per rev, exponent 2": names, values and units in one line; a pure number has no unit to show."""
    return ", ".join(f"{spoken(name)} {told_value(value)} {unit_in_words(value.unit)}".strip()
                     for name, value in named)


def unit_or_dash(unit: str) -> str:
    """In a table: a pure number has no unit to show."""
    return "–" if unit == "1" else format_unit(unit)


def in_order(cause: str, parameters: Mapping[str, Value]) -> list[tuple[str, Value]]:
    """The parameters as the effect lists them, one after the other where there are several; JSON sorts them by name."""
    known = [q.name for q in find_effect(cause).parameters] if cause in effect_names() else []
    place = {name: k for k, name in enumerate(known)}

    def rank(parameter: str) -> tuple[int, int, str]:
        own, which = part_of(cause, parameter)
        return which, place.get(own, len(known)), parameter

    return sorted(parameters.items(), key=lambda item: rank(item[0]))



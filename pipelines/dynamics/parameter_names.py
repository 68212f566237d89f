"""Split the names of effects' parameters in results into their parts.

The stage comes first, then the cause, its joint and the quantity.

    named_in("extend model cogging joint 2 amplitude 2")
        "extend model", cogging at joint 2, "amplitude_2"
    named_in("coulomb:3:level")
        Coulomb friction at joint 3, "level"
    quantity_of("cogging joint 1 phase 5")
        of the second wave there its second phase: the quantity "phase_2"
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from pipelines.effects import effect_names, find_effect
from pipelines.effects.base import Quantity

__all__ = ["Named", "named_in", "numbered", "part_of", "quantity_of"]

_WORD = re.compile(r"\S+")
_CAUSES = (
    re.compile(r"([a-z_]+)(?::(\d+))?:([a-z_0-9]+)"),  # "coulomb:3:level", "payload:mass"
    re.compile(r"([a-z_]+)(?: joint (\d+))?(?: (.+))?"))  # "coulomb joint 3 level", "payload mass"
# how friction was fitted; "output-error" stands in results of earlier versions alone
_METHOD = re.compile(r"(?:varpro|output-error|ekf) ")
_NUMBERED = re.compile(r"(.+)_([2-9]|[1-9][0-9]+)$")  # harmonics, and waves of further orders
_HARMONIC = re.compile(r" ([2-9]|[1-9][0-9]+)(?= \(\d+\)$|$)")
_AGAIN = re.compile(r" \(\d+\)$")  # the how manieth of one name it is


@dataclass(frozen=True)
class Named:
    """A number of an effect at its place, by what a result calls it."""

    before: str  # the stage, and where in it
    cause: str  # of a friction fit the law of the joint
    joint: int | None
    what: str  # the parameter; of a friction fit also "coulomb.level", of its law, or "inertia"
    of_law: bool  # it is of a friction fit, which names everything of a joint by its law


def named_in(name: str) -> Named | None:
    """Return the effect and the parameter that `name` is of; None where it is of no effect."""
    for start in (word.start() for word in _WORD.finditer(name)):
        for pattern in _CAUSES:
            if (found := pattern.fullmatch(name, start)) is not None and found[1] in effect_names():
                method = _METHOD.match(what := found[3] or "")
                what = _HARMONIC.sub(r"_\1", what[method.end():] if method else what)
                return Named(name[:start].strip(), found[1],
                             None if found[2] is None else int(found[2]), what, method is not None)
    return None


def quantity_of(name: str) -> Quantity | None:
    """Return the quantity that a figure of this name is a value of; None where it is of no
    effect."""
    found = named_in(name)
    if found is None:
        return None
    effect, dot, what = found.what.partition(".")
    cause, what = (effect.replace(" ", "_"), what) if dot else (found.cause, found.what)
    own, _ = part_of(cause, _AGAIN.sub("", what).replace(" ", "_"))
    return next((q for q in find_effect(cause).parameters
                 if q.name == own), None) if cause in effect_names() else None


def numbered(parameter: str) -> tuple[str, int]:
    """Name and number, 1 where it has none: ("order", 2) of "order_2"."""
    found = _NUMBERED.match(parameter)
    return (found[1], int(found[2])) if found else (parameter, 1)


def part_of(cause: str, parameter: str) -> tuple[str, int]:
    """Return the effect's own parameter, and of the how manieth one at its joint it is."""
    known = [q.name for q in find_effect(cause).parameters] if cause in effect_names() else []
    name, number = numbered(parameter)
    numbers = max((numbered(own)[1] for own in known), default=1)
    first = (number - 1) % numbers + 1
    own = name if first == 1 else f"{name}_{first}"
    return (parameter,
            1) if parameter in known or own not in known else (own, (number - 1) // numbers + 1)

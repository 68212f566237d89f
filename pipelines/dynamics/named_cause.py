"""Read a cause as it is written on the command line.

"cogging:2", "cogging:2:amplitude=0.1,order=18", "gravity_tilt:angle=0.02".

    acting = acting_cause("cogging:2:amplitude=0.1", robot.revolute)

What is not given keeps its default: a non-linear number that of the effect, an amplitude zero, or
what physics gives it. Any other amplitude has to be given: with all at zero an effect does nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipelines.dynamics.arm import Acting
from pipelines.effects import effect_names, find_effect
from pipelines.effects.base import Effect, Quantity, joints_of
from pipelines.errors import UsageError, did_you_mean

__all__ = ["acting_cause", "refuse_unknown", "wanted_cause"]

# whose option it is
_LISTED_BY = {"--with": "extend", "--exclude": "diagnose", "--discriminate": "design-excitation"}


def acting_cause(
    text: str, revolute: Sequence[bool], where: str = "--fault", command: str = "simulate"
) -> Acting:
    """Return the cause that `text` names, with its numbers.

    Args:
        revolute: of each joint of the arm, whether it turns.
        command: whose help lists the causes that there are.

    Raises:
        UsageError: C01, no such cause or parameter; C02, a joint or number that does not fit.
    """
    effect, given = _read(text, revolute, where, command)
    linear = [q for q in effect.parameters if not q.shape and not q.derived and q.period is None]
    fixed = effect.parameters.fixed
    values = (_defaults(effect) if fixed is None else effect.values(fixed)) | given
    if not given or not any(q.name in given or values[q.name] for q in linear):
        words = f"'{text}' does not say how strong it is"
        if follows := [q.name for q in effect.parameters if q.derived and q.name in given]:
            words = f"'{text}': {', '.join(follows)} follows from other numbers"
        ranges = ", ".join(map(_range, linear if given else effect.parameters))
        raise UsageError("C02", words, where=where, remedy=f"give some of {ranges}")
    turns = effect.joint is None or revolute[effect.joint - 1]
    return Acting.of(effect, values, origin="assumed", revolute=turns)


def wanted_cause(
    text: str, revolute: Sequence[bool], where: str = "--with"
) -> tuple[Effect, dict[str, float]]:
    """Return the cause that `text` names, to be fitted, and where its non-linear numbers start.

    Raises:
        UsageError: C01, no such cause or number; C02, a joint or number that does not fit, or one
            that every fit finds anew.
    """
    effect, given = _read(text, revolute, where)
    shapes = [q.name for q in effect.parameters if q.shape and not q.derived]
    if linear := [name for name in given if name not in shapes]:
        words = f"'{text}': {', '.join(linear)} is fitted and takes no value"
        remedy = f"a start can be given to {', '.join(shapes) or 'none of its numbers'}"
        raise UsageError("C02", words, where=where, remedy=remedy)
    return effect, given


def refuse_unknown(text: str, where: str, command: str = "extend") -> None:
    """Refuse a text that does not begin with the name of a cause.

    Raises:
        UsageError: C01; with the nearest names, and where all of them stand.
    """
    name = text.split(":")[0]
    if name not in effect_names():
        near = did_you_mean(name, effect_names(), 3) or did_you_mean(name, effect_names(), 3, 0.5)
        remedy = f"'rrrid {_LISTED_BY.get(where, command)} --help' lists all causes"
        raise UsageError("C01", f"'{name}' is not a cause{near}", where=where, remedy=remedy)


def _read(
    text: str, revolute: Sequence[bool], where: str, command: str = "extend"
) -> tuple[Effect, dict[str, float]]:
    """Return the effect at its joint, and the numbers that are given."""
    refuse_unknown(text, where, command)
    name, *place = text.split(":")
    kind, numbers = find_effect(name), place.pop() if place and "=" in place[-1] else ""
    effect = kind(joint=_joint(text, kind, place, revolute, where))
    known, given = {q.name: q for q in kind.parameters}, dict[str, float]()
    for own, _, number in (part.partition("=") for part in numbers.split(",") if part.strip()):
        own = own.strip()
        if own not in known:
            words = f"{name} has no parameter '{own}'{did_you_mean(own, known)}"
            remedy = f"its parameters are {', '.join(known)}"
            raise UsageError("C01", words, where=where, remedy=remedy)
        try:
            given[own] = float(number)
        except ValueError:
            given[own] = math.nan
        if not known[own].low <= given[own] <= known[own].high:
            what = "is not a number" if math.isnan(given[own]) else "is out of range"
            remedy = f"it takes {', '.join(map(_range, kind.parameters))}"
            raise UsageError("C02", f"{own} = {number} {what}", where=where, remedy=remedy)
    for own, value in (_defaults(effect) | given).items() if given else ():
        if why := known[own].unfit(value, effect.joint, len(revolute)):
            remedy = f"give {own} another number"
            raise UsageError("C02", f"'{text}': {why}", where=where, remedy=remedy)
    return effect, given


def _defaults(effect: Effect) -> dict[str, float]:
    return {q.name: float(getattr(effect, q.name)) if q.shape else 0.0 for q in effect.parameters}


def _joint(
    text: str, kind: type[Effect], place: list[str], revolute: Sequence[bool], where: str
) -> int | None:
    """Return the joint that stands between the name and the numbers."""
    of_joint, able = kind.scope == "joint", joints_of(kind, revolute)
    if len(place) != of_joint:
        takes = "a joint" if of_joint else "no joint, it belongs to the whole arm"
        words, remedy = f"'{text}': {kind.name} takes {takes}", f"write {kind.name}"
        remedy += ":JOINT:NAME=VALUE" if of_joint else ":NAME=VALUE"
    elif not of_joint:
        return None
    elif place[0] not in map(str, range(1, len(revolute) + 1)):
        words = f"'{place[0]}' is no joint of this arm"
        remedy = f"give one of 1 to {len(revolute)}"
    elif int(place[0]) not in able:
        words = f"'{text}': joint {place[0]} slides, and only one that turns can have it"
        remedy = f"give one of {', '.join(map(str, able)) or 'no joint: name another cause'}"
    else:
        return int(place[0])
    raise UsageError("C02", words, where=where, remedy=remedy)


def _range(q: Quantity) -> str:
    """ "amplitude -50 to 50 N m"; a pure number has no unit to show."""
    return f"{q.name} {q.low:g} to {q.high:g}{'' if q.unit == '1' else f' {q.unit}'}"

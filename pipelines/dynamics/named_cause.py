"""Read a cause as it is written on the command line.

"cogging:2", "cogging:2:amplitude=0.1,order=18", "gravity_tilt:angle=0.02".

    acting = acting_cause("cogging:2:amplitude=0.1", robot.revolute)

What is not given keeps its default: a non-linear number that of the effect, an amplitude zero, or
what physics gives it, as that of a drive that clips. Any other amplitude has to be given, for an
effect of which all are zero does nothing.
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


def acting_cause(text: str, revolute: Sequence[bool], where: str = "--fault",
                 command: str = "simulate") -> Acting:
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
        follows = [q.name for q in effect.parameters if q.derived and q.name in given]
        words = f"'{text}' does not say how strong it is"
        if follows:
            words = f"'{text}': {', '.join(follows)} follows from other numbers"
        ranges = ", ".join(map(_range, linear if given else effect.parameters))
        raise UsageError("C02", words, where=where,
                         remedy=f"give {ranges}" if given else f"give some of {ranges}")
    turns = effect.joint is None or revolute[effect.joint - 1]
    return Acting.of(effect, values, origin="assumed", revolute=turns)


def wanted_cause(text: str, revolute: Sequence[bool],
                 where: str = "--with") -> tuple[Effect, dict[str, float]]:
    """Return the cause that `text` names, to be fitted, and where its non-linear numbers start.

    As in "cogging:2" or "cogging:2:order=18".

    Raises:
        UsageError: C01, no such cause or number; C02, a joint or number that does not fit, or one
            that every fit finds anew.
    """
    effect, given = _read(text, revolute, where)
    shapes = [q.name for q in effect.parameters if q.shape and not q.derived]
    if linear := [name for name in given if name not in shapes]:
        remedy = f"write {text.rpartition(':')[0]}"
        if shapes:
            remedy = f"a start can be given to {', '.join(shapes)}"
        raise UsageError("C02", f"'{text}': {', '.join(linear)} is fitted and takes no value",
                         where=where, remedy=remedy)
    return effect, given


def refuse_unknown(text: str, where: str, command: str = "extend") -> None:
    """Refuse a text that does not begin with the name of a cause.

    Raises:
        UsageError: C01; with the nearest names, and where all of them stand.
    """
    name = text.split(":")[0]
    if name not in effect_names():
        near = did_you_mean(name, effect_names(), 3) or did_you_mean(name, effect_names(), 3, 0.5)
        raise UsageError("C01", f"'{name}' is not a cause{near}", where=where,
                         remedy=f"'rrrid {_LISTED_BY.get(where, command)} --help' lists all causes")


def _read(text: str, revolute: Sequence[bool], where: str,
          command: str = "extend") -> tuple[Effect, dict[str, float]]:
    """Return the effect at its joint, and the numbers that are given."""
    refuse_unknown(text, where, command)
    name, *rest = text.split(":")
    kind, numbers = find_effect(name), rest.pop() if rest and "=" in rest[-1] else ""
    effect = kind(joint=_joint(text, kind, rest, numbers, revolute, where))
    known = {q.name: q for q in kind.parameters}
    given: dict[str, float] = {}
    for own, _, number in (part.partition("=") for part in numbers.split(",") if part.strip()):
        own = own.strip()
        if own not in known:
            raise UsageError("C01", f"{name} has no parameter '{own}'{did_you_mean(own, known)}",
                             where=where, remedy=f"its parameters are {', '.join(known)}")
        given[own] = _number(number, own, where)
        if not known[own].low <= given[own] <= known[own].high:
            raise UsageError("C02", f"{own} = {given[own]:g} is out of range", where=where,
                             remedy=f"it takes {', '.join(map(_range, kind.parameters))}")
    for own, value in (_defaults(effect) | given).items() if given else ():
        if why := known[own].unfit(value, effect.joint, len(revolute)):
            raise UsageError("C02", f"'{text}': {why}", where=where,
                             remedy=f"give {own} another number")
    return effect, given


def _defaults(effect: Effect) -> dict[str, float]:
    return {q.name: float(getattr(effect, q.name)) if q.shape else 0.0 for q in effect.parameters}


def _joint(text: str, kind: type[Effect], rest: list[str], numbers: str,
           revolute: Sequence[bool], where: str) -> int | None:
    """Return the joint that stands between the name and the numbers."""
    def refused(words: str, remedy: str) -> UsageError:
        return UsageError("C02", words, where=where, remedy=remedy)

    of_joint = kind.scope == "joint"
    if len(rest) != of_joint:
        what = "a joint" if of_joint else "no joint, it belongs to the whole arm"
        place = f"{':JOINT' if of_joint else ''}{f':{numbers}' if numbers else ''}"
        raise refused(f"'{text}': {kind.name} takes {what}", f"write {kind.name}{place}")
    if not rest:
        return None
    said, able = rest[0], joints_of(kind, revolute)
    if not (said.isascii() and said.isdigit()) or not 1 <= int(said[:6]) <= len(revolute):
        raise refused(f"'{said}' is no joint of this arm", f"give one of 1 to {len(revolute)}")
    if int(said) not in able:
        remedy = f"give one of {', '.join(map(str, able))}" if able else "name another cause"
        raise refused(f"'{text}': joint {int(said)} slides, and only one that turns can have it",
                      remedy)
    return int(said)


def _range(q: Quantity) -> str:
    """"amplitude -50 to 50 N m"; a pure number has no unit to show."""
    return f"{q.name} {q.low:g} to {q.high:g}{'' if q.unit == '1' else f' {q.unit}'}"


def _number(text: str, name: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UsageError("C02", f"{name}: '{text}' is not a number", where=where,
                         remedy=f"write for example {name}=0.1")
    return value

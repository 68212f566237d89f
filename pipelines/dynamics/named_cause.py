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
    name, *rest = text.split(":")
    refuse_unknown(text, where, command)
    kind = find_effect(name)
    joint, numbers = _place(text, kind, rest, revolute, where)
    values = _values(text, kind, kind(joint=joint), numbers, where)
    _refuse_unfit(text, kind, values, joint, len(revolute), where)
    _refuse_weak(text, kind, values, numbers, where)
    return Acting.of(kind(joint=joint), values, origin="assumed", revolute=joint is None
                     or revolute[joint - 1])


def wanted_cause(text: str, revolute: Sequence[bool],
                 where: str = "--with") -> tuple[Effect, dict[str, float]]:
    """Return the cause that `text` names, to be fitted, and where its non-linear numbers start.

    As in "cogging:2" or "cogging:2:order=18".

    Raises:
        UsageError: C01, no such cause or number; C02, a joint or number that does not fit, or one
            that every fit finds anew.
    """
    name, *rest = text.split(":")
    refuse_unknown(text, where)
    kind = find_effect(name)
    joint, numbers = _place(text, kind, rest, revolute, where)
    effect = kind(joint=joint)
    if not numbers:
        return effect, {}
    values = _values(text, kind, effect, numbers, where)
    _refuse_unfit(text, kind, values, joint, len(revolute), where)
    given = [part.partition("=")[0].strip() for part in numbers.split(",") if part.strip()]
    shapes = [q.name for q in kind.parameters if q.shape and not q.derived]
    if linear := [one for one in given if one not in shapes]:
        raise UsageError(
            "C02", f"'{text}': {', '.join(linear)} is fitted and takes no value", where=where,
            remedy=f"a start can be given to {', '.join(shapes)}"
            if shapes else f"write {text.split(':')[0]}"
            f"{'' if joint is None else f':{joint}'}")
    return effect, {one: values[one] for one in given}


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


def _place(text: str, kind: type[Effect], rest: list[str], revolute: Sequence[bool],
           where: str) -> tuple[int | None, str]:
    """Return the joint, and the text of the numbers."""
    numbers = rest.pop() if rest and "=" in rest[-1] else ""
    place = ":JOINT" if kind.scope == "joint" else ""
    belongs = f"write {kind.name}{place}{f':{numbers}' if numbers else ''}"
    wanted = 1 if kind.scope == "joint" else 0
    if len(rest) != wanted:
        what = "a joint" if wanted else "no joint, it belongs to the whole arm"
        raise UsageError("C02", f"'{text}': {kind.name} takes {what}", where=where, remedy=belongs)
    if not rest:
        return None, numbers
    if not (rest[0].isascii() and rest[0].isdigit()) or not 1 <= int(rest[0][:6]) <= len(revolute):
        raise UsageError("C02", f"'{rest[0]}' is no joint of this arm", where=where,
                         remedy=f"give one of 1 to {len(revolute)}")
    joint, able = int(rest[0]), joints_of(kind, revolute)
    if joint not in able:
        raise UsageError(
            "C02", f"'{text}': joint {joint} slides, and only one that turns can have it",
            where=where,
            remedy=f"give one of {', '.join(map(str, able))}" if able else "name another cause")
    return joint, numbers


def _values(text: str, kind: type[Effect], effect: Effect, numbers: str,
            where: str) -> dict[str, float]:
    known = {quantity.name: quantity for quantity in kind.parameters}
    fixed = {} if kind.parameters.fixed is None else effect.values(kind.parameters.fixed)
    values = {
        q.name: float(getattr(effect, q.name)) if q.shape else fixed.get(q.name, 0.0)
        for q in kind.parameters
    }
    ranges = ", ".join(map(_range, kind.parameters))
    given = [part.partition("=") for part in numbers.split(",") if part.strip()]
    if not given:
        raise UsageError("C02", f"'{text}' does not say how strong it is", where=where,
                         remedy=f"give some of {ranges}")
    for name, _, number in given:
        name = name.strip()
        if name not in known:
            raise UsageError("C01",
                             f"{kind.name} has no parameter '{name}'{did_you_mean(name, known)}",
                             where=where, remedy=f"its parameters are {', '.join(known)}")
        values[name] = _number(number, name, where)
        if not known[name].low <= values[name] <= known[name].high:
            raise UsageError("C02", f"{name} = {values[name]:g} is out of range", where=where,
                             remedy=f"it takes {ranges}")
    return values


def _range(q: Quantity) -> str:
    """"amplitude -50 to 50 N m"; a pure number has no unit to show."""
    return f"{q.name} {q.low:g} to {q.high:g}{'' if q.unit == '1' else f' {q.unit}'}"


def _refuse_weak(text: str, kind: type[Effect], values: dict[str, float], numbers: str,
                 where: str) -> None:
    """C02, only numbers that do nothing without an amplitude: an order, a frequency."""
    linear = [q for q in kind.parameters if not q.shape and not q.derived and q.period is None]
    given = {part.partition("=")[0].strip() for part in numbers.split(",")}
    if given & {q.name for q in linear} or any(values[q.name] for q in linear):
        return
    ranges = ", ".join(map(_range, linear))
    follows = [q.name for q in kind.parameters if q.derived and q.name in given]
    what = f"'{text}' does not say how strong it is"
    if follows:
        what = f"'{text}': {', '.join(follows)} follows from other numbers"
    raise UsageError("C02", what, where=where, remedy=f"give {ranges}")


def _refuse_unfit(text: str, kind: type[Effect], values: dict[str, float], joint: int | None,
                  joints: int, where: str) -> None:
    """C02, a number that names a joint or a link which the arm does not have."""
    for quantity in kind.parameters:
        if why := quantity.unfit(values[quantity.name], joint, joints):
            raise UsageError("C02", f"'{text}': {why}", where=where,
                             remedy=f"give {quantity.name} another number")


def _number(text: str, name: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UsageError("C02", f"{name}: '{text}' is not a number", where=where,
                         remedy=f"write for example {name}=0.1")
    return value

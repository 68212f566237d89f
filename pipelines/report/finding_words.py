"""Describe findings in words: the verdict in one line a cause, their place and size.

headlines(result)              the verdict, a line for each cause
where(finding)                 " at joint 2 (from joint 1)"
how_much(finding)              "0.349 ± 0.001 N m", "28.0 ± 0.1 Hz", "-10.0 ± 0.1 %"
taken_in(finding, left)        ", most of which the nominal model had taken in"
of_any_size(finding)           whether these logs leave open how large its torque is
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipelines.diagnosis.result import Alternative, Finding, Result, Value
from pipelines.effects import find_effect
from pipelines.estimation.nominal import within
from pipelines.io.log import Array
from pipelines.report.config import REPORT
from pipelines.report.sentences import as_sentence
from pipelines.report.style import format_number, with_std

__all__ = ["headlines", "how_much", "of_any_size", "other_joint", "taken_in", "where"]

# usual units, where these are not SI
_USUAL = {"1": (100.0, "%"), "rad": (1e3, "mrad"), "m": (1e3, "mm"), "s": (1e3, "ms")}
_DEGREE = np.pi / 180.0
_TORQUES = ("N m", "N")
_OTHER = {"from_joint": "from", "with_joint": "with"}  # parameters that name another joint


def headlines(found: Result) -> tuple[str, ...]:
    """Return the verdict: a line for each cause, or one line where no cause is named."""
    changed = found.question == "what has changed"
    if found.findings:
        lines = [_line(one, found) for one in found.findings]
        return (*lines, as_sentence(found.reason)) if found.reason else tuple(lines)
    if found.verdict == "no-fault-found":
        what = "No change since the reference logs" if changed else "No fault"
        return (
            f"{what} was found, as far as these logs can tell. {as_sentence(found.reason)}".strip(),
        )
    if found.verdict == "cannot-judge":
        what = "has changed since the reference logs" if changed else "is wrong"
        return (f"These logs cannot show whether anything {what}: {as_sentence(found.reason)}",)
    return (f"The residual exceeds the noise, and no cause is named: {as_sentence(found.reason)}",)


def _line(one: Finding, found: Result) -> str:
    """Return a cause: joint, size, probability, gain, share of the excess residual, next action."""
    size, p = how_much(one), _probability(one.probability)
    what = f"{one.title}{where(one, found.joints)}{f': {size}' if size else ''}{p}"
    if one.alternatives:
        first, *more = one.alternatives
        others = f"or {_alternative(one, first, found.joints)}"
        others = f"{others}, or {len(more)} more" if more else others
        words = f"{what}, {others}: these logs do not separate them."
        whole = f"{words} {as_sentence(one.experiment or '')}".strip()
        return whole if len(whole) <= REPORT.headline else words
    gain = f"; {_gain(one, found)}, {100.0 * one.explained:.0f} % of the excess residual."
    action = as_sentence(find_effect(one.cause).words.remedy.split(";")[0])
    line = f"{what}{gain} {action}"
    return line if len(line) <= REPORT.headline else f"{what}{gain}"


def _gain(one: Finding, found: Result) -> str:
    """Return the held-out torque error of its joint, or of the largest, without and with it."""
    torque = one.gain.validate_torque_rms
    joint = int(np.argmax(torque.before - torque.after)) if one.joint is None else one.joint - 1
    unit, scale = _torque_unit(one), 1.0
    if joint < len(found.rated) and np.isfinite(found.rated[joint]):
        unit, scale = "% of rated", 100.0 / found.rated[joint]
    before, after = (
        format_number(float(x[joint]) * scale, 2) for x in (torque.before, torque.after)
    )
    at = f" of joint {joint + 1}" if one.joint is None else ""
    return f"held-out torque error{at} {before} → {after} {unit}"


def _torque_unit(one: Finding) -> str:
    """Return the unit of the torque of a finding: "N" at a sliding joint, by its numbers."""
    units = {value.unit for name, value in one.parameters.items() if not name.startswith("force")}
    return "N" if units & {"N", "N s/m", "N/m"} else "N m"  # the force of a contact is at the tip


def _probability(p: float | None) -> str:
    if p is None or not np.isfinite(p):
        return ""
    return " (p > 0.99)" if p > 0.99 else f" (p = {p:.2f})"


def _alternative(first: Finding, other: Alternative, names: Sequence[str]) -> str:
    like = replace(first, cause=other.cause, joint=other.joint, log=None)
    like = replace(like, parameters=other.parameters, torque_rms=np.nan)
    size, p = how_much(like), _probability(other.probability)
    title = within(find_effect(other.cause).words.title)
    return f"{title}{where(like, names)}{f': {size}' if size else ''}{p}"


def where(one: Finding, names: Sequence[str] = ()) -> str:
    """Return the joint of a finding, the other joint it depends on, and when it happened.

    Args:
        names: of the joints; none: only the number is given.
    """
    other, start = other_joint(one.parameters), one.parameters.get("start")
    at = "" if one.joint is None else f" at joint {one.joint}"
    name = names[one.joint - 1] if one.joint is not None and one.joint <= len(names) else ""
    told = ", ".join(x for x in (name if name != f"joint {one.joint}" else "", other) if x)
    when = ""
    if start is not None and isinstance(start.value, int | float):
        when = f", {start.value:.2f} s into {one.log or 'every log'}"
    return f"{at}{f' ({told})' if told else ''}{when}"


def how_much(one: Finding) -> str:
    """Return the size of a finding with its standard deviation, and the order of what repeats.

    Where no single number is its size, the rms of its torque.
    """
    effect = find_effect(one.cause)
    name = effect.words.size
    size = one.parameters.get(name)
    if size is None or not isinstance(size.value, int | float) or not np.isfinite(size.value):
        known = np.isfinite(one.torque_rms)
        return f"{format_number(one.torque_rms, 2)} {_torque_unit(one)} rms" if known else ""
    times, unit = _USUAL.get(size.unit, (1.0, size.unit))
    if name == "angle":
        times, unit = 1.0 / _DEGREE, "°"
    signed = size.unit != "kg" and any(q.name == name and q.low < 0.0 for q in effect.parameters)
    std = size.std * times if isinstance(size.std, float) else None
    words = f"{'+' if signed and size.value > 0.0 else ''}{with_std(size.value * times, std)}"
    order = one.parameters.get("order")
    waves = "" if order is None else f", order {format_number(float(np.ravel(order.value)[0]), 3)}"
    return f"{words}{'' if unit == '°' else ' '}{unit.replace('^2', '²')}{waves}"


def other_joint(parameters: Mapping[str, Value]) -> str:
    """Return "from joint 1"; empty where a cause depends on no other joint."""
    for name, word in _OTHER.items():
        joint = parameters[name].value if name in parameters else None
        if isinstance(joint, int | float):
            return f"{word} joint {joint:g}"
    return ""


def taken_in(one: Finding, left: Array) -> str:
    """Return what is said where the nominal model imitates most of the power of a torque.

    Its residual at that joint contains the part of that torque that it does not imitate.

    Args:
        left: (joints,) [N m] rms that the nominal model leaves of the logs it was fitted to.
    """
    rest = float(np.nanmax(left)) if one.joint is None else float(left[one.joint - 1])
    most = one.torque_rms**2 > 2.0 * rest**2
    return ", most of which the nominal model had taken in" if most else ""


def of_any_size(one: Finding) -> bool:
    """Return whether the largest torque among the numbers has no finite deviation."""
    torques = [v for v in one.parameters.values() if v.unit in _TORQUES and np.ndim(v.value) == 0]
    largest = max(torques, key=lambda v: abs(np.nan_to_num(v.value)), default=None)
    return largest is not None and largest.std is not None and bool(np.isinf(largest.std).all())

"""Describe findings in words: the verdict in one line a cause, their place and size.

headlines(result)              the verdict, a line for each cause
where(finding)                 "at joint 2 (from joint 1)"
how_much(finding)              "0.349 ± 0.001 N m", "28.0 ± 0.1 Hz", "-10.0 ± 0.1 %"
beyond_chance(finding)         whether held-out time alone shows that it is there
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pipelines.effects import find_effect
from pipelines.estimation.nominal import within
from pipelines.report.config import REPORT
from pipelines.report.document import sentence
from pipelines.report.style import format_number, with_std

if TYPE_CHECKING:
    from pipelines.diagnosis.result import Alternative, Finding, Result, Value

__all__ = ["beyond_chance", "headlines", "how_much", "of_any_size", "other_joint", "where"]

# usual units, where these are not SI
_USUAL = {"1": (100.0, "%"), "rad": (1e3, "mrad"), "m": (1e3, "mm"), "s": (1e3, "ms")}
_DEGREE = np.pi / 180.0
_TORQUES = ("N m", "N")
_OTHER = {"from_joint": "from", "with_joint": "with"}  # parameters that name another joint


def headlines(found: Result) -> tuple[str, ...]:
    """Return the verdict: a line for each cause, or one line where no cause is named.

    Causes whose gain on held-out time is not beyond chance share the last line.
    """
    if not found.findings:
        changed = found.question == "what has changed"
        return (sentence("no_cause", found.verdict, changed, found.reason),)
    any_sure = any(map(beyond_chance, found.findings))
    lines, weak = [], []
    for one in found.findings:
        if any_sure and not beyond_chance(one):
            weak.append(_cause(one, found.joints))
        else:
            lines.append(_line(one, found))
    lines += [sentence("weaker", weak)] if weak else []
    return (*lines, sentence("rest", found.reason)) if found.reason else tuple(lines)


def beyond_chance(one: Finding) -> bool:
    """Return whether a 95 % interval of the gain excludes zero, or other evidence names it."""
    outside = one.origin not in ("residual", "reversals")
    return outside or bool((one.gain.validate_torque_rms.ci95[:, 1] < 0.0).any())


def _line(one: Finding, found: Result) -> str:
    """Return a cause: joint, size, probability, gain, share of the excess residual, next action."""
    what = _cause(one, found.joints)
    if one.alternatives:
        others = [_alternative(one, other, found.joints) for other in one.alternatives]
        short, *action = (sentence("alternatives", what, others, x) for x in ("", one.experiment))
    else:
        gain = (_gain(one, found), one.explained)
        remedy = find_effect(one.cause).words.remedy.split(";")[0]
        short, *action = (sentence("gain", what, *gain, x) for x in ("", remedy))
    return next((line for line in action if len(line) <= REPORT.headline), short)


def _cause(one: Finding, names: Sequence[str]) -> str:
    return sentence("cause", one.title, where(one, names), how_much(one), one.probability)


def _alternative(first: Finding, other: Alternative, names: Sequence[str]) -> str:
    like = replace(first, cause=other.cause, joint=other.joint, log=None, torque_rms=np.nan)
    like = replace(like, parameters=other.parameters, probability=other.probability)
    return _cause(replace(like, title=within(find_effect(other.cause).words.title)), names)


def _gain(one: Finding, found: Result) -> dict[str, object]:
    """Return the held-out torque error of its joint, or of the largest, without and with it."""
    torque = one.gain.validate_torque_rms
    joint = int(np.argmax(torque.before - torque.after)) if one.joint is None else one.joint - 1
    unit, scale = _torque_unit(one), 1.0
    if joint < len(found.rated) and np.isfinite(found.rated[joint]):
        unit, scale = "% of rated", 100.0 / found.rated[joint]
    before, after = (float(x[joint]) * scale for x in (torque.before, torque.after))
    at = joint + 1 if one.joint is None else None
    return {"before": before, "after": after, "unit": unit, "joint": at}


def _torque_unit(one: Finding) -> str:
    """Return the unit of the torque of a finding: "N" at a sliding joint, by its numbers."""
    units = {value.unit for name, value in one.parameters.items() if not name.startswith("force")}
    return "N" if units & {"N", "N s/m", "N/m"} else "N m"  # the force of a contact is at the tip


def where(one: Finding, names: Sequence[str] = ()) -> str:
    """Return the joint of a finding, the other joint it depends on, and when it happened.

    Args:
        names: of the joints; none: only the number is given.
    """
    start = one.parameters.get("start")
    when = start.value if start is not None and isinstance(start.value, int | float) else None
    name = names[one.joint - 1] if one.joint is not None and one.joint <= len(names) else ""
    details = [
        x for x in (name if name != f"joint {one.joint}" else "", other_joint(one.parameters)) if x
    ]
    return sentence("where", one.joint, details, when, one.log)


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


def of_any_size(one: Finding) -> bool:
    """Return whether the largest torque among the numbers has no finite deviation."""
    torques = [v for v in one.parameters.values() if v.unit in _TORQUES and np.ndim(v.value) == 0]
    largest = max(torques, key=lambda v: abs(np.nan_to_num(v.value)), default=None)
    return largest is not None and largest.std is not None and bool(np.isinf(largest.std).all())

"""Describe findings in words: their place, their size, and the causes that imitate them.

summary_of(result)             one sentence for a technician
where(finding)                 " at joint 2 (from joint 1)"
how_much(finding)              " of 0.15 kg", " (28 Hz)", " (-10 %)"
taken_in(finding, left)        ", most of which the nominal model had taken in"
of_any_size(finding)           whether these logs leave open how large its torque is
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipelines.diagnosis.result import Alternative, Diagnosis, Finding, Value
from pipelines.effects import find_effect
from pipelines.estimation.nominal import plain_number, within
from pipelines.io.log import Array
from pipelines.report.config import REPORT

__all__ = ["how_much", "of_any_size", "other_joint", "summary_of", "taken_in", "where"]

# usual units, where these are not SI
_USUAL = {"1": (100.0, "%"), "rad": (1e3, "mrad"), "m": (1e3, "mm"), "s": (1e3, "ms")}
_DEGREE = np.pi / 180.0
_TORQUES = ("N m", "N")
_OTHER = {"from_joint": "from", "with_joint": "with"}  # parameters that name another joint


def summary_of(found: Diagnosis) -> str:
    """Return the summary, one sentence for a technician."""
    if found.verdict == "no-fault-found":
        return "Nothing is wrong with this arm, as far as these logs can tell."
    if found.verdict == "cannot-judge":
        return f"Whether anything is wrong with this arm cannot be judged: {found.reason}."
    if not found.findings:
        return f"Something is wrong, and no cause is named: {found.reason}."
    first, *more = found.findings
    what = f"{first.title}{how_much(first)}{where(first)}"
    if first.alternatives:
        which = "".join(f", or {_alternative(first, one)}" for one in first.alternatives)
        return f"{what}{which}: these logs do not tell which. {first.experiment or ''}".rstrip()
    revolute = () if found.nominal is None else found.nominal.robot.revolute
    turns = revolute if first.joint is None else revolute[first.joint - 1 : first.joint]
    units = dict.fromkeys("N m rms of torque" if one else "N rms of force" for one in turns)
    size = f"{first.torque_rms:.2g} {' or '.join(units)}"
    return f"{what}: {size}{taken_in(first, found.residual_rms.identify)}{_beside(more)}."


def _alternative(first: Finding, other: Alternative) -> str:
    like = replace(first, cause=other.cause, joint=other.joint, log=None)
    like = replace(like, parameters=other.parameters)
    return f"{within(find_effect(other.cause).words.title)}{how_much(like)}{where(like)}"


def where(one: Finding) -> str:
    """Return the joint of a finding, the other joint it depends on, and when it happened."""
    other, start = other_joint(one.parameters), one.parameters.get("start")
    at = "" if one.joint is None else f" at joint {one.joint}"
    when = ""
    if start is not None and isinstance(start.value, int | float):
        when = f", {start.value:.2f} s into {one.log or 'every log'}"
    return f"{at}{f' ({other})' if other else ''}{when}"


def how_much(one: Finding) -> str:
    """Return the number that is the size of a finding, to three digits; empty without one."""
    effect = find_effect(one.cause)
    told = one.parameters.get(effect.words.size)
    if told is None or not isinstance(told.value, int | float) or not np.isfinite(told.value):
        return ""
    if told.unit == "kg" and one.joint is None:
        return f" of {plain_number(told.value, 3)} kg"
    degrees, usual = (1.0 / _DEGREE, "°"), _USUAL.get(told.unit, (1.0, told.unit))
    times, unit = degrees if effect.words.size == "angle" else usual
    signed = any(q.name == effect.words.size and q.low < 0.0 for q in effect.parameters)
    sign = "+" if signed and told.value > 0.0 else ""
    space = "" if unit == "°" else " "
    std = told.std if isinstance(told.std, float) and np.isfinite(told.std) else 0.0
    off = f" ± {plain_number(std * times, 2)}" if abs(told.value) < REPORT.vague * std else ""
    return f" ({sign}{plain_number(told.value * times, 3)}{off}{space}{unit.replace('^2', '²')})"


def other_joint(parameters: Mapping[str, Value]) -> str:
    """Return "from joint 1"; empty where a cause depends on no other joint."""
    for name, word in _OTHER.items():
        joint = parameters[name].value if name in parameters else None
        if isinstance(joint, int | float):
            return f"{word} joint {joint:g}"
    return ""


def _beside(others: Sequence[Finding]) -> str:
    """Return "; and torque logging delay (120 ms) at joint 1", and how many more there are."""
    told = [f"{within(one.title)}{how_much(one)}{where(one)}" for one in others[:REPORT.told]]
    if len(others) > REPORT.told:
        told.append(f"{len(others) - REPORT.told} more")
    *first, last = told or [""]
    return f"; {', '.join(first)}{' ' if first else ''}and {last}" if last else ""


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

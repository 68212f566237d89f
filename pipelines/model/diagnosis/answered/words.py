"""Words of a finding that its sentence and its report share: where it is, and how much of it a model without it imitates.

    where(finding)                 " at joint 2 (from joint 1)"
    how_much(finding)              " of 0.15 kg", " (28 Hz)", " (-10 %)"
    beside(findings)               "; and torque logging delay (120 ms) at joint 1"
    taken_in(finding, left)        ", most of which the nominal model had taken in"
    of_any_size(finding)           whether these logs leave open how large its torque is
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.result import Finding, Value
from pipelines.model.effects import find_effect
from pipelines.model.words import plain_number, within

__all__ = ["beside", "how_much", "of_any_size", "other_joint", "taken_in", "where"]

# Units as a technician says them, where others than SI are usual. How far something is tilted is told in degrees.
_USUAL = {"1": (100.0, "%"), "rad": (1e3, "mrad"), "m": (1e3, "mm"), "s": (1e3, "ms")}
_DEGREE = np.pi / 180.0
_TORQUES = ("N m", "N")
_TOLD = 2  # further findings that a sentence names
_OTHER = {"from_joint": "from", "with_joint": "with"}  # parameters that name another joint


def where(one: Finding) -> str:
    """Its joint, and the other one that it has to do with, and when it happened; empty where it belongs to the whole arm."""
    other, start = other_joint(one.parameters), one.parameters.get("start")
    at = "" if one.joint is None else f" at joint {one.joint}"
    when = ""
    if start is not None and isinstance(start.value, int | float):
        when = f", {start.value:.2f} s into {one.log or 'every log'}"
    return f"{at}{f' ({other})' if other else ''}{when}"


def how_much(one: Finding) -> str:
    """The number that says how much of it there is, to three digits; empty where no single one does."""
    effect = find_effect(one.cause)
    told = one.parameters.get(effect.words.size)
    if told is None or not isinstance(told.value, int | float) or not np.isfinite(told.value):
        return ""
    if told.unit == "kg" and one.joint is None:
        return f" of {plain_number(told.value, 3)} kg"
    times, unit = (1.0 / _DEGREE, "°") if effect.words.size == "angle" else _USUAL.get(told.unit, (1.0, told.unit))
    signed = any(q.name == effect.words.size and q.low < 0.0 for q in effect.parameters)
    sign = "+" if signed and told.value > 0.0 else ""
    return f" ({sign}{plain_number(told.value * times, 3)}{'' if unit == '°' else ' '}{unit.replace('^2', '²')})"


def other_joint(parameters: Mapping[str, Value]) -> str:
    """"from joint 1"; empty where a cause has to do with no other joint."""
    found = ((word, parameters[name].value) for name, word in _OTHER.items() if name in parameters)
    return next((f"{word} joint {joint:g}" for word, joint in found if isinstance(joint, int | float)), "")


def beside(others: Sequence[Finding]) -> str:
    """"; and torque logging delay (120 ms) at joint 1", and how many more where they are many; or nothing."""
    told = [f"{within(one.title)}{how_much(one)}{where(one)}" for one in others[:_TOLD]]
    if len(others) > _TOLD:
        told.append(f"{len(others) - _TOLD} more")
    *first, last = told or [""]
    return f"; {', '.join(first)}{' ' if first else ''}and {last}" if last else ""


def taken_in(one: Finding, left: Array) -> str:
    """Said where friction and rigid body, fitted without the finding, imitate most of the power of its torque.

    What they leave of its joint holds whatever of that torque they do not imitate.

    Args:
        left: (joints,) [N m] rms that the nominal model leaves of the logs it was fitted to.
    """
    rest = float(np.nanmax(left)) if one.joint is None else float(left[one.joint - 1])
    return ", most of which the nominal model had taken in" if one.torque_rms**2 > 2.0 * rest**2 else ""


def of_any_size(one: Finding) -> bool:
    """Return whether the largest torque among its numbers has no finite deviation: the model can take in any amount of it."""
    told = [(abs(float(np.nan_to_num(value.value))), value.std) for value in one.parameters.values()
            if value.unit in _TORQUES and isinstance(value.value, int | float)]
    _, std = max(told, key=lambda each: each[0], default=(0.0, None))
    return isinstance(std, int | float) and bool(np.isinf(std))

"""What is told of one finding: what it is, what to check, what it is worth, the figure that proves it, and its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipelines.diagnosis.result import Finding, Gain, ResidualRms
from pipelines.log.experiment import Array
from pipelines.model.effects import find_effect
from pipelines.model.parameter_names import numbered
from pipelines.report.diagnosis_answers import answer_figures
from pipelines.report.diagnosis_proof import proof_figures
from pipelines.report.diagnosis_words import (
    as_sentence,
    cause_at,
    in_order,
    meaning_of,
    named,
    spoken,
    told_value,
    torque_of,
    unit_or_dash,
)
from pipelines.report.finding_words import of_any_size, taken_in, where
from pipelines.report.joint_units import Units
from pipelines.report.report import Section, Table
from pipelines.report.style import format_decimals, format_number, three_digits, to_one_place
from pipelines.report.tip_words import span_words, tip_worth

__all__ = ["finding_section", "gain_table", "numbers_section"]

_TURNING = Units()
_HIDDEN = 2.0  # times the share of the whole, from which the share at its own joint says something else


def finding_section(number: int, one: Finding, nominal: ResidualRms, offer: bool = True, floor: str = "the noise floor",
                    units: Units = _TURNING, beside: Sequence[Finding] = (), left: Array | None = None) -> Section:
    """What it is, what to check, what it is worth, and the figure that proves it.

    Args:
        nominal: what the model without any finding leaves, and the floor of the held-out logs.
        offer: say how to extend the model by it.
        floor: what its share is counted from.
        beside: every finding, this one among them.
        left: held-out torque error of each joint with all findings.
    """
    kind = find_effect(one.cause)
    text = [f"{kind.words.explanation}", f"What to check: {kind.words.remedy}", f"How it shows: {kind.words.signature}",
            f"{_share(one, nominal, floor)}; {format_number(100.0 * (1.0 - one.identifiability), 2)} % of it is confounded with "
            f"model parameters.{tip_worth(one.gain)}"]
    if of_any_size(one):
        text.append("How large its torque is these logs do not tell: rigid body and friction can take in any amount of it, and the "
                    "size given below is one of many: fed forward, it holds on motion like that of these logs alone")
    elif math.isfinite(one.torque_rms):
        text.append(f"Over the logs that were fitted its torque is {torque_of(one, units)} rms{taken_in(one, nominal.identify)}; "
                    "over other motion it may be more or less")
    text += _larger(one, units, left)
    if one.origin == "frequency responses":
        text.append("Frequency responses name it, and it explains these logs as well; its numbers are "
                    "fitted to both")
    if offer and not _happens_once(one):
        text.append(_offer(one, [other for other in beside if not _happens_once(other)]))
    if one.alternatives:
        names = ", ".join(f"{named(r.cause, r.joint)} (similarity {format_number(r.similarity, 2)})" for r in one.alternatives)
        text.append(f"It could also be {names}. To tell: {one.experiment or kind.words.experiment}")
        pair = " ".join(cause_at(some.cause, some.joint) for some in (one, one.alternatives[0]))
        text.append(f"Or let \"rrrid design-excitation LOG --discriminate {pair}\" design the motion")
    return Section(f"{number}. {one.title}{where(one)}", tuple(as_sentence(t) for t in text),
                   figures=(*answer_figures(number, one), *proof_figures(number, one, units)))


def _larger(one: Finding, units: Units, left: Array | None) -> list[str]:
    """At which joints the held-out error is larger with it, beyond its interval, and stays so with all findings: what another takes
    away again, the two share, and it is no doubt of this one."""
    torque = one.gain.validate_torque_rms
    grown = torque.after - torque.before
    stays = grown if left is None else left - torque.before
    larger = (torque.ci95[:, 0] > 0.0) & (stays > grown - torque.ci95[:, 0])  # more than the interval is wide
    told = [f"at joint {j + 1}, {format_number(float(torque.after[j]), 3)} instead of {format_number(float(torque.before[j]), 3)} "
            f"{units.at(j + 1).torque} rms" for j in np.flatnonzero(larger).tolist()]
    where_not = "; ".join(told)
    return [f"With it the held-out torque error is larger {where_not}: not all of it is what the arm does there"] if told else []


def numbers_section(number: int, one: Finding, units: Units = _TURNING, every: Sequence[Finding] = ()) -> Section:
    """What was identified and what it gains, joint by joint: behind the figure that proves it.

    Args:
        every: findings of the report; what frequency responses name is taken out before a residual is searched.
    """
    taken = " and what frequency responses name" if any(other.origin == "frequency responses" for other in every) else ""
    beside = f"the findings before it{taken}" if one.origin in ("residual", "reversals") else "all other findings"
    return Section(f"{number}. In numbers", (), (_numbers(one), gain_table(
        one.gain, f"Gain on held-out time, root mean square, beside {beside}.", units)))


def _offer(one: Finding, every: Sequence[Finding]) -> str:
    """How to extend the model, by all findings where there are others; and what held-out logs lack where no joint's gain is beyond
    its interval there."""
    command = _extending([one])
    if one.origin not in ("residual", "reversals") or (one.gain.validate_torque_rms.ci95[:, 1] < 0.0).any():
        return f"{command} writes the model with it{f', {_extending(every)} that with all' if len(every) > 1 else ''}"
    return (f"On the held-out time alone no joint's gain is beyond its 95 % interval. {command} writes the model with it where "
            "that of the whole arm is; else record more with the purpose \"validate\"")


def _extending(some: Sequence[Finding]) -> str:
    causes = dict.fromkeys(cause_at(one.cause, one.joint) for one in some)
    return f"\"rrrid extend LOGS {' '.join(f'--with {cause}' for cause in causes)}\""


def _happens_once(one: Finding) -> bool:
    return find_effect(one.cause).clock == "log"


def _share(one: Finding, nominal: ResidualRms, floor: str) -> str:
    """Return its share of the residual above the floor of all joints; and of its own joint, where a larger one hides the share."""
    whole = f"It accounts for {format_number(100.0 * one.explained, 3)} % of the residual above {floor}"
    own = _own_share(one, nominal)
    if len(nominal.identify) == 1 or not own > _HIDDEN * one.explained:
        return whole
    return f"{whole} at all joints together, and {format_number(100.0 * own, 2)} % of that of joint {one.joint}, held out"


def _own_share(one: Finding, nominal: ResidualRms) -> float:
    """Of the power that its own joint has above the floor on held-out time; NaN where it has none, or no joint of its own."""
    if one.joint is None or one.origin == "base parameters":
        return math.nan
    torque, j = one.gain.validate_torque_rms, one.joint - 1
    before, after, whole, floor = (float(x[j]) ** 2 for x in (torque.before, torque.after, nominal.validate, nominal.noise_floor))
    return float(np.clip((before - after) / (whole - floor), 0.0, 1.0)) if whole > floor else math.nan


def _numbers(one: Finding) -> Table:
    if not set(one.parameters) <= {q.name for q in find_effect(one.cause).parameters}:
        return _numbers_of_several(one)
    rows = tuple((spoken(name), told_value(value), unit_or_dash(value.unit), meaning_of(one.cause, name))
                 for name, value in in_order(one.cause, one.parameters))
    return Table(("parameter", "value ± std", "unit", "what it is"), rows, "What was identified.")


def _numbers_of_several(one: Finding) -> Table:
    """A row for each number that parameters end in: the waves of three gears in nine rows, not in 27."""
    listed = {numbered(name): value for name, value in in_order(one.cause, one.parameters)}
    names = dict.fromkeys(name for name, _ in listed)
    units = {name: unit_or_dash(next(value.unit for (own, _), value in listed.items() if own == name)) for name in names}
    rows: list[tuple[str | int, ...]] = [
        (number, *(told_value(listed[name, number]) if (name, number) in listed else "–" for name in names))
        for number in sorted({number for _, number in listed})]
    said = "; ".join(f"{spoken(name)}: {meaning_of(one.cause, name)}" for name in names)
    return Table(("number", *(f"{spoken(name)} [{unit}]" for name, unit in units.items())), tuple(rows),
                 f"What was identified, value ± std, several of the kind at one joint; {said}; from number 2 on, of the next one. "
                 "In result.json the number ends a parameter's name.")


def gain_table(gain: Gain, caption: str, units: Units = _TURNING) -> Table:
    """Joint by joint: torque and simulated position, without and with; the caption ends in how much of which logs was simulated."""
    torque, position = gain.validate_torque_rms, gain.simulated_position_rms
    joints = len(torque.before)
    errors = to_one_place([*map(float, torque.before), *map(float, torque.after)])
    decimals = 1 + max((len(f"{x:.9g}".partition(".")[2]) for x in errors if x is not None), default=0)  # a change is smaller
    rows = []
    for j in range(joints):
        low, high = (format_decimals(float(end), decimals) if math.isfinite(end) else "–" for end in torque.ci95[j])
        moved = (None, None) if position is None else (three_digits(1e3 * x[j]) for x in (position.before, position.after))
        rows.append((j + 1, *errors[j::joints], f"{low} to {high}", *moved))
    unit, small = units.torque, units.thousandths
    return Table(("joint", f"torque error without [{unit}]", f"with [{unit}]", f"change, 95 % [{unit}]",
                  f"simulated position error without [{small}]", f"with [{small}]"), tuple(rows),
                 f"{caption}{f' Positions are simulated {span}.' if (span := span_words(gain)) else ''}")

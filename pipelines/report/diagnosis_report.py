"""The report of a diagnosis: the verdict and what to check, the proof, the picture of what is wrong, rivals, ledger, limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from pipelines.model.diagnosis.outcome import Result
from pipelines.model.diagnosis.responding import BELOW
from pipelines.model.diagnosis.result import Finding, Gain, Trial
from pipelines.model.effects import find_effect
from pipelines.report.diagnosis_limits import limits_sections
from pipelines.report.diagnosis_picture import picture_sections
from pipelines.report.diagnosis_proof import proof_figures
from pipelines.report.diagnosis_words import (
    cause_at,
    floor_words,
    held_out_floor,
    held_out_words,
    in_order,
    meaning_of,
    named,
    per_joint,
    spoken,
    title_of,
    together,
    told_value,
    told_values,
    unit_or_dash,
    without_keys,
)
from pipelines.report.diagnosis_words import torque_errors as errors_table
from pipelines.report.joint_units import Units, units_in
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import format_decimals, format_number, to_one_place

__all__ = ["diagnosis_report", "finding_section", "gain_table", "numbers_section"]

_LEDGER = 40  # lines
_OUT_OF_REACH = "A threshold above 100 % is told as a dash: an arm in order leaves so much of it that such logs cannot show it."
_TURNING = Units()
_TONES: dict[str, Tone] = {"nothing-wrong": "good", "cause": "bad", "unknown": "attention"}


def diagnosis_report(result: Result) -> Report:
    """Verdict, key figures, findings with their proof, evidence, limits."""
    units = units_in(result)
    found = [section for number, one in enumerate(result.findings, 1)
             for section in (finding_section(number, one, units=units), numbers_section(number, one, units))]
    sections = [*found, *_unknown(result), *picture_sections(result, result.rated, units), *_standing(result), *_others(result),
                *limits_sections(result), _basis(result), *_doctor(result)]
    return Report(f"Diagnosis of {result.robot}" if result.robot else "Diagnosis", _verdict(result), _TONES[result.verdict],
                  errors_table(result.residual_rms, result.after_rms, result.rated, *held_out_floor(result), units),
                  tuple(sections), _advice(result))


def _verdict(result: Result) -> str:
    """One sentence; what to check stands in the first section."""
    if result.verdict == "nothing-wrong":
        since = " has changed since the reference logs" if result.question == "what has changed" else " is wrong with this arm"
        caveat = f" {_sentence(without_keys(result.reason))}" if result.reason else ""
        return f"Nothing{since}, as far as these logs can tell: what they could have shown stands below.{caveat}"
    if result.verdict == "unknown":
        return f"Something is wrong that has no name here: {without_keys(result.reason)}."
    first, *more = result.findings
    changed = "What has changed: " if result.question == "what has changed" else ""
    others = f"; and {', '.join(words for _, words in together((one.cause, one.joint) for one in more))}" if more else ""
    size = f", {_size(first, units_in(result))}" if math.isfinite(first.torque_rms) else ""
    tip = first.gain.tip_error_rms
    moved = f"; for it the simulated tip is {format_number(1e3 * tip.before, 2)} mm off" if tip is not None else ""
    rest = f" Beside it, {without_keys(result.reason)}." if result.reason else ""
    return f"{changed}{first.title}{_at(first.joint)}{size}{moved}{others}.{rest}"


def _advice(result: Result) -> tuple[str, ...]:
    """What to look at on the machine, cause by cause."""
    causes = together((one.cause, one.joint) for one in result.findings)
    return tuple(f"What to check{f' for {words}' if len(result.findings) > 1 else ''}: {_sentence(find_effect(cause).remedy)}"
                 for cause, words in causes)


def _at(joint: int | None) -> str:
    return "" if joint is None else f" at joint {joint}"


def _size(one: Finding, units: Units) -> str:
    rated = f" ({format_number(100.0 * one.of_rated, 2)} % of the rated torque)" if math.isfinite(one.of_rated) else ""
    return f"{_torque(one, units)} rms of torque that the model does not have{rated}"


def _torque(one: Finding, units: Units) -> str:
    """Of its own joint, or of the largest."""
    return f"{format_number(one.torque_rms, 2)} {units.at(one.joint).torque}"


def _rounded(x: float) -> float | None:
    return float(f"{x:.3g}") if math.isfinite(x) else None


def _reachable(threshold: float) -> float | None:
    """[%] a threshold, where anything could exceed it: no gain is more than the whole residual."""
    return _hundredths(100.0 * threshold) if threshold <= 1.0 else None


def _hundredths(x: float) -> float | None:
    return round(x, 2) if math.isfinite(x) else None


def finding_section(number: int, one: Finding, offer: bool = True, floor: str = "the floor", units: Units = _TURNING) -> Section:
    """What it is, what to check, what it is worth, and the figure that proves it.

    Args:
        offer: say how to extend the model by it.
        floor: what its share is counted from.
    """
    kind = find_effect(one.cause)
    text = [f"{kind.explanation}", f"What to check: {kind.remedy}", f"How it shows: {kind.signature}", _worth(one, floor)]
    if math.isfinite(one.torque_rms):
        text.append(f"Over the logs that were fitted its torque is {_torque(one, units)} rms; over other motion it may be more or "
                    "less")
    if one.origin == "frequency responses":
        text.append("Frequency responses name it; its numbers are theirs, or a refit to all logs that agrees with them. What it is "
                    f"worth is judged below {format_number(BELOW * _frequency(one), 2)} Hz: near the frequency of the spring a "
                    "torque worked out from the encoder is mostly noise")
    if one.doubt:
        text.append(f"The extended model goes without it: {without_keys(one.doubt)}")
    if offer and not one.doubt and not _happens_once(one):
        text.append(f"\"rrrid extend LOGS --with {cause_at(one.cause, one.joint)}\" writes the model with it")
    if one.rivals:
        names = ", ".join(f"{named(r.cause, r.joint)} (similarity {format_number(r.similarity, 2)})" for r in one.rivals)
        text.append(f"It could also be {names}. To tell: {one.experiment or kind.experiment}")
    return Section(f"{number}. {one.title}{_at(one.joint)}", tuple(_sentence(t) for t in text),
                   figures=tuple(proof_figures(number, one, units)))


def numbers_section(number: int, one: Finding, units: Units = _TURNING) -> Section:
    """What was identified and what it gains, joint by joint: behind the figure that proves it."""
    beside = "the findings before it" if one.origin in ("residual", "reversals") else "all other findings"
    return Section(f"{number}. In numbers", (), (_numbers(one), gain_table(
        one.gain, f"Gain on held-out time, root mean square, beside {beside}.", units)))


def _frequency(one: Finding) -> float:
    found = one.parameters["frequency"].value
    return found if isinstance(found, float) else math.nan


def _happens_once(one: Finding) -> bool:
    kind = find_effect(one.cause)
    return any(q.shape and q.name in kind.per_log for q in kind.parameters)


def _sentence(text: str) -> str:
    """It begins large and ends in a full stop."""
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")


def _worth(one: Finding, floor: str) -> str:
    simulation = {"closed-loop": "simulated in closed loop, with the controller of the logs",
                  "windowed": "simulated over short windows from smoothed states, for the logs do not know their controller",
                  "none": "not simulated"}[one.gain.simulation]
    tip = one.gain.tip_error_rms
    said = ""
    if tip is not None:
        before, after = 1e3 * tip.before, 1e3 * tip.after
        said = f" The simulated tip is {format_number(before, 3)} mm off without it and {format_number(after, 3)} mm with it"
        said += f", {simulation}."
    return (f"It explains {format_number(100.0 * one.explained, 3)} % of what stands above {floor}; the refitted model could "
            f"hide {format_number(100.0 * (1.0 - one.visibility), 2)} % of it.{said}")


def _numbers(one: Finding) -> Table:
    rows = tuple((spoken(name), told_value(value), unit_or_dash(value.unit), meaning_of(one.cause, name))
                 for name, value in in_order(one.cause, one.parameters))
    return Table(("parameter", "value ± std", "unit", "what it is"), rows, "What was identified.")


def gain_table(gain: Gain, caption: str, units: Units = _TURNING) -> Table:
    """Joint by joint: torque and simulated position, without and with."""
    torque, position = gain.validate_torque_rms, gain.simulated_position_rms
    joints = len(torque.before)
    errors = to_one_place([*map(float, torque.before), *map(float, torque.after)])
    decimals = 1 + max((len(f"{x:.9g}".partition(".")[2]) for x in errors if x is not None), default=0)  # a change is smaller
    rows = []
    for j in range(joints):
        low, high = (format_decimals(float(end), decimals) if math.isfinite(end) else "–" for end in torque.ci95[j])
        rows.append((j + 1, *errors[j::joints], f"{low} to {high}",
                     *((None, None) if position is None else (_rounded(1e3 * x[j]) for x in (position.before, position.after)))))
    unit, small = units.torque, units.thousandths
    return Table(("joint", f"torque error without [{unit}]", f"with [{unit}]", f"change, 95 % [{unit}]",
                  f"simulated position error without [{small}]", f"with [{small}]"), tuple(rows), caption)


def _unknown(result: Result) -> list[Section]:
    if result.verdict != "unknown":
        return []
    near = sorted(_nearest(result.ledger).items(), key=lambda one: -one[1])[:5]
    names = ", ".join(f"{named(*place)} ({format_number(100.0 * gain, 3)} % of the residual)" for place, gain in near)
    tried = f" The nearest explanations, none of them good enough: {names}." if near else ""
    return [Section("Why there is no name", (
        _sentence(without_keys(result.reason)) + tried, *_follows(result),
        "A wrong name costs more than none. What follows shows where and when the residual stands above its floor."))]


def _follows(result: Result) -> Iterator[str]:
    """Which signals the joint that is farthest above its floor goes with most."""
    for one in result.evidence[:1]:
        joint = int(np.argmax(np.nan_to_num(one.above_floor))) + 1
        curves = sorted((c for c in one.curves if c.joint == joint), key=lambda c: -c.explained)[:3]
        if curves:
            said = ", ".join(f"{c.against} ({format_number(100.0 * c.explained, 2)} % of its power)" for c in curves)
            yield f"The residual of joint {joint} goes most with {said}."


def _nearest(ledger: Iterable[Trial]) -> dict[tuple[str, int | None], float]:
    """What each cause takes off the residual at most; to first order where it was not fitted, for it stayed below its threshold."""
    found: dict[tuple[str, int | None], float] = {}
    for t in ledger:
        gain = t.exact_gain if math.isfinite(t.exact_gain) else t.gain
        if gain > found.get((t.cause, t.joint), 0.0):
            found[t.cause, t.joint] = gain
    return found


def _standing(result: Result) -> list[Section]:
    if not result.standing:
        return []
    rows = tuple((title_of(one.cause), one.joint, told_values(in_order(one.cause, one.parameters)),
                  _rounded(100.0 * one.explained)) for one in result.standing)
    return [Section("What the reference logs show as well", ("It is part of this robot and no news; the extended model has it.",),
                    (Table(("effect", "joint", "parameters", "explains [%]"), rows),))]


def _others(result: Result) -> list[Section]:
    """Rejected hypotheses and the ledger."""
    sections = []
    if result.rejected:
        why = tuple((title_of(one.cause), one.joint, without_keys(one.reason)) for one in result.rejected)
        sections.append(Section("Rejected", ("They came close, and are not believed.",), (Table(("cause", "joint", "why"), why),)))
    shown = [t for t in result.ledger if t.accepted or math.isfinite(t.exact_gain)]
    shown += [t for t in sorted(result.ledger, key=lambda t: -t.gain) if t not in shown][:max(0, _LEDGER - len(shown))]
    if shown:
        rows = tuple((t.step, title_of(t.cause), t.joint, _hundredths(100.0 * t.gain), _reachable(t.threshold),
                      _hundredths(100.0 * t.exact_gain), _hundredths(t.visibility),
                      "accepted" if t.accepted else without_keys(t.reason))
                     for t in sorted(shown[:_LEDGER], key=lambda t: (t.step, -t.gain)))
        tones: tuple[Tone, ...] = tuple("good" if row[-1] == "accepted" else "neutral" for row in rows)
        more = len(result.ledger) - len(rows)
        text = (f"{more} more, all weaker, stand in result.json.",) if more > 0 else ()
        sections.append(Section("Ledger of hypotheses", text, (Table(
            ("search", "cause", "joint", "gain [%]", "threshold [%]", "gain, fitted exactly [%]", "visibility", "outcome"), rows,
            "Share of the squared residual that each takes away on held-out time; what does not exceed its threshold is not "
            f"believed. {_OUT_OF_REACH}{_alike(len(result.residual_rms.identify))}", tones),)))
    return sections


def _alike(joints: int) -> str:
    """Why the share of a cause that explains everything at its joint is far from 100 %."""
    if joints < 2:
        return ""
    return (f" Each joint is weighed by its own residual: of {joints} joints, what explains all at one and nothing elsewhere takes "
            f"away {format_number(100.0 / joints, 2)} %.")


def _basis(result: Result) -> Section:
    """Where floor and thresholds come from, and what judged."""
    origins = sorted({one.origin for one in result.thresholds})
    text = [floor_words(result), held_out_words(result.held_out), f"Thresholds come from {' and '.join(origins) or 'nothing'}."]
    if result.calibrated_with:
        text.append(f"An earlier diagnosis has stored them, of {', '.join(result.calibrated_with)}.")
    if result.replicas:
        text.append(f"The twin is the fitted model run {result.replicas} times through the same controllers, references, encoders "
                    f"and noise of {per_joint(result.noise)} N m; what it shows as well is no fault.")
    if result.without:
        text.append(f"Left out, because you said so: {', '.join(map(title_of, result.without))}.")
    best: dict[tuple[str, int | None], float] = {(one.cause, one.joint): one.gain for one in result.thresholds
                                                    if math.isfinite(one.gain)}
    rows = tuple((title_of(cause), joint, _reachable(gain)) for (cause, joint), gain in sorted(
        best.items(), key=lambda item: (item[0][0], item[0][1] or 0)))
    table = Table(("cause", "joint", "share of the squared residual to exceed [%]"), rows,
                  f"Thresholds of what these logs can show. {_OUT_OF_REACH}")
    return Section("What this rests on", tuple(text), (table,) if rows else ())


def _doctor(result: Result) -> Iterable[Section]:
    if result.doctor:
        yield Section("What the log doctor remarks", (), (checks_table(result.doctor),))

"""The reports of a diagnosis and of an extension: verdict, proof, residual, candidates, limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pipelines.diagnosis.answer import WEAKER
from pipelines.diagnosis.result import (
    DetectionLimit,
    Diagnosis,
    Extension,
    Rejected,
    ResidualRms,
    Result,
    Trial,
    Value,
)
from pipelines.effects import find_effect
from pipelines.estimation.nominal import within
from pipelines.io.log import Array
from pipelines.report.diagnosis_finding import finding_section, gain_table, numbers_section
from pipelines.report.diagnosis_picture import picture_sections
from pipelines.report.finding_words import headlines
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.sections import boundary_card, data_quality
from pipelines.report.sentences import as_sentence, paragraphs, sentence
from pipelines.report.style import format_number, format_unit, three_digits, to_one_place
from pipelines.report.words import (
    Units,
    format_value,
    format_values,
    in_order,
    is_cause,
    laws_words,
    named,
    spoken,
    threshold_words,
    title_of,
    together,
    unit_or_dash,
    units_in,
    without_keys,
)

_CANDIDATES = 40  # numerics: lines
_IN_RUN = "--set diagnose.model=FILE"
_NEAR = 5  # numerics: explanations that are named where none is found
_TONES: dict[str, Tone] = {
    "no-fault-found": "good",
    "cause": "bad",
    "unknown": "attention",
    "cannot-judge": "attention",
}
# What of a cause's shape a technician can use; the rest is the form of its law.
_AT = {
    "order": "{size} waves {per}",
    "from_joint": "from joint {size}",
    "with_joint": "with joint {size}",
    "link": "of link {size}",
    "speed": "speed {size} {unit}",
    "distance": "travel {size} {unit}",
    "time_constant": "time constant {size} {unit}",
    "duration": "lasting {size} {unit}",
    "frequency": "{size} {unit}",
    "gap": "free play {size} {unit}",
    "limit": "at {size} {unit}",
}

_say, _paragraphs = partial(sentence, "diagnosis"), partial(paragraphs, "diagnosis")


def diagnosis_report(result: Result) -> Report:
    """Verdict, key figures, findings with their proof, evidence, limits."""
    units, nominal, after = units_in(result), result.residual_rms, result.after_rms
    sections = []
    for number, one in enumerate(result.findings, 1):
        found = finding_section(
            number, one, nominal, units=units, beside=result.findings, left=after.validate
        )
        sections += [found, numbers_section(number, one, units, result.findings)]
    sections += _unknown(result)
    more = picture_sections(result, result.rated, units, floor_words(result))
    more += [*_baseline(result), *_rejected(result), *_candidates(result)]
    more += [*_limits(result), _basis(result), *data_quality(result.data_quality)]
    sections += [*boundary_card(result.boundary), *(replace(one, folded=True) for one in more)]
    name = "noise of the residual" if _is_noise(result) else "left by reference logs"
    errors = torque_errors(
        nominal, after, result.rated, nominal.noise_floor, name, floor_words(result), units
    )
    title = f"Diagnosis of {result.robot}" if result.robot else "Diagnosis"
    judged = _say("held_out", result.held_out)
    basis = (
        laws_words(result.laws_of, _IN_RUN, result.fewer_terms),
        judged,
        threshold_words(result),
    )
    shown, advice = tuple(sections), _advice(result)
    return Report(title, _verdict(result), _tone(result), errors, shown, advice, basis)


def _tone(result: Result) -> Tone:
    """Return the tone; what healthy machines have as well is a fault only where it changed."""
    causes = [one.cause for one in result.findings]
    causes += [other.cause for one in result.findings for other in one.alternatives]
    ordinary = all(find_effect(cause).parameters.healthy == math.inf for cause in causes)
    if result.verdict == "cause" and ordinary and result.question != "what has changed":
        return "attention"
    return _TONES[result.verdict]


def _verdict(result: Result) -> str:
    """A line for each cause, and one for causes that were not looked for."""
    lines = [without_keys(line) for line in headlines(result)]
    without = dict.fromkeys(within(title_of(c)) for c in result.without if is_cause(c))
    if without:
        lines.append(f"Not looked for, because you said so: {', '.join(without)}.")
    return "\n".join(lines)


def _advice(result: Result) -> tuple[str, ...]:
    """Return what to check on the machine, of causes whose line has no room for it."""
    said = " ".join(headlines(result))
    several = len(result.findings) > 1
    return tuple(
        f"What to check{f' for {words}' if several else ''}: {as_sentence(remedy)}"
        for cause, words in together(result.findings)
        if (remedy := find_effect(cause).words.remedy).split(";")[0] not in said
    )


def _is_noise(found: Diagnosis) -> bool:
    """Return whether the floor is noise of the residual: there are no reference logs."""
    return found.noise_floor_origin != "reference logs"


def floor_words(found: Diagnosis) -> str:
    """Return where the noise floor comes from."""
    return _say("floor", found.noise_floor_origin)


def torque_errors(
    before: ResidualRms,
    after: ResidualRms,
    rated: Sequence[float],
    floor: Array,
    name: str,
    words: str,
    units: Units = Units(),  # noqa: B008
) -> Table:
    """Return the held-out torque error of each joint before and after, beside the noise floor.

    Where nothing extends the model there is no column of the extended one.

    Args:
        floor: (joints,) [N m]; `name`: what it is called; `words`: where it comes from.
    """
    extended = not np.array_equal(before.validate, after.validate, equal_nan=True)
    errors = [before.validate, after.validate] if extended else [before.validate]
    joints = len(floor)
    limits = [x if math.isfinite(x) else math.nan for x in [*rated, *[math.nan] * joints][:joints]]
    shares = to_one_place(
        [100.0 * float(x) / y for e in errors for x, y in zip(e, limits, strict=True)]
    )
    torques = to_one_place([float(x) for values in (*errors, floor) for x in values])
    rows = tuple((j + 1, *torques[j::joints], *shares[j::joints]) for j in range(joints))
    unit = units.torque
    heads: tuple[str, ...] = (f"torque error [{unit}]", f"{name} [{unit}]", "error [% of rated]")
    if extended:
        heads = (f"torque error now [{unit}]", f"extended [{unit}]", f"{name} [{unit}]")
        heads += ("now [% of rated]", "extended [% of rated]")
    return Table(("joint", *heads), rows, f"Held out, root mean square. {words}".strip())


def _percent(x: float) -> float | None:
    return round(100.0 * x, 2) if math.isfinite(x) else None


def _reachable(threshold: float) -> float | None:
    """[%] a threshold, where anything could exceed it: no gain is more than all the residual."""
    return _percent(threshold) if threshold <= 1.0 else None


def _unknown(result: Result) -> list[Section]:
    """The nearest explanations, and which signals the residual goes with, where none is named."""
    if result.verdict != "unknown":
        return []
    gains = sorted(_nearest(result.candidate_causes).items(), key=lambda item: -item[1])[:_NEAR]
    near = [(named(*place), gain) for place, gain in gains]
    joint, curves = 0, []
    if result.evidence:
        one = result.evidence[0]
        joint = int(np.argmax(np.nan_to_num(one.above_noise_floor))) + 1
        own = [c for c in one.curves if c.joint == joint]
        curves = sorted(own, key=lambda c: -c.explained)[:3]
    text = _paragraphs("unknown", without_keys(result.reason), near, joint, curves)
    return [Section("Why there is no name", text)]


def _nearest(candidates: Iterable[Trial]) -> dict[tuple[str, int | None], float]:
    """Return the largest gain of each cause; to first order where it was not fitted."""
    found: dict[tuple[str, int | None], float] = {}
    for t in candidates:
        gain = t.exact_gain if math.isfinite(t.exact_gain) else t.gain
        if gain > found.get((t.cause, t.joint), 0.0):
            found[t.cause, t.joint] = gain
    return found


def _baseline(result: Result) -> list[Section]:
    if not result.baseline_effects:
        return []
    rows = []
    for one in result.baseline_effects:
        parameters = format_values(in_order(one.cause, one.parameters))
        share = three_digits(100.0 * one.explained)
        rows.append((title_of(one.cause), one.joint, parameters, share))
    table = Table(("effect", "joint", "parameters", "explains [%]"), tuple(rows))
    text = "The reference logs show them as well; the extended model has them."
    return [Section("Baseline effects", (text,), (table,))]


def _rejected(result: Result) -> list[Section]:
    """A line for each reason with all causes it holds for, those that are only weaker last."""
    rejected: Sequence[Rejected] = result.rejected
    if not rejected:
        return []
    reasons = sorted({one.reason: None for one in rejected}, key=lambda reason: reason == WEAKER)
    rows = []
    for reason in reasons:
        causes = together(one for one in rejected if one.reason == reason)
        rows.append(("; ".join(words for _, words in causes), without_keys(reason)))
    weaker = sum(one.reason == WEAKER for one in rejected)
    text = _paragraphs("rejected", weaker, len(rejected) - weaker, WEAKER)
    return [Section("Rejected", text, (Table(("causes", "why"), tuple(rows)),))]


def _candidates(result: Result) -> list[Section]:
    """Those that were fitted, and of the others the best."""
    everything = result.candidate_causes
    shown = [t for t in everything if t.accepted or math.isfinite(t.exact_gain)]
    others = sorted((t for t in everything if t not in shown), key=lambda t: -t.gain)
    shown = [*shown, *others[: max(0, _CANDIDATES - len(shown))]]
    if not shown:
        return []
    rows = []
    for t in sorted(shown[:_CANDIDATES], key=lambda t: (t.step, -t.gain)):
        gains = (_percent(t.gain), _reachable(t.threshold), _percent(t.exact_gain))
        rows.append((t.step, title_of(t.cause), t.joint, *gains, _outcome(t, result)))
    tones: tuple[Tone, ...] = tuple("good" if r[-1] == "accepted" else "neutral" for r in rows)
    more = len(everything) - len(rows)
    text = (f"{more} more, all weaker, are in result.json.",) if more > 0 else ()
    columns: tuple[str, ...] = ("search", "cause", "joint", "gain in square [%]", "threshold [%]")
    columns += ("gain in square, fitted exactly [%]", "outcome")
    caption = _say("candidates", len(result.residual_rms.identify))
    return [Section("Candidate causes", text, (Table(columns, tuple(rows), caption, tones),))]


def _outcome(trial: Trial, result: Result) -> str:
    """A cause that the search took is not named for that: held-out time decides."""
    if not trial.accepted:
        return without_keys(trial.reason)
    is_named = any((f.cause, f.joint) == (trial.cause, trial.joint) for f in result.findings)
    return "accepted" if is_named else "fitted by the search, not named"


def _basis(result: Result) -> Section:
    """Where floor and thresholds come from, and what judged."""
    text = (
        laws_words(result.laws_of, _IN_RUN, result.fewer_terms),
        floor_words(result),
        _say("held_out", result.held_out),
        threshold_words(result),
    )
    best = {(t.cause, t.joint): t.gain for t in result.thresholds if math.isfinite(t.gain)}
    ordered = sorted(best.items(), key=lambda item: (item[0][0], item[0][1] or 0))
    rows = tuple((title_of(cause), joint, _reachable(gain)) for (cause, joint), gain in ordered)
    columns = ("cause", "joint", "share of the squared residual to exceed [%]")
    caption = f"Thresholds of what these logs can show. {_say('out_of_reach')}"
    return Section("What this rests on", text, (Table(columns, rows, caption),) if rows else ())


def _limits(result: Diagnosis) -> list[Section]:
    """The smallest of each cause that would have been found, and what to record for the others."""
    sections = []
    if result.detection_limits:
        rows = tuple(
            (title_of(one.cause), one.joint, spoken(one.parameter), *_smallest(one))
            for one in result.detection_limits
        )
        table = Table(("cause", "joint", "parameter", "smallest", "unit", "at"), rows)
        sections.append(Section("Detection limits", _paragraphs("limits"), (table,)))
    if result.not_identifiable:
        hidden = tuple(
            (title_of(one.cause), one.joint, without_keys(one.reason), without_keys(one.record))
            for one in result.not_identifiable
        )
        table = Table(("cause", "joint", "why", "what to record"), hidden)
        text = ("Neither found nor excluded.",)
        sections.append(Section("What these logs cannot tell", text, (table,)))
    if result.without_limit:
        rest = tuple((title_of(o.cause), without_keys(o.reason)) for o in result.without_limit)
        table = Table(("cause", "what is known of it"), rest)
        text = ("Of these no smallest size that would have been found is known.",)
        sections.append(Section("No detection limit available", text, (table,)))
    return sections


def _shape(at: Mapping[str, Value]) -> str:
    """For which waves, joint, speed or time it is, in words."""
    return ", ".join(
        _AT[name].format(
            size=format_number(value.value, 3),
            unit=format_unit(value.unit),
            per="a turn" if value.unit == "1/rev" else "in 2π m",
        )
        for name, value in at.items()
        if name in _AT and isinstance(value.value, int | float)
    )


def _smallest(one: DetectionLimit) -> tuple[str, ...]:
    """Value, unit, and for what it is; words where nothing that is expected would show."""
    value = one.minimum.value
    parameters = [q for q in find_effect(one.cause).parameters if q.name == one.parameter]
    ends = [abs(end) for q in parameters for end in (q.low, q.high) if end]
    if isinstance(value, float) and ends and not one.or_less and value >= min(ends):
        return "cannot be seen", "", ""
    shown = format_number(value, 2) if isinstance(value, float) else format_value(one.minimum)
    unit = unit_or_dash(one.minimum.unit)
    return shown, unit, "this or less" if one.or_less else _shape(one.at)


def extension_report(result: Extension) -> Report:
    """Verdict, key figures, one section a cause, what was refused."""
    units, before = units_in(result), result.residual_rms
    sections = [*_not_accepted(result)]
    for number, one in enumerate(result.findings, 1):
        sections.append(finding_section(number, one, before, False, "the noise", units))
        sections.append(numbers_section(number, one, units))
    sections += [_extension_basis(result, units), *data_quality(result.data_quality)]
    tone: Tone = "good" if result.accepted else "attention" if result.findings else "bad"
    words = f"{_extension_now(result)} {_say('extension_noise')}".strip()
    floor, name = before.noise_floor, "noise of the residual"
    errors = torque_errors(before, result.after_rms, result.rated, floor, name, words, units)
    title = f"Extension of {result.robot}" if result.robot else "Extension"
    basis = (laws_words(result.laws_of, fewer=result.fewer_terms),)
    return Report(title, _extension_verdict(result), tone, errors, tuple(sections), basis=basis)


def _extension_now(result: Extension) -> str:
    """Return which model the column "now" is of; `diagnose` may give another figure."""
    if not result.findings:
        return ""
    loads = [o for o in result.findings if o.origin == "base parameters"]
    return _say("extension_now", named(loads[0].cause, loads[0].joint) if loads else "")


def _extension_verdict(result: Extension) -> str:
    refused = [words for _, words in together(result.rejected)]
    found = [words for _, words in together(result.findings)]
    reason = result.rejected[0].reason if result.rejected else "no cause was named"
    return _say("extension", result, found, refused, without_keys(reason))


def _not_accepted(result: Extension) -> list[Section]:
    if not result.rejected:
        return []
    rows = tuple((title_of(o.cause), o.joint, without_keys(o.reason)) for o in result.rejected)
    text = "The held-out logs do not bear it out. There is no way around that."
    return [Section("Not accepted", (text,), (Table(("cause", "joint", "why"), rows),))]


def _extension_basis(result: Extension, units: Units) -> Section:
    laws = laws_words(result.laws_of, fewer=result.fewer_terms)
    baseline = [without_keys(name) for name in result.baseline_effects]
    text = _paragraphs("extension_basis", laws, result, baseline)
    tables: tuple[Table, ...] = ()
    if result.gain is not None and len(result.findings) > 1:
        caption = "Gain of all accepted causes together, on held-out time, root mean square."
        tables = (gain_table(result.gain, caption, units),)
    return Section("What this rests on", text, tables)

"""The reports of a diagnosis and of an extension: verdict, proof, residual, candidates, limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pipelines.diagnosis.answer import WEAKER
from pipelines.diagnosis.result import (
    DetectionLimit,
    Extension,
    Finding,
    Gain,
    ResidualRms,
    Result,
    Trial,
)
from pipelines.effects import effect_names, find_effect
from pipelines.estimation.nominal import within
from pipelines.report import words
from pipelines.report.config import REPORT
from pipelines.report.diagnosis_figures import evidence_figures, finding_figures
from pipelines.report.document import capital, document, sentence
from pipelines.report.finding_words import beyond_chance, headlines, how_much, of_any_size, where
from pipelines.report.report import Report, Table, Tone, columns_table
from pipelines.report.sections import checks_table, with_card
from pipelines.report.style import format_number
from pipelines.report.words import Units, named, title_of, together, units_in

_CANDIDATES = 40  # numerics: lines
_OPEN = 3  # numerics: findings that are not folded
_IN_RUN = "--set diagnose.model=FILE"
_NO_TIP = 1e-9  # numerics: [m] no tip: nothing that is simulated and measured comes so near
_TONES: dict[str, Tone] = {
    "no-fault-found": "good",
    "cause": "bad",
    "unknown": "attention",
    "cannot-judge": "attention",
}
# what of a cause's shape a technician can use; the rest is the form of its law
_AT = ("order", "from_joint", "with_joint", "link", "speed", "distance", "duration", "frequency")


def diagnosis_report(result: Result) -> Report:
    """Verdict, key figures, findings with their proof, evidence, limits."""
    units, left = units_in(result), result.after_rms.validate
    lasting = [one for one in result.findings if find_effect(one.cause).clock != "log"]
    findings = []
    for number, one in enumerate(result.findings, 1):
        context = finding_context(number, one, result.residual_rms, units, left)
        context["folded"] = number > _OPEN or not (beyond_chance(one) or number == 1)
        context["command"] = command([one]) if find_effect(one.cause).clock != "log" else ""
        context["every"] = command(lasting) if len(lasting) > 1 and number == 1 else ""
        findings.append(context)
    said = " ".join(lines := headlines(result))
    causes = together(result.findings)
    advice = [(what, find_effect(cause).words.remedy) for cause, what in causes]
    report = document(
        "diagnosis",
        _tone(result),
        result=result,
        words=words,
        lines=[words.without_keys(line) for line in lines],
        left_out=[within(title_of(cause)) for cause in result.without if _may_be_wrong(cause)],
        advice=[(what, remedy) for what, remedy in advice if remedy.split(";")[0] not in said],
        errors=torque_errors(result, units),
        findings=findings,
        checks_table=checks_table,
        laws=sentence("laws", result.laws_of, _IN_RUN, words.fewer_words(result.fewer_terms)),
        judged=sentence("held_out", result.held_out),
        origins=sorted({one.origin for one in result.thresholds}),
        to_record=_to_record(result),
        near=_nearest(result.candidate_causes),
        rejected=_by_reason(result),
        candidates=_candidates(result),
        limits=detection_limits(result.detection_limits, len(result.residual_rms.identify)),
        thresholds=_thresholds(result),
        evidence=[(one, evidence_figures(one, k, units)) for k, one in enumerate(result.evidence)],
        rated=[x if math.isfinite(x) else None for x in result.rated],
        units=units,
    )
    return with_card(report, result.boundary, first=result.verdict != "cause")


def extension_report(result: Extension) -> Report:
    """Verdict, key figures, the causes, what was refused."""
    units, before = units_in(result), result.residual_rms
    findings = [
        finding_context(number, one, before, units) | {"folded": False, "command": "", "every": ""}
        for number, one in enumerate(result.findings, 1)
    ]
    loads = [one for one in result.findings if one.origin == "base parameters"]
    reason = result.rejected[0].reason if result.rejected else "no cause was named"
    tone: Tone = "good" if result.accepted else "attention" if result.findings else "bad"
    return document(
        "extension",
        tone,
        result=result,
        words=words,
        errors=torque_errors(result, units),
        found=[what for _, what in together(result.findings)],
        refused=[what for _, what in together(result.rejected)],
        reason=words.without_keys(reason),
        load=named(loads[0].cause, loads[0].joint) if loads else "",
        findings=findings,
        laws=sentence("laws", result.laws_of, "", words.fewer_words(result.fewer_terms)),
        judged=sentence("held_out", result.held_out),
        checks_table=checks_table,
        units=units,
    )


def finding_context(
    number: int, one: Finding, nominal: ResidualRms, units: Units, left: np.ndarray | None = None
) -> dict[str, object]:
    """Return the context of finding.jinja.

    Args:
        nominal: residual of the model without any finding, and the floor of the held-out logs.
        left: (joints,) held-out torque error with all findings.
    """
    torque = one.gain.validate_torque_rms
    grown = torque.after - torque.before
    stays = grown if left is None else left - torque.before
    # more than the interval is wide, and not taken away again by another finding
    larger = (torque.ci95[:, 0] > 0.0) & (stays > grown - torque.ci95[:, 0])
    rest = np.nanmax(nominal.identify) if one.joint is None else nominal.identify[one.joint - 1]
    rival = next(iter(one.alternatives), None)
    share = _own_share(one, nominal)
    return {
        "one": one,
        "place": where(one),
        "size": how_much(one),
        "texts": find_effect(one.cause).words,
        "share": share if share > REPORT.own_share * one.explained else None,
        "any_size": of_any_size(one),
        "torque": "" if not math.isfinite(one.torque_rms)
        else f"{format_number(one.torque_rms, 2)} {units.at(one.joint).torque}",
        "imitated": one.torque_rms**2 > 2.0 * rest**2,
        "larger": [(j + 1, torque.before[j], torque.after[j]) for j in np.flatnonzero(larger)],
        "tip": tip_errors(one.gain),
        "span": sentence("span", one.gain),
        "sure": beyond_chance(one),
        "pair": "" if rival is None
        else f"{words.cause_at(one.cause, one.joint)} {words.cause_at(rival.cause, rival.joint)}",
        "figures": finding_figures(number, one, units),
    }  # fmt: skip


def command(some: Sequence[Finding]) -> str:
    """How to extend the model by these findings."""
    causes = dict.fromkeys(words.cause_at(one.cause, one.joint) for one in some)
    return f'"rrrid extend LOGS {" ".join(f"--with {cause}" for cause in causes)}"'


def tip_errors(gain: Gain) -> tuple[str, str] | None:
    """[mm] simulated tip error before and after, as printed; None where no tip was simulated."""
    tip = gain.tip_error_rms
    if tip is None or max(tip.before, tip.after) < _NO_TIP:
        return None
    return format_number(1e3 * tip.before, 3), format_number(1e3 * tip.after, 3)


def _own_share(one: Finding, nominal: ResidualRms) -> float:
    """Of the held-out power that its joint has above the floor; NaN where it has none."""
    if one.joint is None or one.origin == "base parameters" or len(nominal.identify) == 1:
        return math.nan
    torque = one.gain.validate_torque_rms
    powers = (torque.before, torque.after, nominal.validate, nominal.noise_floor)
    before, after, whole, floor = (float(x[one.joint - 1]) ** 2 for x in powers)
    return min(1.0, max(0.0, (before - after) / (whole - floor))) if whole > floor else math.nan


def _may_be_wrong(cause: str) -> bool:
    """Return whether a cause is no friction law that any nominal model may have."""
    return cause in effect_names() and find_effect(cause).evidence != "none"


def _tone(result: Result) -> Tone:
    """Return the tone; what healthy machines have as well is a fault only where it changed."""
    causes = [one.cause for one in result.findings]
    causes += [other.cause for one in result.findings for other in one.alternatives]
    ordinary = all(find_effect(cause).parameters.healthy == math.inf for cause in causes)
    if result.verdict == "cause" and ordinary and result.question != "what has changed":
        return "attention"
    return _TONES[result.verdict]


def torque_errors(result: Result | Extension, units: Units) -> Table:
    """Return the held-out torque error of each joint before and after, beside the noise floor.

    Where nothing extends the model there is no column of the extended one.
    """
    before, after = result.residual_rms.validate, result.after_rms.validate
    extended = not np.array_equal(before, after, equal_nan=True)
    floor, unit = result.residual_rms.noise_floor, units.torque
    rated = np.full(len(floor), math.nan)
    rated[: len(result.rated)] = result.rated[: len(floor)]
    rated[np.isinf(rated)] = math.nan
    columns: dict[str, Iterable[float | int]] = {"joint": range(1, len(floor) + 1)}
    columns[f"torque error{' now' * extended} [{unit}]"] = before.tolist()
    if extended:
        columns[f"extended [{unit}]"] = after.tolist()
    columns[f"noise floor [{unit}]"] = floor.tolist()
    columns[f"{'now' if extended else 'error'} [% of rated]"] = (100.0 * before / rated).tolist()
    if extended:
        columns["extended [% of rated]"] = (100.0 * after / rated).tolist()
    return columns_table(columns)


def _to_record(result: Result) -> list[tuple[str, str]]:
    """Return what shows causes that these logs cannot: (recording, causes)."""
    wanted: dict[str, list[tuple[str, str]]] = {}
    for one in result.not_identifiable:
        wanted.setdefault(one.record, []).append((one.cause, str(one.joint or "")))
    return [
        (
            words.without_keys(record),
            capital("; ".join(what for _, what in words.at_places(places))),
        )
        for record, places in wanted.items()
    ]


def _nearest(trials: Iterable[Trial], most: int = 5) -> list[tuple[str, float]]:
    """Return the largest gain of each cause; to first order where it was not fitted."""
    found: dict[str, float] = {}
    for t in trials:
        place, gain = named(t.cause, t.joint), t.exact_gain
        gain = gain if math.isfinite(gain) else t.gain
        found[place] = max(gain, found.get(place, 0.0))
    return sorted(found.items(), key=lambda item: -item[1])[:most]


def _by_reason(result: Result) -> list[tuple[str, str]]:
    """All rejected causes of a reason in a line, those that are only weaker last."""
    reasons = dict.fromkeys(one.reason for one in result.rejected)
    rows = []
    for reason in sorted(reasons, key=lambda reason: reason == WEAKER):
        causes = together(one for one in result.rejected if one.reason == reason)
        rows.append(("; ".join(what for _, what in causes), words.without_keys(reason)))
    return rows


def _percent(x: float) -> float | None:
    return round(100.0 * x, 2) if math.isfinite(x) else None


def _candidates(result: Result) -> list[tuple[object, ...]]:
    """Those that were fitted, and of the others the best."""
    every = sorted(
        result.candidate_causes,
        key=lambda t: (not (t.accepted or math.isfinite(t.exact_gain)), -t.gain),
    )
    causes = {(one.cause, one.joint) for one in result.findings}
    rows: list[tuple[object, ...]] = []
    for t in sorted(every[:_CANDIDATES], key=lambda t: (t.step, -t.gain)):
        outcome = words.without_keys(t.reason)
        if t.accepted:  # held-out time decides whether it is named
            taken = (t.cause, t.joint) in causes
            outcome = "accepted" if taken else "fitted by the search, not named"
        threshold = _percent(t.threshold) if t.threshold <= 1.0 else None
        gains = (_percent(t.gain), threshold, _percent(t.exact_gain))
        rows.append((t.step, title_of(t.cause), t.joint, *gains, outcome))
    return rows


def _thresholds(result: Result) -> list[tuple[object, ...]]:
    """The share of the squared residual that each cause has to exceed, joint by joint."""
    best = {(t.cause, t.joint): t.gain for t in result.thresholds if t.gain <= 1.0}
    ordered = sorted(best, key=lambda place: (place[0], place[1] or 0))
    return [(title_of(cause), joint, _percent(best[cause, joint])) for cause, joint in ordered]


def detection_limits(limits: Iterable[DetectionLimit], joints: int) -> Table:
    """Return the smallest of each cause that would have been found, cause by joint."""
    rows: dict[tuple[str, str], dict[int | None, str]] = {}
    for one in limits:
        what = f"{title_of(one.cause)}, {words.spoken(one.parameter)}"
        rows.setdefault((what, one.minimum.unit), {})[one.joint] = _smallest(one)
    columns = (None, *range(1, joints + 1))
    heads = ("cause", "unit", "arm", *(f"joint {j}" for j in range(1, joints + 1)))
    cells = (
        (what, words.unit_or_dash(unit), *(own.get(joint) for joint in columns))
        for (what, unit), own in rows.items()
    )
    return Table(heads, tuple(cells))


def _smallest(one: DetectionLimit) -> str:
    """The value, and for which order or joint; words where nothing that is expected would show."""
    value = one.minimum.value
    known = [q for q in find_effect(one.cause).parameters if q.name == one.parameter]
    ends = [abs(end) for q in known for end in (q.low, q.high) if end]
    if isinstance(value, float) and ends and not one.or_less and value >= min(ends):
        return "cannot be seen"
    shown = format_number(value, 2) if isinstance(value, float) else words.format_value(one.minimum)
    at = ["or less"] if one.or_less else []
    at += [words.format_values([(name, one.at[name])]) for name in _AT if name in one.at]
    return f"{shown} ({', '.join(at)})" if at else shown

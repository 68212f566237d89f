"""The report of a diagnosis: verdict, what to check, proof, residual analysis, alternatives, candidates, limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pipelines.diagnosis.answer import WEAKER
from pipelines.diagnosis.result import Finding, Rejected, Result, Trial
from pipelines.model.effects import find_effect
from pipelines.model.words import within
from pipelines.report.boundary_card import boundary_card
from pipelines.report.diagnosis_finding import finding_section, numbers_section
from pipelines.report.diagnosis_floor import (
    floor_name,
    floor_words,
    held_out_words,
    judge_words,
    what_stays,
)
from pipelines.report.diagnosis_floor import torque_errors as errors_table
from pipelines.report.diagnosis_limits import limits_sections
from pipelines.report.diagnosis_picture import picture_sections
from pipelines.report.diagnosis_words import (
    as_sentence,
    at_places,
    in_order,
    is_cause,
    named,
    title_of,
    together,
    told_values,
    torque_of,
    without_keys,
)
from pipelines.report.finding_words import how_much, of_any_size, taken_in, where
from pipelines.report.joint_units import units_in
from pipelines.report.model_words import laws_words, threshold_words
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import format_number, three_digits
from pipelines.report.tip_words import all_together, tip_change

__all__ = ["diagnosis_report"]

_LEDGER = 40  # lines
_IN_RUN = "--set diagnose.model=FILE"
_OUT_OF_REACH = "A threshold above 100 % is shown as a dash: a healthy arm leaves so much of it that such logs cannot show it."
_TONES: dict[str, Tone] = {"no-fault-found": "good", "cause": "bad", "unknown": "attention", "cannot-judge": "attention"}


def diagnosis_report(result: Result) -> Report:
    """Verdict, key figures, findings with their proof, evidence, limits."""
    units, nominal = units_in(result), result.residual_rms
    found = [section for number, one in enumerate(result.findings, 1)
             for section in (finding_section(number, one, nominal, units=units, beside=result.findings,
                                             left=result.after_rms.validate),
                             numbers_section(number, one, units, result.findings))]
    sections = [*boundary_card(result.boundary), *found, *_unknown(result),
                *picture_sections(result, result.rated, units), *_standing(result), *_others(result),
                *limits_sections(result), _basis(result), *_doctor(result)]
    return Report(f"Diagnosis of {result.robot}" if result.robot else "Diagnosis", _verdict(result), _tone(result),
                  errors_table(nominal, result.after_rms, result.rated, nominal.noise_floor, floor_name(result),
                               floor_words(result), units),
                  tuple(sections), _advice(result),
                  (laws_words(result.laws_of, _IN_RUN, result.fewer_terms), threshold_words(result)))


def _tone(result: Result) -> Tone:
    """What machines in order have as well is no fault of this one, unless it has changed, or may be something else."""
    causes = [cause for one in result.findings for cause in (one.cause, *(alternative.cause for alternative in one.alternatives))]
    ordinary = result.question != "what has changed" and all(find_effect(cause).parameters.healthy == math.inf for cause in causes)
    return "attention" if result.verdict == "cause" and ordinary else _TONES[result.verdict]


def _verdict(result: Result) -> str:
    """One sentence; by what it was judged where that is no log of its own; what was not looked for. What to check stands in the
    first section."""
    blocks = "" if result.held_out == "logs" else f" Judged by {judge_words(result.held_out)}."
    causes = ", ".join(dict.fromkeys(within(title_of(cause)) for cause in result.without if is_cause(cause)))
    return f"{_said(result)}{blocks}{f' Not looked for, because you said so: {causes}.' if causes else ''}"


def _said(result: Result) -> str:
    if result.verdict == "no-fault-found":
        since = " has changed since the reference logs" if result.question == "what has changed" else " is wrong with this arm"
        caveat = f" {as_sentence(without_keys(result.reason))}" if result.reason else ""
        beyond = f"{_untold(result)}; what they would have shown, the report lists"
        return f"Nothing{since}, as far as these logs can tell{beyond}.{caveat}"
    if result.verdict == "unknown":
        return f"Something is wrong, and no cause is named: {without_keys(result.reason)}."
    if result.verdict == "cannot-judge":
        anything = "has changed since the reference logs" if result.question == "what has changed" else "is wrong with this arm"
        return f"Whether anything {anything} cannot be judged: {without_keys(result.reason)}."
    first, *more = result.findings
    changed = "What has changed: " if result.question == "what has changed" else ""
    others = f"; and {', '.join(_beside(more))}" if more else ""
    size = f", {_size(first, result)}" if math.isfinite(first.torque_rms) else ""
    whole = all_together(result.findings)
    alone = whole is first.gain
    change = tip_change(whole) if not (alone and more) else ""  # of the first alone it says nothing of them all
    moved = f"; with {'it' if alone else 'them'} {change}" if change else ""
    rest = f" In addition, {without_keys(result.reason)}." if result.reason else ""
    cause = f"{first.title}{how_much(first)}{where(first)}"
    return f"{changed}{cause}{size}{moved + others if alone else others + moved}.{rest}{what_stays(result)}"


def _untold(result: Result) -> str:
    """What nobody should take for looked at: of it these logs say nothing."""
    places = [words for _, words in at_places((one.cause, str(one.joint or "")) for one in result.not_identifiable)]
    if not places:
        return ""
    return f", and they say nothing of {' and '.join(filter(None, (', '.join(places[:-1]), places[-1])))}"


def _beside(more: Sequence[Finding]) -> Iterator[str]:
    """Every further cause once: with its joints, or, where it is at one place alone, with how much of it there is."""
    for cause, words in together(more):
        own = [one for one in more if one.cause == cause]
        yield f"{within(own[0].title)}{how_much(own[0])}{where(own[0])}" if len(own) == 1 else words


def _advice(result: Result) -> tuple[str, ...]:
    """What to look at on the machine, cause by cause."""
    causes = together(result.findings)
    several = len(result.findings) > 1
    return tuple(f"What to check{f' for {words}' if several else ''}: {as_sentence(find_effect(cause).words.remedy)}"
                 for cause, words in causes)


def _size(one: Finding, result: Result) -> str:
    """Of its torque, and whether the model hid most of it."""
    if of_any_size(one):
        return "of a size that these logs do not tell"
    rated = f" ({format_number(100.0 * one.of_rated, 2)} % of the rated torque)" if math.isfinite(one.of_rated) else ""
    return f"{torque_of(one, units_in(result))} rms of torque{rated}{taken_in(one, result.residual_rms.identify)}"


def _reachable(threshold: float) -> float | None:
    """[%] a threshold, where anything could exceed it: no gain is more than the whole residual."""
    return _hundredths(100.0 * threshold) if threshold <= 1.0 else None


def _hundredths(x: float) -> float | None:
    return round(x, 2) if math.isfinite(x) else None


def _unknown(result: Result) -> list[Section]:
    if result.verdict != "unknown":
        return []
    near = sorted(_nearest(result.candidate_causes).items(), key=lambda one: -one[1])[:5]
    names = ", ".join(f"{named(*place)} ({format_number(100.0 * gain, 3)} % of the residual)" for place, gain in near)
    tried = f" The nearest explanations, not named: {names}." if near else ""
    return [Section("Why there is no name", (
        as_sentence(without_keys(result.reason)) + tried, *_follows(result),
        "A wrong name costs more than none. The residual analysis shows where and when the residual exceeds the noise floor."))]


def _follows(result: Result) -> Iterator[str]:
    """Which signals the joint that is farthest above its floor goes with most."""
    for one in result.evidence[:1]:
        joint = int(np.argmax(np.nan_to_num(one.above_noise_floor))) + 1
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
    if not result.baseline_effects:
        return []
    rows = tuple((title_of(one.cause), one.joint, told_values(in_order(one.cause, one.parameters)),
                  three_digits(100.0 * one.explained)) for one in result.baseline_effects)
    return [Section("Baseline effects", ("The reference logs show them as well; the extended model has them.",),
                    (Table(("effect", "joint", "parameters", "explains [%]"), rows),))]


def _others(result: Result) -> list[Section]:
    """Rejected hypotheses and the ledger."""
    sections = []
    if result.rejected:
        sections.append(Section("Rejected", (_refused(result.rejected),), (Table(("causes", "why"), _folded(result.rejected)),)))
    shown = [t for t in result.candidate_causes if t.accepted or math.isfinite(t.exact_gain)]
    shown += [t for t in sorted(result.candidate_causes, key=lambda t: -t.gain) if t not in shown][:max(0, _LEDGER - len(shown))]
    if shown:
        rows = tuple((t.step, title_of(t.cause), t.joint, _hundredths(100.0 * t.gain), _reachable(t.threshold),
                      _hundredths(100.0 * t.exact_gain), _outcome(t, result))
                     for t in sorted(shown[:_LEDGER], key=lambda t: (t.step, -t.gain)))
        tones: tuple[Tone, ...] = tuple("good" if row[-1] == "accepted" else "neutral" for row in rows)
        more = len(result.candidate_causes) - len(rows)
        text = (f"{more} more, all weaker, are in result.json.",) if more > 0 else ()
        sections.append(Section("Candidate causes", text, (Table(
            ("search", "cause", "joint", "gain in square [%]", "threshold [%]", "gain in square, fitted exactly [%]",
             "outcome"), rows,
            "Gain in square: share of the squared residual of the fitted logs that each takes away; what does not exceed its "
            f"threshold is not accepted, nor what held-out time does not confirm. {_OUT_OF_REACH} "
            "So is that of a cause that takes next to nothing: none was computed."
            f"{_alike(len(result.residual_rms.identify))}", tones),)))
    return sections


def _outcome(trial: Trial, result: Result) -> str:
    """What a search has taken up is not named for that: the time held out has its say."""
    if not trial.accepted:
        return without_keys(trial.reason)
    named = any((one.cause, one.joint) == (trial.cause, trial.joint) for one in result.findings)
    return "accepted" if named else "fitted by the search, not named"


def _refused(rejected: Sequence[Rejected]) -> str:
    """How close they came: most were not even tried, for others took more off the residual."""
    weaker = sum(one.reason == WEAKER for one in rejected)
    if not weaker:
        return "They came close, and were not accepted."
    more = len(rejected) - weaker
    rest = f" The other {more if more > 1 else 'one'} came close, and {'were' if more > 1 else 'was'} not accepted." if more else ""
    which = "Each of these" if not more else f"{weaker} of these are {WEAKER}: each" if weaker > 1 else f"One is {WEAKER}: it"
    return (f"{which} takes more than its threshold off the residual in some search, but others take more and were tried "
            f"instead.{rest}")


def _folded(rejected: Sequence[Rejected]) -> tuple[tuple[str, str], ...]:
    """A line for each reason with all causes it holds for, those that are only weaker last: every one stands in result.json."""
    reasons = sorted(dict.fromkeys(one.reason for one in rejected), key=lambda reason: reason == WEAKER)
    return tuple(("; ".join(words for _, words in together(one for one in rejected if one.reason == reason)), without_keys(reason))
                 for reason in reasons)


def _alike(joints: int) -> str:
    """Why the share of a cause that explains everything at its joint is far from 100 %."""
    if joints < 2:
        return ""
    return (f" Each joint is weighed by its own residual: of {joints} joints, what explains all at one and nothing elsewhere takes "
            f"away {format_number(100.0 / joints, 2)} %.")


def _basis(result: Result) -> Section:
    """Where floor and thresholds come from, and what judged."""
    text = [laws_words(result.laws_of, _IN_RUN, result.fewer_terms), floor_words(result), held_out_words(result.held_out),
            threshold_words(result)]
    best: dict[tuple[str, int | None], float] = {(one.cause, one.joint): one.gain for one in result.thresholds
                                                    if math.isfinite(one.gain)}
    rows = tuple((title_of(cause), joint, _reachable(gain)) for (cause, joint), gain in sorted(
        best.items(), key=lambda item: (item[0][0], item[0][1] or 0)))
    table = Table(("cause", "joint", "share of the squared residual to exceed [%]"), rows,
                  f"Thresholds of what these logs can show. {_OUT_OF_REACH}")
    return Section("What this rests on", tuple(text), (table,) if rows else ())


def _doctor(result: Result) -> Iterable[Section]:
    if result.data_quality:
        yield Section("Data quality", (), (checks_table(result.data_quality),))

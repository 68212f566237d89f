"""Build the result of a diagnosis: verdict, findings, limits, ledger.

answer(prepared, diagnose_prepared(prepared, config), tell)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pipelines.diagnosis.compliance import untold
from pipelines.diagnosis.decision import limited_by_estimate
from pipelines.diagnosis.engine import Diagnosis as Found
from pipelines.diagnosis.findings import Worth, alternatives_of, extension_of, findings_of, weigh
from pipelines.diagnosis.limits import Limits, limits_of, without_limit
from pipelines.diagnosis.result import Diagnosis, Extended, Finding, Rejected, Threshold, Trial
from pipelines.diagnosis.screening import best_of
from pipelines.diagnosis.selection import Cause
from pipelines.diagnosis.standing import standing_of
from pipelines.diagnosis.trained import train
from pipelines.diagnosis.unnamed import Key
from pipelines.estimation.candidate_columns import place_of
from pipelines.estimation.model_fit import no_better, worse_log
from pipelines.estimation.preparation import Prepared
from pipelines.estimation.residual_analysis import Evidence, evidence

__all__ = ["WEAKER", "answer"]

_ACCEPTED = "accepted"
_ALIKE = "these logs do not tell it from the cause that is named"
_WORSE = "others predict blocks of time better"
WEAKER = "weaker than others"


def answer(
    prepared: Prepared,
    found: Found,
    tell: Callable[[str], None],
    blocks: int,
    whole: bool = True,
    exclude: Sequence[str] = (),
) -> tuple[Diagnosis, Extended | None]:
    """Return the result of a diagnosis, and the model extended by its causes if they have names.

    Args:
        blocks: of time, held out in turn where there is no log of role "validate".
        whole: with figures, simulated arms and detection limits.
        exclude: causes that were not considered.
    """
    tell("estimating gains and detection limits")
    look, reference = found.look, prepared.reference is not None
    causes, worth, worse = _worth(prepared, found, blocks, whole)
    own = {id(one.cause): alternatives_of(one) for one in look.selection.rounds}
    named = [(one.probability[one.key], own[id(one)]) for one in causes]
    reported, spread = look.reported, look.covariance
    findings = findings_of(worth, look.later, reported, spread, named, found.responses)
    verdict = "unknown" if worse and not causes else found.decision.verdict
    reason = "; ".join(one for one in (worse, found.decision.reason) if one)
    limits = _limits(found, findings, exclude) if whole else Limits((), ())
    trained, last = worth.trained, len(causes)
    told_of = Diagnosis(
        verdict,
        "",
        findings,
        worth.standing,
        _rejected(found, causes, worse),
        limits.detection_limits,
        limits.not_identifiable,
        worth.rms(0),
        "what has changed" if reference else "what is wrong",
        "blocks" if prepared.judge is None else "logs",
        worth.floor_origin,
        reason,
        worth.rms(last),
        _ledger(found),
        _thresholds(found, f"parts of {'the reference' if reference else 'these'} logs"),
        (_evidence(worth, last),) if whole else (),
        trained.arm(0),
        trained.arm(last),
        fewer_terms=prepared.fewer,
    )
    told_of = limited_by_estimate(told_of, prepared)
    if whole:
        unsized = without_limit(told_of, bool(prepared.logs.frf), exclude)
        told_of = replace(told_of, without_limit=unsized)
    return told_of, extension_of(prepared, worth, findings) if verdict == "cause" else None


def _evidence(worth: Worth, last: int) -> Evidence:
    """Return what the nominal model leaves, and the position errors of the simulated arms."""
    nominal = worth.trained.models[0]
    return evidence(nominal, worth.floor, worth.simulated[0], worth.simulated[last])


def _limits(found: Found, findings: Sequence[Finding], exclude: Sequence[str]) -> Limits:
    """Return the limits of the causes without a finding, and what responses leave open."""
    look, named = found.look, {one.cause for one in findings}
    limits = limits_of(look.later, look.selection.end, look.baseline)
    more = (one for one in untold(found.responses, exclude) if one.cause not in named)
    return replace(limits, not_identifiable=(*limits.not_identifiable, *more))


def _worth(
    prepared: Prepared, found: Found, blocks: int, whole: bool
) -> tuple[tuple[Cause, ...], Worth, str]:
    """Return the causes, their worth on held-out rows, and why the last of them are dropped.

    A gain counts on rows that a model was not fitted to: a cause has no name with which the torque
    of a held-out log is predicted worse than by the nominal model, or no better than without it.
    """
    causes = found.decision.causes
    standing = standing_of(prepared.reference, found.look.later)
    effects = found.look.reported.model.effects if causes else ()
    trained = train(prepared, found.look.later, effects, blocks, standing)
    worth, why = weigh(prepared, trained, standing, whole), ""
    while causes:
        first, *_, last, now = worth.left[0], *worth.left[: len(causes) + 1]
        worse = worse_log(trained.data, first, now)
        if len(causes) > 1 and effects[len(causes) - 1].log is None:
            worse = worse or no_better(trained.data, last, now)
        if not worse:
            break
        why = f"with {place_of(*causes[-1].key)} {worse}"
        causes = causes[:-1]
    return causes, worth.first(len(causes)), why


def _rejected(found: Found, causes: Sequence[Cause], worse: str) -> tuple[Rejected, ...]:
    """Return the causes above their thresholds that are not named.

    Args:
        worse: why some of the selected causes are dropped.
    """
    settled = {key for one in causes for key in (one.key, *one.alternatives)}
    doubtful = {one.key for one in found.look.selection.causes}
    out: dict[Key, Rejected] = {}
    for one in found.look.selection.rounds:
        for key in one.tried:
            doubt = found.decision.reason if key in doubtful else ""
            out[key] = Rejected(*key, one.stopped or worse or doubt or _WORSE)
    return tuple(one for key, one in out.items() if key not in settled)


def _ledger(found: Found) -> tuple[Trial, ...]:
    """Return every candidate above the threshold of its round, and how it fared."""
    rows, out = found.look.later.rows.count, []
    for step, one in enumerate(found.look.selection.rounds, 1):
        power = one.before.cost
        exact = {key: 1.0 - fit.cost / power for key, fit in one.tried.items()}
        reasons = dict.fromkeys(exact, one.stopped or _WORSE)
        if one.cause is not None:
            reasons |= dict.fromkeys(one.cause.alternatives, _ALIKE)
        if one.cause is not None and one.cause in found.decision.causes:
            reasons[one.cause.key] = _ACCEPTED
        for screened in sorted(one.significant, key=lambda s: -s.gain):
            key, group = screened.group.key, screened.group
            if group.kind == "unnamed":
                continue
            bound = found.look.baseline.threshold(group, screened.freedom, rows)
            gains = (screened.gain / power, bound / power, exact.get(key, np.nan))
            reason = reasons.get(key, WEAKER)
            out.append(Trial(step, *key, *gains, reason == _ACCEPTED, reason))
    return tuple(out)


def _thresholds(found: Found, origin: str) -> tuple[Threshold, ...]:
    """Return what each cause had to exceed in the last round, in its best shape."""
    end, later = found.look.selection.end, found.look.later
    rows, best = later.rows.count, best_of(later.screened(end))
    return tuple(
        Threshold(
            *key, found.look.baseline.threshold(one.group, one.freedom, rows) / end.cost, origin
        )
        for key, one in best.items()
        if one.group.kind != "unnamed"
    )

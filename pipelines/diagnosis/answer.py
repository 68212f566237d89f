"""What is told of a diagnosis: verdict, sentence, findings with their numbers and what they gain.

answer(prepared, diagnose_prepared(prepared, config), tell)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from pipelines.diagnosis.candidates import Key
from pipelines.diagnosis.engine import Diagnosis as Found
from pipelines.diagnosis.limits import Limits, limits_of
from pipelines.diagnosis.screening import best_of
from pipelines.diagnosis.selection import Candidate, Round
from pipelines.diagnosis.table import Array
from pipelines.diagnosis.trained import Trained, covariance, train
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.answered.judgeable import limited_by_estimate
from pipelines.model.diagnosis.answered.words import beside, how_much, taken_in, where
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.extend import Extended, with_uncertainty
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.given.compliance import gaps_untold, untold
from pipelines.model.diagnosis.result import (
    Diagnosis,
    Finding,
    Gain,
    Rejected,
    ResidualRms,
    Rival,
    Threshold,
    Trial,
    Value,
    Verdict,
)
from pipelines.model.diagnosis.unseen.without_limit import without_limit
from pipelines.model.diagnosis.worth.evidence import evidence
from pipelines.model.diagnosis.worth.gains import (
    Simulation,
    gain_of,
    simulation_errors,
    torque_gain_of,
)
from pipelines.model.diagnosis.worth.numbers import acting, parameters, told
from pipelines.model.diagnosis.worth.proof import proof
from pipelines.model.diagnosis.worth.simulated import as_simulated, with_simulation
from pipelines.model.words import within

__all__ = ["answer"]

_REFERENCE = "reference logs"
_THESE = "blocks"
_VERDICTS: dict[str, Verdict] = {
    "cause": "cause",
    "no-fault-found": "nothing-wrong",
    "unknown": "unknown",
}
_ACCEPTED = "accepted"
_ALIKE = "these logs do not tell it from the cause that is named"
_WORSE = "others predict blocks of time better"
_WEAKER = "weaker than others"


def answer(
    prepared: Prepared,
    found: Found,
    tell: Callable[[str], None],
    blocks: int,
    whole: bool = True,
    exclude: Sequence[str] = (),
) -> tuple[Diagnosis, Extended | None]:
    """Return the result of a diagnosis, and the model extended by its causes where they have names.

    Args:
        blocks: of time, held out in turn where there is no log of role "validate".
        whole: with figures, simulated arms and detection limits.
        exclude: causes that were not considered.
    """
    tell("weighing what was found, and what these logs would have shown")
    causes, end = found.decision.causes, found.selection.end
    trained = train(prepared, found.later, end.model.effects if causes else (), blocks)
    last = len(trained.models) - 1
    left = [trained.held_out(k) for k in range(last + 1)]
    floor = _floor(prepared, found, trained)
    arms = [one.model.arm for one in trained.models]
    simulated = (
        simulation_errors(arms, prepared.judging or prepared.motions)
        if whole
        else [Simulation.none(arm.n_joints) for arm in arms]
    )
    gains = [
        gain_of(torque_gain_of(trained.data, *left[k : k + 2]), *simulated[k : k + 2])
        for k in range(last)
    ]
    findings = _findings(prepared, found, trained, gains, floor, whole)
    rms = [
        ResidualRms(trained.models[k].rms, trained.data.rms(left[k]), floor) for k in (0, last)
    ]
    limits = limits_of(found.later, end, found.baseline) if whole else Limits((), ())
    compliance = found.responses
    verdict = _VERDICTS[found.decision.verdict]
    told_of = Diagnosis(
        verdict,
        _sentence(verdict, found.decision.reason, findings, trained, found),
        findings,
        (),
        _rejected(found),
        limits.detectable,
        (*limits.not_testable, *untold(compliance, exclude), *gaps_untold(compliance, exclude))
        if whole
        else (),
        rms[0],
        "what is wrong" if prepared.reference is None else "what has changed",
        "blocks" if prepared.judge is None else "logs",
        _origin(prepared),
        found.decision.reason,
        rms[1],
        _ledger(found),
        _thresholds(found, _origin(prepared)),
        (evidence(trained.models[0], floor, ()),) if whole else (),
        0,
        np.full(len(floor), np.nan),
        None,
        with_uncertainty(arms[0], trained.models[0]),
        _extended(trained),
        fewer_terms=prepared.fewer,
    )
    told_of = with_simulation(told_of, as_simulated((simulated[0], simulated[last])))
    told_of = limited_by_estimate(told_of, prepared)
    if whole:
        untold_of = without_limit(told_of, bool(prepared.logs.frf), exclude)
        told_of = replace(told_of, without_limit=untold_of)
    if verdict != "cause":
        return told_of, None
    gain = gain_of(torque_gain_of(trained.data, left[0], left[last]), simulated[0], simulated[last])
    return told_of, _extension(prepared, told_of, gains[0] if last == 1 else gain)


def _extension(prepared: Prepared, told_of: Diagnosis, gain: Gain) -> Extended:
    """Return the model with every cause that lasts."""
    return Extended(
        told_of.extended,
        tuple(one for one in told_of.findings if one.log is None),
        (),
        gain,
        told_of.residual_rms,
        told_of.after_rms,
        told_of.held_out,
        (),
        (*prepared.motions, *prepared.judging),
        len(prepared.motions),
        prepared.fewer,
    )


def _origin(prepared: Prepared) -> str:
    return _THESE if prepared.reference is None else _REFERENCE


def _floor(prepared: Prepared, found: Found, trained: Trained) -> Array:
    """Return (joints,) [N m] what the nominal model leaves of the machine in order.

    Without reference logs, what the last model leaves of the rows it was fitted to.
    """
    rows = prepared.reference
    if rows is None:
        return trained.models[-1].rms
    return rows.rms(rows.y - found.later.dataset.model.torque(rows))


def _findings(
    prepared: Prepared,
    found: Found,
    trained: Trained,
    gains: Sequence[Gain],
    floor: Array,
    whole: bool,
) -> tuple[Finding, ...]:
    """Return the causes, strongest first, their numbers by all rows."""
    later, end = found.later, found.selection.end
    causes = found.decision.causes
    if not causes:
        return ()
    _, names = later.slopes(end)
    every = Refined(
        end.model,
        later.rows.data,
        trained.models[0].weight,
        np.zeros(0),
        np.zeros((len(end.model.beta) + len(names), 0)),
        tuple(names),
        covariance(later, end),
    )
    out = []
    for place, cause in enumerate(causes):
        before, after = trained.models[place : place + 2]
        effect, log = end.model.effects[place].effect, end.model.effects[place].log
        size, joint, of_rated = _size(trained, place, floor)
        own = [one for one in found.selection.rounds if one.cause is cause]
        rivals = _rivals(own[0], later.rows.count) if own else ()
        shown = None if log is None else log - before.data.first
        drawn = whole and (shown is None or shown < len(before.data.logs))
        responses = effect.evidence == "frequency responses" and found.responses is not None
        answers = (
            found.responses.answers(Acting.of(effect, end.model.effects[place].values))
            if responses and found.responses is not None and whole
            else ()
        )
        out.append(
            Finding(
                effect.name,
                effect.joint,
                effect.title,
                parameters(every, place),
                _explained(trained, place, floor),
                _visibility(found, place),
                rivals,
                effect.experiment if rivals else None,
                gains[place],
                _evidence_of(effect.evidence),
                size,
                of_rated,
                proof(
                    before,
                    after,
                    joint + 1 if responses else effect.joint,
                    shown,
                    bool(effect.per_log) and log is not None,
                )
                if drawn
                else None,
                answers=answers,
                log=None if log is None else later.rows.data.logs[log - later.rows.data.first].log.name,
            )
        )
    return tuple(sorted(out, key=lambda one: -one.explained))


Origin = Literal["residual", "base parameters", "frequency responses", "reversals"]


def _evidence_of(evidence_of: str) -> Origin:
    known: dict[str, Origin] = {
        "base parameters": "base parameters",
        "frequency responses": "frequency responses",
        "reversals": "reversals",
    }
    return known.get(evidence_of, "residual")


def _size(trained: Trained, place: int, floor: Array) -> tuple[float, int, float]:
    """Return the rms [N m] of a cause's torque at its joint or where it stands highest.

    And that joint, from 0, and the share of its rated torque.
    """
    model, data = trained.models[-1].model, trained.models[-1].data
    effect = model.effects[place].effect
    own = data.rms(model.torque(data) - model.without(place).torque(data))
    joint = int(np.argmax(own / floor)) if effect.joint is None else effect.joint - 1
    rated = data.logs[0].log.robot.joints[joint].torque
    share = float(own[joint] / rated) if np.isfinite(rated) and rated > 0.0 else np.nan
    return float(own[joint]), joint, share


def _explained(trained: Trained, place: int, floor: Array) -> float:
    """Return the share of the nominal residual's power above the floor that a cause takes away."""

    def above(k: int) -> float:
        power = np.square(trained.models[k].rms / floor)
        return float(np.sum(np.maximum(power - 1.0, 0.0)))

    taken = (above(place) - above(place + 1)) / max(above(0), 1e-12)
    return float(np.clip(taken, 0.0, 1.0))


def _visibility(found: Found, place: int) -> float:
    """Return the part of a cause's torque that the other numbers of the model cannot imitate."""
    later, model = found.later, found.selection.end.model
    rows, prior = later.rows, found.selection.end.info
    own = [
        a - b
        for a, b in zip(rows.torque(model), rows.torque(model.without(place)), strict=True)
    ]
    moments = later.base.moments(own)
    power = sum(float(x @ x) for x in own)
    imitated = moments @ np.linalg.solve(prior + later.gram, moments)
    return float(np.sqrt(np.clip(1.0 - imitated / max(power, 1e-300), 0.0, 1.0)))


def _rivals(own: Round, rows: int) -> tuple[Rival, ...]:
    """Return the causes that the data do not tell from the one selected."""
    if own.cause is None or own.state is None:
        return ()

    def taken(state_residual: Sequence[Array]) -> Array:
        return np.concatenate(
            [a - b for a, b in zip(own.before.residual, state_residual, strict=True)]
        )

    mine, out = taken(own.state.residual), []
    for one in own.tried:
        if one.key in own.cause.alternatives:
            theirs = taken(one.state.residual)
            size = float(np.linalg.norm(mine) * np.linalg.norm(theirs))
            out.append(Rival(*one.key, float(mine @ theirs) / max(size, 1e-300)))
    return tuple(sorted(out, key=lambda one: -one.similarity))


def _extended(trained: Trained) -> Arm:
    """Return the arm with every cause that lasts, all numbers with their standard deviations."""
    done = trained.models[-1]
    known = done.covariance()
    kept = [k for k, one in enumerate(done.model.effects) if one.log is None]
    return with_uncertainty(
        done.model.nominal.extended(*(acting(done, k, known) for k in kept)), done
    )


def _sentence(
    verdict: Verdict, reason: str, findings: Sequence[Finding], trained: Trained, found: Found
) -> str:
    """Return what a technician is told."""
    if verdict == "nothing-wrong":
        return "Nothing is wrong with this arm, as far as these logs can tell."
    if not findings:
        return f"Something is wrong, and no cause is named: {reason}."
    first = findings[0]
    revolute = trained.models[0].model.arm.robot.revolute
    turns = revolute if first.joint is None else revolute[first.joint - 1 : first.joint]
    unit = " or ".join(
        dict.fromkeys("N m rms of torque" if one else "N rms of force" for one in turns)
    )
    what = f"{first.title}{how_much(first)}{where(first)}"
    others = _others(first, found)
    if others:
        return (
            f"{what}{''.join(f', or {one}' for one in others)}: these logs do not tell which. "
            f"{first.experiment or ''}".rstrip()
        )
    size = f": {first.torque_rms:.2g} {unit}{taken_in(first, trained.models[0].rms)}"
    return f"{what}{size}{beside(findings[1:])}."


def _others(first: Finding, found: Found) -> list[str]:
    """Return the alternatives of a finding, each with its number."""
    keys = {(one.cause, one.joint) for one in first.rivals}
    own = [one for one in found.selection.rounds if one.cause is not None]
    same = [one for one in own if one.cause and one.cause.key == (first.cause, first.joint)]
    return [
        f"{within(effect.effect.title)}{how_much(like)}{where(like)}"
        for one in same[:1]
        for candidate in one.tried
        if candidate.key in keys
        for effect, like in [_like(first, candidate)]
    ]


def _like(first: Finding, candidate: Candidate) -> tuple[Acting, Finding]:
    one = candidate.state.model.effects[-1]
    other = Acting.of(one.effect, one.values)
    cause, joint = candidate.key
    numbers: dict[str, Value] = told(other)
    return other, replace(first, cause=cause, joint=joint, parameters=numbers, log=None)


def _rejected(found: Found) -> tuple[Rejected, ...]:
    """Return what stood above its threshold and is not named."""
    named = {one.key for one in found.decision.causes}
    alike = {key for one in found.decision.causes for key in one.alternatives}
    out: dict[Key, Rejected] = {}
    for one in found.selection.rounds:
        for trial in one.tried:
            if trial.key not in named | alike:
                out[trial.key] = Rejected(*trial.key, one.stopped or _WORSE)
    return tuple(out.values())


def _ledger(found: Found) -> tuple[Trial, ...]:
    """Return every candidate above the threshold of its round, and how it fared."""
    rows, out = found.later.rows.count, []
    for step, one in enumerate(found.selection.rounds, 1):
        power = one.before.cost
        exact = {trial.key: 1.0 - trial.state.cost / power for trial in one.tried}
        alike = () if one.cause is None else one.cause.alternatives
        for screened in sorted(one.significant, key=lambda s: -s.gain):
            key, group = screened.group.key, screened.group
            if group.kind == "unnamed":
                continue
            accepted = one.cause is not None and one.cause.key == key
            reason = (
                _ACCEPTED
                if accepted
                else _ALIKE
                if key in alike
                else _WEAKER
                if key not in exact
                else one.stopped or _WORSE
            )
            bound = found.baseline.threshold(group.kind, screened.freedom, rows)
            out.append(
                Trial(
                    step,
                    *key,
                    screened.gain / power,
                    bound / power,
                    np.nan,
                    exact.get(key, np.nan),
                    accepted,
                    reason,
                )
            )
    return tuple(out)


def _thresholds(found: Found, origin: str) -> tuple[Threshold, ...]:
    """Return what each cause had to exceed in the last round, in its best shape."""
    end, later = found.selection.end, found.later
    rows, best = later.rows.count, best_of(later.screened(end))
    return tuple(
        Threshold(
            *key, found.baseline.threshold(one.group.kind, one.freedom, rows) / end.cost, origin
        )
        for key, one in best.items()
        if one.group.kind != "unnamed"
    )

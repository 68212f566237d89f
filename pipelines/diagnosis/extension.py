"""Extend the nominal model by causes that somebody names, as far as held-out rows bear them out.

    extended = extend(prepared, (Wanted(effect), …), config, blocks)

No threshold: the cause was named. The one that gains most is fitted first. One is accepted where
its numbers are possible, where it takes torque off held-out rows beyond its bootstrap interval, and
where no held-out log gets worse by more than a tenth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pipelines.diagnosis.candidate_fits import Candidate, refit
from pipelines.diagnosis.compliance import compliance
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import pose
from pipelines.diagnosis.findings import Worth, extension_of, findings_of, weigh
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.result import Extended, Rejected
from pipelines.diagnosis.screening import best_of
from pipelines.diagnosis.standing import standing_of
from pipelines.diagnosis.state import State
from pipelines.diagnosis.trained import covariance, train
from pipelines.dynamics.arm import Acting
from pipelines.estimation.candidate_columns import Wanted, usable
from pipelines.estimation.model_fit import worse_log
from pipelines.estimation.nominal import plain_number
from pipelines.estimation.preparation import Prepared

__all__ = ["extend"]

_NOTHING = "it takes nothing off the held-out error"
_NOT_MOVED = "since the reference logs the base parameters have not moved as it moves them"
_IMPOSSIBLE = "fitted exactly, its numbers are impossible"


def extend(
    prepared: Prepared, wanted: Sequence[Wanted], config: DiagnosisConfig, blocks: int
) -> Extended:
    """Return the model with the wanted causes that are accepted.

    Args:
        blocks: of time, held out in turn where there is no log of role "validate".

    Raises:
        UsageError: C02, a cause that no model of these logs can take up.
    """
    later = pose(prepared, config)
    model = later.dataset.model
    for one in wanted:
        key = (one.effect.name, one.effect.joint)
        revolute = model.arm.robot.revolute
        usable(later.dictionary.families.get(key), one, model.columns.laws, revolute)
    responses = compliance(prepared.logs.frf, model.nominal)
    named = {one.place: one for one in (responses.named if responses else ())}
    standing = standing_of(prepared.reference, later)
    refused: list[Rejected] = []
    left = list(wanted)
    while True:
        state, taken, impossible = _fitted(later, left, named)
        refused += impossible
        left = taken
        trained = train(prepared, later, state.model.effects, blocks, standing)
        worth = weigh(prepared, trained, standing, whole=True)
        doubts = [_doubt(worth, place) for place in range(len(left))]
        if not any(doubts):
            break
        place = max(k for k, doubt in enumerate(doubts) if doubt)  # the last gains least
        cause = left.pop(place)
        refused.append(Rejected(cause.effect.name, cause.effect.joint, doubts[place]))
    known, open_sets = covariance(later, state), [(None, ())] * len(left)
    findings = findings_of(worth, later, state, known, open_sets, responses)
    found = replace(extension_of(prepared, worth, findings), rejected=tuple(refused))
    return found if left else replace(found, arm=None, gain=None)


def _fitted(
    later: Later, wanted: Sequence[Wanted], responses: dict[str, Acting]
) -> tuple[State, list[Wanted], list[Rejected]]:
    """Return the model with the causes fitted, the greatest first, those in order, and the rest."""
    state, left = later.start(), list(wanted)
    taken: list[Wanted] = []
    impossible: list[Rejected] = []
    while left:
        tried = [(one, _tried(later, state, one, responses.get(one.place))) for one in left]
        good = [(one, done) for one, done in tried if done is not None and done.possible]
        for one, done in tried:
            if done is None or not done.possible:
                reason = _IMPOSSIBLE + ("" if done is None else _numbers(done))
                impossible.append(Rejected(one.effect.name, one.effect.joint, reason))
        if not good:
            break
        one, best = min(good, key=lambda pair: pair[1].state.cost)
        taken.append(one)
        state, left = best.state, [other for other, _ in good if other is not one]
    return state, taken, impossible


def _tried(later: Later, state: State, one: Wanted, known: Acting | None) -> Candidate | None:
    """Return a cause fitted from its best shape, or from the numbers that responses give it."""
    if known is not None:
        effect = known.effect.at(known.values)
        return refit(later, state, effect, effect.amplitudes(known.values))
    best = best_of(later.screened(state))[one.effect.name, one.effect.joint]
    start: dict[str, Any] = dict(one.start)
    return refit(later, state, replace(later.form(best.group), **start), best.amplitudes)


def _doubt(worth: Worth, place: int) -> str:
    """Return why the held-out rows do not bear a cause out; empty where they do."""
    gain = worth.gain(place, place + 1).validate_torque_rms
    if not (gain.ci95[:, 1] < 0.0).any():
        effect = worth.trained.models[-1].model.effects[place].effect
        return _NOT_MOVED if effect.evidence == "base parameters" else _NOTHING
    return worse_log(worth.trained.data, worth.left[place], worth.left[place + 1])


def _numbers(done: Candidate) -> str:
    """Return ": order = 6.02 1/rev, …" of a cause whose numbers are impossible."""
    one, revolute = done.state.model.effects[-1], done.state.model.arm.robot.revolute
    turning = one.effect.joint is None or revolute[one.effect.joint - 1]
    every = one.effect.parameters
    units = {q.name: "" if q.unit == "1" else f" {q.unit_at(turning)}" for q in every}
    shown = one.effect.reported(one.values).items()
    told = [
        f"{name} = {plain_number(value, 3)}{units[name]}"
        for name, value in shown
        if name in units and isinstance(value, float)
    ]
    return f": {', '.join(told)}" if told else ""

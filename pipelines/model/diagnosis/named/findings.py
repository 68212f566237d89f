"""From the steps of a search to findings: numbers, rivals, gain and proof of each named cause, and why others are not named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.named.chain import with_some, worth
from pipelines.model.diagnosis.named.joined import once_each
from pipelines.model.diagnosis.named.verdict import Ruling, explained
from pipelines.model.diagnosis.result import RIVALS, Answer, Finding, Gain, Rejected, Rival
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.searched.beside import Part
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.searched.search import Found, Step
from pipelines.model.diagnosis.worth.gains import Simulation, worse_log
from pipelines.model.diagnosis.worth.held_out import held_out_left
from pipelines.model.diagnosis.worth.numbers import acting, parameters, told
from pipelines.model.diagnosis.worth.proof import proof

__all__ = ["Causes", "agreement", "extended_arm", "findings", "held_finding", "rejected", "unlike"]

_AGREE = (0.4, 2.5)  # of its amplitude, that each log must ask for by itself
_BLOCKS = 10  # of one log, that must agree as logs do
_TELLS = 9.0  # squared distance of the amplitude from none, in variances of what a log would ask for, for the log to be asked
# That variance, in those of white noise: rows next to each other share the noise of the low-pass and what the model lacks. By their
# own correlation it is 1.3 to 2.9 for most causes on logs of noise alone, 1.7 to 20 on two of the test bench, 5 in the middle.
_ALIKE = 10.0


@dataclass(frozen=True, eq=False)
class Causes:
    """The causes that are named."""

    findings: tuple[Finding, ...]
    simulated: tuple[Simulation, ...]  # the nominal arm and that with all of them; empty where nothing is named


def findings(found: Found, ruling: Ruling, simulated: Sequence[Simulation], prepared: Prepared, nominal: Array, floor: Array,
             blocks: int, draw: bool, beside: Sequence[Acting] = ()) -> Causes:
    """Each named cause, the one that explains most first, and how the arms without and with all of them follow.

    The final model holds them, in the order of their steps.

    Args:
        simulated: the nominal arm and that after each step.
        nominal: (joints,) [N m] what the nominal model leaves.
        beside: effects that the rows are without.
    """
    covariance = found.final.covariance()
    steps = [found.steps[k] for k in ruling.named]
    models = _in_steps(found, ruling.named, steps)
    taken = [explained(before.rms, after.rms, nominal, floor) for before, after in models]
    order = _told([(best.effect.name, best.effect.joint) for step in steps if (best := step.best) is not None], taken)
    told = worth(found, ruling.named, order, simulated, prepared, beside, blocks) if order else []
    each = once_each(
        _finding(found, steps[place], best, place, (one.before, one.after), covariance, taken[place], floor, one.gain, draw)
        for places, one in zip(order, told, strict=True) for place in places if (best := steps[place].best) is not None)
    return Causes(each, (told[0].simulated[0], told[-1].simulated[1]) if told else ())


def _told(causes: Sequence[tuple[str, int | None]], taken: Sequence[float]) -> list[list[int]]:
    """Places of each cause at its joint, the strongest first: the waves of one gear are one cause."""
    places: dict[tuple[str, int | None], list[int]] = {}
    for place in sorted(range(len(causes)), key=lambda place: -taken[place]):
        places.setdefault(causes[place], []).append(place)
    return sorted(places.values(), key=lambda own: -sum(taken[place] for place in own))


def _in_steps(found: Found, named: Sequence[int], steps: Sequence[Step]) -> list[tuple[Refined, Refined]]:
    """The models before and after each named cause: as it was found, or, where one before it was dropped since, fitted anew with
    those that stay."""
    if list(named) == list(range(len(named))):
        return [(step.before, step.before if step.best is None else step.best.done) for step in steps]
    return list(pairwise([found.nominal, *(with_some(found, range(count)) for count in range(1, len(steps))), found.final]))


def held_finding(part: Part, nominal: Array, floor: Array, draw: bool, answers: Sequence[Answer] = ()) -> Finding:
    """A cause that frequency responses name, `answers`, with what the logs of motion say of it."""
    acting, before, after = part.acting, part.before, part.after
    effect, data = acting.effect, before.data
    torque = np.zeros(data.rows) if after.data.known is None else after.data.known
    torque = torque if data.known is None else torque - data.known
    size, joint, of_rated = _size(torque, data, effect.joint, floor)
    seen = float(np.linalg.norm(before.fit.project(torque)) / max(float(np.linalg.norm(torque * before.weights)), 1e-300))
    return Finding(effect.name, effect.joint, effect.title, told(acting), explained(before.rms, after.rms, nominal, floor), seen,
                   (), None, part.gain, "frequency responses", size, of_rated, proof(before, after, joint + 1) if draw else None,
                   part.doubt, tuple(answers) if draw else ())


def _size(torque: Array, data: Data, joint: int | None, floor: Array) -> tuple[float, int, float]:
    """[N m] rms of a cause's torque at its joint, or where it stands highest; that joint, from 0; and the share of the rated."""
    own = data.rms(torque)
    where = int(np.argmax(own / np.maximum(floor, 1e-12))) if joint is None else joint - 1
    rated = data.logs[0].log.robot.joints[where].torque
    return float(own[where]), where, float(own[where] / rated) if np.isfinite(rated) and rated > 0.0 else np.nan


def _finding(found: Found, step: Step, best: Tried, place: int, models: tuple[Refined, Refined], covariance: Array, taken: float,
             floor: Array, gain: Gain, draw: bool) -> Finding:
    effect, data, log = best.effect, step.before.data, found.final.model.effects[place].log
    rivals = _rivals(step, best)
    torque = data.y - found.final.left - _without(found.final, place)
    size, _, of_rated = _size(torque, data, effect.joint, floor)
    numbers = parameters(found.final, place, covariance)
    origin: Literal["residual", "reversals"] = "reversals" if effect.evidence == "reversals" else "residual"
    return Finding(effect.name, effect.joint, effect.title, numbers, taken, best.visibility, rivals,
                   effect.experiment if rivals else None, gain, origin, size, of_rated,
                   proof(*models, effect.joint, None if log is None else log - data.first, best.screened.family.event)
                   if draw else None,
                   log=None if log is None else data.logs[log - data.first].log.name)


def _without(done: Refined, place: int) -> Array:
    """(rows,) [N m] torque of the model without one of its effects."""
    return done.model.without(place).torque(done.data)


def _rivals(step: Step, best: Tried) -> tuple[Rival, ...]:
    """Causes of nearly the same torque that take something off the held-out error as well."""
    mine = step.before.residual - best.done.residual
    found = []
    for one in step.rivals:
        theirs = step.before.residual - one.done.residual
        alike = float(mine @ theirs) / max(float(np.linalg.norm(mine) * np.linalg.norm(theirs)), 1e-300)
        if one is not best and alike > RIVALS and one.error < 1.0 and one.possible:
            found.append(Rival(one.screened.cause, one.screened.joint, alike))
    return tuple(sorted(found, key=lambda rival: -rival.similarity))


def unlike(before: Refined, after: Refined, place: int, prepared: Prepared, blocks: int) -> str:
    """Why effect number `place` of `after`, which `before` lacks, does not do the same in every log; empty where it does."""
    data = after.data if prepared.judge is None else prepared.judge
    if worse := worse_log(data, *(held_out_left(one, prepared.judge, blocks) for one in (before, after))):
        return worse
    off = [f"{scale:.2g}" for scale in agreement(after, place, prepared) if not _AGREE[0] < scale < _AGREE[1]]
    parts = "parts of the log" if prepared.judge is None and len(prepared.data.logs) == 1 else "logs"
    return f"{parts} do not agree on its size: {', '.join(off)} of it" if off else ""


def agreement(done: Refined, place: int, prepared: Prepared) -> list[float]:
    """The amplitude that each log asks for by itself, in parts of the one found; each block of time where there is one log.

    Only of those that can tell. Where the joint of a gap is held, its two sides float against each other, and no torque says where.
    """
    scales = []
    effect = done.model.effects[place].effect
    alone = prepared.judge is None and len(prepared.data.logs) == 1  # it would be asked what it was asked before
    for data in (prepared.data, prepared.judge):
        if data is None:
            continue
        torque = done.model.torque(data)
        share = torque - done.model.without(place).torque(data)
        left = data.y - torque
        weights = done.weight[data.joint]
        parts = data.blocks(_BLOCKS) if alone else data.log_of
        for part in range(int(parts.max()) + 1):
            own = parts == part
            if effect.evidence == "reversals" and effect.joint and not (own & data.counts & (data.joint == effect.joint - 1)).any():
                continue
            s, r = share[own] * weights[own], left[own] * weights[own]
            power = float(s @ s)
            rows = max(int(np.count_nonzero(data.counts[own])), 1)  # those of joints that are held are none
            if power > _TELLS * _ALIKE * float(r @ r) / rows:
                scales.append(1.0 + float(s @ r) / power)
    return scales


def rejected(found: Found, ruling: Ruling) -> tuple[Rejected, ...]:
    """What came close: above its threshold, or found and not named."""
    best = [found.steps[k].best for k in ruling.named]
    named = {(one.effect.name, one.effect.joint) for one in best if one is not None}
    out: dict[tuple[str, int | None], Rejected] = {}
    for step in found.steps:
        for trial in step.trials:
            key = (trial.cause, trial.joint)
            doubted = trial.accepted and trial.step - 1 in ruling.doubts
            if key in named or (key in out and not doubted) or trial.gain <= trial.threshold:
                continue
            whole = ruling.reason if ruling.verdict != "cause" else ""  # of a cause it says what is beside that
            why = ruling.doubts.get(trial.step - 1) or whole or "not named" if trial.accepted else trial.reason
            out[key] = Rejected(trial.cause, trial.joint, why)
    return tuple(out.values())


def extended_arm(found: Found, ruling: Ruling) -> Arm:
    """The arm with what is named, refitted, every effect with its standard deviations."""
    covariance = found.final.covariance()
    final = found.final.model
    kept = [k for k, one in enumerate(final.effects) if k < len(ruling.named) and one.log is None]
    return final.nominal.extended(*(acting(found.final, k, covariance) for k in kept))


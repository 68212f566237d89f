"""The second question: what has changed since the reference logs, and what it is worth.

    found = changed(first, reference, settings, calibration, memory)

The search is `search` with the gate of `since_reference`; what is beside it, the base parameters that have moved, is `absorbed`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipelines.log.experiment import Array
from pipelines.log.shared_work import meanwhile
from pipelines.model.diagnosis.answered.told import Limits, diagnosis_of, limits_of, sentence, strongest
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.doubted import unlike_noise, unnamed
from pipelines.model.diagnosis.believed.oscillating import oscillation
from pipelines.model.diagnosis.believed.pruned import settled
from pipelines.model.diagnosis.believed.steadied import steadied, steady_nominal
from pipelines.model.diagnosis.believed.unchanged import Before
from pipelines.model.diagnosis.floor.calibrated import conditions_of, origin_of, refuse_calibration
from pipelines.model.diagnosis.floor.calibration import Calibration
from pipelines.model.diagnosis.floor.motion_floor import motion_floor, noise_in
from pipelines.model.diagnosis.given.floored import Floored
from pipelines.model.diagnosis.given.responding import Responding
from pipelines.model.diagnosis.given.since import Since, since_reference
from pipelines.model.diagnosis.memory import Memory
from pipelines.model.diagnosis.named.carried import carried, unmoved
from pipelines.model.diagnosis.named.verdict import Ruling, rule
from pipelines.model.diagnosis.reference.absorbed import Absorbed, Unexplained
from pipelines.model.diagnosis.reference.standing import Chance
from pipelines.model.diagnosis.result import Diagnosis, Finding, Rejected
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.rows.imperfections import DriveNoise
from pipelines.model.diagnosis.screened.candidates import Family
from pipelines.model.diagnosis.searched.beside import acted
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.ledger import line_of_moved
from pipelines.model.diagnosis.searched.search import Found, search
from pipelines.model.diagnosis.worth.simulated import arms_of, as_simulated, followed_by, with_simulation
from pipelines.model.effects import find_effect
from pipelines.model.effects.base import Effect
from pipelines.model.words import within

__all__ = ["changed"]

Gained = dict[Family, float]  # by each cause where nothing has changed

_STOOD = 4  # times that effects are taken to stand by what later logs show of them
_MOVED = ("the base parameters have moved since the reference logs, and no cause that is known moves them so: one set for "
          "before and after leaves {:.2g} times what a set for each leaves; look at the tool, at the zeros of the encoders, and at "
          "the torque constants of all drives")


def changed(first: Responding, reference: Data, chosen: DiagnosisSettings, given: Calibration | None,
             memory: Memory) -> Diagnosis:
    """What is different since the reference logs."""
    logs = [log for log, _ in first.held.prepared.referring]
    if given is not None:
        refuse_calibration(given, first.held.prepared, first.held.case.families, "reference logs", logs)
    known = None if given is None else (given.weight, {(one.cause, one.joint): one.own for one in given.causes})
    taken = first.held.case.beside
    since = (since_reference(first.held.prepared, reference, chosen, taken, known) if taken or known is not None else
             memory.since(first.held.prepared, chosen))
    alone = since
    drives = partial(_drives, first, reference, seed=chosen.seed)
    one = _compared(first, alone, reference, chosen, memory, drives)
    since, found, case, noise = one.since, one.found, one.case, one.noise
    floor = since.floor_of(case.data)
    case = replace(case, unlike=frozenset(np.flatnonzero(floor > since.floor).tolist()))
    now = replace(first.held.prepared, data=case.data, judge=case.judge)
    first = replace(first, held=replace(first.held, prepared=now))
    limits_beside = partial(_limits, found, case, first, since)
    with meanwhile(limits_beside) if chosen.limits else nullcontext(limits_beside) as limits:
        done = settled(found, rule(found, floor), case, now, floor)
        done = replace(done, found=steady_nominal(done.found))
        done = unlike_noise(done, lambda: oscillation(reference, since.left).stands)
        moved = since.absorbed(done.found.final, () if done.ruling.named else case.families)
        if isinstance(moved, Absorbed) and done.ruling.verdict == "unknown":
            done = unnamed(done, _with_load(found, case, now, since.floor, floor, noise, chosen.seed))
        judging = 1.0 if case.judge is None else _times(since.floor_of(case.judge), since.floor)
        floored = Floored(floor, "reference logs", None, given, noise, since.floor, judging)
        sure = isinstance(moved, Absorbed) and not moved.unsure
        told = diagnosis_of(first, case, done, floored, chosen, partial(_taken, limits, since.chance), sure,
                            moved is not None)
    if given is None:
        told = replace(told, calibration=Calibration(
            origin_of("reference logs", logs, None, chosen), conditions_of(now), alone.chance.weight, alone.floor,
            np.full(case.data.n_joints, np.nan), alone.chance.bounds, None, ()))
    told = replace(told, question="what has changed", standing=(*first.standing, *since.standing))
    if isinstance(moved, Unexplained):
        return _nameless(told, _MOVED.format(moved.times)) if told.verdict == "nothing-wrong" else told
    if moved is None:
        return told
    loaded = _with_moved(told, moved, done.found, now, case, chosen)
    # Of rows that lack what responses have named, the figure would not be that of the nominal model.
    return replace(loaded, unmoved_rms=None) if first.held.acting else loaded


def _drives(first: Responding, reference: Data, since: Since, seed: int) -> DriveNoise | None:
    """The noise of the drives, from what the standing effects leave of the reference logs."""
    prepared = first.held.prepared
    return noise_in(since.case.model, reference, since.left, prepared.referring, prepared.recipe, seed)


def _limits(found: Found, case: Case, first: Responding, since: Since) -> tuple[Limits, Gained]:
    """What would have been found of what has changed; and what chance gives each cause, as far as it has been asked by then."""
    last = found.steps[-1]  # nothing else of the search has a part in them
    alone, case = steadied(Found(last.before, (last,), last.before), case)
    return limits_of(alone.steps[-1], case, first, since.probed), dict(since.chance.known)


def _taken(limits: Callable[[], tuple[Limits, Gained]], chance: Chance) -> Limits:
    """What another process has found out, chance's part for the next diagnosis too."""
    found, known = limits()
    chance.known.update(known)
    return found


@dataclass(frozen=True, eq=False)
class _Compared:
    """Logs held against the reference logs."""

    since: Since
    found: Found
    case: Case  # which knows already how much of what was found the reference logs have
    noise: DriveNoise | None


def _compared(first: Responding, since: Since, reference: Data, chosen: DiagnosisSettings, memory: Memory,
              drives: Callable[[Since], DriveNoise | None]) -> _Compared:
    """The search in what has changed, and meanwhile the noise of the drives. What it finds that stood in the reference logs as well
    is taken out with the rest that stands, and it searches again."""
    taken = first.held.case.beside
    for count in range(_STOOD + 1):
        case = first.nameable(since.case)
        asked = Before(case, again=count < _STOOD)
        with meanwhile(partial(drives, since), patient=True) as noise:
            # Once a search ends early: of many joints that have the same law each would have a search of its own.
            once = count == 0
            found = search(case, chosen.most, ends=asked.ended if once else None, vain=asked.shown if once else None)
            more = asked.stood(found.final)
            if not more:
                return _Compared(since, found, asked.told(found.final), noise())
        before, stood = since, (*since.stood, *more)  # beside more that stands, chance gives each cause less: known is no longer
        since = since_reference(first.held.prepared, reference, chosen, taken, None, stood, since.of_reference)
        memory.instead(before, since)
    raise AssertionError("nothing stands in the last round")


def _nameless(told: Diagnosis, why: str) -> Diagnosis:
    turning = () if told.nominal is None else told.nominal.robot.revolute
    return replace(told, verdict="unknown", reason=why,
                   summary=sentence(Ruling("unknown", (), why), (), turning, told.residual_rms.identify))


def _with_moved(told: Diagnosis, moved: Absorbed, found: Found, now: Prepared, case: Case,
                chosen: DiagnosisSettings) -> Diagnosis:
    """With what the base parameters say has changed, where nothing that was found says it already."""
    turning = now.data.logs[0].log.robot.revolute
    if told.verdict == "unknown" or told.extended is None:
        why = "the base parameters have moved as it moves them, beside something that has no name"
        return _not_accepted(told, moved, why)
    if (like := _alike(moved.effect, told.findings)) is not None:
        why = f"the base parameters have moved, but {within(like.title)}, which was found, moves them too"
        return _not_accepted(told, moved, why)
    if why := moved.unsure:
        refused = _not_accepted(told, moved, why)
        return refused if told.findings else _nameless(refused, why)
    one = carried(moved, found.final, told.extended, now, case.beside, chosen.blocks, chosen.evidence)
    if one.doubt:
        told = _not_accepted(told, moved, one.doubt, one.gained)
        return _nameless(told, _MOVED.format(moved.times)) if moved.far and not told.findings else told
    findings, beside = strongest((one.finding, *told.findings)), told.reason if told.verdict == "cause" else ""
    named = replace(told, verdict="cause", findings=findings, reason=beside, extended=one.arm,
                    unmoved_rms=unmoved(one, found.nominal, now.judge, told.residual_rms.floor),
                    ledger=(*told.ledger, line_of_moved(moved, told.ledger, one.gained)),
                    summary=sentence(Ruling("cause", (), beside), findings, turning, told.residual_rms.identify))
    if not named.evidence:
        return named
    return with_simulation(named, as_simulated(one.simulated) or followed_by(arms_of(named), now.logs))


def _not_accepted(told: Diagnosis, moved: Absorbed, why: str, gained: float = np.nan) -> Diagnosis:
    """With the reason among what is rejected, its rivals with it, and in the ledger beside what it gains."""
    places = dict.fromkeys((one.name, one.joint) for one in (moved.effect, *moved.rivals))
    return replace(told, rejected=(*told.rejected, *(Rejected(name, joint, why) for name, joint in places)),
                   ledger=(*told.ledger, line_of_moved(moved, told.ledger, gained, why)))


def _alike(effect: Effect, found: Iterable[Finding]) -> Finding | None:
    """What was found that `effect` could be mistaken for.

    A longer link, say, moves masses that lie beyond it, and which part of a base parameter these are no torque tells.
    """
    return next((one for one in found if one.cause in effect.twins or effect.name in find_effect(one.cause).twins), None)


def _with_load(found: Found, case: Case, now: Prepared, before: Array, floor: Array, noise: DriveNoise | None, seed: int) -> Array:
    """(joints,) [N m] floor of the later logs, whose arm is heavier: it reverses more slowly; `floor`, that of the reference logs
    `before` at such speeds, where nobody can tell."""
    arm = acted(found.nominal.model.arm, case.beside)
    own = None if noise is None else motion_floor(found.nominal.model, arm, noise, now.motions, case.data, now, before, seed,
                                                  case.beside, _times(floor, before))
    return floor if own is None else np.maximum(own, floor)


def _times(floor: Array, before: Array) -> Array:
    """(joints,) how many times the power one floor is of the other; once where there is none to multiply."""
    return np.square(np.divide(floor, before, out=np.ones_like(floor), where=before > 0.0))

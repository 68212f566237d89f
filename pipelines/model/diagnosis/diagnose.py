"""Diagnose an arm: what its nominal model gets wrong in these logs, and why.

    found = diagnose(Logs.by_role(logs), DiagnosisSettings())
    found.verdict, found.findings, found.extended

Reconstruct and condition the logs; fit the nominal model; take the greatest causes away for a moment and make the twin of what
is left; search with the twin's thresholds; judge what was found on held-out logs; say what these logs cannot tell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.log.shared_work import meanwhile
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.absorbed import Absorbed, Unexplained
from pipelines.model.diagnosis.beside import Held, acted
from pipelines.model.diagnosis.calibrated import conditions_of, following_of, origin_of, refuse_unfit
from pipelines.model.diagnosis.calibration import Calibration
from pipelines.model.diagnosis.candidates import families, whole_motion
from pipelines.model.diagnosis.carried import carried
from pipelines.model.diagnosis.case import Case
from pipelines.model.diagnosis.change_of_sign import SEVERAL, loosened, of_one_law, plainer_of, shows, wrong_law
from pipelines.model.diagnosis.compliance import Compliance
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.doubted import of_replicas, unlike_motion, unlike_noise, unnamed
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.floored import Floored, floored_by
from pipelines.model.diagnosis.imperfections import DriveNoise
from pipelines.model.diagnosis.inputs import GAP_HZ, Logs, Prepared, narrowed
from pipelines.model.diagnosis.memory import Memory
from pipelines.model.diagnosis.motion_floor import motion_floor, noise_in
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.oscillating import oscillation
from pipelines.model.diagnosis.own_motion import put_right
from pipelines.model.diagnosis.pruned import settled
from pipelines.model.diagnosis.refit import Refined
from pipelines.model.diagnosis.responding import Responding, responding
from pipelines.model.diagnosis.result import Diagnosis, Finding, Rejected
from pipelines.model.diagnosis.search import Explored, Found, gap_first, gives_way, glance, greatest, provisional, search
from pipelines.model.diagnosis.second_look import looked_again
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.diagnosis.simulated import arms_of, followed_by, with_simulation
from pipelines.model.diagnosis.since import Since, since_reference
from pipelines.model.diagnosis.steadied import steady_nominal
from pipelines.model.diagnosis.told import diagnosis_of, limits_of, sentence, strongest
from pipelines.model.diagnosis.unchanged import stood_before
from pipelines.model.diagnosis.verdict import Ruling, rule
from pipelines.model.diagnosis.words import within
from pipelines.model.effects import find_effect
from pipelines.model.effects.base import Effect

__all__ = ["diagnose"]

Tell = Callable[[str], None]

_STOOD = 4  # times that effects are taken to stand by what later logs show of them
_MOVED = ("the base parameters have moved since the reference logs, and no cause that is known moves them so: one set for "
          "before and after leaves {:.2g} times what a set for each leaves; look at the tool, at the zeros of the encoders, and at "
          "the torque constants of all drives")


def diagnose(logs: Logs, settings: DiagnosisSettings | None = None, arm: Arm | None = None, tell: Tell | None = None,
             calibration: Calibration | None = None, memory: Memory | None = None) -> Diagnosis:
    """What the nominal model of an arm gets wrong in `logs`, and why.

    Args:
        arm: whose friction laws the nominal model takes, fitted anew; Coulomb and viscous friction where left out.
        tell: progress, in words.
        calibration: thresholds that an earlier diagnosis has stored, instead of a twin.
        memory: of what was worked out of these logs, for an extension after it.

    Raises:
        InputRejected: no log can be fitted (S01, T04, T08).
        UsageError: C02, the calibration is not for these logs.
    """
    chosen, say = settings or DiagnosisSettings(), tell or (lambda words: None)
    memory = memory or Memory()
    prepared = memory.prepared(logs, chosen, arm)
    seen = _looked_at(prepared, chosen, say, calibration, memory)
    other, again = loosened(prepared), None
    if other is not prepared and of_one_law(greatest(seen.rough)):
        again = _again(other, chosen, say, calibration, memory)
    if again is not None and again.verdict != "unknown" and len(again.findings) < SEVERAL:
        held = again
    else:
        held = found = _diagnosed(seen, chosen, say, calibration, memory)
        doubted = other is not prepared and wrong_law(found, chosen.most)
        if doubted and (found.verdict == "cause" or again is not None or shows(prepared, other)):
            again = again or _again(other, chosen, say, calibration, memory)
            held = plainer_of(found, again)
    if held is again:
        memory.instead(prepared, other)
    return held


def _again(other: Prepared, chosen: DiagnosisSettings, say: Tell, calibration: Calibration | None, memory: Memory) -> Diagnosis:
    """By the loosened laws."""
    say("fitting by which curve friction changes its sign")
    return _diagnosed(_looked_at(other, chosen, say, calibration, memory), chosen, say, calibration, memory)


@dataclass(frozen=True, eq=False)
class _Seen:
    """Logs at a first look."""

    first: Responding
    case: Case
    prepared: Prepared
    rough: tuple[Explored, ...]  # the greatest causes; empty where there are reference logs to compare with


def _looked_at(prepared: Prepared, chosen: DiagnosisSettings, say: Tell, calibration: Calibration | None, memory: Memory) -> _Seen:
    if prepared.logs.frf:
        say("looking at the frequency responses")
    first = responding(_plain(prepared, chosen, calibration, memory), prepared, chosen.without)
    case, prepared = _nameable(first.held.case, first.stiff), first.held.prepared
    if prepared.reference is not None:
        return _Seen(first, case, prepared, ())
    say("looking for the greatest causes")
    seen = glance(case)
    if first.stiff is not None and not first.stiff.named and gives_way(seen):
        say("looking for a gap below the frequencies at which it rings")
        try:
            slow = narrowed(prepared, GAP_HZ, [0.0] * prepared.data.n_joints)
        except InputRejected:  # T04, D05: too little is left below so low a low-pass; this look is one more
            return _Seen(first, case, prepared, provisional(case, seen))
        there = _nameable(_case(slow, chosen), first.stiff)
        rough = provisional(there)
        if gap_first(rough[0]):
            return _Seen(replace(first, held=Held(there, slow)), there, slow, rough)
    return _Seen(first, case, prepared, provisional(case, seen))


def _diagnosed(seen: _Seen, chosen: DiagnosisSettings, say: Tell, calibration: Calibration | None, memory: Memory) -> Diagnosis:
    first, case, prepared, rough = seen.first, seen.case, seen.prepared, seen.rough
    if prepared.reference is not None:
        say("comparing with the reference logs")
        return _changed(first, prepared.reference, chosen, calibration, memory)
    say("simulating the twin" if calibration is None else "taking the stored thresholds")
    floored = floored_by(prepared, case, rough, chosen, calibration)
    say("looking for causes")
    case = replace(case, thresholds=floored.thresholds)
    found = search(case, chosen.most, rough)
    known = floored.thresholds is not None
    usual = None if floored.calibration is None else following_of(floored.calibration, prepared, calibration is not None)
    mended = usual is not None and put_right(found.nominal.fit, found.final.fit, usual)
    done = settled(found, rule(found, floored.rms, known, mended), case, prepared, floored.rms, known)
    if floored.twin is not None:
        done = looked_again(done, case, prepared, floored.twin, chosen.most, floored.rms)
        done = unlike_noise(done, partial(of_replicas, floored.twin))
    return diagnosis_of(first, case, done if usual is None else unlike_motion(done, usual), floored, chosen)


def _nameable(case: Case, stiff: Compliance | None) -> Case:
    """Where frequency responses show no spring, what gives way may be a gap, which the residual then names."""
    return replace(case, nameable=(*case.nameable, "reversals")) if stiff is not None and not stiff.named else case


def _plain(prepared: Prepared, chosen: DiagnosisSettings, given: Calibration | None, memory: Memory) -> Case:
    """With nothing taken out: of the comparison with the reference logs, where there is no more to do before it."""
    if prepared.reference is None or prepared.logs.frf or given is not None:
        return _case(prepared, chosen)
    return replace(memory.since(prepared, chosen).case, beside=())


def _case(prepared: Prepared, chosen: DiagnosisSettings) -> Case:
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = families(columns.laws, whole_motion(prepared.data), model.arm, chosen.without)
    return Case(prepared.data, prepared.judge, model, fit.weight, every, None, chosen.blocks)


def _changed(first: Responding, reference: Data, chosen: DiagnosisSettings, given: Calibration | None,
             memory: Memory) -> Diagnosis:
    """What is different since the reference logs."""
    logs = [log for log, _ in first.held.prepared.referring]
    if given is not None:
        refuse_unfit(given, first.held.prepared, first.held.case.families, "reference logs", logs)
    known = None if given is None else (given.weight, {(one.cause, one.joint): one.own for one in given.causes})
    taken = first.held.case.beside
    since = (since_reference(first.held.prepared, reference, chosen, taken, known) if taken or known is not None else
             memory.since(first.held.prepared, chosen))
    alone = since
    drives = partial(_drives, first, reference, seed=chosen.seed)
    with meanwhile(partial(drives, alone)) as noise_beside:
        since, found = _compared(first, alone, reference, chosen, memory)
        noise = noise_beside() if since is alone else None
    case = _nameable(since.case, first.stiff)
    floor = since.floor_of(case.data)
    case = replace(case, unlike=frozenset(np.flatnonzero(floor > since.floor).tolist()))
    now = replace(first.held.prepared, data=case.data, judge=case.judge)
    first = replace(first, held=replace(first.held, prepared=now))
    with meanwhile(partial(limits_of, found.steps[-1], case, first, since.probed)) if chosen.limits else nullcontext() as limits:
        done = settled(found, rule(found, floor), case, now, floor)
        done = replace(done, found=steady_nominal(done.found))
        done = unlike_noise(done, lambda: oscillation(reference, since.left).stands)
        noise = noise if since is alone else drives(since)
        moved = since.absorbed(done.found.final, () if done.ruling.named else case.families)
        if isinstance(moved, Absorbed) and done.ruling.verdict == "unknown":
            done = unnamed(done, _with_load(found, case, now, since.floor, floor, noise, chosen.seed))
        judging = 1.0 if case.judge is None else _times(since.floor_of(case.judge), since.floor)
        floored = Floored(floor, "reference logs", None, given, noise, since.floor, judging)
        told = diagnosis_of(first, case, done, floored, chosen, limits, isinstance(moved, Absorbed) and not moved.unsure)
    if given is None:
        told = replace(told, calibration=Calibration(
            origin_of("reference logs", logs, None, chosen), conditions_of(now), alone.chance.weight, alone.floor,
            np.full(case.data.n_joints, np.nan), alone.chance.bounds, None, ()))
    told = replace(told, question="what has changed", standing=(*first.standing, *since.standing))
    if isinstance(moved, Unexplained):
        return _nameless(told, _MOVED.format(moved.times)) if told.verdict == "nothing-wrong" else told
    return told if moved is None else _with_moved(told, moved, done.found.final, now, case, chosen)


def _drives(first: Responding, reference: Data, since: Since, seed: int) -> DriveNoise | None:
    """The noise of the drives, from what the standing effects leave of the reference logs."""
    prepared = first.held.prepared
    return noise_in(since.case.model, reference, since.left, prepared.referring, prepared.recipe, seed)


def _compared(first: Responding, since: Since, reference: Data, chosen: DiagnosisSettings,
              memory: Memory) -> tuple[Since, Found]:
    """The search in what has changed. What it finds that stood in the reference logs as well is taken out with the rest that
    stands, and it searches again."""
    taken = first.held.case.beside
    for _ in range(_STOOD):
        case = _nameable(since.case, first.stiff)
        found = search(case, chosen.most)
        more = stood_before(found, case)
        if not more:
            return since, found
        before, stood = since, (*since.stood, *more)  # beside more that stands, chance gives each cause less: known is no longer
        since = since_reference(first.held.prepared, reference, chosen, taken, None, stood)
        memory.instead(before, since)
    return since, search(_nameable(since.case, first.stiff), chosen.most)


def _nameless(told: Diagnosis, why: str) -> Diagnosis:
    turning = () if told.nominal is None else told.nominal.robot.revolute
    return replace(told, verdict="unknown", reason=why,
                   summary=sentence(Ruling("unknown", (), why), (), turning, told.residual_rms.identify))


def _with_moved(told: Diagnosis, moved: Absorbed, final: Refined, now: Prepared, case: Case,
                chosen: DiagnosisSettings) -> Diagnosis:
    """With what the base parameters say has changed, where nothing that was found says it already."""
    turning = now.data.logs[0].log.robot.revolute
    if told.verdict == "unknown" or told.extended is None:
        why = "the base parameters have moved as it moves them, beside something that has no name"
        return replace(told, rejected=(Rejected(moved.effect.name, moved.effect.joint, why), *told.rejected))
    if (like := _alike(moved.effect, told.findings)) is not None:
        why = f"the base parameters have moved, but {within(like.title)}, which was found, moves them too"
        return _not_accepted(told, moved.effect.name, moved.effect.joint, why)
    if why := moved.unsure:
        if told.findings:
            return _not_accepted(told, moved.effect.name, moved.effect.joint, why)
        return _nameless(told, why)
    one = carried(moved, final, told.extended, now, case.beside, chosen.blocks, chosen.evidence)
    if one.doubt:
        told = _not_accepted(told, one.finding.cause, one.finding.joint, one.doubt)
        return _nameless(told, _MOVED.format(moved.times)) if moved.far and not told.findings else told
    findings, beside = strongest((one.finding, *told.findings)), told.reason if told.verdict == "cause" else ""
    named = replace(told, verdict="cause", findings=findings, reason=beside, extended=one.arm,
                    summary=sentence(Ruling("cause", (), beside), findings, turning, told.residual_rms.identify))
    return with_simulation(named, followed_by(arms_of(named), now.logs)) if named.evidence else named


def _not_accepted(told: Diagnosis, cause: str, joint: int | None, why: str) -> Diagnosis:
    return replace(told, rejected=(*told.rejected, Rejected(cause, joint, why)))


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

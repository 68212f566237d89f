"""Diagnose an arm: what its nominal model gets wrong in these logs, and why.

    found = diagnose(Logs.by_role(logs), DiagnosisSettings())
    found.verdict, found.findings, found.extended

Reconstruct and condition the logs; fit the nominal model; take the greatest causes away for a moment and make the twin of what
is left; search with the twin's thresholds; judge what was found on held-out logs; say what these logs cannot tell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.beside import Held, Judged, acted, judged
from pipelines.model.diagnosis.calibrated import bounds_of, conditions_of, following_of, origin_of, refuse_unfit, thresholds_of
from pipelines.model.diagnosis.calibration import Calibration
from pipelines.model.diagnosis.candidates import families, whole_motion
from pipelines.model.diagnosis.carried import carried
from pipelines.model.diagnosis.case import Case
from pipelines.model.diagnosis.change_of_sign import loosened, wrong_law
from pipelines.model.diagnosis.compliance import Compliance, untold
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.evidence import evidence, floors_of
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.findings import extended_arm, findings, held_finding, rejected
from pipelines.model.diagnosis.held_out import held_out_left
from pipelines.model.diagnosis.injection import Probe
from pipelines.model.diagnosis.inputs import GAP_HZ, Logs, Prepared, narrowed
from pipelines.model.diagnosis.limits import detectable, not_testable
from pipelines.model.diagnosis.memory import Memory
from pipelines.model.diagnosis.motion_floor import motion_floor, noise_in
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.own_motion import following
from pipelines.model.diagnosis.pruned import Settled, settled, unlike_held_out, unlike_motion, unnamed
from pipelines.model.diagnosis.responding import Responding, responding
from pipelines.model.diagnosis.result import Detectable, Diagnosis, Finding, NotTestable, Rejected, ResidualRms, Threshold
from pipelines.model.diagnosis.search import Explored, Found, Step, clean, gap_first, gives_way, provisional, search
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.diagnosis.since import Probed, since_reference
from pipelines.model.diagnosis.thresholds import Thresholds
from pipelines.model.diagnosis.twin import drive_noise, make_twin, replayable, white
from pipelines.model.diagnosis.verdict import Ruling, rule
from pipelines.model.effects import find_effect
from pipelines.model.effects.base import Effect

__all__ = ["diagnose"]

Tell = Callable[[str], None]


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
    found = _diagnosed(prepared, chosen, say, calibration, memory)
    other = loosened(prepared) if calibration is None and wrong_law(found) else prepared
    if other is prepared:
        return found
    say("fitting by which curve friction changes its sign")
    return min(found, _diagnosed(other, chosen, say, None, Memory()), key=lambda one: len(one.findings))


def _diagnosed(prepared: Prepared, chosen: DiagnosisSettings, say: Callable[[str], None], calibration: Calibration | None,
               memory: Memory) -> Diagnosis:
    if prepared.logs.frf:
        say("looking at the frequency responses")
    first = responding(_plain(prepared, chosen, calibration, memory), prepared, chosen.without)
    if first.held.prepared.reference is not None:
        say("comparing with the reference logs")
        return _changed(first, first.held.prepared.reference, chosen, calibration, memory)
    case, prepared = _nameable(first.held.case, first.stiff), first.held.prepared
    say("looking for the greatest causes")
    rough = provisional(case)
    if first.stiff is not None and not first.stiff.named and gives_way(rough[0]):
        say("looking for a gap below the frequencies at which it rings")
        slow = narrowed(prepared, GAP_HZ, [0.0] * prepared.data.n_joints)
        there = _nameable(_case(slow, chosen), first.stiff)
        seen = provisional(there)
        if gap_first(seen[0]):
            case, prepared, rough, first = there, slow, seen, replace(first, held=Held(there, slow))
    say("simulating the twin" if calibration is None else "taking the stored thresholds")
    floored = _floored(prepared, case, rough, chosen, calibration)
    say("looking for causes")
    case = replace(case, thresholds=floored.thresholds)
    found = search(case, chosen.most, rough)
    known = floored.thresholds is not None
    done = settled(found, rule(found, floored.rms, known), case, prepared, floored.rms, known)
    usual = None if floored.calibration is None else following_of(floored.calibration, prepared, calibration is not None)
    return _told(first, case, done if usual is None else unlike_motion(done, usual), floored, chosen)


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


@dataclass(frozen=True, eq=False)
class _Floored:
    """The floor, where it comes from, and what follows from it."""

    rms: Array  # (joints,) [N m]
    origin: str
    thresholds: Thresholds | None
    calibration: Calibration | None
    noise: Array | None  # (joints,) [N m] of the drives; None where nobody knows


def _floored(prepared: Prepared, case: Case, rough: tuple[Explored, ...], chosen: DiagnosisSettings,
             given: Calibration | None) -> _Floored:
    """By what was stored; by the twin where a controller is known; else by the noise in the residual."""
    if given is not None:
        refuse_unfit(given, prepared, case.families, "twin")
    made = _calibrated(prepared, case, rough, chosen) if given is None else given
    if made is None:
        return _Floored(white(prepared.data, clean(rough[-1])), "blocks", None, None, None)
    return _Floored(made.floor, "twin", thresholds_of(made, case.families, prepared, given is not None), made, made.noise)


def _calibrated(prepared: Prepared, case: Case, rough: tuple[Explored, ...], chosen: DiagnosisSettings) -> Calibration | None:
    """Thresholds by the twin; None where the logs do not know their controller, or the fitted arm cannot be simulated."""
    places = replayable([log for log, _ in prepared.motions])
    if not places or not chosen.replicas:
        return None
    left, last, weight = clean(rough[-1]), rough[-1].before, rough[0].before.weight
    model = last.model
    try:
        noise = drive_noise(model, prepared.data, left, prepared.motions, prepared.recipe, places[0], chosen.seed)
        twin = make_twin(model, last.weight, prepared.data, prepared.motions, prepared.recipe, noise, chosen.replicas, chosen.seed)
    except InputRejected:  # such an arm cannot be simulated: D15, D17
        return None
    if twin is None:
        return None
    found = Thresholds.of_twin(twin, case.families, model.nominal, weight)
    return Calibration(
        origin_of("twin", [prepared.motions[place][0] for place in places], model.nominal, chosen), conditions_of(prepared), weight,
        twin.rms, twin.noise, bounds_of(case.families, found.gain, found.own), found.wide,
        floors_of(twin.data, twin.fits[0].left) if chosen.evidence else (),
        following(*twin.weighted(weight)).max(axis=1))


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
    case = _nameable(since.case, first.stiff)
    now = replace(first.held.prepared, data=case.data, judge=case.judge)
    first = replace(first, held=replace(first.held, prepared=now))
    found = search(case, chosen.most)
    done = settled(found, rule(found, since.floor), case, now, since.floor)
    noise = noise_in(case.model, reference, since.left, now.referring, now.recipe, chosen.seed)
    moved = since.absorbed(done.found.final.of_effects, () if done.ruling.named else case.families)
    if moved is not None and done.ruling.verdict == "unknown":
        done = unnamed(done, _with_load(found, case, now, since.floor, noise, chosen.seed))
    told = _told(first, case, done, _Floored(since.floor, "reference logs", None, given, noise), chosen, since.probed,
                 moved is not None and not moved.unsure)
    if given is None:
        told = replace(told, calibration=Calibration(
            origin_of("reference logs", logs, None, chosen), conditions_of(now), since.chance.weight, since.floor,
            np.full(case.data.n_joints, np.nan), since.chance.bounds, None, ()))
    told = replace(told, question="what has changed", standing=(*first.standing, *since.standing))
    if moved is None:
        return told
    if told.verdict == "unknown" or told.extended is None:
        why = "the base parameters have moved as it moves them, beside something that has no name"
        return replace(told, rejected=(Rejected(moved.effect.name, moved.effect.joint, why), *told.rejected))
    if (like := _alike(moved.effect, told.findings)) is not None:
        why = f"the base parameters have moved, but {like.title[:1].lower()}{like.title[1:]}, which was found, moves them too"
        return replace(told, rejected=(*told.rejected, Rejected(moved.effect.name, moved.effect.joint, why)))
    if why := moved.unsure:
        if told.findings:
            return replace(told, rejected=(*told.rejected, Rejected(moved.effect.name, moved.effect.joint, why)))
        return replace(told, verdict="unknown", reason=why, summary=_sentence(Ruling("unknown", (), why), ()))
    one = carried(moved, done.found.final, told.extended, now, case.beside, chosen.blocks, chosen.evidence)
    if one.doubt:
        return replace(told, rejected=(*told.rejected, Rejected(one.finding.cause, one.finding.joint, one.doubt)))
    findings = _strongest((one.finding, *told.findings))
    return replace(told, verdict="cause", findings=findings, reason="", extended=one.arm,
                   summary=_sentence(Ruling("cause", (), ""), findings))


def _alike(effect: Effect, found: Iterable[Finding]) -> Finding | None:
    """What was found that `effect` could be mistaken for.

    A longer link, say, moves masses that lie beyond it, and which part of a base parameter these are no torque tells.
    """
    return next((one for one in found if one.cause in effect.twins or effect.name in find_effect(one.cause).twins), None)


def _with_load(found: Found, case: Case, now: Prepared, before: Array, noise: Array | None, seed: int) -> Array:
    """(joints,) [N m] floor of the later logs, whose arm is heavier: it reverses more slowly; `before` where nobody can tell."""
    arm = acted(found.nominal.model.arm, case.beside)
    own = None if noise is None else motion_floor(found.nominal.model, arm, noise, now.motions, case.data, now, before, seed)
    return before if own is None else np.maximum(own, before)


def _strongest(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(findings, key=lambda finding: -finding.explained))


def _told(first: Responding, case: Case, done: Settled, floored: _Floored, chosen: DiagnosisSettings,
          probed: Probed | None = None, moved: bool = False) -> Diagnosis:
    done, responded, own = _held_against(first, case, done, floored, chosen, moved)
    found, ruling, prepared = done.found, done.ruling, first.held.prepared
    nominal, last = found.nominal, found.steps[-1]
    plain = first.held.plain or nominal  # nothing taken out for what responses name
    parts = responded.parts
    held = tuple(held_finding(part, plain.rms, floored.rms, chosen.evidence) for part in parts)
    named = _strongest((*held, *findings(found, ruling, done.simulated, prepared, plain.rms, floored.rms, chosen.blocks,
                                         chosen.evidence, case.beside)))
    if held:
        ruling = replace(ruling, verdict="cause")
    thresholds = last.thresholds
    bounds = tuple(Threshold(f.cause, f.joint, float(g / last.before.rss), thresholds.origin)
                   for f, g in zip(case.families, thresholds.gain, strict=True))
    limits, beyond = _limits(last, case, prepared, probed) if chosen.limits else ((), ())
    hidden = not_testable(prepared.data, nominal.fit, nominal.model.columns, found.steps[0].screened, nominal.model.arm,
                          bool(prepared.referring), chosen.without)
    judge = first.held.judge if parts else prepared.judge
    rms = [ResidualRms(one.rms, (one.data if rows is None else rows).rms(held_out_left(one, rows, chosen.blocks)), floored.rms)
           for one, rows in ((plain, judge), (responded.final, responded.judge))]
    made = floored.calibration
    pictures = (evidence(plain, floored.rms, () if made is None else made.floors, None),) if chosen.evidence else ()
    arm = extended_arm(replace(found, final=responded.final), ruling)
    standing = [one for one in case.beside if one not in first.held.acting]
    return Diagnosis(
        ruling.verdict, _sentence(ruling, named), named, (), rejected(found, ruling), limits,
        (*first.undecided, *hidden, *beyond, *untold(first.stiff, chosen.without)), rms[0], "what is wrong",
        "blocks" if judge is None else "logs", floored.origin, ruling.reason, rms[1],
        tuple(trial for step in found.steps for trial in step.trials), bounds, pictures,
        0 if made is None else made.origin.replicas, np.full(len(floored.rms), np.nan) if made is None else made.noise, own,
        acted(plain.model.arm, standing), acted(arm, responded.acting), made)


def _held_against(first: Responding, case: Case, done: Settled, floored: _Floored, chosen: DiagnosisSettings,
                  moved: bool) -> tuple[Settled, Judged, Array | None]:
    """What is believed beside the floor of the held-out logs, what responses have named beside that, and this floor (joints,)
    [N m]; None where there is none."""
    held, prepared = replace(first.held, case=case), first.held.prepared
    responded = judged(held, done.found.final)
    judge = first.held.judge if responded.parts else prepared.judge
    if judge is None or responded.judge is None or floored.noise is None:
        return done, responded, None
    final = responded.final
    own = motion_floor(final.model, acted(final.model.arm, responded.acting), floored.noise, prepared.judging, judge, prepared,
                       floored.rms, chosen.seed)
    if own is None:
        return done, responded, None
    believed = unlike_held_out(done, responded.judge.rms(held_out_left(final, responded.judge, chosen.blocks)), own, moved)
    return believed, responded if believed is done else judged(held, believed.found.final), own


def _limits(last: Step, case: Case, prepared: Prepared, probed: Probed | None,
            ) -> tuple[tuple[Detectable, ...], tuple[NotTestable, ...]]:
    """By hiding causes in what the last model leaves; with reference logs beside these."""
    arms = case.arms(last.before.model)
    probe, bounds = ((Probe.of(last.before, case.judge, arms), last.thresholds) if probed is None else
                     probed(last.before, case.judge, arms))
    return detectable(last.screened, bounds, prepared.data.logs[0].log.robot.revolute, probe)


def _sentence(ruling: Ruling, named: tuple[Finding, ...]) -> str:
    """What a technician is told."""
    if ruling.verdict == "nothing-wrong":
        caveat = f": {ruling.reason}" if ruling.reason else ""
        return f"Nothing is wrong with this arm, as far as these logs can tell{caveat}."
    if ruling.verdict == "unknown":
        return f"Something is wrong that has no name here: {ruling.reason}."
    first = named[0]
    where = "" if first.joint is None else f" at joint {first.joint}"
    more = f", and {len(named) - 1} more" if len(named) > 1 else ""
    size = f": {first.torque_rms:.2g} N m of torque that the model does not have" if np.isfinite(first.torque_rms) else ""
    return f"{first.title}{where}{size}{more}."

"""What is told of a search: findings and what they gain, what these logs cannot show, and the sentence for a technician.

    told = diagnosis_of(first, case, done, floored, chosen)

Before it is told, it is held against the logs that nothing was fitted to: they have a floor of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial

import numpy as np

from pipelines.log.experiment import Array
from pipelines.log.shared_work import meanwhile
from pipelines.model.diagnosis.answered.loud import only_if_loud
from pipelines.model.diagnosis.answered.unbiased import unbiased
from pipelines.model.diagnosis.answered.words import beside, how_much, taken_in, where
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.doubted import above_in_both, unlike_held_out
from pipelines.model.diagnosis.believed.pruned import Settled
from pipelines.model.diagnosis.believed.steadied import steady, steady_nominal
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.floor.motion_floor import motion_floor
from pipelines.model.diagnosis.given.compliance import gaps_untold, untold
from pipelines.model.diagnosis.given.floored import Floored
from pipelines.model.diagnosis.given.responding import Responding
from pipelines.model.diagnosis.named.findings import extended_arm, findings, held_finding, rejected
from pipelines.model.diagnosis.named.verdict import Ruling
from pipelines.model.diagnosis.result import Detectable, Diagnosis, Finding, NotTestable, ResidualRms, Threshold
from pipelines.model.diagnosis.searched.beside import Judged, acted, judged
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Step
from pipelines.model.diagnosis.unseen.injection import Probe
from pipelines.model.diagnosis.unseen.limits import detectable, not_testable
from pipelines.model.diagnosis.worth.evidence import evidence
from pipelines.model.diagnosis.worth.extrapolated import extrapolated
from pipelines.model.diagnosis.worth.held_out import held_out_left
from pipelines.model.diagnosis.worth.simulated import arms_of, followed_by, with_simulation

__all__ = ["Limits", "diagnosis_of", "limits_of", "sentence", "strongest"]

Limits = tuple[tuple[Detectable, ...], tuple[NotTestable, ...]]


def diagnosis_of(first: Responding, case: Case, done: Settled, floored: Floored, chosen: DiagnosisSettings,
                 ) -> Diagnosis:
    """What was found, as a result tells it."""
    done = replace(done, found=steady_nominal(done.found))
    held, prepared = replace(first.held, case=case), first.held.prepared
    floor_of = partial(_own_floor, first=first, case=case, floored=floored, chosen=chosen)
    if held.acting or prepared.judge is None or floored.noise is None:  # to judge what responses name is work: it is done once
        done = replace(done, found=unbiased(done.found, prepared, case, chosen.seed))
        responded = judged(held, done.found.final)
        own = floor_of(responded)
    else:
        # Of the model as it was fitted: an arm in order that reverses one or two in a hundred more sharply leaves as much.
        with meanwhile(partial(floor_of, judged(held, done.found.final))) as floor:
            done = replace(done, found=unbiased(done.found, prepared, case, chosen.seed))
            own = floor()
        responded = judged(held, done.found.final)
    done, responded = _held_against(first, case, done, responded, own, chosen, floored.rms)
    plain = done.found.nominal if held.plain is None else steady(held.plain)  # nothing taken out for what responses name
    named = findings(done.found, done.ruling, done.simulated, prepared, plain.rms, floored.rms, chosen.blocks, chosen.evidence,
                     case.beside)
    told = _told(first, case, done, responded, floored, chosen, own, plain, named.findings)
    arms = arms_of(told) if chosen.evidence else ()
    with meanwhile(partial(followed_by, arms, first.held.prepared.logs)) if arms else nullcontext(lambda: None) as followed:
        found, beyond = limits_of(done.found.steps[-1], case, first) if chosen.limits else ((), ())
        hidden = (*told.not_testable, *beyond, *untold(first.stiff, chosen.without),
                  *gaps_untold(first.stiff, chosen.without))
        return with_simulation(replace(told, detectable=found, not_testable=hidden), followed())


def _told(first: Responding, case: Case, done: Settled, responded: Judged, floored: Floored, chosen: DiagnosisSettings,
          own: Array | None, plain: Refined, causes: tuple[Finding, ...]) -> Diagnosis:
    """All of it but the limits and how the arm follows.

    Args:
        own: (joints,) [N m] floor of the held-out logs.
        plain: the nominal model with nothing taken out for what responses name.
        causes: those that residuals name.
    """
    found, ruling, prepared = done.found, done.ruling, first.held.prepared
    nominal, last = found.nominal, found.steps[-1]
    parts = responded.parts
    held = tuple(held_finding(part, plain.rms, floored.rms, chosen.evidence, first.answers(part.acting)) for part in parts)
    named = strongest((*held, *causes))
    if held:
        ruling = replace(ruling, verdict="cause")
    thresholds = last.thresholds
    bounds = tuple(Threshold(f.cause, f.joint, float(g / last.before.rss), thresholds.origin)
                   for f, g in zip(case.families, thresholds.gain, strict=True))
    hidden = not_testable(prepared.data, nominal.fit, nominal.model.columns, found.steps[0].screened, nominal.model.arm,
                          bool(prepared.referring), chosen.without)
    judge = first.held.judge if parts else prepared.judge
    rms = [ResidualRms(one.rms, (one.data if rows is None else rows).rms(held_out_left(one, rows, chosen.blocks)), floored.rms)
           for one, rows in ((plain, judge), (responded.final, responded.judge))]
    made = floored.calibration
    pictures = (evidence(plain, floored.rms, () if made is None else made.floors),) if chosen.evidence else ()
    arm = extended_arm(replace(found, final=responded.final), ruling)
    robot, noise = arm.robot, np.full(len(floored.rms), np.nan) if made is None else made.noise
    doubt = only_if_loud(noise, [joint.torque for joint in robot.joints], robot.revolute)
    standing = [one for one in case.beside if one not in first.held.acting]
    return Diagnosis(
        ruling.verdict, sentence(ruling, named, arm.robot.revolute, plain.rms, doubt), named, (), rejected(found, ruling), (),
        (*first.undecided, *hidden), rms[0], "what is wrong",
        "blocks" if judge is None else "logs", floored.origin, ruling.reason, rms[1],
        tuple(trial for step in found.steps for trial in step.trials), bounds, pictures,
        0 if made is None else made.origin.replicas, noise, own,
        acted(plain.model.arm, standing), acted(arm, responded.acting), made,
        no_twin=floored.no_twin)


def _own_floor(responded: Judged, first: Responding, case: Case, floored: Floored, chosen: DiagnosisSettings) -> Array | None:
    """(joints,) [N m] floor of the held-out logs; None where there is none."""
    prepared = first.held.prepared
    judge = first.held.judge if responded.parts else prepared.judge
    if judge is None or responded.judge is None or floored.noise is None:
        return None
    final = responded.final
    known = floored.rms if floored.reference is None else floored.reference
    return motion_floor(final.model, acted(final.model.arm, responded.acting), floored.noise, prepared.judging, judge, prepared,
                        known, chosen.seed, case.beside, floored.judging)


def _held_against(first: Responding, case: Case, done: Settled, responded: Judged, own: Array | None, chosen: DiagnosisSettings,
                  fitted: Array) -> tuple[Settled, Judged]:
    """What is believed beside the floor of the held-out logs, `own` (joints,) [N m], that of the fitted ones, and what responses
    have named beside that."""
    held, prepared = replace(first.held, case=case), first.held.prepared
    judge = first.held.judge if responded.parts else prepared.judge
    if own is None or judge is None or responded.judge is None:
        return done, responded
    plain = judge.rms(held_out_left(first.held.plain or done.found.nominal, judge, chosen.blocks))
    left = responded.judge.rms(held_out_left(responded.final, responded.judge, chosen.blocks))

    def believed(floor: Array) -> Settled:
        asked = done
        if done.ruling.verdict == "nothing-wrong":
            asked = done if responded.parts else above_in_both(done, plain, floor, fitted)
        return asked if asked is not done else unlike_held_out(done, left, floor, plain, bool(responded.parts), fitted)

    told = believed(own)
    if told is not done and done.ruling.verdict == "nothing-wrong":  # fitted to other motion, an arm in order leaves more
        told = believed(np.hypot(own, extrapolated(done.found.nominal, judge)))
    return told, responded if told.found is done.found else judged(held, told.found.final)


def limits_of(last: Step, case: Case, first: Responding) -> Limits:
    """What would have been found, and what not however large, by hiding causes in what the model leaves that the last look of a
    search was at."""
    arms = case.arms(last.before.model)
    probe = Probe.of(last.before, case.judge, arms)
    return detectable(last.screened, last.thresholds, first.held.prepared.data.logs[0].log.robot.revolute, probe, case.nameable,
                      slight=case.thresholds is not None)


def sentence(ruling: Ruling, named: tuple[Finding, ...], revolute: Sequence[bool], left: Array,
             doubt: str = "") -> str:
    """What a technician is told.

    Args:
        revolute: (joints,) which of them turn.
        left: (joints,) [N m] rms that the nominal model leaves of the logs it was fitted to.
        doubt: on what "nothing wrong" hangs besides.
    """
    if ruling.verdict == "nothing-wrong":
        caveat = f": {ruling.reason}" if ruling.reason else ""
        return f"Nothing is wrong with this arm, as far as these logs can tell{doubt}{caveat}."
    if ruling.verdict == "unknown":
        return f"Something is wrong, and no cause is named: {ruling.reason}."
    first = named[0]
    turns = revolute if first.joint is None else revolute[first.joint - 1:first.joint]
    what = " or ".join(dict.fromkeys("N m rms of torque" if one else "N rms of force" for one in turns))
    size = f": {first.torque_rms:.2g} {what}{taken_in(first, left)}" if np.isfinite(first.torque_rms) else ""
    oddly = f" Beside it, {ruling.reason}." if ruling.reason else ""
    return f"{first.title}{how_much(first)}{where(first)}{size}{beside(named[1:])}.{oddly}"


def strongest(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """What explains most first."""
    return tuple(sorted(findings, key=lambda finding: -finding.explained))

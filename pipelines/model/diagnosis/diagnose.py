"""Diagnose an arm: what its nominal model gets wrong in these logs, and why.

    found = diagnose(Logs.by_role(logs), DiagnosisSettings())
    found.verdict, found.findings, found.extended

Reconstruct and condition the logs; fit the nominal model; take the greatest causes away for a moment and make the twin of what
is left; search with the twin's thresholds; judge what was found on held-out logs; say what these logs cannot tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.answered.judgeable import limited_by_estimate
from pipelines.model.diagnosis.answered.told import diagnosis_of
from pipelines.model.diagnosis.asked.fitted_too import at_floor, fitted_too, of_those_held_out, only_held_out, share_held_out
from pipelines.model.diagnosis.asked.inputs import GAP_HZ, Logs, Prepared, narrowed
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.doubted import (
    louder_than_logs,
    of_replicas,
    told_why,
    unlike_motion,
    unlike_noise,
    without_twin,
)
from pipelines.model.diagnosis.believed.pruned import settled
from pipelines.model.diagnosis.believed.second_look import looked_again
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.own_motion import put_right
from pipelines.model.diagnosis.floor.calibrated import following_of
from pipelines.model.diagnosis.floor.calibration import Calibration
from pipelines.model.diagnosis.given.change_of_sign import SEVERAL, loosened, of_one_law, plainer_of, shows, wrong_law
from pipelines.model.diagnosis.given.floored import floored_by
from pipelines.model.diagnosis.given.responding import Responding, responding
from pipelines.model.diagnosis.memory import Memory
from pipelines.model.diagnosis.named.verdict import rule
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.searched.beside import Held
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Explored, gap_first, gives_way, glance, greatest, provisional, search
from pipelines.model.diagnosis.unseen.without_limit import without_limit
from pipelines.model.diagnosis.worth.held_out import held_out_left

__all__ = ["diagnose"]

Tell = Callable[[str], None]



def diagnose(logs: Logs, settings: DiagnosisSettings | None = None, arm: Arm | None = None, tell: Tell | None = None,
             calibration: Calibration | None = None, memory: Memory | None = None) -> Diagnosis:
    """What the nominal model of an arm gets wrong in `logs`, and why.

    Args:
        arm: whose friction laws the nominal model takes, fitted anew, with no more terms than `logs` tell apart, or with those
            that a calibration was made with; Coulomb and viscous friction where left out.
        tell: progress, in words.
        calibration: thresholds that an earlier diagnosis has stored, instead of a twin.
        memory: of what was worked out of these logs, for an extension after it.

    Raises:
        InputRejected: no log can be fitted (S01, T04, T08, D05).
        UsageError: C02, the calibration is not for these logs.
    """
    chosen, say = settings or DiagnosisSettings(), tell or (lambda words: None)
    memory = memory or Memory()
    found = _asked(logs, chosen, arm, say, calibration, memory)
    if calibration is not None or not _only_held_out(found):
        return found
    say("fitting the held-out logs too, which alone show what is wrong")
    try:
        again = _asked(fitted_too(logs), chosen, arm, say, None, Memory())
    except InputRejected:  # of the recipe of all logs together, nothing may be left: this look is one more
        return found
    left = of_those_held_out(again.after_rms.validate, found.residual_rms.identify, share_held_out(logs))
    # By the floors of before: a twin of logs that show it has its blows among its noise, as far as they were not found.
    named = again.verdict == "cause" and at_floor(left, _floor(found))
    return replace(again, held_out="blocks of all logs", calibration=found.calibration) if named else found


def _floor(found: Diagnosis) -> Array:
    """(joints,) [N m] of an arm in order, of fitted logs or held-out ones."""
    floor = found.residual_rms.floor
    return floor if found.held_out_floor is None else np.maximum(floor, found.held_out_floor)


def _only_held_out(found: Diagnosis) -> bool:
    """Whether nobody knows what is wrong, for the fitted logs are those of an arm in order, as its twin is."""
    if found.verdict != "unknown" or found.held_out != "logs" or found.floor_origin != "twin" or found.held_out_floor is None:
        return False
    rms = found.residual_rms
    return only_held_out(rms.identify, rms.floor, rms.validate, found.held_out_floor)


def _asked(logs: Logs, chosen: DiagnosisSettings, arm: Arm | None, say: Tell, calibration: Calibration | None,
           memory: Memory) -> Diagnosis:
    """Of these logs as they are, those of role validate judging."""
    prepared = memory.prepared(logs, chosen, arm, () if calibration is None else calibration.conditions.laws)
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
    held = limited_by_estimate(held, other if held is again else prepared)
    held = replace(held, fewer_terms=prepared.fewer) if prepared.fewer else held
    return replace(held, without_limit=without_limit(held, bool(logs.frf), chosen.without)) if chosen.limits else held


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
    rough: tuple[Explored, ...]  # the greatest causes


def _looked_at(prepared: Prepared, chosen: DiagnosisSettings, say: Tell, calibration: Calibration | None, memory: Memory) -> _Seen:
    if prepared.logs.frf:
        say("looking at the frequency responses")
    first = responding(_case(prepared, chosen), prepared, chosen.without)
    case, prepared = first.nameable(first.held.case), first.held.prepared
    say("looking for the greatest causes")
    seen = glance(case)
    if first.stiff is not None and not first.stiff.named and gives_way(seen):
        say("looking for a gap below the frequencies at which it rings")
        try:
            slow = narrowed(prepared, GAP_HZ, [0.0] * prepared.data.n_joints)
        except InputRejected:  # T04, D05: too little is left below so low a low-pass; this look is one more
            return _Seen(first, case, prepared, provisional(case, seen))
        there = first.nameable(_case(slow, chosen))
        rough = provisional(there)
        if gap_first(rough[0]):
            return _Seen(replace(first, held=Held(there, slow)), there, slow, rough)
    return _Seen(first, case, prepared, provisional(case, seen))


def _diagnosed(seen: _Seen, chosen: DiagnosisSettings, say: Tell, calibration: Calibration | None, memory: Memory) -> Diagnosis:
    first, case, prepared, rough = seen.first, seen.case, seen.prepared, seen.rough
    say("simulating the twin" if calibration is None else "taking the stored thresholds")
    floored = floored_by(prepared, case, rough, chosen, calibration)
    say("looking for causes")
    case = replace(case, thresholds=floored.thresholds)
    found = search(case, chosen.most, rough)
    known = floored.thresholds is not None
    usual = None if floored.calibration is None else following_of(floored.calibration, prepared, calibration is not None)
    mended = usual is not None and put_right(found.nominal.fit, found.final.fit, usual)
    done = settled(found, rule(found, floored.rms, known, mended), case, prepared, floored.rms, known)
    if floored.runs_away:
        rows = case.data if case.judge is None else case.judge
        left = held_out_left(done.found.nominal, case.judge, case.blocks)
        done = without_twin(done, rows.rms(left), floored.rms, floored.runs_away)
    done = told_why(done, floored.no_twin)
    if floored.twin is not None:
        done = looked_again(done, case, prepared, floored.twin, chosen.most, floored.rms)
        done = louder_than_logs(unlike_noise(done, partial(of_replicas, floored.twin)), floored.rms)
    say("weighing what was found, and what these logs would have shown" if chosen.limits else "weighing what was found")
    return diagnosis_of(first, case, done if usual is None else unlike_motion(done, usual), floored, chosen)


def _case(prepared: Prepared, chosen: DiagnosisSettings) -> Case:
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = families(columns.laws, whole_motion(prepared.data), model.arm, chosen.without)
    return Case(prepared.data, prepared.judge, model, fit.weight, every, None, chosen.blocks)

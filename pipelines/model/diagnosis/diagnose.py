"""Diagnose an arm: what its nominal model gets wrong in these logs, and why.

    found = diagnose(Logs.by_role(logs), DiagnosisSettings())
    found.verdict, found.findings, found.extended

Reconstruct and condition the logs; fit the nominal model; take the greatest causes away for a moment and make the twin of what
is left; search with the twin's thresholds; judge what was found on held-out logs; say what these logs cannot tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.absorbed import Absorbed
from pipelines.model.diagnosis.candidates import families, whole_motion
from pipelines.model.diagnosis.compliance import Compliance, compliance, untold
from pipelines.model.diagnosis.evidence import evidence
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.findings import absorbed_finding, extended_arm, findings, rejected
from pipelines.model.diagnosis.inputs import Logs, Prepared, prepare
from pipelines.model.diagnosis.limits import detectable, not_testable
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.pruned import settled
from pipelines.model.diagnosis.result import Diagnosis, Finding, ResidualRms, Threshold, Verdict
from pipelines.model.diagnosis.search import Case, Explored, Found, clean, held_out_left, provisional, search
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.diagnosis.since import Since, since_reference
from pipelines.model.diagnosis.thresholds import Thresholds
from pipelines.model.diagnosis.twin import Twin, drive_noise, make_twin, replayable, white
from pipelines.model.diagnosis.verdict import Ruling, rule

__all__ = ["diagnose"]

Tell = Callable[[str], None]


def diagnose(logs: Logs, settings: DiagnosisSettings | None = None, arm: Arm | None = None, tell: Tell | None = None) -> Diagnosis:
    """What the nominal model of an arm gets wrong in `logs`, and why.

    Args:
        arm: whose friction laws the nominal model takes, fitted anew; Coulomb and viscous friction where left out.
        tell: progress, in words.

    Raises:
        InputRejected: no log can be fitted (S01, T04, T08).
    """
    chosen, say = settings or DiagnosisSettings(), tell or (lambda words: None)
    prepared = prepare(logs, chosen, arm)
    if prepared.reference is not None:
        say("comparing with the reference logs")
        since = since_reference(prepared, prepared.reference, chosen)
        stiff = compliance(logs.frf, since.case.model.nominal, chosen.without)
        return _responding(_changed(prepared, replace(since, case=_nameable(since.case, stiff)), chosen), stiff, chosen)
    case = _case(prepared, chosen)
    stiff = compliance(logs.frf, case.model.nominal, chosen.without)
    case = _nameable(case, stiff)
    say("looking for the greatest causes")
    rough = provisional(case)
    say("simulating the twin")
    floored = _floored(prepared, case, rough, chosen)
    say("looking for causes")
    case = replace(case, thresholds=floored.thresholds)
    found = search(case, chosen.most, rough)
    found, ruling = settled(found, rule(found, floored.rms, floored.twin is not None), case, prepared)
    return _responding(_told(prepared, case, found, ruling, floored, chosen), stiff, chosen)


def _nameable(case: Case, stiff: Compliance | None) -> Case:
    """Where frequency responses show a rigid arm, what gives way is a gap, which the residual then names."""
    return replace(case, nameable=(*case.nameable, "reversals")) if stiff is not None and stiff.rigid else case


def _responding(told: Diagnosis, stiff: Compliance | None, chosen: DiagnosisSettings) -> Diagnosis:
    """With what the frequency responses name, or leave open; causes that the residual names stay beside them."""
    told = replace(told, not_testable=(*told.not_testable, *untold(stiff, chosen.without)))
    if stiff is None or not stiff.findings:
        return told
    findings = (*told.findings, *stiff.findings)
    return replace(told, verdict="cause", findings=findings, reason="", summary=_sentence(Ruling("cause", (), ""), findings))


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
    twin: Twin | None
    thresholds: Thresholds | None
    noise: Array


def _floored(prepared: Prepared, case: Case, rough: tuple[Explored, ...], chosen: DiagnosisSettings) -> _Floored:
    """By the twin where a controller is known, else by the noise in the residual."""
    left, last = clean(rough[-1]), rough[-1].before
    places = replayable([log for log, _ in prepared.motions])
    nan = np.full(prepared.data.n_joints, np.nan)
    if places and chosen.replicas:
        model = last.model
        try:
            noise = drive_noise(model, prepared.data, left, prepared.motions, prepared.recipe, places[0], chosen.seed)
            twin = make_twin(model, last.weight, prepared.data, prepared.motions, prepared.recipe, noise, chosen.replicas,
                             chosen.seed)
        except InputRejected:  # such an arm cannot be simulated: D15, D17
            twin = None
        if twin is not None:
            bounds = Thresholds.of_twin(twin, case.families, model.nominal, rough[0].before.weight)
            return _Floored(twin.rms, "twin", twin, bounds, twin.noise)
    return _Floored(white(prepared.data, left), "blocks", None, None, nan)


def _changed(prepared: Prepared, since: Since, chosen: DiagnosisSettings) -> Diagnosis:
    """What is different since the reference logs."""
    now = replace(prepared, data=since.case.data, judge=since.case.judge)
    found = search(since.case, chosen.most)
    found, ruling = settled(found, rule(found, since.floor), since.case, now)
    floored = _Floored(since.floor, "reference logs", None, None, np.full(prepared.data.n_joints, np.nan))
    told = _told(now, since.case, found, ruling, floored, chosen)
    told = replace(told, question="what has changed", standing=since.standing)
    if told.extended is not None:
        told = replace(told, extended=replace(told.extended, effects=(*since.acting, *told.extended.effects)))
    return told if since.absorbed is None else _with_absorbed(told, since.absorbed)


def _with_absorbed(told: Diagnosis, moved: Absorbed) -> Diagnosis:
    """A cause that the base parameters show is a finding as well."""
    one = absorbed_finding(moved, told)
    findings = tuple(sorted((one, *told.findings), key=lambda finding: -finding.explained))
    verdict: Verdict = "unknown" if told.verdict == "unknown" else "cause"
    if verdict == "unknown":
        return told
    return replace(told, verdict=verdict, findings=findings, summary=_sentence(Ruling("cause", (), ""), findings))


def _told(prepared: Prepared, case: Case, found: Found, ruling: Ruling, floored: _Floored, chosen: DiagnosisSettings) -> Diagnosis:
    nominal, last = found.nominal, found.steps[-1]
    named = findings(found, ruling, prepared, floored.rms, chosen.blocks, chosen.evidence)
    thresholds = last.thresholds
    bounds = tuple(Threshold(f.cause, f.joint, float(g / last.before.rss), thresholds.origin)
                   for f, g in zip(case.families, thresholds.gain, strict=True))
    limits = detectable(last.screened, thresholds, prepared.data.logs[0].log.robot.revolute) if chosen.limits else ()
    hidden = not_testable(prepared.data, nominal.fit, nominal.model.columns, found.steps[0].screened, nominal.model.arm,
                          bool(prepared.referring), chosen.without)
    judge = prepared.judge
    rms = [ResidualRms(one.rms, (one.data if judge is None else judge).rms(held_out_left(one, judge, chosen.blocks)), floored.rms)
           for one in (nominal, found.final)]
    pictures = (evidence(nominal, floored.rms, floored.twin, None),) if chosen.evidence else ()
    return Diagnosis(
        ruling.verdict, _sentence(ruling, named), named, (), rejected(found, ruling), limits, hidden, rms[0], "what is wrong",
        "blocks" if judge is None else "logs", floored.origin, ruling.reason, rms[1],
        tuple(trial for step in found.steps for trial in step.trials), bounds, pictures,
        0 if floored.twin is None else len(floored.twin.fits), floored.noise, nominal.model.arm, extended_arm(found, ruling))


def _sentence(ruling: Ruling, named: tuple[Finding, ...]) -> str:
    """What a technician is told."""
    if ruling.verdict == "nothing-wrong":
        return "Nothing is wrong with this arm, as far as these logs can tell."
    if ruling.verdict == "unknown":
        return f"Something is wrong that has no name here: {ruling.reason}."
    first = named[0]
    where = "" if first.joint is None else f" at joint {first.joint}"
    more = f", and {len(named) - 1} more" if len(named) > 1 else ""
    size = f": {first.torque_rms:.2g} N m of torque that the model does not have" if np.isfinite(first.torque_rms) else ""
    return f"{first.title}{where}{size}{more}."

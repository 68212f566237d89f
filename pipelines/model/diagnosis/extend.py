"""Extend the nominal model by causes that somebody names, refit everything, and accept them by what was held out alone.

    found = extend(logs, (Wanted(effect), …), settings, arm)
    found.accepted, found.extended, found.gain

No threshold and no twin: the cause was named. It is accepted where its gain on held-out torque is beyond its bootstrap interval,
where the logs agree on its size, where no held-out log gets worse by more than a tenth, and where the simulated arm comes
nearer to the measured one, if anything can be simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pipelines.errors import InputRejected
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.answered.impossible import numbers_of
from pipelines.model.diagnosis.answered.unbiased import unbiased
from pipelines.model.diagnosis.asked.fitted_too import (
    at_floor,
    fitted_too,
    of_those_held_out,
    only_held_out,
    share_held_out,
)
from pipelines.model.diagnosis.asked.inputs import GAP_HZ, Logs, Prepared, narrowed
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.chance import BY_CHANCE
from pipelines.model.diagnosis.believed.fewer import all_but
from pipelines.model.diagnosis.believed.repeated import at_odds, vague
from pipelines.model.diagnosis.believed.steadied import steadied, steady
from pipelines.model.diagnosis.believed.straying import strays
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.floor.drive_noise import white
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.given.change_of_sign import clearly_less, loosened, shows
from pipelines.model.diagnosis.given.responding import Responding, responding
from pipelines.model.diagnosis.memory import Memory
from pipelines.model.diagnosis.named.findings import extended_arm, findings, held_finding
from pipelines.model.diagnosis.named.verdict import Ruling
from pipelines.model.diagnosis.result import Finding, Rejected, ResidualRms
from pipelines.model.diagnosis.screened.candidates import place_of
from pipelines.model.diagnosis.screened.wanted import Wanted
from pipelines.model.diagnosis.searched.beside import Held, acted, judged
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.ledger import IMPOSSIBLE, UNBELIEVABLE
from pipelines.model.diagnosis.searched.search import Found, search
from pipelines.model.diagnosis.searched.wanted import wanted_families
from pipelines.model.diagnosis.worth.extended import Extended, with_uncertainty
from pipelines.model.diagnosis.worth.gains import gain_of, simulation_errors, torque_gain_of
from pipelines.model.diagnosis.worth.held_out import held_out_left

__all__ = ["extend"]

_NOTHING = "it takes nothing off the held-out error"
_REFUSED = {UNBELIEVABLE: UNBELIEVABLE, IMPOSSIBLE: "fitted exactly, its numbers are none that it can have"}
_ALL = ("residual", "frequency responses", "reversals")  # kinds of evidence: somebody has it


def extend(logs: Logs, wanted: Sequence[Wanted], settings: DiagnosisSettings | None = None, arm: Arm | None = None,
           tell: Callable[[str], None] | None = None, memory: Memory | None = None) -> Extended:
    """The nominal model with the wanted causes, as far as the held-out logs bear them out.

    Args:
        arm: whose friction laws the nominal model takes, fitted anew, with no more terms than `logs` tell apart; Coulomb and
            viscous friction where left out.
        memory: of what a diagnosis of these logs has worked out of them.

    Raises:
        InputRejected: no log can be fitted (S01, T04, T08, D05).
        UsageError: C02, a cause that no model of these logs can take up.
    """
    chosen, say = settings or DiagnosisSettings(), tell or (lambda words: None)
    memory = memory or Memory()
    found = _by_curves(logs, wanted, chosen, arm, say, memory)
    before = found.before
    unseen = found.arm is None and all(one.reason == _NOTHING for one in found.rejected)
    # Nobody knows a floor here: what the model leaves of the logs it was fitted to stands for it.
    if not unseen or not logs.validate or not only_held_out(
            before.identify, before.identify, before.validate, before.identify):
        return found
    say("fitting the held-out logs too, which alone show what is wrong")
    try:
        again = _by_curves(fitted_too(logs), wanted, chosen, arm, say, Memory())
    except InputRejected:
        return found
    left = of_those_held_out(again.after.validate, before.identify, share_held_out(logs))
    return replace(again, held_out="blocks of all logs") if again.arm is not None and at_floor(left, before.identify) else found


def _by_curves(logs: Logs, wanted: Sequence[Wanted], chosen: DiagnosisSettings, arm: Arm | None, say: Callable[[str], None],
               memory: Memory) -> Extended:
    """By the curve of friction that fits better."""
    prepared = memory.prepared(logs, chosen, arm)
    found = _extended(prepared, wanted, chosen, say, memory)
    other = loosened(prepared)
    if other is prepared or not shows(prepared, other):
        return found
    say("fitting by which curve friction changes its sign")
    return _better(found, _extended(other, wanted, chosen, say, memory))


def _better(found: Extended, again: Extended) -> Extended:
    """`again`, with the curve of friction fitted, where that leaves clearly less of some joint held out and of none more."""
    return again if clearly_less(again.after.validate, found.after.validate) else found


def _extended(prepared: Prepared, wanted: Sequence[Wanted], chosen: DiagnosisSettings, say: Callable[[str], None],
              memory: Memory) -> Extended:
    if any(one.effect.evidence == "reversals" for one in wanted):
        prepared = narrowed(prepared, GAP_HZ, [0.0] * prepared.data.n_joints)
    first = _responding(prepared, wanted, chosen)
    case, prepared = first.held.case, first.held.prepared
    given = {one.place for one in case.beside}
    every = wanted_families(case, [one for one in wanted if one.place not in given])
    left, refused = list(every), dict[tuple[str, int | None], str]()
    while True:
        say(f"fitting {', '.join(place_of(f.cause, f.joint) for f in left) or 'the nominal model'}")
        found, named, why = _tried(replace(case, families=tuple(left)), prepared, chosen)
        refused |= why
        if not why:
            break
        left = [one for one in left if (one.cause, one.joint) not in why]
    return _told(found, named, refused, replace(first, held=replace(first.held, case=case, prepared=prepared)), chosen)


def _responding(prepared: Prepared, wanted: Sequence[Wanted], chosen: DiagnosisSettings) -> Responding:
    """What frequency responses give of the wanted causes; the others are fitted to motion."""
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    plain = Case(prepared.data, prepared.judge, Exact.start(columns, fit), fit.weight, (), None, chosen.blocks, _ALL)
    places = [one.place for one in wanted if one.effect.evidence == "frequency responses"]
    if not places or not prepared.logs.frf:
        return Responding(None, Held(plain, prepared))
    return responding(plain, prepared, only=places)


def _tried(case: Case, prepared: Prepared, chosen: DiagnosisSettings, again: bool = True,
           ) -> tuple[Found, tuple[Finding, ...], dict[tuple[str, int | None], str]]:
    """Fitted one after the other, the strongest first; and why some of them are not accepted.

    Args:
        again: a cause that may act more than once at its place, waves of other orders say, does so as far as held-out time bears
            it out; once, where any of them is doubted.
    """
    none = np.zeros(len(case.families))
    free = Thresholds(none, none, "none: the cause was named", case.weight, tuple(f.joint for f in case.families))
    asked = replace(case, thresholds=free, named=True, again=again)
    found, case = steadied(search(asked, len(case.families) + chosen.most), case)
    found = unbiased(found, prepared, case, chosen.seed)
    steps = [step for step in found.steps if step.best is not None]
    ruling = Ruling("cause", tuple(range(len(steps))), "")
    arms = [found.nominal.model.arm, *(step.best.done.model.arm for step in steps if step.best is not None)]
    simulated = simulation_errors([acted(arm, case.beside) for arm in arms], prepared.judging or prepared.motions)
    told = findings(found, ruling, simulated, prepared, found.nominal.rms, white(case.data, found.final.left), chosen.blocks,
                    chosen.evidence, case.beside).findings
    why: dict[tuple[str, int | None], str] = {}
    late = any(step.best is not None and step.best.effect.last for step in steps)
    there = set[tuple[str, int | None]]()
    for k, step in enumerate(steps):
        if step.best is not None and (doubt := at_odds(found, k, prepared, case) or
                                      strays(found, found, k, simulated, prepared, case, late, partial(all_but, found, k, case)) or
                                      (BY_CHANCE if vague(found, k, prepared, case) else "")):
            if (step.best.effect.name, step.best.effect.joint) in there:
                return _tried(case, prepared, chosen, again=False)
            why[step.best.effect.name, step.best.effect.joint] = doubt
        there |= {(step.best.effect.name, step.best.effect.joint)} if step.best is not None else set()
    taken = {(one.cause, one.joint) for one in told}
    none_such = {(trial.cause, trial.joint): _REFUSED[trial.reason] + numbers_of(trial, step.rivals) for step in found.steps
                 for trial in step.trials if trial.reason in _REFUSED}
    why |= {place: none_such.get(place, _NOTHING)
            for place in ((f.cause, f.joint) for f in case.families) if place not in taken}
    return found, told, why


def _told(found: Found, named: tuple[Finding, ...], refused: Mapping[tuple[str, int | None], str], first: Responding,
          chosen: DiagnosisSettings) -> Extended:
    """Everything that was accepted, in one model."""
    prepared, done = first.held.prepared, judged(first.held, found.final, paying=True)
    judge, final = done.judge, done.final
    floor = white(final.data, final.left)
    steps = tuple(range(sum(step.best is not None for step in found.steps)))  # of one finding there may be several
    whole = acted(with_uncertainty(extended_arm(replace(found, final=final), Ruling("cause", steps, "")), final), done.acting)
    refused = dict(refused) | {(part.acting.effect.name, part.acting.effect.joint): part.doubt for part in done.parts if part.doubt}
    kept = [part for part in done.parts if not part.doubt]
    plain, before = (steady(first.held.plain), first.held.judge) if first.held.plain is not None else (found.nominal, judge)
    every = (*(held_finding(part, plain.rms, floor, chosen.evidence, first.answers(part.acting)) for part in kept), *named)
    rows = final.data if judge is None else judge
    now = held_out_left(final, judge, chosen.blocks)
    was = held_out_left(plain, before, chosen.blocks)
    rms = [ResidualRms(plain.rms, rows.rms(was), floor), ResidualRms(final.rms, rows.rms(now), floor)]
    standing = tuple(one for one in done.acting if one not in first.held.acting)
    arm = gain = None
    if every:
        arm, bare = whole, acted(plain.model.arm, standing)
        gain = every[0].gain if len(every) == 1 else gain_of(
            torque_gain_of(rows, was, now), *simulation_errors([bare, arm], prepared.judging or prepared.motions))
    rejected = tuple(Rejected(cause, joint, reason) for (cause, joint), reason in refused.items())
    return Extended(arm, tuple(sorted(every, key=lambda one: -one.explained)), rejected, gain, rms[0], rms[1],
                    "blocks" if judge is None else "logs", standing, (*prepared.motions, *prepared.judging), len(prepared.motions),
                    prepared.fewer)

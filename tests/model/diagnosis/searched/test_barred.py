"""Which of two causes it is, where the greater one's threshold is not passed: by what they take away, fitted and held out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.screened.candidates import Family, families, whole_motion
from pipelines.model.diagnosis.screened.screen import Screened, screen
from pipelines.model.diagnosis.searched.barred import better_than
from pipelines.model.diagnosis.searched.case import Case, HeldOut
from pipelines.model.diagnosis.searched.gate import Gate
from pipelines.model.diagnosis.searched.hypotheses import fitted
from pipelines.model.effects import all_effects
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden

ASKED = ("spring", "encoder_eccentricity", "torque_offset", "cogging")


def pulled(motion: Motion) -> Array:
    """A spring of 0.6 N m/rad at joint 3."""
    out = np.zeros_like(motion.q)
    out[:, 2] = 0.6 * (motion.q[:, 2] - 0.3)
    return out


def misread(log: ExperimentLog) -> ExperimentLog:
    """The disc of joint 3 beside its axis: 20 mrad, once a turn."""
    q = log.q.copy()
    q[:, 2] += 0.02 * np.sin(q[:, 2] + 0.8)
    return replace(log, signals={**log.signals, "q": replace(log.signals["q"], values=q)})


def looked_at(load: Callable[[Motion], Array] | None, misreads: bool) -> tuple[Case, Refined, dict[str, Screened]]:
    """A case, its nominal model, and the causes of joint 3 on what that leaves."""
    logs = [hidden(1, load), hidden(2, load), hidden(3, load, "validate")]
    first, second, judging = [misread(log) for log in logs] if misreads else logs
    prepared = prepare(Logs((first, second), (judging,)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    others = tuple(kind.name for kind in all_effects() if kind.name not in ASKED)
    every = families(columns.laws, whole_motion(prepared.data), model.arm, others)
    case = Case(prepared.data, prepared.judge, model, fit.weight, every, None)
    now = refine(case.model, case.data, case.weight)
    found = screen(case.data, now.fit, every, case.arms(now.model))
    return replace(case, thresholds=_bounds(every, fit.weight)), now, {one.cause: one for one in found if one.joint == 3}


def _bounds(every: Sequence[Family], weight: Array) -> Thresholds:
    """Some floor: how high it is, a gate says."""
    gain = np.ones(len(every))
    return Thresholds(gain, gain, "made up", weight, tuple(one.joint for one in every))


def gate(seen: dict[str, Screened], passed: str, refused: frozenset[int] = frozenset()) -> Gate:
    """With which one cause passes its threshold."""
    every = tuple(seen.values())
    return Gate(every, _bounds([one.family for one in every], np.ones(3)), (seen[passed],), refused)


@pytest.mark.slow
@pytest.mark.parametrize(("load", "misreads", "truth", "other"), [
    (None, True, "encoder_eccentricity", "spring"), (pulled, False, "spring", "torque_offset")])
def test_the_greater_cause_is_taken_whichever_passed(load: Callable[[Motion], Array] | None, misreads: bool, truth: str,
                                                     other: str) -> None:
    case, now, seen = looked_at(load, misreads)
    error = HeldOut.of(now, case)
    lesser, greater = (fitted(case, now, seen[name], error) for name in (other, truth))
    every = tuple(seen.values())
    found = better_than(lesser, case, now, every, gate(seen, other))
    assert found is not None
    assert (found.effect.name, found.effect.joint) == (truth, 3)
    assert better_than(greater, case, now, every, gate(seen, truth)) is None


def test_what_held_out_time_refused_stays_out_and_so_does_all_where_no_floor_is_known() -> None:
    case, now, seen = looked_at(pulled, False)
    lesser, every = fitted(case, now, seen["torque_offset"], HeldOut.of(now, case)), tuple(seen.values())
    assert better_than(lesser, case, now, every, gate(seen, "torque_offset")) is not None
    others = frozenset(id(one) for one in every if one.cause != "torque_offset")
    assert better_than(lesser, case, now, every, gate(seen, "torque_offset", others)) is None
    assert better_than(lesser, replace(case, thresholds=None), now, every, gate(seen, "torque_offset")) is None


@pytest.mark.slow
def test_what_passed_is_not_asked_again() -> None:
    """Among those above their thresholds the search has chosen already, by its own rules."""
    case, now, seen = looked_at(pulled, False)
    lesser, every = fitted(case, now, seen["torque_offset"], HeldOut.of(now, case)), tuple(seen.values())
    assert better_than(lesser, case, now, every, replace(gate(seen, "torque_offset"), passed=every)) is None


@pytest.mark.slow
def test_what_is_no_number_is_not_better() -> None:
    case, now, seen = looked_at(pulled, False)
    error, every = HeldOut.of(now, case), tuple(seen.values())
    lesser = fitted(case, now, seen["torque_offset"], error)
    none = replace(case, judge=replace(case.judge, logs=tuple(replace(one, y=np.nan * one.y) for one in case.judge.logs)))
    assert better_than(lesser, none, now, every, gate(seen, "torque_offset")) is None

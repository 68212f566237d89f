"""The search on logs of which the truth is known: the cause, its place and its numbers; nothing where nothing is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipelines.model.diagnosis.asked.inputs import Logs, Prepared, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.mistaken import imitated
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.floor.thresholds import Thresholds, without_twin
from pipelines.model.diagnosis.screened.candidates import Family, families, whole_motion
from pipelines.model.diagnosis.screened.screen import screen, screen_family
from pipelines.model.diagnosis.searched import hypotheses
from pipelines.model.diagnosis.searched import search as search_module
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.gate import Gate
from pipelines.model.diagnosis.searched.ledger import ENOUGH, GIVES_WAY, Tried, ledger
from pipelines.model.diagnosis.searched.search import provisional, search
from pipelines.model.effects import all_effects, find_effect
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden, wave

QUICK = ("cogging", "torque_offset", "spring", "time_delay", "quadratic_drag")


def case_of(prepared: Prepared) -> Case:
    """With few causes, so that it is quick."""
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    others = tuple(kind.name for kind in all_effects() if kind.name not in QUICK)
    every = families(columns.laws, whole_motion(prepared.data), model.arm, others)
    return Case(prepared.data, prepared.judge, model, fit.weight, every, None)


@pytest.fixture(scope="module")
def waving() -> Case:
    return case_of(prepare(Logs((hidden(1, wave), hidden(2, wave)), (hidden(3, wave, "validate"),)), DiagnosisSettings()))


def test_cogging_is_found_at_its_joint_with_its_numbers(waving: Case) -> None:
    found = search(waving, 1)
    best = found.steps[0].best
    assert best is not None
    assert (best.effect.name, best.effect.joint) == ("cogging", 2)
    values = best.done.model.effects[0].values
    assert values["order"] == pytest.approx(11.0, abs=0.01)
    assert values["amplitude"] == pytest.approx(0.1, rel=0.03)
    assert values["phase"] == pytest.approx(0.6, abs=0.05)


def test_what_is_left_is_noise(waving: Case) -> None:
    """The drives' 20, 10 and 5 mN m, as far as the low-pass lets them through."""
    assert (search(waving, 1).final.rms < np.array([0.012, 0.006, 0.004])).all()


def test_nothing_is_worth_a_step_without_a_cause() -> None:
    case = case_of(prepare(Logs((hidden(1), hidden(2)), (hidden(3, None, "validate"),)), DiagnosisSettings()))
    assert search(case, 2).steps[0].best is None


def test_a_delay_is_fitted_exactly() -> None:
    """Position 3 ms late at joint 3: to first order the torque is a slope, exactly it is another moment."""
    late = 3
    logs = []
    for seed, role in ((1, "identify"), (2, "identify"), (3, "validate")):
        log = hidden(seed, None, role)
        q = log.q.copy()
        q[late:, 2] = q[:-late, 2]
        logs.append(replace(log, signals={**log.signals, "q": replace(log.signals["q"], values=q)}))
    found = search(case_of(prepare(Logs(tuple(logs[:2]), (logs[2],)), DiagnosisSettings())), 1)
    best = found.steps[0].best
    assert best is not None
    assert (best.effect.name, best.effect.joint) == ("time_delay", 3)
    assert best.done.model.effects[0].values["delay"] == pytest.approx(0.003, abs=5e-5)


def test_an_invisible_cause_has_no_visibility(waving: Case) -> None:
    """A rotor's inertia at joint 1 is p7 of the arm, at joint 3 it is not."""
    now = refine(waving.model, waving.data, waving.weight)
    eta = []
    for joint in (1, 3):
        effect = find_effect("rotor_inertia")(joint=joint)
        eta.append(screen_family(waving.data, now.fit, Family("rotor_inertia", joint, (effect,)), now.model.arm).best_visibility)
    assert eta[0] < 1e-3
    assert eta[1] > 0.5


def test_the_gain_of_a_screening_is_that_of_least_squares(waving: Case) -> None:
    """gᵀ G⁻¹ g is how much numpy's least squares takes off the squared residual with the columns added."""
    now = refine(waving.model, waving.data, waving.weight)
    family = next(f for f in waving.families if f.cause == "spring" and f.joint == 2)
    found = screen(waving.data, now.fit, [family], now.model.arm)[0]
    columns = waving.data.lay(lambda motion: found.shape[0].columns(motion, now.model.arm))
    table = np.concatenate([now.slopes, columns]) * now.weights
    _, rss, *_ = np.linalg.lstsq((table / np.linalg.norm(table, axis=1)[:, None]).T, now.residual, rcond=1e-12)
    base = now.slopes * now.weights
    size = np.linalg.norm(base, axis=1)
    _, before, *_ = np.linalg.lstsq((base[size > 0] / size[size > 0, None]).T, now.residual, rcond=1e-12)
    assert found.gain[0] == pytest.approx(float(before[0] - rss[0]), rel=0.02)


def test_a_drift_that_is_seen_only_at_its_beginning_has_numbers_that_can_be() -> None:
    """12 mN m s/rad less every second, straight: no end of it is in the logs, and the fit alone would go to more than there is."""
    def less(motion: Motion) -> np.ndarray:  # type: ignore[type-arg]
        out = np.zeros_like(motion.q)
        out[:, 1] = -0.012 * (motion.t - motion.t[0]) * motion.dq[:, 1]
        return out

    prepared = prepare(Logs((hidden(1, less), hidden(2, less)), (hidden(3, less, "validate"),)), DiagnosisSettings())
    case = case_of(prepared)
    others = tuple(kind.name for kind in all_effects() if kind.name != "viscous_drift")
    drifts = families(case.model.columns.laws, whole_motion(case.data), case.model.arm, others)
    found = search(replace(case, families=(*case.families, *drifts)), 1)
    best = found.steps[0].best
    assert best is not None
    assert (best.effect.name, best.effect.joint) == ("viscous_drift", 2)
    assert best.possible
    values, end = best.done.model.effects[0].values, float(np.ptp(case.data.logs[0].motion.t))
    friction = find_effect("viscous_drift")(joint=2)._viscous(best.done.model.nominal)
    gone = -values["relative_change"] * -np.expm1(-end / values["time_constant"]) * friction
    assert gone == pytest.approx(0.012 * end, rel=0.15)


@pytest.mark.slow
def test_an_event_belongs_to_its_log() -> None:
    """A push at the tip for 0.3 s in the second of two logs is found there, at its time."""
    def push(motion: Motion) -> np.ndarray:  # type: ignore[type-arg]
        from tests.model.diagnosis.arms import arm

        window = np.where((motion.t > 3.0) & (motion.t < 3.3), np.sin(np.pi * (motion.t - 3.0) / 0.3), 0.0)
        step, out = 1e-6, np.zeros_like(motion.q)
        for j in range(3):
            moved = motion.q.copy()
            moved[:, j] += step
            jacobian = (arm().body.tip(moved) - arm().body.tip(motion.q)) / step
            out[:, j] = -window * (jacobian @ np.array([0.0, 6.0, 10.0]))
        return out

    prepared = prepare(Logs((hidden(1), hidden(2, push)), (hidden(3, None, "validate"),)), DiagnosisSettings())
    case = case_of(prepared)
    arm_now = case.model.arm
    family = families((), whole_motion(case.data), arm_now, tuple(k.name for k in all_effects() if k.name != "contact"))
    found = search(replace(case, families=(*case.families, *family)), 1)
    best = found.steps[0].best
    assert best is not None
    assert best.effect.name == "contact"
    assert best.log == 1
    values = best.done.model.effects[0].values
    assert values["start"] == pytest.approx(3.0, abs=0.01)
    assert values["force"] == pytest.approx(np.hypot(6.0, 10.0), rel=0.05)
    step = found.steps[0]
    gained, passed = step.before.rss - best.done.rss, (best.screened,)
    for share, event in ((0.9, True), (1.1, False)):  # of what it takes fitted exactly, that its columns had to
        thresholds = replace(step.thresholds, gain=np.full(len(step.screened), share * gained))
        asked = search_module._step(case, search_module.Explored(step.before, step.screened, step.rivals),
                                    Gate(step.screened, thresholds, passed, frozenset()), 1, True)
        assert (asked.best is best) is event


def test_eleven_waves_a_turn_could_have_passed_for_themselves_and_for_no_spring(waving: Case) -> None:
    """A polynomial of the angle does not follow eleven waves a turn; the wave itself does, wherever the search put its numbers."""
    step = search(waving, 1).steps[0]
    there = {(family.cause, family.joint): imitated(step, family, waving) for family in waving.families}
    assert there["cogging", 2] > 0.9
    assert there["spring", 2] < 0.25
    assert there["cogging", 1] < 0.25


def test_what_no_arm_could_have_moved_with_is_not_taken(waving: Case) -> None:
    """However little it leaves: the plainest example is a torque that is clipped all the time."""
    tried = search(waving, 1).steps[0].rivals
    best = search_module.fewest(tried)
    assert best is not None
    others = [replace(one, believable=False) if one is best else one for one in tried]
    assert search_module.fewest(others) is not best
    trial = next(one for one in ledger([best.screened], [best.screened], without_twin([best.screened], 1e-9, np.ones(3)),
                                       [replace(best, believable=False)], None, best.done, 1))
    assert "could not have moved" in trial.reason


def test_less_than_nothing_is_not_what_a_cause_explains(waving: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing was taken up it is told why: something explains more that nobody can name, or enough had been found. Where
    something was, what lost to it is not told that it was accepted: whether it is named is another question."""
    first = search(waving, 1).steps[0]
    best = first.best
    assert best is not None
    bounds = without_twin([best.screened], 1e-9, np.ones(3))
    (lost,) = ledger([best.screened], [best.screened], bounds, [replace(best, rank=best.rank + 0.01)], best, first.before, 1)
    assert lost.reason == "explains less than the one that the search took up"
    for reason, other, most in ((GIVES_WAY, first.screened[0], 1), (ENOUGH, None, 0)):
        monkeypatch.setattr(search_module, "unnameable", lambda *_, other=other: other)
        (step,) = search(waving, most).steps
        told = {trial.reason for trial in step.trials if (trial.cause, trial.joint) == (best.effect.name, best.effect.joint)}
        assert told == {reason}


def test_what_was_found_at_a_joint_is_not_called_weaker_than_others(waving: Case) -> None:
    """A search asks once whether it is there: what is left above a threshold then was not weighed against anything."""
    found = search(waving, 1)
    best = found.steps[0].best
    assert best is not None
    again = next(one for one in found.steps[0].screened if (one.cause, one.joint) == (best.effect.name, best.effect.joint))
    trial, = ledger([again], [again], without_twin([again], 1e-9, np.ones(3)), [], None, found.final, 2)
    assert trial.gain > trial.threshold
    assert trial.reason == "found there already, and not asked again"


def test_what_does_not_pass_is_no_rival_of_what_does(waving: Case) -> None:
    """However great: a cause that gains a hundredth of another is fitted where that other stays below its threshold."""
    rough = provisional(waving)
    screened = rough[0].screened
    most = max(one.gain[0] for one in screened)
    small = max((one for one in screened if one.gain[0] < 0.1 * most), key=lambda one: one.gain[0])
    gain = np.array([0.5 * one.gain[0] if one is small else np.inf for one in screened])
    weight = rough[0].before.weight
    given = Thresholds(gain, np.zeros(len(gain)), "a test", weight, tuple(one.joint for one in screened))
    first = search(replace(waving, thresholds=given), 1, rough).steps[0]
    assert small not in [one.screened for one in rough[0].tried]
    assert [one.screened for one in first.rivals] == [small]


class Alone(Tried):
    """Fitted to nothing that another process could leave out."""

    @property
    def lean(self) -> Tried:
        return self

    def whole(self, *_: object) -> Tried:
        return self


@pytest.mark.parametrize("sure", [True, False])
def test_another_law_of_a_cause_is_as_sure_of_it(sure: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A spring that was worth its number beside an offset is not given up for the offset when it turns out to harden."""
    line, left = find_effect("spring")(joint=2), {False: 1.0, True: 0.5}

    def fit(effect: Any, certain: bool) -> Any:
        done: Any = SimpleNamespace(model=SimpleNamespace(effects=(SimpleNamespace(possible=True),)))
        return Alone(cast(Any, None), effect, None, done, 0.5, 0.5, 0.1, certain)

    straight = replace(line, degree=1, highest=5)
    monkeypatch.setattr(hypotheses, "_refitted", lambda case, now, one, effect, error: fit(effect, False))
    monkeypatch.setattr(hypotheses, "_left_at", lambda case, tried: left[tried.effect.degree > 1])
    found = hypotheses.best_form(cast(Any, None), cast(Any, None), fit(straight, sure), 1.0)
    assert found.effect.degree > 1
    assert found.sure is sure


@pytest.mark.parametrize("height", [5.0, 200.0])
def test_a_torque_beyond_any_that_the_machine_has_given_is_no_number_of_a_cause(waving: Case, height: float) -> None:
    """A wave of 200 N m at a joint whose motors gave 30 at most, and of 5, which they may have had."""
    effect = find_effect("cogging")(joint=2)
    model = waving.model.with_effect(effect.full(), np.array([height, 0.0, 0.0, 0.0, 0.0, 0.0]))
    done = cast(Any, SimpleNamespace(model=model, data=waving.data))
    largest = max(float(np.abs(one.log.tau).max()) for one in waving.data.logs)
    assert 5.0 < largest < 200.0
    assert hypotheses._of_size(done) is (height < largest)

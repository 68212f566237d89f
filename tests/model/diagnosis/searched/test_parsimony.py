"""Of causes that explain nearly the same, the plainest: what a further number is worth."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.optimize import minimize

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.searched import hypotheses
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.searched.parsimony import fewest
from pipelines.model.effects import find_effect
from pipelines.model.effects.base import Effect
from pipelines.model.effects.spring import Spring
from pipelines.model.effects.torque_offset import TorqueOffset
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden


@pytest.mark.parametrize(("less", "rank", "numbers", "told", "taken"), [
    (12.0, 0.49, 2, 4.0, True), (6.0, 0.49, 2, 4.0, False), (12.0, 0.51, 2, 4.0, False), (12.0, 0.49, 3, 4.0, False),
    (12.0, 0.49, 2, 2.0, False)])
def test_a_further_number_is_taken_for_what_it_is_worth(less: float, rank: float, numbers: int, told: float, taken: bool,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    """A spring along one line beside an offset: of 3000 rows of unit variance a number is worth log 3000, 8.0. It is not taken
    where held-out time says otherwise, nor with two more, nor where its slope is two deviations from none."""

    def fit(effect: Any, rss: float, at: float, count: int) -> Any:
        model = SimpleNamespace(effects=(SimpleNamespace(effect=effect, count=count, possible=True),))
        done: Any = SimpleNamespace(rss=rss, model=model, rms=np.ones(3), data=SimpleNamespace(rows=3000))
        screened: Any = SimpleNamespace(joint=2, shape=(find_effect(effect.name)(joint=2),), cause=effect.name)
        return Tried(screened, effect, None, done, 0.5, at, 0.1)

    line = find_effect("spring")(joint=2)
    offset, whole = fit(find_effect("torque_offset")(joint=2), 3000.0, 0.5, 1), fit(replace(line, degree=5), 2995.0, 0.495, 6)
    monkeypatch.setattr(hypotheses, "_refitted", lambda *_: fit(line, 3000.0 - less, rank, numbers))
    monkeypatch.setattr(hypotheses, "_beyond", lambda *_: told)
    case: Any = SimpleNamespace(data=SimpleNamespace(rows=3000))
    found = hypotheses.plainer(case, cast(Any, None), [whole, offset], offset, 1.0)
    assert (found is not None) is taken
    if found is not None:
        assert fewest(sorted([offset, found], key=lambda one: one.rank)) is found
    assert fewest([whole, offset]) is offset


@pytest.mark.parametrize(("left", "held_out", "taken"), [(0.66, 0.9, True), (0.66, 1.01, False), (0.8, 0.7, False)])
def test_what_lasts_is_better_than_what_happened_once_and_leaves_more(left: float, held_out: float, taken: bool) -> None:
    """An arm that meets its torque's limit again and again, told as a touch in one log: that leaves 0.74 of the fitted logs, with
    which it is ranked, for the others are none of its business. The limit leaves less of them, and of the others as well."""

    def fit(rss: float, error: float, rank: float, log: int | None, count: int) -> Tried:
        model = SimpleNamespace(effects=(SimpleNamespace(effect=None, count=count, possible=True),))
        done: Any = SimpleNamespace(rss=rss, model=model, rms=np.full(3, rss), data=SimpleNamespace(rows=3000))
        screened: Any = SimpleNamespace(joint=None if log is not None else 3)
        effect: Any = SimpleNamespace(name="contact" if log is not None else "torque_saturation", twins=())
        return Tried(screened, effect, log, done, error, rank, 0.1)

    touch, limit = fit(0.74, 0.74, 0.74, 1, 5), fit(left, held_out, float(np.sqrt(left * held_out)), None, 1)
    assert fewest(sorted([touch, limit], key=lambda one: one.rank)) is (limit if taken else touch)


def test_deviations_from_a_plane_are_the_least_that_scipy_finds() -> None:
    rng = np.random.default_rng(4)
    numbers, plane, root = rng.standard_normal(4), rng.standard_normal((4, 2)), rng.standard_normal((4, 4))
    covariance = root @ root.T
    inverse = np.linalg.inv(covariance)
    least = minimize(lambda x: (numbers - plane @ x) @ inverse @ (numbers - plane @ x), np.zeros(2), tol=1e-14)
    assert hypotheses.apart_from(numbers, covariance, plane) == pytest.approx(np.sqrt(least.fun), rel=1e-6)
    assert hypotheses.apart_from(plane @ [2.0, -3.0], covariance, plane) == pytest.approx(0.0, abs=1e-9)


def _line_and_offset(seed: int, stiffness: float) -> tuple[Data, Tried, Tried]:
    """A straight spring, and an offset, fitted to an offset of 0.3 N m at joint 2, a spring and a slow wander."""
    rng = np.random.default_rng(seed)
    hertz, phase = rng.uniform(0.1, 1.0, 12), rng.uniform(0.0, 2.0 * np.pi, 12)

    def load(motion: Motion) -> Array:
        out = np.zeros_like(motion.q)
        out[:, 1] = 0.3 + stiffness * motion.q[:, 1] + 0.02 * np.sin(2.0 * np.pi * np.outer(motion.t, hertz) + phase).sum(axis=1)
        return out

    prepared = prepare(Logs((hidden(seed, load),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)

    def tried(effect: Effect, count: int) -> Tried:
        start = Exact.start(columns, fit).with_effect(effect, np.full(count, 0.1))
        return Tried(cast(Any, None), effect, None, refine(start, prepared.data, fit.weight), 0.5, 0.5, 0.1)

    return prepared.data, tried(Spring(joint=2, degree=1, highest=1), 2), tried(TorqueOffset(joint=2), 1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_slow_wander_makes_no_spring_of_an_offset(seed: int) -> None:
    assert hypotheses._beyond(*_line_and_offset(seed, 0.0)) < 3.0
    assert hypotheses._beyond(*_line_and_offset(seed, 3.0)) > 6.0


def test_for_white_noise_the_wander_would_be_a_spring() -> None:
    data, line, _ = _line_and_offset(1, 0.0)
    slopes, slope = line.done.slopes / line.done.rms[data.joint], line.done.of_effect(0)[0]
    white = np.linalg.inv(slopes @ slopes.T)[slope, slope]
    assert abs(line.done.model.effects[0].amplitudes[0]) > 10.0 * np.sqrt(white)


def test_a_slope_that_is_not_told_is_no_slope() -> None:
    """Not even where its number is many deviations from none: that of what is held is zero in the covariance."""
    data, line, offset = _line_and_offset(1, 3.0)
    line.done.__dict__["unseen"] = line.done.of_effect(0)[:1]
    assert hypotheses._beyond(data, line, offset) == 0.0


@pytest.mark.parametrize(("less", "error", "plain"), [(30.0, 0.95, True), (60.0, 0.95, False), (30.0, 0.9, False)])
def test_numbers_that_chance_would_take_as_well_are_none(less: float, error: float, plain: bool) -> None:
    """A whole spring beside an offset under much noise: five further numbers take less than five times log 3000, 40, or more."""

    def fit(effect: Any, rss: float, held: float, count: int) -> Any:
        model = SimpleNamespace(effects=(SimpleNamespace(effect=effect, count=count, possible=True),))
        done: Any = SimpleNamespace(rss=rss, model=model, rms=np.ones(3), data=SimpleNamespace(rows=3000))
        return Tried(cast(Any, SimpleNamespace(joint=2)), effect, None, done, held, held * rss / 3200.0, 0.1)

    offset = fit(find_effect("torque_offset")(joint=2), 3000.0, 0.96, 1)
    whole = fit(find_effect("spring")(joint=2), 3000.0 - less, error, 6)
    assert fewest([whole, offset]) is (offset if plain else whole)


@pytest.mark.parametrize(("left", "plain"), [((0.01, 0.01, 0.01), True), ((0.01, 0.012, 0.01), False)])
def test_of_an_arms_cause_and_a_joints_the_plainer_is_taken_where_they_are_one(left: tuple[float, ...], plain: bool) -> None:
    """A tilt that joint 1 alone feels is a constant torque there. Of a fault of 1 N m a fiftieth is far above the noise: what the
    tilt takes off joint 2 as well is no chance."""

    def fit(effect: Any, at: float, count: int, rms: tuple[float, ...]) -> Any:
        model = SimpleNamespace(effects=(SimpleNamespace(effect=effect, count=count, possible=True),))
        done: Any = SimpleNamespace(model=model, rms=np.array(rms))
        return Tried(cast(Any, SimpleNamespace(joint=effect.joint)), effect, None, done, 0.5, at, 0.1)

    tilt = fit(find_effect("gravity_tilt")(), 0.0100, 2, (0.01, 0.01, 0.01))
    offset = fit(find_effect("torque_offset")(joint=1), 0.0101, 1, left)
    assert fewest([tilt, offset]) is (offset if plain else tilt)


def test_what_leaves_more_is_no_cause_though_held_out_time_happens_to_show_less() -> None:
    """Held out it leaves 1 % less, of the fitted logs 8 % more: nothing is found then."""
    model = SimpleNamespace(effects=(SimpleNamespace(count=1, possible=True),))
    done: Any = SimpleNamespace(model=model, rms=np.ones(3))
    lag = Tried(cast(Any, SimpleNamespace(joint=1)), find_effect("torque_lag")(joint=1), None, done, 0.99, 1.034, 0.1)
    assert fewest([lag]) is None

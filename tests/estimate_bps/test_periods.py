"""Periods of a periodic experiment: averaged where they are alike, their scatter beside what the estimate leaves."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from pipelines.estimate_bps import Result, compute
from pipelines.estimation.periods import PeriodicLog
from pipelines.io.files import Opened
from pipelines.io.log import Array, ExperimentLog
from pipelines.report.bps_report import bps_report
from pipelines.stage import Inputs
from sample_logs.make_closed_form import NOISE, torque_step
from tests.estimate_bps.estimates import SYMMETRIC
from tests.estimation.experiments import arm, experiment, periodic, truth
from tests.healthy import with_signal
from tests.seeds import rarely

ENCODER = 1e-5


def estimated(*logs: ExperimentLog, **settings: object) -> Result:
    opened = tuple(Opened(Path(log.name), "", log, ()) for log in logs)
    return compute(Inputs(opened), replace(SYMMETRIC, **settings))  # type: ignore[arg-type]


def of_periods(seed: int, periods: int, encoder: float = 3e-6) -> Result:
    return _of_periods(seed, periods, encoder)


@lru_cache(maxsize=16)
def _of_periods(seed: int, periods: int, encoder: float) -> Result:
    return estimated(periodic(seed, periods, encoder))


def std_of(found: Result) -> Array:
    return np.array([p.std for p in found.parameters], dtype=np.float64)


def deviation(found: Result) -> Array:
    """(estimate - truth) / std."""
    value = np.array([p.value for p in found.parameters], dtype=np.float64)
    return (value - truth([p.name for p in found.parameters])) / std_of(found)


def only(found: Result) -> PeriodicLog:
    (beside,) = found.noise_floor
    return beside


@pytest.mark.slow
def test_five_periods_are_worth_the_root_of_five() -> None:
    """Over four experiments standard deviations shrink by √5, and the estimates are as good as they say."""
    one, five = ([of_periods(seed, periods) for seed in range(4)] for periods in (1, 5))
    assert all(only(found).averaged and only(found).periods == 5 for found in five)
    spread = [np.sqrt(np.mean([std_of(found) ** 2 for found in part], axis=0)) for part in (one, five)]
    assert np.median(spread[0] / spread[1]) == pytest.approx(np.sqrt(5.0), rel=0.05)
    np.testing.assert_allclose(spread[0] / spread[1], np.sqrt(5.0), rtol=0.2)
    z = np.array([deviation(found) for found in five])
    assert np.mean(np.abs(z) < 2.0) > 0.88
    assert np.abs(z).max() < 4.0
    assert max(five[0].equations) < 1.2 * max(one[0].equations)


@pytest.mark.parametrize("encoder", [3e-6, *rarely(3e-5)])
def test_the_floor_is_the_noise_that_was_put_in(encoder: float) -> None:
    """Position and torque of one sample within 5 %; the model being right, the residual is what noise leaves, within 25 %."""
    beside = only(of_periods(0, 5, encoder))
    np.testing.assert_allclose(beside.position, np.hypot(encoder, ENCODER / np.sqrt(12.0)), rtol=0.05)
    np.testing.assert_allclose(beside.torque, np.hypot(NOISE, torque_step(arm().robot) / np.sqrt(12.0)), rtol=0.05)
    np.testing.assert_allclose(beside.ratio, 1.0, atol=0.25)


def test_what_the_model_lacks_stands_above_the_floor() -> None:
    """A ripple of 0.1 N m over the waist's position: ten times the noise of its mean, in that joint alone; the verdict says it."""
    def ripple(q: Array, tau: Array) -> None:
        tau[:, 0] += 0.1 * np.sqrt(2.0) * np.sin(7.0 * q[:, 0])

    found = estimated(periodic(0, 5, spoil=ripple))
    beside = only(found)
    assert beside.ratio[0] > 10.0
    assert beside.residual[0] == pytest.approx(0.1, rel=0.3)
    report = bps_report(found)
    assert f"at most {beside.ratio[0]:.2g} times the noise floor ({found.joints[0]})" in report.verdict
    assert report.key_figures is not None
    assert any("noise floor" in str(row[0]) for row in report.key_figures.rows)
    assert "Residual beside the noise floor" in [section.title for section in report.sections]


def test_a_disturbed_period_is_left_out_and_named() -> None:
    """Somebody held the elbow for half a second of the third period: T10 says so, and the estimate is that of the rest."""
    def touched(q: Array, tau: Array) -> None:
        tau[24_000:24_500, 2] += 0.3

    found = estimated(periodic(0, 5, spoil=touched))
    assert only(found).left_out == (3,)
    assert only(found).periods == 4
    assert [check.message for check in found.data_quality if check.code == "RRID-T10"] == [
        "period 3 differs from the 4 others and is left out of their mean"]
    assert np.abs(deviation(found)).max() < 4.0
    np.testing.assert_allclose(only(found).ratio, 1.0, atol=0.25)


def loaded(q: Array, tau: Array) -> None:
    """The second half with a kilogram in the hand."""
    tau[len(q) // 2:, 1] += 9.81 * 0.4 * np.cos(q[len(q) // 2:, 1])


def other(q: Array, tau: Array) -> None:
    """Every second period is another motion."""
    q[10_000:20_000], tau[10_000:20_000] = q[10_000:20_000][::-1].copy(), tau[10_000:20_000][::-1].copy()


@pytest.mark.parametrize(("periods", "spoil", "words"), [
    (2, loaded, "torque of joint 2"), (2, other, "motion of joint")])
def test_periods_that_are_not_alike_are_not_averaged(periods: int, spoil: object, words: str) -> None:
    found = estimated(periodic(0, periods, spoil=spoil), skip_sanity_checks=True)  # type: ignore[arg-type]
    assert not only(found).averaged
    assert words in only(found).why_not
    (check,) = [check for check in found.data_quality if check.code == "RRID-T10"]
    assert words in check.message
    assert max(found.equations) > 1.5 * max(of_periods(0, 1).equations)


@pytest.mark.slow
def test_a_log_with_an_uneven_clock_is_folded_on_its_even_grid() -> None:
    log = periodic(0, 2)
    t = log.t + np.random.default_rng(3).uniform(-0.03, 0.03, log.n_samples) * 1e-3
    assert only(estimated(with_signal(log, t=t))).averaged


@pytest.mark.slow
def test_a_log_of_one_period_beside_one_of_five_counts_for_its_own() -> None:
    """Both together know more than the five alone, by about 6/5 periods: equations of a mean weigh five times."""
    both = estimated(periodic(0, 5), experiment(1))
    assert len(both.noise_floor) == 1
    gain = std_of(of_periods(0, 5)) / std_of(both)
    assert 1.0 < np.median(gain) < 1.35
    assert np.abs(deviation(both)).max() < 4.0
    rms = np.array(both.torque_rms["identify"])
    np.testing.assert_allclose(rms, np.sqrt((only(both).residual**2 * 5 + (NOISE / 5) ** 2) / 6), rtol=0.4)


@pytest.mark.parametrize("period", [0.2, *rarely(0.1, 0.01, 7.3)])
def test_a_wrong_period_is_told_and_changes_no_estimate(period: float) -> None:
    """T10, and what a log without a period gives."""
    log = periodic(0, 2)
    none, found = estimated(replace(log, period=None)), estimated(replace(log, period=period))
    said = [check for check in found.data_quality if check.message.startswith("its periods are not averaged")]
    assert [check.code for check in said] == ["RRID-T10"]
    np.testing.assert_allclose(std_of(found), std_of(none), rtol=1e-9)

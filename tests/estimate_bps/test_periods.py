"""Periods of a periodic experiment: averaged where they are alike, their scatter beside what the estimate leaves."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps, reconstruct
from pipelines.estimate_bps import Result, compute
from pipelines.estimation.comparison import Beside
from pipelines.io.files import Opened
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.results import decode, encode
from pipelines.report.bps_report import bps_report
from pipelines.stage import Inputs, Request, run_stage
from sample_logs.make_closed_form import NOISE, torque_step
from tests.estimate_bps.estimates import SYMMETRIC, contents, stage
from tests.healthy import with_signal
from tests.model.estimation.experiments import arm, experiment, looped, periodic, truth

ENCODER = 1e-5


def estimated(*logs: ExperimentLog, **settings: object) -> Result:
    opened = tuple(Opened(Path(log.name), "", log, ()) for log in logs)
    return compute(Inputs(opened), replace(SYMMETRIC, **settings))  # type: ignore[arg-type]


def of_periods(seed: int, periods: int, encoder: float = 3e-6, average: bool = True) -> Result:
    return _of_periods(seed, periods, encoder, average)


@lru_cache(maxsize=16)
def _of_periods(seed: int, periods: int, encoder: float, average: bool) -> Result:
    return estimated(periodic(seed, periods, encoder), average=average)


def std_of(found: Result) -> Array:
    return np.array([p.std for p in found.parameters], dtype=np.float64)


def deviation(found: Result) -> Array:
    """(estimate - truth) / std."""
    value = np.array([p.value for p in found.parameters], dtype=np.float64)
    return (value - truth([p.name for p in found.parameters])) / std_of(found)


def only(found: Result) -> Beside:
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


@pytest.mark.parametrize(("encoder", "average"), [
    (3e-6, True), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((3e-6, False), (3e-5, True), (3e-5, False)))])
def test_the_floor_is_the_noise_that_was_put_in(encoder: float, average: bool) -> None:
    """Position and torque of one sample within 5 %; the model being right, the residual is what noise leaves, within 25 %."""
    beside = only(of_periods(0, 5, encoder, average))
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
    assert f"at most {beside.ratio[0]:.2g} times what the noise between periods leaves ({found.joints[0]})" in report.verdict
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


def test_a_result_from_before_starts_were_looked_for_is_still_reported() -> None:
    """Its periods say nothing of how long the motion took to settle: not known, and no reason to refuse the rest."""
    text, series = encode(of_periods(0, 5))
    for log in text["noise_floor"]:
        del log["settling_time"]
    old = decode(Result, text, series)
    assert only(old).settling_time is None
    assert "how long its motion took to settle is not known" in str(bps_report(old).sections)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_loop_that_settles_spoils_no_mean_of_two_periods(seed: int) -> None:
    """From rest the shoulder sags by 5 to 10 mrad, for 0.3 s, and so does the held-out log.

    Averaged into the mean, that made the held-out error of shoulder and elbow up to four times what it is without a mean.
    """
    logs = looped(seed, 2), looped(seed + 50, 2, "validate")
    mean, every = (estimated(*logs, average=average, compare=False) for average in (True, False))
    assert all(log.averaged and 0.1 <= log.settling_time <= 0.6 for log in mean.noise_floor)
    assert (np.array(mean.torque_rms["validate"]) < 1.02 * np.array(every.torque_rms["validate"])).all()
    assert [check.code for check in mean.data_quality if "in which the motion settled" in check.message] == ["RRID-T10"] * 2
    assert [check.message for check in every.data_quality if check.code == "RRID-T10"] == [
        f"the first {log.settling_time:.2g} s of its periods, in which the motion settled, are kept, for its periods are not "
        "averaged" for log in every.noise_floor]
    for found, fate in ((mean, "left out"), (every, "kept")):
        assert f"its first {found.noise_floor[0].settling_time:.2g} s, in which the motion settled, are {fate}" in str(
            bps_report(found).sections)


def drifting(q: Array, tau: Array) -> None:
    """Friction of the shoulder that falls by 0.05 N m from period to period."""
    speed = np.gradient(q[:, 1], 1e-3)
    tau[:, 1] -= 0.05 * (np.arange(len(q)) // 10_000) * np.sign(speed)


def loaded(q: Array, tau: Array) -> None:
    """The second half with a kilogram in the hand."""
    tau[len(q) // 2:, 1] += 9.81 * 0.4 * np.cos(q[len(q) // 2:, 1])


def other(q: Array, tau: Array) -> None:
    """Every second period is another motion."""
    q[10_000:20_000], tau[10_000:20_000] = q[10_000:20_000][::-1].copy(), tau[10_000:20_000][::-1].copy()


@pytest.mark.parametrize(("periods", "spoil", "words"), [
    (2, loaded, "torque of joint 2"), (2, other, "motion of joint"),
    pytest.param(4, drifting, "torque of joint 2 drifts", marks=pytest.mark.slow)])
def test_periods_that_are_not_alike_are_not_averaged(periods: int, spoil: object, words: str) -> None:
    found = estimated(periodic(0, periods, spoil=spoil), skip_sanity_checks=True)  # type: ignore[arg-type]
    assert not only(found).averaged
    assert words in only(found).why_not
    (check,) = [check for check in found.data_quality if check.code == "RRID-T10"]
    assert words in check.message
    assert max(found.equations) > 1.5 * max(of_periods(0, 1).equations)


@pytest.mark.slow
def test_without_averaging_every_sample_counts() -> None:
    beside, found = only(of_periods(0, 5, average=False)), of_periods(0, 5, average=False)
    assert not beside.averaged
    assert beside.why_not == "not asked for"
    assert max(found.equations) > 4 * max(of_periods(0, 5).equations)
    assert not [check for check in found.data_quality if check.code == "RRID-T10"]


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


@pytest.mark.slow
def test_derived_logs_give_what_recordings_give(tmp_path: Path) -> None:
    """Averaged or not: `reconstruct` and then `estimate-bps` on its logs is `estimate-bps` on the recordings, bit for bit."""
    direct = contents(stage(tmp_path / "h5", periodic(0, 2)).folder)
    recorded = Request((tmp_path / "h5/logs",), out=tmp_path / "motion", no_report=True, format="parquet")
    motion = run_stage(reconstruct.STAGE, recorded, replace(SYMMETRIC.reconstruction, average=False))
    again = Request((motion.folder,), out=tmp_path / "again", no_report=True)
    assert contents(run_stage(estimate_bps.STAGE, again, SYMMETRIC).folder) == direct


@pytest.mark.slow
def test_every_method_takes_the_same_mean() -> None:
    """The table of methods compares them on the mean of the same periods: as many equations, least left by the smoother."""
    rows = estimated(periodic(0, 3), compare=True).comparison
    assert [row.failed for row in rows] == [""] * 4
    assert len({row.equations for row in rows}) == 1
    error = {row.method: row.validate for row in rows}
    assert min(error, key=error.__getitem__) == "smoother"

"""Periods that are not averaged know what their mean knows: an error of the model that repeats is no independent one each time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pipelines.estimate_bps import Result
from pipelines.io.log import Array
from pipelines.report.bps_report import bps_report
from tests.estimate_bps.test_periods import deviation, estimated, of_periods, only, std_of
from tests.model.estimation.experiments import periodic

PERIODS, REPLICAS, FEW = 4, 8, 3
Spoil = Callable[[Array, Array], None]


def cogging(seed: int) -> Spoil:
    """Four ripples of 0.05 N m at every joint, over its position, of orders and phases that nobody knows."""
    rng = np.random.default_rng([22, seed])
    order, phase = rng.uniform(5.0, 40.0, (4, 3)), rng.uniform(0.0, 2.0 * np.pi, (4, 3))

    def spoil(q: Array, tau: Array) -> None:
        for one, where in zip(order, phase, strict=True):
            tau += 0.05 * np.sin(one * q + where)

    return spoil


def replicas(spoil: Callable[[int], Spoil | None], average: bool, arms: int = REPLICAS) -> list[Result]:
    return [estimated(periodic(seed, PERIODS, spoil=spoil(seed)), average=average) for seed in range(arms)]


def spread(found: list[Result]) -> Array:
    return np.asarray(np.sqrt(np.mean([std_of(one) ** 2 for one in found], axis=0)))


@pytest.mark.parametrize(("spoil", "arms"), [
    pytest.param(cogging, FEW, id="cogging", marks=pytest.mark.slow),
    pytest.param(cogging, REPLICAS, id="cogging, eight arms", marks=pytest.mark.slow),
    pytest.param(lambda seed: None, REPLICAS, id="noise alone, eight arms", marks=pytest.mark.slow)])
def test_the_scatter_is_what_is_told(spoil: Callable[[int], Spoil | None], arms: int) -> None:
    """Whether their torque ripples or is what the model says: with every period taken for news, ripple would leave errors of
    two standard deviations."""
    z = np.array([deviation(found) for found in replicas(spoil, False, arms)])
    assert 0.75 < np.sqrt(np.mean(z**2)) < 1.3
    assert np.mean(np.abs(z) < 2.0) > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [cogging, pytest.param(lambda seed: None, id="noise alone")])
def test_both_ways_know_as_much(spoil: Callable[[int], Spoil | None]) -> None:
    """Standard deviations within 10 %, parameter by parameter, and the same story of residual and noise."""
    every, mean = replicas(spoil, False), replicas(spoil, True)
    np.testing.assert_allclose(spread(every) / spread(mean), 1.0, atol=0.1)
    for one, other in zip(every, mean, strict=True):
        np.testing.assert_allclose(only(one).ratio, only(other).ratio, rtol=0.02)


@pytest.mark.slow
def test_what_the_model_lacks_stands_as_far_above_the_floor() -> None:
    """0.1 N m at the waist beside the noise of a mean of three, whichever way: the first sentence says the same."""
    def ripple(q: Array, tau: Array) -> None:
        tau[:, 0] += 0.1 * np.sqrt(2.0) * np.sin(7.0 * q[:, 0])

    both = [estimated(periodic(0, 3, spoil=ripple), average=average) for average in (True, False)]
    mean, every = map(only, both)
    assert (mean.averaged, every.averaged) == (True, False)
    assert every.residual[0] == pytest.approx(0.1, rel=0.3)
    np.testing.assert_allclose(every.noise_floor, mean.noise_floor, rtol=0.02)
    np.testing.assert_allclose(every.ratio, mean.ratio, rtol=0.02)
    said = [bps_report(found).verdict.partition("the residual of the fitted logs is ")[2].partition(" times")[0] for found in both]
    assert said[0] == said[1] != ""


@pytest.mark.parametrize(("periods", "averages"), [
    ((0.2,), (True,)), pytest.param((0.2, 0.1, 0.01, 7.3), (True, False), marks=pytest.mark.slow)])
def test_a_wrong_period_is_told_and_changes_no_estimate(periods: Sequence[float], averages: Sequence[bool]) -> None:
    """T10 where a mean was asked for; and in either way what a log without a period gives."""
    log = periodic(0, 2)
    none = estimated(replace(log, period=None))
    for period, average in product(periods, averages):
        found = estimated(replace(log, period=period), average=average)
        said = [check for check in found.data_quality if check.message.startswith("its periods are not averaged")]
        assert [check.code for check in said] == ["RRID-T10"] * average
        np.testing.assert_allclose(std_of(found), std_of(none), rtol=1e-9)


def test_a_touch_that_is_kept_is_named() -> None:
    """Nobody asked for its period to be left out, and the elbow was held there: it is in the fit, and said to be."""
    def touched(q: Array, tau: Array) -> None:
        tau[24_000:24_500, 2] += 0.3

    found = estimated(periodic(0, 5, spoil=touched), average=False)
    assert [check.message for check in found.data_quality if check.code == "RRID-T10"] == [
        "period 3 differs from the 4 others and is kept, for its periods are not averaged"]
    assert "period 3 differs and is kept" in str(bps_report(found).sections)
    assert max(found.equations) > 4.5 * max(of_periods(0, 1).equations)

"""The mean motion of several periods is as near to the true motion as it says."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.periods import Periods, doubts, mean_period
from pipelines.io.log import Array, ExperimentLog
from tests.estimation.experiments import motion_of, one_period, periodic
from tests.healthy import with_signal
from tests.seeds import rarely


@pytest.mark.parametrize(("encoder", "gain"), [(3e-6, np.sqrt(5.0)), *rarely((3e-5, np.sqrt(5.0))), (0.0, 1.0)])
def test_the_mean_is_as_good_as_it_says(encoder: float, gain: float) -> None:
    """Five periods: the error is 0.7 to 1.1 of the stated deviation, and about √5 below that of a sample.

    Without noise the steps of the encoder repeat with the motion: nothing is gained, and none is claimed.
    """
    log = periodic(0, 5, encoder)
    found = reconstruct(log, Reconstruction())
    _, made = mean_period(log, found, None)
    assert made is not None
    mean_log, mean = made
    assert mean.mean is not None
    assert mean.std is not None
    inside = slice(mean.mean.first, mean.mean.last)
    truth = motion_of(0)(np.arange(10_000) * 1e-3)
    phase = np.rint(mean_log.t[inside] / 1e-3).astype(int) % 10_000
    for k, name in enumerate(("q", "dq", "ddq")):
        true = np.roll(getattr(truth, name), 3000, axis=0)  # where `periodic` begins
        error = (getattr(mean.motion, name)[inside] - true[phase]).std(axis=0)
        ratio = error / mean.std[k][inside].mean(axis=0)
        assert ((ratio > 0.7) & (ratio < 1.1)).all(), (name, ratio)
        single = (getattr(found.motion, name) - np.tile(true, (5, 1)))[10_000:-10_000].std(axis=0)
        np.testing.assert_allclose(single / error, gain, rtol=0.15)


def settling(periods: int, seconds: float, lead: int = 0, size: float = 0.02) -> ExperimentLog:
    """An elbow that starts `size` [rad] off and gets there in `seconds`; after it, `lead` samples of a further period."""
    def sag(q: Array, tau: Array) -> None:
        away = size * np.exp(-np.arange(len(q)) * 1e-3 / seconds)
        q[:, 2] += away
        tau[:, 2] -= 20.0 * away  # what a loop with that gain answers

    log = periodic(0, periods + 1, spoil=sag)
    rows = slice(0, 10_000 * periods + lead)
    return with_signal(log, **{name: log[name][rows] for name in ("t", "q", "tau")})


def louder(periods: int, seed: int) -> ExperimentLog:
    """Five milli-newton metres of noise in the elbow's torque, and thirty more while it moves: the first 55 % of every period."""
    rng = np.random.default_rng([11, seed])

    def noise(q: Array, tau: Array) -> None:
        moves = np.arange(len(q)) % 10_000 < 5500
        tau[:, 2] += 0.03 * moves * rng.standard_normal(len(q))

    return periodic(seed, periods, spoil=noise)


def elbow_error(log: ExperimentLog) -> float:
    """[rad] largest error of the elbow's mean position."""
    _, made = mean_period(log, reconstruct(log, Reconstruction()), None)
    assert made is not None
    mean_log, mean = made
    assert mean.mean is not None
    inside = slice(mean.mean.first, mean.mean.last)
    phase = np.rint(mean_log.t[inside] / 1e-3).astype(int) % 10_000
    return float(np.abs(mean.motion.q[inside, 2] - one_period(0)[0][phase, 2]).max())


@pytest.mark.slow
def test_of_three_periods_the_first_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """A start of 0.6 mrad, too small to make its period an odd one: two others remain, whose mean has nothing of it."""
    log = settling(3, 0.1, size=6e-4)
    floor, _ = mean_period(log, reconstruct(log, Reconstruction()), None)
    assert floor is not None
    assert (floor.left_out, floor.periods) == ((1,), 2)
    assert elbow_error(log) < 2e-5
    monkeypatch.setattr(Periods, "begins_apart", lambda *given: False)
    floor, _ = mean_period(log, reconstruct(log, Reconstruction()), None)
    assert floor is not None
    assert (floor.left_out, floor.periods) == ((), 3)
    assert elbow_error(log) > 3e-5


def test_of_what_settles_slowly_the_first_period_goes() -> None:
    """What is left of it in the second one is no more than noise leaves."""
    log = settling(5, 1.5)
    floor, _ = mean_period(log, reconstruct(log, Reconstruction()), None)
    assert floor is not None
    assert (floor.left_out, floor.periods, floor.unlike) == ((1,), 4, "")
    assert elbow_error(log) < 2e-5


@pytest.mark.parametrize(("periods", "seed"), [(2, 0), (5, 0), *rarely((2, 1), (3, 0), (5, 1))])
def test_noise_that_is_larger_in_a_part_of_the_period_is_no_start(periods: int, seed: int) -> None:
    """What is quiet is a joint at rest, not an arm that has settled: every period is averaged."""
    log = louder(periods, seed)
    floor, made = mean_period(log, reconstruct(log, Reconstruction()), None)
    assert floor is not None
    assert made is not None
    assert (floor.left_out, floor.periods, floor.unlike) == ((), periods, "")


def test_two_periods_that_never_settle_are_not_averaged() -> None:
    """A sag that is still dying away at the end leaves nothing to compare: said, and every sample is used as it is."""
    log = settling(2, 4.0)
    floor, made = mean_period(log, reconstruct(log, Reconstruction()), None)
    assert floor is not None
    assert made is None
    (check,) = doubts(floor, "log")
    assert check.code == "RRID-T10"
    assert "not averaged" in check.message

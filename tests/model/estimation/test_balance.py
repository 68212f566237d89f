"""The balance of power tells what is wrong with acceleration or time from what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.estimation.balance import Balance, power_balance
from pipelines.estimation.config import BalanceConfig
from pipelines.estimation.estimate import Recipe, fit_logs, motions_of
from pipelines.estimation.motion import Reconstruction
from pipelines.estimation.nominal import nominal_columns
from pipelines.io.log import ExperimentLog
from tests.healthy import with_signal
from tests.model.estimation.experiments import experiment, truth

SEEDS = range(1)
SMOOTHER = Reconstruction()


def balance_of(log: ExperimentLog, gain: float = 1.0, min_speed: float = 0.0, how: Reconstruction = SMOOTHER) -> Balance:
    """Its motion's acceleration times `gain`."""
    ((_, found),) = motions_of([log], how)
    spoilt = replace(found, motion=replace(found.motion, ddq=gain * found.motion.ddq))
    columns = nominal_columns(log.robot, symmetric=True)
    balance = power_balance(fit_logs(((log, spoilt),), columns, Recipe(how, min_speed=(min_speed,))).estimate)
    assert balance is not None
    return balance


@pytest.mark.parametrize("gain", [0.99, 1.03, *(pytest.param(gain, marks=pytest.mark.slow) for gain in (0.97, 1.01))])
def test_a_scaled_acceleration_is_found(gain: float) -> None:
    """Inertias of the torque fit come out 1/gain too large, the balance's stay true: the differences say it at once."""
    for seed in SEEDS:
        found = balance_of(experiment(seed), gain)
        assert not found.agree
        assert max(found.apart) > BalanceConfig.alone
        z = (np.array(found.value) - truth(list(found.names))) / found.std
        assert np.abs(z).max() < 4.5, (seed, z)


@pytest.mark.parametrize("samples", [-1, 3, *(pytest.param(k, marks=pytest.mark.slow) for k in (-3, 1))])
def test_a_delay_is_found_and_measured(samples: int) -> None:
    """Torque that comes whole samples late, or early, beside the position: found to a tenth of a sample."""
    for seed in SEEDS:
        log = experiment(seed)
        found = balance_of(with_signal(log, tau=np.roll(log.tau, samples, axis=0)))
        assert not found.agree
        assert found.delay == pytest.approx(1e-3 * samples, abs=1e-4)
        assert abs(found.delay) > 10.0 * found.delay_std


@pytest.mark.parametrize("hertz", [3.0, 10.0, 30.0])
def test_a_motion_that_contradicts_itself_is_found(hertz: float) -> None:
    """What an observer of so few hertz calls speed is not the slope of what it calls position."""
    found = balance_of(experiment(1), how=Reconstruction(method="observer", bandwidth=(hertz,)))
    assert not found.agree
    assert found.closure > 0.05
    assert balance_of(experiment(1)).closure < 1e-4


def test_what_the_fit_leaves_out_is_left_out() -> None:
    """A stretch of torque at its limit, samples without measurement, and slow ones: fewer balances, and still they agree."""
    log = experiment(0)
    tau = log.tau.copy()
    tau[3000:3200, 1] = np.nan
    limited = np.clip(tau, *(sign * 0.9 * np.nanmax(np.abs(tau), axis=0) for sign in (-1.0, 1.0)))
    whole = balance_of(log)
    for spoilt in (tau, limited):
        found = balance_of(with_signal(log, tau=spoilt))
        assert found.agree, found
        assert found.windows < whole.windows
    assert balance_of(log, min_speed=0.2).windows < 0.8 * whole.windows
    assert balance_of(log, min_speed=0.2).agree

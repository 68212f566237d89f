"""Equations of one phase are those of one posture, whatever the period is in samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.estimation.covariance import Cycle
from pipelines.estimation.estimate import Recipe, cycle_of, equations_of
from pipelines.estimation.mean_period import mean_period
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.nominal import nominal_columns
from pipelines.estimation.regression import LogEquations
from pipelines.io.log import Array, ExperimentLog
from tests.healthy import with_signal
from tests.model.estimation.experiments import arm, motion_of, periodic

HOW = Reconstruction()


def equations(log: ExperimentLog, decimation: int | None = None) -> LogEquations:
    return equations_of(((log, reconstruct(log, HOW)),), Recipe(HOW, 20.0, decimation), nominal_columns(arm().robot))[0]


def apart(one: LogEquations, cycle: Cycle) -> float:
    """[rad] largest distance of a true posture from the mean of those with its phase."""
    q = motion_of(0)(one.found.motion.t[one.moments()] + 3.0).q  # where `periodic` begins
    mean = np.zeros((cycle.count, 3))
    np.add.at(mean, cycle.phase, q)
    seen: Array = np.bincount(cycle.phase, minlength=cycle.count)[:, None].astype(np.float64)
    return float(np.abs(q - (mean / np.maximum(seen, 1.0))[cycle.phase]).max())


@pytest.mark.parametrize(("decimation", "gap", "most"), [(10, False, 1e-9), (7, False, 0.02), (10, True, 0.02)])
def test_one_phase_is_one_posture(decimation: int, gap: bool, most: float) -> None:
    """To rounding where the period is a whole number of equations, else to half a step of them, 0.02 rad at 3 rad/s."""
    log = periodic(0, 3)
    if gap:
        q = log.q.copy()
        q[14_003:14_503] = np.nan
        log = with_signal(log, q=q)
    one = equations(log, decimation)
    cycle = cycle_of(one)
    assert cycle is not None
    assert len(cycle.phase) == one.samples
    assert cycle.count == -(-10_000 // decimation)
    assert apart(one, cycle) < most


def test_a_period_that_comes_once_has_no_cycle() -> None:
    log = periodic(0, 2)
    mean = mean_period(log, reconstruct(log, HOW), 20.0)[1]
    assert mean is not None
    assert cycle_of(equations_of((mean,), Recipe(HOW, 20.0), nominal_columns(arm().robot))[0]) is None
    assert cycle_of(equations(periodic(0, 1))) is None
    assert cycle_of(equations(replace(log, period=None))) is None
    assert cycle_of([]) is None


@pytest.mark.parametrize("period", [0.01, 0.2, 7.3, 9.5])
def test_a_wrong_period_makes_no_cycle(period: float) -> None:
    """Of the 10 s of the motion: too few phases, or postures of one phase that have nothing in common."""
    assert cycle_of(equations(replace(periodic(0, 3), period=period))) is None


def test_a_joint_that_rests_hinders_no_cycle() -> None:
    """What it does is noise, and another each time."""
    log = periodic(0, 2)
    q = log.q.copy()
    q[:, 0] = 0.3 + 1e-5 * np.random.default_rng(0).standard_normal(len(q))
    assert cycle_of(equations(with_signal(log, q=q))) is not None

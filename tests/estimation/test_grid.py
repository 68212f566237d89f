"""Samples of a clock that wanders, steps or loses ticks are laid where they belong, and nothing is interpolated."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.estimation.grids import grids, lay_on, on_grid
from pipelines.estimation.state_estimation import design, smooth
from tests.estimation.chains import swing

T = 1e-3


def test_dropped_samples_leave_empty_places() -> None:
    keep = np.setdiff1d(np.arange(1000), [100, 500, 501])
    (grid,) = grids(np.asarray(keep * T), T)
    laid = lay_on(np.arange(1000.0)[keep, None], grid)
    assert grid.size == 1000
    assert np.flatnonzero(np.isnan(laid[:, 0])).tolist() == [100, 500, 501]
    assert np.array_equal(laid[keep, 0], keep.astype(float))


def test_gaps_steps_and_cuts_begin_a_new_grid() -> None:
    """T01, T04: time that steps back, more than ten missing samples, and a place the caller names."""
    t = np.concatenate([np.arange(100), np.arange(200, 300), np.arange(250, 350)]) * T
    assert [(g.first, g.last) for g in grids(t, T, np.array([150]))] == [(0, 100), (100, 150), (150, 200), (200, 300)]


def test_a_fast_clock_does_not_drift_off_the_grid() -> None:
    """A clock 0.04 % fast is 24 samples ahead after a minute; every sample keeps its own place, and the step is the clock's own."""
    (grid,) = grids(np.asarray(np.arange(60_000) * T * 1.0004), T)
    assert np.array_equal(grid.place, np.arange(60_000))
    assert grid.step == pytest.approx(1.0004 * T, rel=1e-12)


def test_jitter_holes_drift_and_a_slip_of_phase() -> None:
    """Lost samples leave holes, drift is followed, and after half a sample's slip every sample still has a place of its own."""
    t = np.arange(3000) * 1.0001e-3 + np.random.default_rng(2).uniform(-2e-5, 2e-5, 3000)
    t[2000:] += 0.5e-3
    keep = np.delete(np.arange(3000), [10, 11, 500])
    (grid,) = grids(t[keep], T)
    assert np.flatnonzero(np.isnan(lay_on(keep.astype(float), grid)))[:3].tolist() == [10, 11, 500]
    assert np.count_nonzero(np.diff(grid.place) <= 0) <= 1


def test_a_clock_that_is_none_is_refused() -> None:
    """T05: random times fall on each other's places."""
    with pytest.raises(InputRejected, match="T05"):
        grids(np.sort(np.random.default_rng(0).uniform(0.0, 1.0, 1000)), T)


def test_even_samples_are_left_alone() -> None:
    """On an even clock the grid changes no bit."""
    y, observer = swing(1000, 2, 1e-5), design(T, np.array([50.0, 500.0]), 1e-10 / 12)
    (grid,) = grids(np.asarray(np.arange(1000) * T), T)
    states, _ = on_grid(y, grid, T, lambda laid: (smooth(laid, observer).states, laid[None]))
    assert np.array_equal(states, smooth(y, observer).states)

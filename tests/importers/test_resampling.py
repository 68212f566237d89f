"""Uneven samples are put on an even grid without inventing a motion."""

from __future__ import annotations

import numpy as np

from pipelines.estimation.grids import grid, resample
from tests.importers.good import recording


def test_the_spline_follows_a_smooth_motion_between_uneven_samples() -> None:
    """Fourth order: halving the steps makes the error about sixteen times smaller."""
    rng = np.random.default_rng(3)
    errors = []
    for n in (200, 400):
        t = np.linspace(0.0, 2.0, n) + rng.uniform(-0.2, 0.2, n) * 2.0 / n
        at = grid(0.3, 1.7, 500.0)
        errors.append(np.abs(resample(t, np.sin(9.0 * t)[:, None], at)[:, 0] - np.sin(9.0 * at)).max())
    assert errors[0] < 1e-5
    assert errors[1] < errors[0] / 8.0


def test_resampling_on_the_samples_themselves_changes_nothing() -> None:
    t, q = recording().t, recording().signals["q"]
    for method in ("spline", "linear"):
        assert np.allclose(resample(t, q, t, method), q, rtol=0, atol=1e-15)  # type: ignore[arg-type]


def test_a_grid_has_every_sample_it_can() -> None:
    assert grid(0.0, 10.0, 400.0).size == 4001
    assert grid(0.0, 9.9999, 400.0)[-1] == 9.9975

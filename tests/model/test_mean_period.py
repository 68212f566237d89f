"""The mean motion of several periods is as near to the true motion as it says."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.model.mean_period import mean_period
from pipelines.model.motion import Reconstruction, reconstruct
from tests.model.estimation.experiments import motion_of, periodic


@pytest.mark.parametrize(("encoder", "gain"), [(3e-6, np.sqrt(5.0)), (3e-5, np.sqrt(5.0)), (0.0, 1.0)])
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

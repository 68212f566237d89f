"""What reconstruction does to accelerations: the longer chain of integrators, and the second pass of the smoother."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.estimation.motion import Reconstruction, reconstruct
from tests.estimation.experiments import motion_of
from tests.healthy import ENCODER, good_log, make_log, rest, with_signal


@pytest.mark.parametrize(("order", "expected"), [(3, 1.0 / 12.0), (4, 0.0)])
def test_a_held_jerk_makes_acceleration_too_large(order: int, expected: float) -> None:
    """The samples of a sinusoid explained by a jerk held over each sample: acceleration comes out 1 + (ωT)²/12 too large.

    The samples are exact and the observer is told to follow them, so that nothing else is left.
    """
    log, hz = good_log(), 10.0
    w = 2.0 * np.pi * hz
    swing = np.sin(w * log.t)[:, None] * np.ones(3)
    exact = replace(with_signal(log, q=swing), name="sinusoid")
    found = reconstruct(exact, Reconstruction(order=order, bandwidth=(300.0,))).motion.ddq[1000:-1000]
    truth = (-w**2 * swing)[1000:-1000]
    gain = np.sum(found * truth, axis=0) / np.sum(truth * truth, axis=0)
    np.testing.assert_allclose((gain - 1.0) / (w * 1e-3) ** 2, expected, atol=0.01)


def test_accelerations_are_not_too_small() -> None:
    """Ten excitations up to 6 Hz, as an encoder counts them: found against true acceleration has slope 1 within 3 standard
    errors, which are 1e-6. One pass of the smoother leaves 5e-6 to 7e-6 too little, which no number of samples averages out."""
    still, slopes = make_log(rest, duration=10.0), []
    for seed in range(10):
        truth = motion_of(seed)(still.t)
        found = reconstruct(with_signal(still, q=ENCODER * np.rint(truth.q / ENCODER)), Reconstruction()).motion
        inner = slice(500, -500)
        slopes.append(np.sum(found.ddq[inner] * truth.ddq[inner], axis=0) / np.sum(truth.ddq[inner] ** 2, axis=0) - 1.0)
    mean, error = np.mean(slopes, axis=0), np.std(slopes, axis=0, ddof=1) / np.sqrt(len(slopes))
    assert (np.abs(mean) < 3.0 * error).all()
    assert (error < 1.5e-6).all()

"""Why the default chain of integrators is one longer than the paper's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.model.motion import reconstruct
from pipelines.model.tuned import Reconstruction
from tests.healthy import good_log, with_signal


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

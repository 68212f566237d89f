"""The torques of a figure: low-passed as the fit saw them, and nothing hidden where a log is long."""

from __future__ import annotations

import numpy as np
from scipy import signal

from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.result import course, torques
from tests.estimation.experiments import arm, experiment
from tests.healthy import with_signal


def test_what_is_drawn_is_what_a_low_pass_leaves() -> None:
    """A hum of 150 Hz on the torque, which every so-manieth sample would turn into a slow swing, is gone; SciPy's filter agrees."""
    log = experiment(0)
    hum = 3.0 * np.sin(2.0 * np.pi * 150.0 * log.t)[:, None]
    log = with_signal(log, tau=log.tau + hum)
    found = reconstruct(log, Reconstruction())
    drawn = course(log, found, torques(arm(), log, found), 20.0)
    expected = signal.sosfiltfilt(signal.butter(4, 20.0, fs=1e3, output="sos"), log.tau, axis=0)
    at = np.round(drawn.t / 1e-3).astype(int)
    np.testing.assert_allclose(drawn.measured[50:-50], expected[at][50:-50], atol=1e-6)
    assert np.abs(drawn.left[50:-50]).max() < 0.5


def test_a_long_log_hides_no_spike() -> None:
    """Without a low-pass, ten thousand samples in six thousand points: the largest and the smallest are among them."""
    log = experiment(0)
    tau = log.tau.copy()
    tau[4321, 1] += 25.0
    found = reconstruct(log, Reconstruction())
    spiky = with_signal(log, tau=tau)
    drawn = course(spiky, found, torques(arm(), log, found), None)
    assert len(drawn.t) <= 6000
    np.testing.assert_allclose(np.nanmax(drawn.model, axis=0), torques(arm(), log, found).total.max(axis=0), rtol=1e-12)
    np.testing.assert_allclose(np.nanmax(drawn.measured, axis=0), found.good.log.tau.max(axis=0), rtol=1e-12)


def test_a_gap_is_a_gap_in_the_line() -> None:
    log = experiment(0)
    tau = log.tau.copy()
    tau[3000:3500, 2] = np.nan
    spoilt = with_signal(log, tau=tau)
    found = reconstruct(spoilt, Reconstruction())
    drawn = course(spoilt, found, torques(arm(), spoilt, found), 20.0)
    inside = (drawn.t > 3.05) & (drawn.t < 3.45)
    assert not np.isfinite(drawn.measured[inside, 2]).any()
    assert np.isfinite(drawn.measured[(drawn.t > 1.0) & (drawn.t < 2.0)]).all()

"""A drive that hunts shows as a line in the spectrum of what is left; noise, white or slow, and friction at reversals do not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter, welch

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.oscillating import oscillation
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden

AMPLITUDE, HERTZ = 0.05, 5.3  # [N m] at joint 2, with 10 mN m rms of white noise


def hunting(motion: Motion) -> Array:
    """Its rate is pulled by a tenth to and fro."""
    out = np.zeros_like(motion.q)
    out[:, 1] = AMPLITUDE * np.sin(2.0 * np.pi * HERTZ * motion.t + 2.0 * np.sin(2.0 * np.pi * 0.3 * motion.t))
    return out


def left_of(*logs: Any) -> tuple[Data, Array]:
    prepared = prepare(Logs(logs), DiagnosisSettings())
    _, fit = fit_nominal(prepared.data, prepared.columns)
    return prepared.data, fit.left


@pytest.fixture(scope="module")
def healthy() -> tuple[Data, Array]:
    return left_of(hidden(1), hidden(2))


def test_a_drive_that_hunts_is_told_with_its_rate_and_size() -> None:
    seen = oscillation(*left_of(hidden(1, hunting), hidden(2, hunting)))
    assert seen.stands[1] > 30.0
    assert (seen.stands[[0, 2]] < 5.0).all()
    assert seen.hertz[1] == pytest.approx(HERTZ, abs=0.2)
    assert seen.rms[1] == pytest.approx(AMPLITUDE / np.sqrt(2.0), rel=0.2)  # what the model takes up of it


def test_what_is_left_of_an_arm_in_order_has_no_line(healthy: tuple[Data, Array]) -> None:
    assert (oscillation(*healthy).stands < 5.0).all()


@pytest.mark.parametrize("pole", [0.0, 0.9, 0.99])
def test_noise_has_none_however_slow_it_is(healthy: tuple[Data, Array], pole: float) -> None:
    data, _ = healthy
    for seed in range(10):
        noise = lfilter([1.0], [1.0, -pole], np.random.default_rng([7, seed]).standard_normal(data.rows))
        assert (oscillation(data, noise).stands < 8.0).all()


def test_its_size_is_that_of_scipy_s_spectrum(healthy: tuple[Data, Array]) -> None:
    """Welch's (1967), summed over the line."""
    data, _ = healthy
    step = float(np.median(np.diff(data.logs[0].t)))
    x = np.sin(2.0 * np.pi * HERTZ * data.t) * (data.joint == 1)
    seen = oscillation(data, x)
    hertz, density = welch(x[(data.joint == 1) & (data.log_of == 0)], 1.0 / step, nperseg=round(2.5 / step))
    near = np.abs(hertz / HERTZ - 1.0) < 0.25
    assert seen.rms[1] == pytest.approx(np.sqrt(np.trapezoid(density[near], hertz[near])), rel=0.05)
    assert seen.rms[1] == pytest.approx(np.sqrt(0.5), rel=0.05)

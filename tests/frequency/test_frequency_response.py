"""Responses of a plant in a loop: which estimate is biased by what, and by how much."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.frequency.spectra import (
    FrequencyResponse,
    bands_below,
    closed_loop,
    indirect,
)
from tests.frequency.loops import Plant, T, closed_loop_record, controller, welch_responses

KP, KD = 400.0, 28.0
PLANT = Plant(((28.0, 0.07, 0.15), (85.0, 0.05, 0.8)))


def _record(disturbance: float, samples: int = 400_000) -> np.ndarray:
    rng = np.random.default_rng(5)
    v, d, n = (scale * rng.standard_normal(samples) for scale in (10.0, disturbance, 1e-7))
    return closed_loop_record(PLANT, v, d, n, KP, KD)


def _worst(found: FrequencyResponse, truth: np.ndarray) -> float:
    return float(np.median(np.abs(found.response / truth - 1.0)))


def test_a_strong_disturbance_spoils_the_direct_response_alone() -> None:
    """d three times v. r → q tends to P (Φv - conj(CP) Φd) / (Φv + |CP|² Φd), nearly -1/C, and its coherence looks fine:
    above 0.7 up to 8 Hz, more than half wrong everywhere. Φ_vq/Φ_vr stays within what it says of itself.
    """
    x = _record(30.0)
    direct = welch_responses((x,), 1.0 / T, 1000, 1, (2,)).of(0).within(2.0, 15.0)
    default = closed_loop(welch_responses((x,), 1.0 / T, 1000)).within(2.0, 15.0)
    truth, c = PLANT.response(direct.frequency), controller(direct.frequency, KP, KD)
    expected = truth * (1.0 - 9.0 * np.conj(c * truth)) / (1.0 + 9.0 * np.abs(c * truth) ** 2)
    np.testing.assert_allclose(direct.response, expected, rtol=0.06)
    assert (direct.within(2.0, 8.0).coherence > 0.7).all()
    assert (np.abs(direct.response / truth - 1.0) > 0.5).all()
    assert np.mean(np.abs(default.response - truth) ** 2 / default.variance) < 3.0
    assert _worst(default, truth) < 0.2 * _worst(direct, truth)


def test_without_a_disturbance_all_three_agree() -> None:
    """Direct, indirect with the sampled controller, and closed-loop are within 2 % of scipy's sampled plant."""
    x = _record(0.0)
    of_v = welch_responses((x,), 1.0 / T, 4000)
    c = controller(of_v.frequency, KP, KD)
    direct = welch_responses((x,), 1.0 / T, 4000, 1, (2,)).of(0)
    for found in (direct, indirect(of_v.of(0), c), closed_loop(of_v)):
        band = found.within(5.0, 150.0)
        assert _worst(band, PLANT.response(band.frequency)) < 0.02


def test_a_continuous_controller_in_the_indirect_method_costs_what_is_known() -> None:
    """8.8 % at 28 Hz and 25 % at 80 Hz for a double integrator at 1 kHz; the sampled one costs nothing."""
    frequency = np.array([28.0, 80.0])
    plant, c = Plant(()).response(frequency), controller(frequency, KP, KD)
    s = 1.0 / (1.0 + plant * c)
    none = np.zeros(2)
    sensitivity = FrequencyResponse(frequency, s, none, none + 1.0, 1.0, 1.0, 1.0)
    sampled = indirect(sensitivity, c).response
    continuous = indirect(sensitivity, KP + KD * 2j * np.pi * frequency).response
    np.testing.assert_allclose(sampled, plant, rtol=1e-12)
    np.testing.assert_allclose(np.abs(continuous / plant - 1.0), [0.088, 0.25], rtol=0.02)


@pytest.mark.parametrize("way", ["closed loop", "indirect"])
def test_variances_are_those_of_many_repetitions(way: str) -> None:
    """Mean of |error|² over 60 records, against the variance that each states."""
    rng = np.random.default_rng(6)
    ratios = []
    for _ in range(60):
        v, d, n = (scale * rng.standard_normal(8000) for scale in (10.0, 3.0, 1e-6))
        x = closed_loop_record(PLANT, v, d, n, KP, KD)
        of_v = welch_responses((x,), 1.0 / T, 500)
        found = closed_loop(of_v) if way == "closed loop" else indirect(of_v.of(0), controller(of_v.frequency, KP, KD))
        band = found.within(100.0, 250.0)  # smooth there: no leakage
        ratios.append(np.abs(band.response - PLANT.response(band.frequency)) ** 2 / band.variance)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)


def test_bands_of_low_coherence() -> None:
    """Stretches under the limit, with their ends; what is not known counts as low."""
    frequency = np.arange(1.0, 8.0)
    assert bands_below(frequency, np.array([0.1, 0.2, 0.9, 0.69, 0.7, np.nan, 0.6]), 0.7) == ((1.0, 2.0), (4.0, 4.0), (6.0, 7.0))
    assert bands_below(frequency, np.ones(7), 0.7) == ()

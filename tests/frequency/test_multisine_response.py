"""Multisines: noise and distortion told apart, and neither mistaken for the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.multisine import MultisineResponses, multisine_responses
from pipelines.frequency.spectra import closed_loop
from tests.frequency.loops import Plant, T, closed_loop_record

PERIOD = 2000  # samples
PLANT = Plant(((28.0, 0.05, 0.3),))


def _odd_lines() -> np.ndarray:
    """Odd harmonics, one in four of them left out."""
    lines = np.arange(3, 600, 2)
    return np.delete(lines, np.arange(2, len(lines), 4))


def _multisine(rng: np.random.Generator, lines: np.ndarray, periods: int) -> np.ndarray:
    spectrum = np.zeros(PERIOD // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    one = np.fft.irfft(spectrum, PERIOD)
    return np.resize(one / one.std(), periods * PERIOD)


def _filtered(seed: int, bend: tuple[float, float], noise: float, realisations: int = 4, periods: int = 6) -> MultisineResponses:
    """u → linear → z + bend₂ z² + bend₃ z³ + noise, from rest."""
    rng = np.random.default_rng(seed)
    records = []
    for _ in range(realisations):
        u = _multisine(rng, _odd_lines(), periods)
        z = signal.lfilter([0.3], [1.0, -0.7], u)
        y = z + bend[0] * z**2 + bend[1] * z**3
        records.append(np.stack([u, y + noise * rng.standard_normal(len(y))], axis=1))
    return multisine_responses(records, 1.0 / T, PERIOD, 0, (1,))


def _distortion(found: MultisineResponses, realisations: int = 4) -> np.ndarray:
    """Std of the response by nonlinear distortion in one realisation (lines,); 0 where noise explains all."""
    assert found.total is not None
    more = found.total.of(0).variance - found.noise.of(0).variance
    return np.sqrt(np.maximum(more, 0.0) * realisations)


def test_noise_alone_is_no_distortion() -> None:
    """The covariance between realisations is that between periods; detection lines hold noise; errors are as large as said."""
    ratios, shares, excess = [], [], []
    for seed in range(20):
        found = _filtered(seed, (0.0, 0.0), 0.05)
        one = found.noise.of(0)
        _, truth = signal.freqz([0.3], [1.0, -0.7], one.frequency, fs=1.0 / T)
        ratios.append(np.abs(one.response - truth) ** 2 / one.variance)
        assert found.total is not None
        assert found.detection is not None
        shares.append(np.mean(found.total.of(0).variance / one.variance))
        excess.append(np.mean(found.detection.power / found.detection.noise))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.12)
    assert np.mean(np.array(ratios) < 3.0) > 0.93
    assert np.mean(shares) == pytest.approx(1.0, abs=0.12)
    assert np.mean(excess) == pytest.approx(1.1, abs=0.15)  # a quotient with ten degrees of freedom below has this mean


@pytest.mark.parametrize(("bend", "odd"), [((0.1, 0.0), False), ((0.0, 0.1), True)])
def test_the_kind_of_distortion_is_seen(bend: tuple[float, float], odd: bool) -> None:
    """z² fills even lines and leaves odd ones alone; z³ fills odd ones that were left out, and shows between realisations."""
    found = _filtered(0, bend, 1e-3)
    assert found.detection is not None
    seen, is_odd = (found.detection.power > 10.0 * found.detection.noise)[:, 0], found.detection.odd
    assert seen[is_odd == odd].mean() > 0.8
    assert seen[is_odd != odd].mean() < 0.05
    share = np.median(_distortion(found) / np.sqrt(found.noise.of(0).variance))
    assert (share > 10.0) == odd


def test_distortion_is_as_large_as_the_spread_of_many_realisations() -> None:
    """The std that four realisations give of one, against that over forty others."""
    few, many = _filtered(1, (0.0, 0.1), 1e-3), [_filtered(s, (0.0, 0.1), 1e-3, realisations=1) for s in range(10, 50)]
    spread = np.std([one.noise.response[:, 0] for one in many], axis=0, ddof=1)
    assert np.median(_distortion(few) / spread) == pytest.approx(1.0, abs=0.25)


def test_the_start_from_rest_is_taken_off() -> None:
    """A resonance that rings for periods, without noise: the response is right to 1 % where a plain mean of periods is not."""
    rng = np.random.default_rng(4)
    w = 2.0 * np.pi * 28.0
    numerator, denominator, _ = signal.cont2discrete(([w * w], [1.0, 0.01 * w, w * w]), T)
    u = _multisine(rng, np.arange(3, 600), 6)
    y = signal.lfilter(numerator[0], denominator, u)
    found = multisine_responses((np.stack([u, y], axis=1),), 1.0 / T, PERIOD, 0, (1,)).noise.of(0)
    _, truth = signal.freqz(numerator[0], denominator, found.frequency, fs=1.0 / T)
    harmonics = np.rint(found.frequency * PERIOD * T).astype(int)
    plain = np.fft.rfft(y.reshape(6, PERIOD).mean(axis=0))[harmonics] / np.fft.rfft(u[:PERIOD])[harmonics]
    away = np.abs(found.frequency - 28.0) > 5.0
    ours = np.abs(found.response / truth - 1.0)[away].max()
    assert ours < 0.01
    assert ours < 0.1 * np.abs(plain / truth - 1.0)[away].max()


def test_in_a_loop_with_a_disturbance_and_two_stretches() -> None:
    """Φ_vq/Φ_vr of a multisine under slow and fast disturbances: errors as large as said, up to the first and last line."""
    ratios = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        v = 10.0 * _multisine(rng, np.arange(2, 500), 12)
        d = np.cumsum(rng.standard_normal(len(v)))
        d = 2.0 * d / d.std() + rng.standard_normal(len(v))
        x = closed_loop_record(PLANT, v, d, 1e-6 * rng.standard_normal(len(v)), 400.0, 28.0)
        found = closed_loop(multisine_responses((x[:6 * PERIOD], x[6 * PERIOD:]), 1.0 / T, PERIOD).noise)
        ratios.append(np.abs(found.response - PLANT.response(found.frequency)) ** 2 / found.variance)
    assert np.mean(ratios) == pytest.approx(1.1, abs=0.15)
    assert np.mean(np.array(ratios) < 3.0) > 0.92


def test_what_cannot_be_averaged_is_said() -> None:
    """One period, no source, missing samples, realisations of other lines."""
    rng = np.random.default_rng(0)
    x = np.stack([_multisine(rng, np.arange(3, 100), 4), rng.standard_normal(4 * PERIOD)], axis=1)
    other = np.stack([_multisine(rng, np.arange(3, 90), 4), x[:, 1]], axis=1)
    for records, code in (((x[:PERIOD + 5],), "T07"), ((), "T07"), ((x * np.array([0.0, 1.0]),), "D09"),
                          ((np.where(x > 3.0, np.nan, x),), "D01")):
        with pytest.raises(InputRejected) as refused:
            multisine_responses(records, 1.0 / T, PERIOD, 0, (1,))
        assert refused.value.code == f"RRID-{code}"
    with pytest.raises(UsageError):
        multisine_responses((x, other), 1.0 / T, PERIOD, 0, (1,))

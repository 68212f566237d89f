"""Eq. (22): derivatives, start from rest, the adjoint, and bounds between samples."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.simulation.fourier_series import (
    FourierSeries,
    adjoint,
    degree_of,
    periodic_peak,
    synthesise,
)


@pytest.fixture
def series() -> FourierSeries:
    rng = np.random.default_rng(3)
    return FourierSeries(10.0, rng.normal(size=3), *rng.normal(size=(2, 3, 100)))


def test_the_transform_equals_the_sum_of_sines(series: FourierSeries) -> None:
    """Samples by Fourier transform are eq. (22), written out harmonic by harmonic with Δf = 0.1 Hz."""
    t = np.arange(1000) * 0.01
    q, dq, ddq = (np.tile(x[:, None], (1, 1000)) for x in (series.offset, np.zeros(3), np.zeros(3)))
    for j in range(1, 101):
        w, a, b = 2 * np.pi * 0.1 * j, series.cosine[:, j - 1:j], series.sine[:, j - 1:j]
        q += a / w * np.sin(w * t) - b / w * np.cos(w * t)
        dq += a * np.cos(w * t) + b * np.sin(w * t)
        ddq += w * (b * np.cos(w * t) - a * np.sin(w * t))
    for mine, exact in zip(series.samples(1000), (q, dq, ddq), strict=True):
        np.testing.assert_allclose(mine, exact, atol=1e-9 * np.abs(exact).max())
    for mine, exact in zip(series.at(t), (q, dq, ddq), strict=True):
        np.testing.assert_allclose(mine, exact, atol=1e-9 * np.abs(exact).max())


def test_the_derivatives_are_exact(series: FourierSeries) -> None:
    """Speed and acceleration are the derivatives of position, by a complex step."""
    t = np.linspace(0.0, 10.0, 57)
    h = 1e-20
    w, z = series.omega[:, None], t + 1j * h
    q = series.offset[:, None] + series.cosine / w.T @ np.sin(w * z) - series.sine / w.T @ np.cos(w * z)
    np.testing.assert_allclose(q.imag / h, series.at(t)[1], atol=1e-10)


def test_start_from_rest_needs_two_sums(series: FourierSeries) -> None:
    """With Σ a = 0 and Σ j b = 0 it starts with neither speed nor acceleration (verified.md, section 6)."""
    j = np.arange(1, 101)
    a = series.cosine - series.cosine.mean(axis=1, keepdims=True)
    b = series.sine - np.outer(series.sine @ j, j) / (j @ j)
    start = FourierSeries(10.0, series.offset, a, b).at(np.zeros(1))[:, :, 0]
    np.testing.assert_allclose(start[0], series.offset - (b / series.omega).sum(axis=1), atol=1e-12)
    np.testing.assert_allclose(start[1:], 0.0, atol=1e-10)


def test_the_adjoint_is_the_transpose(series: FourierSeries) -> None:
    """<y, F x> = <Fᵀ y, x> for any y."""
    y = np.random.default_rng(4).normal(size=(3, 3, 240))
    offset, cosine, sine = adjoint(y, series.omega)
    there = float((y * synthesise(series.offset, series.cosine, series.sine, series.omega, 240)).sum())
    back = float((offset * series.offset).sum() + (cosine * series.cosine).sum() + (sine * series.sine).sum())
    assert there == pytest.approx(back, rel=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_no_point_between_samples_exceeds_the_bound(seed: int) -> None:
    """Ten samples a shortest wave bound what 400 of them show, and not by more than the factor says."""
    rng = np.random.default_rng(seed)
    one = FourierSeries(10.0, rng.normal(size=2), *rng.normal(size=(2, 2, 40)))
    low, high = periodic_peak(one.samples(400))
    fine = one.samples(16000)
    assert (fine.min(axis=2) >= low - 1e-12).all()
    assert (fine.max(axis=2) <= high + 1e-12).all()
    swing = 0.5 * (fine.max(axis=2) - fine.min(axis=2))
    assert (high - fine.max(axis=2) <= 0.11 * swing).all()  # 1/cos(π 40/400) = 1.0515, on both sides


def test_the_degree_of_a_product_is_the_sum() -> None:
    """sin 7x · cos 5x has degree 12, and exp(sin x) one beyond which next to nothing is left."""
    x = 2 * np.pi * np.arange(200) / 200
    degree, tail = degree_of(np.stack([np.sin(7 * x) * np.cos(5 * x), np.exp(np.sin(x))]))
    assert degree[0] == 12
    assert 5 < degree[1] < 20
    assert (tail < 1e-8).all()

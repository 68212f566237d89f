"""Local polynomials: exact on polynomials, known noise, same as SciPy."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.filters import apply_kernel, half_width, kernel, local_polynomial


@pytest.mark.parametrize("half", [3, 12, 60])
def test_polynomials_up_to_the_order_are_exact(half: int) -> None:
    """A quartic and both its derivatives are reproduced to rounding."""
    ts = 0.01
    t = np.arange(400) * ts
    p = np.polynomial.Polynomial([1e4, -2.0, 0.5, 0.3, -0.2])
    x = np.stack([p(t), -3.0 * p(t)], axis=-1)
    value, first, second = local_polynomial(x, ts, half)
    inner = slice(half, -half)
    for found, exact, tolerance in ((value, p, 1e-9), (first, p.deriv(), 1e-8), (second, p.deriv(2), 1e-4)):
        np.testing.assert_allclose(found[:, 0], exact(t)[inner], atol=tolerance * (1 + 30 / half))
        np.testing.assert_allclose(found[:, 1], -3.0 * exact(t)[inner], atol=3 * tolerance * (1 + 30 / half))


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_weights_are_those_of_scipy(derivative: int) -> None:
    from scipy.signal import savgol_coeffs

    np.testing.assert_allclose(kernel(20, 4, derivative), savgol_coeffs(41, 4, derivative, use="dot"), atol=1e-13)


def test_the_convolution_is_the_sum_it_says() -> None:
    rng = np.random.default_rng(0)
    x, w = rng.standard_normal((300, 2)) + 50.0, rng.standard_normal(11)
    direct = np.stack([x[i:i + 11].T @ w for i in range(290)])
    np.testing.assert_allclose(apply_kernel(x, w), direct, atol=1e-12)


@pytest.mark.parametrize(("rate", "cutoff"), [(1000.0, 20.0), (5000.0, 20.0), (500.0, 10.0)])
def test_the_width_gives_the_cutoff(rate: float, cutoff: float) -> None:
    """At the cutoff a sine comes out at 1/√2, within Schafer's own 10 %; a fifth below it at 99 %."""
    half = half_width(1 / rate, cutoff)
    w = kernel(half, 4, 0)
    k = np.arange(-half, half + 1)

    def gain(f: float) -> float:
        return float(w @ np.cos(2 * np.pi * f / rate * k))

    assert gain(cutoff) == pytest.approx(np.sqrt(0.5), rel=0.12)
    assert gain(0.2 * cutoff) > 0.999


def test_noise_falls_as_the_weights_say() -> None:
    noise = np.random.default_rng(1).standard_normal((200_000, 1))
    for derivative, values in enumerate(local_polynomial(noise, 1.0, 25)):
        assert np.std(values) == pytest.approx(np.linalg.norm(kernel(25, 4, derivative)), rel=0.03)

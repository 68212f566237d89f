"""What several tests of observers share: a chain driven by jerk, and a smoother in 50 digits that shares no code with ours."""

from __future__ import annotations

from decimal import Decimal, localcontext
from math import factorial

import numpy as np


def walk(rng: np.random.Generator, order: int, sigma: float, sample_time: float, samples: int) -> np.ndarray:
    """States (samples, order) of a chain at rest whose highest derivative is white, held, of standard deviation `sigma`."""
    e = [[sample_time ** (j - i) / factorial(j - i) if j >= i else 0.0 for j in range(order)] for i in range(order)]
    gamma = np.array([sample_time ** (order - i) / factorial(order - i) for i in range(order)])
    x, out = np.zeros(order), np.empty((samples, order))
    for k, xi in enumerate(rng.standard_normal(samples) * sigma):
        out[k] = x
        x = np.array(e) @ x + gamma * xi
    return out


def swing(samples: int, joints: int, step: float, sample_time: float = 1e-3) -> np.ndarray:
    """Measured positions (samples, joints) of sines, rounded to the steps of an encoder."""
    t = np.arange(samples) * sample_time
    q = np.stack([0.5 + np.sin(2 * np.pi * (1 + j) * t + j) for j in range(joints)], axis=1)
    return np.round(q / step) * step


def assert_near(found: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """Every column within `tolerance` of the largest value that it should have."""
    largest = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(found / largest, expected / largest, rtol=0, atol=tolerance)


def with_gaps(y: np.ndarray) -> np.ndarray:
    """Every kind of gap: a block, neighbours one sample apart, the first sample, the last ones; other samples per joint."""
    y = y.copy()
    for joint, missing in ((0, [*range(500, 520), 530, 532]), (1, [0, 535, *range(900, 905)]), (2, [-3, -2, -1])):
        y[missing, joint] = np.nan
    return y


def _inverse(m: np.ndarray) -> np.ndarray:
    """Gauss-Jordan with pivoting on objects."""
    n = len(m)
    a = np.concatenate([m, np.array([[Decimal(int(i == j)) for j in range(n)] for i in range(n)], dtype=object)], axis=1)
    for i in range(n):
        p = i + int(np.argmax([abs(v) for v in a[i:, i]]))
        a[[i, p]] = a[[p, i]]
        a[i] = a[i] / a[i, i]
        for r in range(n):
            if r != i:
                a[r] = a[r] - a[i] * a[r, i]
    return a[:, n:]


def exact_smoother(y: np.ndarray, sample_time: float, sigma: float, variance: float, mean: np.ndarray,
                   covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Filtered and smoothed states and standard deviations of one channel, NaN missing, in 50 digits by the textbook.

    Kalman 1960; Rauch, Tung & Striebel 1965.
    """
    n = len(mean)
    with localcontext() as context:
        context.prec = 50
        big = np.vectorize(lambda v: Decimal(float(v)), otypes=[object])
        t = Decimal(sample_time)
        e = np.array([[t ** (j - i) / factorial(j - i) if j >= i else Decimal(0) for j in range(n)] for i in range(n)],
                     dtype=object)
        gamma = np.array([t ** (n - i) / factorial(n - i) for i in range(n)], dtype=object) * Decimal(sigma)
        q, r = gamma[:, None] * gamma[None, :], Decimal(variance)
        x, p = big(mean), big(covariance)
        after, before = [], []
        for value in y:
            before.append((x, p))
            if np.isfinite(value):
                k = p[:, 0] / (p[0, 0] + r)
                x, p = x + k * (Decimal(float(value)) - x[0]), p - k[:, None] * p[0][None, :]
            after.append((x, p))
            x, p = e @ x, e @ p @ e.T + q
        smooth = [after[-1]]
        for k in range(len(y) - 2, -1, -1):
            gain = after[k][1] @ e.T @ _inverse(before[k + 1][1])
            smooth.append((after[k][0] + gain @ (smooth[-1][0] - before[k + 1][0]),
                           after[k][1] + gain @ (smooth[-1][1] - before[k + 1][1]) @ gain.T))
        means = [np.array([s[0] for s in states], dtype=float) for states in (after, smooth[::-1])]
        stds = [np.array([[s[1][i, i].sqrt() for i in range(n)] for s in states], dtype=float) for states in (after, smooth[::-1])]
    return means[0], stds[0], means[1], stds[1]

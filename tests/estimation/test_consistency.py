"""Whether bodies exist that explain an estimate, against Clarabel's semidefinite programme and against bodies that do."""

from __future__ import annotations

import clarabel
import numpy as np
import pytest
from scipy import sparse

from pipelines.estimation.consistency import physical_consistency, pseudo_inertia
from pipelines.io.log import Array

# Three bodies on a line whose torques show a few combinations: what a base set looks like, without an arm.
ONE = np.eye(10)


def bodies(rng: np.random.Generator, count: int) -> Array:
    """Standard parameters (count, 10) of clouds of eight point masses, by summing over the points."""
    out = []
    for _ in range(count):
        m, (x, y, z) = rng.uniform(0.1, 1.0, 8), rng.uniform(-0.4, 0.4, (3, 8))
        out.append([m.sum(), m @ x, m @ y, m @ z, m @ (y**2 + z**2), m @ (x**2 + z**2), m @ (x**2 + y**2), m @ (x * y),
                    m @ (x * z), m @ (y * z)])
    return np.array(out)


def combination(rng: np.random.Generator, count: int, rows: int) -> Array:
    return rng.standard_normal((rows, 10 * count))


def by_clarabel(beta: Array, covariance: Array, combine: Array) -> float:
    """The smallest distance in standard deviations, by an interior-point conic solver (Sousa & Cortesão 2014)."""
    w = np.linalg.cholesky(np.linalg.inv(covariance)).T
    a, b = w @ combine, w @ beta
    count = combine.shape[1] // 10
    unit = np.stack([pseudo_inertia(row[None])[0] for row in ONE], axis=2)
    rows = np.zeros((10 * count, 10 * count))
    for k in range(count):
        for r, (i, j) in enumerate(zip(*np.tril_indices(4), strict=True)):
            rows[10 * k + r, 10 * k:10 * k + 10] = -unit[i, j] * (1.0 if i == j else np.sqrt(2.0))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    found = clarabel.DefaultSolver(sparse.csc_matrix(np.triu(a.T @ a)), -a.T @ b, sparse.csc_matrix(rows), np.zeros(10 * count),
                                   [clarabel.PSDTriangleConeT(4)] * count, settings).solve()
    assert "Solved" in str(found.status)
    return float(np.linalg.norm(a @ np.array(found.x) - b))


def test_pseudo_inertia_is_the_second_moment_of_the_mass() -> None:
    """J = Σ m [r; 1][r; 1]ᵀ over points."""
    m, r = np.array([0.4, 1.1]), np.array([[0.1, -0.3, 0.2], [0.5, 0.2, -0.1]])
    x, y, z = r.T
    phi = [m.sum(), m @ x, m @ y, m @ z, m @ (y**2 + z**2), m @ (x**2 + z**2), m @ (x**2 + y**2), m @ (x * y), m @ (x * z),
           m @ (y * z)]
    homogeneous = np.column_stack([r, np.ones(2)])
    np.testing.assert_allclose(pseudo_inertia(np.array([phi]))[0], (homogeneous.T * m) @ homogeneous, atol=1e-15)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sigma", [1e-5, 1e-2])
def test_real_bodies_are_consistent(seed: int, sigma: float) -> None:
    """What true bodies give, with noise of the stated size, is consistent, and bodies are shown that have it."""
    rng = np.random.default_rng(seed)
    combine, truth = combination(rng, 3, 15), bodies(rng, 3)
    beta = combine @ truth.ravel() + sigma * rng.standard_normal(15)
    found = physical_consistency(beta, sigma**2 * np.eye(15), combine)
    assert found.consistent
    assert found.violating == ()
    assert np.linalg.eigvalsh(pseudo_inertia(found.parameters)).min() > 0.0
    np.testing.assert_allclose(combine @ found.parameters.ravel(), found.nearest, rtol=1e-9)
    assert np.linalg.norm(found.nearest - beta) == pytest.approx(found.distance * sigma, rel=1e-3, abs=sigma)


@pytest.mark.parametrize("seed", range(8))
def test_distance_is_that_of_a_conic_solver(seed: int) -> None:
    """For impossible estimates the distance to the possible is Clarabel's, for covariances of any shape."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    combine, truth = combination(rng, count, 10 * count), bodies(rng, count)
    truth[rng.integers(count), rng.integers(4, 7)] -= rng.uniform(0.5, 3.0)  # a moment of inertia below zero
    beta = combine @ truth.ravel()
    root = rng.standard_normal((len(beta), len(beta))) * rng.uniform(0.01, 0.3, len(beta))
    covariance = root @ root.T + 1e-6 * np.eye(len(beta))
    found = physical_consistency(beta, covariance, combine)
    assert found.distance == pytest.approx(by_clarabel(beta, covariance, combine), rel=2e-3, abs=0.02)


@pytest.mark.parametrize("victim", [0, 1, 2])
def test_the_impossible_body_is_named(victim: int) -> None:
    """A moment of inertia that no mass can have is found, and the body it belongs to."""
    rng = np.random.default_rng(victim)
    truth = bodies(rng, 3)
    truth[victim, 4] = truth[victim, 5] + truth[victim, 6] + 0.05  # the triangle inequality broken
    combine = np.eye(30)[[k for k in range(30) if k % 10 not in (0, 3)]]  # masses and one moment are not seen
    beta = combine @ truth.ravel()
    found = physical_consistency(beta, 1e-6 * np.eye(len(beta)), combine)
    assert not found.consistent
    assert found.violating == (victim,)
    assert found.distance > 20.0


def test_what_is_uncertain_is_not_impossible() -> None:
    """The same negative moment is no contradiction where its std, or its being undetermined, allows for it."""
    rng = np.random.default_rng(0)
    truth = bodies(rng, 2)
    beta = truth.ravel().copy()
    beta[4] = -0.05
    std = np.full(20, 1e-3)
    assert not physical_consistency(beta, np.diag(std**2), np.eye(20)).consistent
    for unsure in (10.0, np.inf):
        std[4] = unsure
        assert physical_consistency(beta, np.diag(std**2), np.eye(20)).consistent

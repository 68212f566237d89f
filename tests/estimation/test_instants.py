"""When samples were taken: uneven sampling, noisy stamps, and both, identified from the positions."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.grids import average_held, instants

STEP, SAMPLES = 2e-3, 6000


def motion(t: np.ndarray) -> np.ndarray:
    """Two joints, an encoder of 1e-5 rad."""
    q = 0.4 * np.sin(np.multiply.outer(t, [3.1, 4.7])) + 0.1 * np.cos(np.multiply.outer(t, [11.0, 7.3]))
    return np.asarray(1e-5 * np.rint(q / 1e-5))


@pytest.mark.parametrize(("sampling", "stamps"), [(0.15, 0.0), (0.0, 0.15), (0.1, 0.1), (0.15, 0.05)])
def test_jitter_of_sampling_is_told_from_noise_of_stamps(sampling: float, stamps: float) -> None:
    """The share is var a / (var a + var b), and the instants are as near to the true ones as that allows."""
    rng = np.random.default_rng(5)
    a, b = (size * STEP * np.clip(rng.standard_normal(SAMPLES), -2.3, 2.3) for size in (sampling, stamps))
    taken = np.arange(SAMPLES) * STEP + a
    t, share = instants(taken + b, motion(taken), STEP)
    assert share == pytest.approx(sampling**2 / (sampling**2 + stamps**2), abs=0.03)
    remains = sampling * stamps / np.hypot(sampling, stamps) * STEP
    assert np.std(t - taken) < 1.1 * remains + 0.02 * STEP


def test_lost_samples_do_not_move_the_clock() -> None:
    """Noisy stamps of an even clock that loses one sample in fifty: the ticks are those of the clock."""
    rng = np.random.default_rng(6)
    kept = np.delete(np.arange(SAMPLES), rng.choice(SAMPLES - 200, SAMPLES // 50, replace=False) + 100)
    noise = 0.1 * np.clip(rng.standard_normal(kept.size), -2.3, 2.3)
    t, share = instants((kept + noise) * STEP, motion(kept * STEP), STEP)
    assert share < 0.05
    assert np.std(t - kept * STEP) < 0.02 * STEP


def test_a_clock_that_walks_is_believed() -> None:
    """A loop that sleeps between samples has no even ticks: its stamps are the instants."""
    t = np.cumsum(STEP * np.random.default_rng(7).uniform(0.8, 1.4, SAMPLES))
    found, _ = instants(t, motion(t), STEP)
    assert np.abs(found - t).max() < 1e-3 * STEP


def test_a_held_command_keeps_its_impulse() -> None:
    """The averages over even steps add up to the integral of the command over the uneven ones."""
    rng = np.random.default_rng(8)
    t = (np.arange(200) + rng.uniform(-0.3, 0.3, 200)) * STEP
    u = rng.standard_normal((200, 2))
    at = t[0] + STEP * np.arange(150)
    hold = np.minimum(np.append(t[1:], np.inf), at[-1] + STEP) - t
    np.testing.assert_allclose(STEP * average_held(t, u, at, STEP).sum(axis=0), np.maximum(hold, 0.0) @ u, rtol=1e-9)

"""Blocks held out in turn are judged by what they had no part in, in memory that does not grow."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
from scipy import signal

from pipelines.estimation.least_squares import Block, by_blocks
from pipelines.io.log import Array
from tests.estimation.problems import CHANNELS, Problem, problem, white
from tests.seeds import rarely

SAMPLES, BLOCKS, GUARD = 1500, 10, 7


def _by_hand(one: Problem, y: Array) -> tuple[Array, Array]:
    """Each block by `lstsq` on all equations farther than the guard, channels weighted by their residual until it settles."""
    betas, rss = [], np.zeros(CHANNELS)
    for held in np.split(np.arange(SAMPLES), BLOCKS):
        rest = np.delete(np.arange(SAMPLES), np.arange(max(0, held[0] - GUARD), min(SAMPLES, held[-1] + 1 + GUARD)))
        sigma = np.ones(CHANNELS)
        for _ in range(30):
            table = (one.Y[rest] / sigma[:, None]).reshape(-1, one.Y.shape[2])
            beta = np.linalg.lstsq(table, (y[rest] / sigma).ravel(), rcond=None)[0]
            weighted = one.Y[rest] / sigma[:, None]
            hat = np.einsum("sjk,kl,sjl->j", weighted, np.linalg.inv(table.T @ table), weighted)
            sigma = np.sqrt(np.square(y[rest] - one.Y[rest] @ beta).sum(axis=0) / (len(rest) - hat))
        betas.append(beta)
        rss += np.square(y[held] - one.Y[held] @ beta).sum(axis=0)
    return np.array(betas), rss


@pytest.mark.parametrize("size", [pytest.param(SAMPLES, marks=pytest.mark.slow), 211])
@pytest.mark.parametrize("triangles", [*rarely(False), True])
def test_each_block_is_judged_by_the_rest_alone(triangles: bool, size: int) -> None:
    """Parameters and weights come from the rest beyond the guard, however the equations arrive."""
    one = problem(1, SAMPLES)
    y = one.clean + white(np.random.default_rng(1), SAMPLES)
    found = by_blocks(one.blocks(y, size), SAMPLES, BLOCKS, GUARD, triangles=triangles)
    _, rss = _by_hand(one, y)
    np.testing.assert_allclose(found.rms**2 * SAMPLES, rss, rtol=1e-5)
    np.testing.assert_allclose(found.signal_rms**2 * SAMPLES, np.square(y).sum(axis=0), rtol=1e-12)
    assert found.relative_error == pytest.approx(np.sqrt(rss.sum() / np.square(y).sum()), rel=1e-5)


def test_triangles_keep_what_normal_equations_lose() -> None:
    """Two columns that differ by 1e-8: without noise the rest explains each block to rounding, by QR alone."""
    one = problem(2, SAMPLES)
    near = one.Y.copy()
    near[:, :, 5] = near[:, :, 4] + 1e-8 * near[:, :, 5]
    alike = Problem(near, one.beta)
    relative = [by_blocks(alike.blocks(alike.clean), SAMPLES, BLOCKS, 0, triangles=by_qr).relative_error
                for by_qr in (True, False)]
    assert relative[0] < 1e-12 < relative[1]


def test_without_a_guard_a_block_knows_its_neighbours_noise() -> None:
    """Noise with a memory of 20 equations: what is held out cannot be explained better than its noise is large.

    Over 2 experiments, short blocks seem to be explained better than that unless their neighbours stand aside.
    """
    seen = {0: np.zeros(2), 60: np.zeros(2)}
    noise = np.zeros(2)
    for seed in range(2):
        rng = np.random.default_rng(seed)

        def remembering(columns: int, rng: np.random.Generator = rng) -> Array:
            return np.asarray(signal.lfilter([1.0], [1.0, -0.95], rng.standard_normal((1700, columns)), axis=0)[500:])

        Y, e = remembering(24).reshape(1200, 2, 12), remembering(2) * [1.0, 0.3]
        noise += np.square(e).sum(axis=0)
        for guard in seen:
            seen[guard] += by_blocks([Block.of(Y, e)], 1200, 120, guard).rms ** 2 * 1200
    assert seen[0][1] < 0.97 * noise[1]
    assert np.all(seen[60] > noise)


class _Endless:
    """As many equations as asked for, made block by block."""

    def __init__(self, blocks: int) -> None:
        self.blocks, self.one = blocks, problem(4, 1000)

    def __iter__(self) -> Iterator[Block]:
        for k in range(self.blocks):
            yield Block.of(self.one.Y, self.one.clean + white(np.random.default_rng(k), 1000))


@pytest.mark.parametrize("triangles", [False, True])
def test_memory_does_not_grow(triangles: bool) -> None:
    """No more than 2 MB beyond one block, at 20,000 and at 100,000 equations."""
    for blocks in (20, 100):
        equations = _Endless(blocks)
        tracemalloc.start()
        by_blocks(equations, 1000 * blocks, BLOCKS, GUARD, triangles=triangles)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 2e6, (blocks, peak)

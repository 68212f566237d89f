"""Made-up equations with known parameters: smooth columns, as motion makes them, and noise of several kinds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from pipelines.estimation.least_squares import Block
from pipelines.io.log import Array

RATE = 500.0
CHANNELS, WIDTH = 3, 13
SIGMA = np.array([0.4, 0.1, 0.02])


@dataclass(frozen=True, eq=False)
class Problem:
    Y: Array  # (samples, channels, width)
    beta: Array

    @property
    def clean(self) -> Array:
        return self.Y @ self.beta

    def blocks(self, y: Array, size: int | None = None) -> list[Block]:
        size = size or len(y)
        return [Block.of(self.Y[k:k + size], y[k:k + size]) for k in range(0, len(y), size)]


def problem(seed: int = 0, samples: int = 5000, width: int = WIDTH, harmonics: int = 60) -> Problem:
    """Ten seconds of columns made of harmonics of 0.1 Hz up to 6 Hz; the last three are one channel's own."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) / RATE
    basis = np.concatenate([np.cos(0.2 * np.pi * np.outer(np.arange(harmonics), t)),
                            np.sin(0.2 * np.pi * np.outer(np.arange(1, harmonics), t))])
    mix = rng.standard_normal((CHANNELS, width, len(basis)))
    Y = np.ascontiguousarray(mix @ basis) / np.sqrt(len(basis) / 2)
    for j in range(CHANNELS):
        Y[j, width - 3:] *= (np.arange(3) == j)[:, None]
    Y[0, :2] = 0.0  # two columns that the first channel does not feel
    return Problem(Y.transpose(2, 0, 1), rng.standard_normal(width))


def white(rng: np.random.Generator, samples: int) -> Array:
    return rng.standard_normal((samples, CHANNELS)) * SIGMA


def autoregressive(rng: np.random.Generator, samples: int, memory: float = 0.95) -> Array:
    """AR(1): a memory of 20 samples."""
    raw = rng.standard_normal((samples + 500, CHANNELS))
    return np.asarray(signal.lfilter([1.0], [1.0, -memory], raw, axis=0)[500:]) * SIGMA


def correlated(rng: np.random.Generator, samples: int) -> Array:
    """What disturbs one channel disturbs the others a little later."""
    raw = rng.standard_normal((samples + 2, 1)) * np.ones(CHANNELS)
    return np.stack([raw[2 - j:samples + 2 - j, j] for j in range(CHANNELS)], axis=1) * SIGMA + 0.3 * white(rng, samples)


def low_passed(values: Array, every: int, cutoff_hz: float = 20.0) -> Array:
    """Filtered forwards and backwards and decimated, as torque and regressor alike are before a fit."""
    sos = signal.butter(4, cutoff_hz, fs=RATE, output="sos")
    return np.asarray(signal.sosfiltfilt(sos, values, axis=0))[::every]

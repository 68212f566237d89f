"""A designed motion as a robot executes it: run-in, periods, run-out, sampled at any rate.

A motion that begins at rest needs no run-in. Any other is reached by a polynomial of fifth order from a posture at rest, and
left by its mirror: position, speed and acceleration are continuous all the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.signal.fourier import FourierSeries

__all__ = ["Trajectory", "quintic"]


def quintic(start: Array, end: Array, duration: float) -> Array:
    """Coefficients (6, joints), of s⁰ … s⁵ with s = t/duration, between states (3, joints) of position, speed, acceleration."""
    scale = np.array([1.0, duration, duration**2])[:, None]
    p0, v0, a0 = start * scale
    p1, v1, a1 = end * scale
    gap, dv, da = p1 - p0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
    return np.stack([p0, v0, 0.5 * a0, 10.0 * gap - 4.0 * dv + 0.5 * da, -15.0 * gap + 7.0 * dv - da,
                     6.0 * gap - 3.0 * dv + 0.5 * da])


def _along(coefficients: Array, s: Array, duration: float) -> Array:
    """Position, speed, acceleration (3, joints, samples) of a polynomial at s = t/duration."""
    powers = s[None] ** np.arange(6)[:, None]
    k = np.arange(6.0)
    first, second = coefficients[1:] * k[1:, None], coefficients[2:] * (k[2:] * k[1:-1])[:, None]
    return np.stack([coefficients.T @ powers, first.T @ powers[:5] / duration, second.T @ powers[:4] / duration**2])


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Run-in, whole periods of a series, run-out."""

    series: FourierSeries
    periods: int
    run_in: float = 0.0  # [s]; the run-out is as long
    rest: Array | None = None  # (joints,) [rad] where a run-in begins, None: the series is at rest itself
    end: Array | None = None  # (joints,) [rad] where the run-out ends

    @property
    def duration(self) -> float:
        return 2.0 * self.run_in + self.periods * self.series.period

    def at(self, t: Array) -> Array:
        """q, dq, ddq (3, joints, samples) at times t (samples,) from the start [s]; beyond the end it rests there."""
        out = np.empty((3, len(self.series.offset), len(t)))
        inside = t - self.run_in
        length = self.periods * self.series.period
        before, behind = inside < 0.0, inside > length * (1.0 + 1e-12)
        run = ~(before | behind)
        out[:, :, run] = self.series.at(np.mod(inside[run], self.series.period))
        state = self.series.at(np.zeros(1))[:, :, 0]
        if self.rest is not None and self.end is not None and self.run_in > 0.0:
            into = quintic(_still(self.rest), state, self.run_in)
            away = quintic(state, _still(self.end), self.run_in)
            out[:, :, before] = _along(into, 1.0 + inside[before] / self.run_in, self.run_in)
            out[:, :, behind] = _along(away, np.minimum((inside[behind] - length) / self.run_in, 1.0), self.run_in)
        else:
            out[:, :, before | behind] = _still(state[0])[:, :, None]
        return out

    def sampled(self, sample_time: float) -> tuple[Array, Array]:
        """Times (samples,) from 0 to the end, and q, dq, ddq (3, joints, samples)."""
        t = np.arange(round(self.duration / sample_time) + 1, dtype=np.float64) * sample_time
        return t, self.at(t)


def _still(posture: Array) -> Array:
    return np.stack([posture, np.zeros_like(posture), np.zeros_like(posture)])

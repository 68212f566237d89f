"""Describe motions as Fourier series, at rest at both ends or reached by a run-in.

A point x of `MotionSpace` holds, for every joint, [q0, a_1 … a_H, b_1 … b_H] of Kostić et al.
2004, eq. (22), each divided by the speed the joint may have over √(1 + (f_j / 0.6 Hz)²): a step in
x is about as much torque at every frequency. Start and end at rest at home are

    Σ a_j = 0,    Σ w_j b_j = 0,    q0 - Σ b_j/w_j = home
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array
from pipelines.errors import UsageError
from pipelines.excitation.config import CONFIG
from pipelines.simulation import fourier_series as fourier

__all__ = ["Harmonics", "MotionSpace", "Trajectory", "plan_harmonics", "quintics"]


@dataclass(frozen=True, eq=False)
class Harmonics:
    """The harmonics of a period, joint by joint."""

    period: float  # [s]
    used: npt.NDArray[np.bool_]  # (joints, harmonics)

    @property
    def omega(self) -> Array:
        return np.asarray(2.0 * np.pi / self.period * np.arange(1, self.used.shape[1] + 1))

    def up_to(self, count: int) -> Harmonics:
        """Return the lowest `count` alone, where each joint has two of them."""
        used = self.used[:, :count]
        return Harmonics(self.period, used) if used.sum(axis=1).min() > 1 else self


def plan_harmonics(frequency: float, count: Sequence[int],
                   stop_band: Sequence[float] = ()) -> Harmonics:
    """Return `count` harmonics of `frequency` [Hz], one a joint, outside of bands from, to [Hz].

    Raises:
        UsageError: C02, too many harmonics, or none outside the bands.
    """
    if not 0.0 < frequency < math.inf or not 1 <= min(count) <= max(count) <= CONFIG.most_harmonics:
        raise UsageError("C02", f"{max(count)} harmonics of {frequency:g} Hz",
                         where="--frequency, --harmonics", remedy="give for example --frequency "
                         f"0.1 --harmonics 100; {CONFIG.most_harmonics} harmonics at most")
    number = np.arange(1, max(count) + 1)
    used = number <= np.array(count)[:, None]
    for low, high in zip(stop_band[::2], stop_band[1::2], strict=True):
        used[:, (frequency * number >= low) & (frequency * number <= high)] = False
    if used.sum(axis=1).min() < CONFIG.fewest_harmonics:
        raise UsageError("C02", "a joint has fewer than two harmonics",
                         where="--harmonics, --stop-band",
                         remedy="give more harmonics, and narrow bands to stay out of")
    return Harmonics(1.0 / frequency, used)


class MotionSpace:
    """Motions as vectors x (joints * (1 + 2 harmonics),)."""

    def __init__(self, harmonics: Harmonics, speed: Array, *, rest: bool,
                 home: Array | None) -> None:
        """Scale by `speed` [rad/s] (joints,); start at `home` [rad] (joints,), or anywhere."""
        self.harmonics, self.home = harmonics, home
        n, top = harmonics.used.shape
        self.joints, self.width = n, 1 + 2 * top
        w = harmonics.omega
        weight = 1.0 / np.sqrt(1.0 + (w / (2.0 * np.pi * CONFIG.knee_hz)) ** 2)
        amplitude = speed[:, None] * weight * harmonics.used
        self.scale = np.concatenate([np.ones((n, 1)), amplitude, amplitude], axis=1)
        rows, values = np.zeros((0, self.width)), np.zeros((n, 0))
        one, zero = np.ones(top), np.zeros(top)
        if rest:
            rows = np.array([[0.0, *one, *zero], [0.0, *zero, *(w / w[-1])]])
            values = np.zeros((n, 2))
        if home is not None:
            rows = np.concatenate([rows, [[1.0, *zero, *(-1.0 / w)]]])
            values = np.concatenate([values, home[:, None]], axis=1)
        # an orthonormal basis (joints, equations, width) and the nearest point that satisfies them
        q, r = np.linalg.qr((rows * self.scale[:, None, :]).transpose(0, 2, 1))
        self._basis = np.ascontiguousarray(q.transpose(0, 2, 1))
        self._point = (q @ np.linalg.solve(r.transpose(0, 2, 1), values[..., None]))[..., 0]

    def project(self, x: Array) -> Array:
        """Return the nearest point that starts as wanted and uses no forbidden harmonic."""
        rows = np.where(self.scale > 0.0, x.reshape(self.joints, self.width), 0.0)
        return np.asarray((rows - self._along(rows) + self._point).ravel())

    def _along(self, rows: Array) -> Array:
        share = np.einsum("jew,jw->je", self._basis, rows)
        return np.asarray(np.einsum("jew,je->jw", self._basis, share))

    def series(self, x: Array) -> fourier.FourierSeries:
        rows, top = x.reshape(self.joints, self.width) * self.scale, (self.width + 1) // 2
        return fourier.FourierSeries(self.harmonics.period, rows[:, 0], rows[:, 1:top],
                                     rows[:, top:])

    def point(self, series: fourier.FourierSeries) -> Array:
        """Return x of a series of as many harmonics or fewer, projected."""
        rows, top = np.zeros((self.joints, self.width)), (self.width + 1) // 2
        rows[:, 0] = series.offset
        rows[:, 1:1 + series.harmonics] = series.cosine
        rows[:, top:top + series.harmonics] = series.sine
        unit = np.divide(rows, self.scale, out=np.zeros_like(rows), where=self.scale > 0.0)
        return self.project(unit)

    def motion(self, x: Array, samples: int) -> Array:
        """Return q, dq, ddq (3, joints, samples) over one period."""
        return self.series(x).samples(samples)

    def gradient(self, bars: Array) -> Array:
        """Return the derivative by x within the space, from those by the motion."""
        offset, cosine, sine = fourier.adjoint(bars, self.harmonics.omega)
        rows = np.concatenate([offset[:, None], cosine, sine], axis=1) * self.scale
        return np.asarray((rows - self._along(rows)).ravel())

    def random(self, rng: np.random.Generator, low: Array, high: Array) -> Array:
        """Return a random motion about a posture between `low` and `high` [rad] (joints,)."""
        x = rng.normal(size=(self.joints, self.width)) / math.sqrt(self.width)
        x[:, 0] = rng.uniform(low, high) if self.home is None else self.home
        return self.project(x.ravel())

    def shrunk(self, x: Array, factor: float) -> Array:
        """Return the same motion about the same place, `factor` times as large."""
        rows = x.reshape(self.joints, self.width).copy()
        rows[:, 1:] *= factor
        if self.home is not None:  # q0 - home = Σ b/w
            rows[:, 0] = self.home + factor * (rows[:, 0] - self.home)
        return self.project(rows.ravel())


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Run-in, whole periods of a series, run-out; both polynomials of fifth order from rest."""

    series: fourier.FourierSeries
    periods: int
    run_in: float = 0.0  # [s]; the run-out is as long
    rest: Array | None = None  # (joints,) [rad] where a run-in begins
    end: Array | None = None  # (joints,) [rad] where the run-out ends

    @property
    def duration(self) -> float:
        return 2.0 * self.run_in + self.periods * self.series.period

    def at(self, t: Array) -> Array:
        """Return q, dq, ddq (3, joints, samples) at times t [s]; at rest after the end."""
        length = self.periods * self.series.period
        inside = t - self.run_in
        out = self.series.at(np.mod(np.clip(inside, 0.0, length), self.series.period))
        state = self.series.at(np.zeros(1))[:, :, 0]
        behind = inside > length * (1.0 + 1e-12)
        if self.rest is None or self.end is None or self.run_in == 0.0:
            out[1:, :, behind] = 0.0
            return out
        still = np.zeros_like(state[0])
        into = [(0.0, np.stack([self.rest, still, still])), (self.run_in, state)]
        away = [(0.0, state), (self.run_in, np.stack([self.end, still, still]))]
        out[:, :, inside < 0.0] = quintics(into, t[inside < 0.0])
        out[:, :, behind] = quintics(away, inside[behind] - length)
        return out

    def sampled(self, sample_time: float) -> tuple[Array, Array]:
        """Return times (samples,) from 0 to the end, and q, dq, ddq (3, joints, samples)."""
        t = np.arange(round(self.duration / sample_time) + 1, dtype=np.float64) * sample_time
        return t, self.at(t)


def quintics(knots: Sequence[tuple[float, Array]], t: Array) -> Array:
    """Return q, dq, ddq (3, joints, samples) of polynomials of fifth order between states.

    Args:
        knots: times [s] and states (3, joints) of position, speed and acceleration; the last is
        kept.
    """
    from scipy.interpolate import BPoly

    times = np.array([time for time, _ in knots])
    curve = BPoly.from_derivatives(times, [state for _, state in knots])
    inside = np.minimum(t, times[-1])
    return np.stack([curve(inside, k).T for k in range(3)])

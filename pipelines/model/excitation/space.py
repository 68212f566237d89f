"""The motions among which a design is sought: Fourier series of given harmonics, at rest at the ends if wanted.

A point x of the space holds, for every joint, [q0, a_1 … a_H, b_1 … b_H] of eq. (22), each divided by a scale: the speed the
joint may have, over √(1 + (f_j / 0.6 Hz)²), so that a step in x means about as much torque at every frequency. What a start
and an end at rest at home ask for are linear equations,

    Σ a_j = 0,    Σ w_j b_j = 0,    q0 - Σ b_j/w_j = home

and every step is projected onto them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from pipelines.errors import UsageError
from pipelines.model.rigid.body import Array
from pipelines.signal import fourier

__all__ = ["Harmonics", "MotionSpace", "plan_harmonics"]

_KNEE = 0.6  # [Hz] where inertia begins to outweigh gravity
_MOST = 2000  # harmonics of the common period


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Which harmonics of the common period each joint has."""

    period: float  # [s]
    used: npt.NDArray[np.bool_]  # (joints, harmonics)

    @property
    def omega(self) -> Array:
        return np.asarray(2.0 * np.pi / self.period * np.arange(1, self.used.shape[1] + 1))

    def up_to(self, count: int) -> Harmonics:
        """The lowest `count` alone."""
        return Harmonics(self.period, self.used[:, :count])


def plan_harmonics(frequency: Sequence[float], count: Sequence[int], stop_band: Sequence[tuple[float, float]] = ()) -> Harmonics:
    """The harmonics of fundamentals `frequency` [Hz], `count` of them, one a joint, but for bands [Hz] to stay out of.

    Raises:
        UsageError: C02, no common period of fewer than 2000 harmonics, or nothing left outside the bands.
    """
    exact = [Fraction(repr(float(f))).limit_denominator(10**6) for f in frequency]
    if any(not math.isfinite(f) or f <= 0.0 for f in frequency) or any(n < 1 for n in count):
        raise UsageError("C02", "a fundamental or a number of harmonics is not positive", where="--frequency, --harmonics",
                         remedy="give for example --frequency 0.1 --harmonics 100")
    base = exact[0]
    for one in exact[1:]:
        base = Fraction(math.gcd(base.numerator * one.denominator, one.numerator * base.denominator),
                        base.denominator * one.denominator)
    multiples = [int(f / base) for f in exact]
    top = max(m * n for m, n in zip(multiples, count, strict=True))
    if top > _MOST:
        raise UsageError("C02", f"{top} harmonics of the common fundamental {float(base):g} Hz", where="--frequency, --harmonics",
                         remedy=f"choose fundamentals that are multiples of one another; {_MOST} harmonics at most")
    used = np.zeros((len(exact), top), dtype=bool)
    for row, m, n in zip(used, multiples, count, strict=True):
        row[m - 1:m * n:m] = True
    hertz = float(base) * np.arange(1, top + 1)
    for low, high in stop_band:
        used[:, (hertz >= low) & (hertz <= high)] = False
    if not (used.sum(axis=1) >= 2).all():
        raise UsageError("C02", "the bands to stay out of leave a joint fewer than two harmonics", where="--stop-band",
                         remedy="narrow the bands, or give more harmonics")
    return Harmonics(1.0 / float(base), used)


class MotionSpace:
    """Motions as vectors x (joints * (1 + 2 harmonics),)."""

    def __init__(self, harmonics: Harmonics, speed: Array, *, rest: bool, home: Array | None) -> None:
        """`speed` [rad/s] (joints,) that each joint may have; `home` [rad] (joints,): where it starts, None: anywhere."""
        self.harmonics, self.home = harmonics, home
        n, top = harmonics.used.shape
        self.joints, self.width = n, 1 + 2 * top
        weight = 1.0 / np.sqrt(1.0 + (harmonics.omega / (2.0 * np.pi * _KNEE)) ** 2)
        amplitude = speed[:, None] * weight * harmonics.used
        self.scale = np.concatenate([np.ones((n, 1)), amplitude, amplitude], axis=1)
        self._basis, self._point = self._equations(rest, home)

    def _equations(self, rest: bool, home: Array | None) -> tuple[Array, Array]:
        """An orthonormal basis (joints, equations, width) of what must not change, and the nearest point that satisfies it."""
        w, top = self.harmonics.omega, len(self.harmonics.omega)
        rows, values = [], []
        if rest:
            rows += [np.concatenate([[0.0], np.ones(top), np.zeros(top)]), np.concatenate([[0.0], np.zeros(top), w / w[-1]])]
            values += [np.zeros(self.joints), np.zeros(self.joints)]
        if home is not None:
            rows.append(np.concatenate([[1.0], np.zeros(top), -1.0 / w]))
            values.append(home)
        if not rows:
            return np.zeros((self.joints, 0, self.width)), np.zeros((self.joints, self.width))
        matrix = np.stack(rows) * self.scale[:, None, :]
        q, r = np.linalg.qr(matrix.transpose(0, 2, 1))
        coordinates = np.linalg.solve(r.transpose(0, 2, 1), np.stack(values, axis=1)[..., None])
        return np.ascontiguousarray(q.transpose(0, 2, 1)), (q @ coordinates)[..., 0]

    def project(self, x: Array) -> Array:
        """The nearest point that starts as wanted and uses no forbidden harmonic."""
        rows = np.where(self.scale > 0.0, x.reshape(self.joints, self.width), 0.0)
        return np.asarray((rows - self._along(rows) + self._point).ravel())

    def _along(self, rows: Array) -> Array:
        return np.asarray(np.einsum("jew,je->jw", self._basis, np.einsum("jew,jw->je", self._basis, rows)))

    def series(self, x: Array) -> fourier.FourierSeries:
        rows, top = x.reshape(self.joints, self.width) * self.scale, self.harmonics.used.shape[1]
        return fourier.FourierSeries(self.harmonics.period, rows[:, 0], rows[:, 1:1 + top], rows[:, 1 + top:])

    def point(self, series: fourier.FourierSeries) -> Array:
        """x of a series of as many harmonics or fewer, projected."""
        top, given = self.harmonics.used.shape[1], series.harmonics
        rows = np.zeros((self.joints, self.width))
        rows[:, 0] = series.offset
        rows[:, 1:1 + given], rows[:, 1 + top:1 + top + given] = series.cosine, series.sine
        return self.project(np.divide(rows, self.scale, out=np.zeros_like(rows), where=self.scale > 0.0))

    def motion(self, x: Array, samples: int) -> Array:
        """q, dq, ddq (3, joints, samples) over one period."""
        return self.series(x).samples(samples)

    def gradient(self, bars: Array) -> Array:
        """Derivative by x within the space, from derivatives by q, dq, ddq (3, joints, samples)."""
        rows = np.concatenate([part if part.ndim == 2 else part[:, None]
                               for part in fourier.adjoint(bars, self.harmonics.omega)], axis=1) * self.scale
        return np.asarray((rows - self._along(rows)).ravel())

    def random(self, rng: np.random.Generator, low: Array, high: Array) -> Array:
        """A random motion about a posture between `low` and `high` [rad] (joints,); its size is left to the limits."""
        x = rng.normal(size=(self.joints, self.width)) / math.sqrt(self.width)
        x[:, 0] = rng.uniform(low, high) if self.home is None else self.home
        return self.project(x.ravel())

    def shrunk(self, x: Array, factor: float) -> Array:
        """The same motion about the same place, `factor` times as large."""
        rows = x.reshape(self.joints, self.width).copy()
        rows[:, 1:] *= factor
        if self.home is not None:  # q0 - home = Σ b/w
            rows[:, 0] = self.home + factor * (rows[:, 0] - self.home)
        return self.project(rows.ravel())

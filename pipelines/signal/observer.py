"""Reconstruct position, speed and acceleration with a Kalman observer, all channels and many samples at once.

Kostić et al. 2004, eq. (16)-(21): each channel is a chain of integrators whose highest derivative, the jerk for order 3, is
white and held over a sample. The gain is the stationary one; what makes the filter exact from its first sample on, and
again after every gap, is the partitioning of Lainiotis 1976 (IEEE Trans. Autom. Control 21, p. 677): the Kalman filter
that starts with covariance P_0 is the stationary filter plus the estimate of a constant offset δ of its first state,

    x_k = x_k^stationary + A^k δ_k,   δ_k = (I + D_0 G_k)^-1 D_0 g_k,   D_0 = P_0 - P,
    G_k = Σ_{j<=k} (c A^j)^T c A^j / S,   g_k = Σ_{j<=k} (c A^j)^T ν_j / S.

Missing samples are predicted through, never interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.signal import blocks
from pipelines.signal import segments as seg
from pipelines.signal.chain import Stationary, lyapunov, stationary
from pipelines.signal.segments import Opening, Part, Piece, Prior, Run

__all__ = ["Observer", "Start", "Track", "design", "observe"]

Array = npt.NDArray[np.float64]

BLOCK = 32  # samples: longer blocks cost arithmetic, shorter ones carries
STARTS = 16  # kept: more different ones than that do not come again
CHUNK = 512 * BLOCK  # samples worked on at once


@dataclass(frozen=True)
class Start:
    """What is known of the states before the first sample, in physical units; without it nothing is (a diffuse start)."""

    mean: Array  # (joints, order)
    covariance: Array  # (joints, order, order)


@dataclass(frozen=True)
class Observer:
    """One stationary Kalman observer a channel, of one order and one sample time."""

    sample_time: float  # T [s]
    jerk_std: Array  # σ of the held highest derivative, [unit / s^order] (joints,)
    noise_variance: Array  # R of the measured position [unit²] (joints,)
    filter: Stationary

    @property
    def order(self) -> int:
        return self.filter.order

    @cached_property
    def unit(self) -> Array:
        """What one scaled state is worth: √R (h / T)^i, (joints, order)."""
        return np.asarray(np.sqrt(self.noise_variance)[:, None] * self.rate)

    @cached_property
    def rate(self) -> Array:
        """(h / T)^i: from scaled to physical time, (joints, order)."""
        return np.asarray((self.filter.step[:, None] / self.sample_time) ** np.arange(self.order))

    @property
    def gain(self) -> Array:
        """k of eq. (20), [1, 1/s, 1/s²] (joints, order)."""
        return np.asarray(self.filter.gain * self.rate)

    @property
    def std(self) -> Array:
        """Standard deviation of the reconstructed states after the start, noise and unknown jerk together. (joints, order)"""
        return np.asarray(np.sqrt(np.einsum("njj->nj", self.filter.posterior)) * self.unit)

    @property
    def noise_std(self) -> Array:
        """The part of it that measurement noise alone causes: what passes the observer of white noise R. (joints, order)"""
        f = self.filter
        spread = lyapunov(f.updater @ f.transition, f.gain[:, :, None] * f.gain[:, None, :])
        return np.asarray(np.sqrt(np.einsum("njj->nj", spread)) * self.unit)

    def response(self, frequency: Array) -> npt.NDArray[np.complex128]:
        """From measured position to every reconstructed state at `frequency` [Hz]: (frequencies, joints, order).

        x(z) = (I - (I - k c) E z^-1)^-1 k y(z), eq. (20).
        """
        f = self.filter
        late = np.exp(-2j * np.pi * np.asarray(frequency, dtype=np.float64) * self.sample_time)[:, None, None, None]
        states = np.linalg.solve(np.eye(self.order) - late * (f.updater @ f.transition), f.gain[..., None].astype(complex))
        return np.asarray(states[..., 0] * self.rate)

    @property
    def bandwidth_hz(self) -> Array:
        """Highest frequency at which the position is passed with -3 dB (1/√2); half the rate where it always is. (joints,)"""
        from pipelines.signal.tuning import observer_bandwidth

        return observer_bandwidth(self)

    @property
    def settled(self) -> int:
        """Samples after which the gain is stationary and the start forgotten."""
        return self.filter.settled

    @cached_property
    def kernel(self) -> tuple[Array, Array, Array]:
        """A^i (joints, B + 1, n, n); what a block's inputs leave at its end (joints, B, n); all its outputs, scaled to physical."""
        f = self.filter
        power = blocks.powers(f.predictor, BLOCK)
        entry = (f.transition @ f.gain[..., None])[:, None]
        leave = (power[:, BLOCK - 1::-1] @ entry)[..., 0]
        free = (f.updater[:, None] @ power[:, :BLOCK]).transpose(0, 2, 3, 1)  # (joints, state, n, B)
        after = f.updater[:, None] @ (power[:, :BLOCK - 1] @ entry)
        pulse = np.concatenate([f.gain[:, None, :, None], after], axis=1)[..., 0].swapaxes(1, 2)
        inside = blocks.impulse_toeplitz(pulse)  # (joints, state, B, B)
        return power, leave, np.concatenate([inside, free], axis=2) * self.rate[..., None, None]

    @cached_property
    def diffuse_opening(self) -> Opening:
        """The return to the stationary gain from a start that knows nothing; it needs no data and is kept."""
        return seg.opening(self, seg.diffuse(self), self.settled)

    @cached_property
    def diffuse_std(self) -> Array:
        """Standard deviations of the states after such a start, (order, settled, joints)."""
        return seg.deviations(self, self.diffuse_opening.covariance(self))

    @cached_property
    def _openings(self) -> dict[tuple[bytes, int], tuple[Opening, Array]]:
        return {}

    def opening(self, excess: Array | None, count: int) -> tuple[Opening, Array]:
        """The return over `count` samples from a start of covariance P + `excess`, and the deviations (order, count, joints).

        No sample decides them, only what was known before: logs that start alike share them, as gaps of one length do.
        """
        if excess is None:
            return self.diffuse_opening, self.diffuse_std
        key = excess.tobytes(), count
        if key not in self._openings:
            if len(self._openings) >= STARTS:
                self._openings.clear()
            start = seg.opening(self, excess, count)
            self._openings[key] = start, seg.deviations(self, start.covariance(self))
        return self._openings[key]

    def pick(self, joints: npt.NDArray[np.intp]) -> Observer:
        """The observer of some of the joints."""
        f = self.filter
        part = Stationary(f.order, *(getattr(f, name)[joints] for name in Stationary.__dataclass_fields__ if name != "order"))
        return Observer(self.sample_time, self.jerk_std[joints], self.noise_variance[joints], part)


@dataclass(frozen=True)
class Track:
    """Reconstructed states, and how well they are known: constant but for the stretches listed."""

    states: Array  # (order, samples, joints): position, speed, acceleration, ...
    std: Array  # (order, joints) where nothing is near
    stretches: tuple[Piece, ...]  # standard deviations near the ends and gaps

    def full_std(self) -> Array:
        """The standard deviation of every sample, the shape of `states`."""
        out = np.empty_like(self.states)
        out[:] = self.std[:, None, :]
        for piece in self.stretches:
            out[:, piece.first:piece.first + piece.std.shape[1], piece.joints] = piece.std
        return out


def design(sample_time: float, jerk_std: Array | float, noise_variance: Array | float, order: int = 3) -> Observer:
    """The observer for jerk of standard deviation σ and measurement noise R (Δθ²/12 for a counted encoder); one a channel."""
    sigma, variance = np.broadcast_arrays(np.atleast_1d(np.asarray(jerk_std, dtype=np.float64)),
                                          np.asarray(noise_variance, dtype=np.float64))
    if not (sample_time > 0.0 and np.all(sigma > 0.0) and np.all(variance > 0.0)):
        raise UsageError("C02", "sample time, jerk level and measurement noise of an observer must be positive numbers",
                         remedy="correct them")
    index = sigma * sample_time**order / np.sqrt(variance)
    return Observer(sample_time, sigma.copy(), variance.copy(), stationary(order, index))


def observe(y: Array, observer: Observer, start: Start | None = None, out: Array | None = None) -> Track:
    """Causal reconstruction of `y` (samples, joints), NaN where nothing was measured. Equal to the Kalman filter throughout.

    `out` (joints, order, samples) is memory for the states, for whoever reconstructs many logs: new pages cost more than the work.
    """
    samples, joints = checked(y, observer)
    states = np.empty((joints, observer.order, samples)) if out is None else out
    pieces: list[Piece] = []
    for part in seg.parts(y):
        whole = len(part.joints) == joints
        own = observer if whole else observer.pick(part.joints)
        room = states if whole else np.empty((len(part.joints), observer.order, samples))
        pieces += _observe_part(part, own, seg.begin(own, part, start), room)
        if not whole:
            states[part.joints] = room
    return Track(states.transpose(1, 2, 0), observer.std.T, tuple(pieces))


def checked(y: Array, observer: Observer) -> tuple[int, int]:
    if y.ndim != 2 or y.shape[1] != len(observer.jerk_std):
        raise UsageError("C02", f"the observer has {len(observer.jerk_std)} channels, the measurement has shape {y.shape}",
                         remedy="tune the observer on the same joints")
    if len(y) < 2:
        raise InputRejected("T08", f"{len(y)} samples: nothing can be reconstructed", remedy="record at least two samples")
    return y.shape


def _observe_part(part: Part, observer: Observer, prior: Prior, out: Array) -> list[Piece]:
    """Channels that miss the same samples: stretch by stretch into `out` (joints, order, samples)."""
    pieces, position = [], 0
    for first, last in [*part.runs, (part.samples, part.samples)]:
        if first > position:
            ahead = seg.predict_gap(observer, prior, first - position)
            out[:, :, position:first] = ahead.states.swapaxes(1, 2) * observer.rate[..., None]
            out[:, 0, position:first] += part.offset[:, None]
            pieces.append(Piece(position, part.joints, seg.deviations(observer, ahead.covariance)))
            prior = ahead.prior
        if last > first:
            std, prior = filter_run(observer, part.run(first, last), prior, out[:, :, first:last])
            pieces.append(Piece(first, part.joints, std))
        position = last
    return pieces


def block_starts(observer: Observer, y: Array, mean: Array, spare: int = 0) -> tuple[Array, Array]:
    """Whole blocks of `y` (joints, samples) with their stationary predictions beside them, and the prediction after them.

    `spare` columns are left beside them for what a smoother knows from behind.
    """
    joints, samples = y.shape
    count, n = samples // BLOCK, observer.order
    # inputs and start of a block side by side: one product gives all that follows from both
    beside = np.empty((joints, count, BLOCK + n + spare))
    beside[:, :, :BLOCK] = y[:, :count * BLOCK].reshape(joints, count, BLOCK)
    starts = _starts(observer, beside[:, :, :BLOCK], mean)
    beside[:, :, BLOCK:BLOCK + n] = starts[:, :-1]
    return beside, starts[:, -1]


def _starts(observer: Observer, y: Array, mean: Array) -> Array:
    """Stationary predictions at the start of every block of `y` (joints, blocks, BLOCK) and after the last."""
    power, leave, _ = observer.kernel
    starts = np.empty((len(y), y.shape[1] + 1, observer.order))
    starts[:, 0] = mean
    np.matmul(y, leave, out=starts[:, 1:])
    return blocks.scan(power[:, BLOCK], starts)


def chunks(samples: int) -> list[tuple[int, int]]:
    """Pieces of whole blocks and a last one: what is worked on at once stays in the cache, and memory does not grow."""
    return [(at, min(samples, at + CHUNK)) for at in range(0, samples, CHUNK)]


def after_rest(observer: Observer, rest: Array, mean: Array) -> Array:
    """The stationary prediction after less than a block of measurements, `rest` (joints, samples)."""
    size = rest.shape[1]
    if not size:
        return mean
    power, leave, _ = observer.kernel
    return np.asarray((power[:, size] @ mean[..., None])[..., 0] + (rest[:, None] @ leave[:, BLOCK - size:])[:, 0])


def advance(observer: Observer, y: Run, mean: Array) -> list[Array]:
    """Stationary predictions of the first sample of every chunk and of the sample after the last."""
    means = [mean]
    for a, b in chunks(y.samples):
        piece = y.take(a, b)
        whole = (b - a) // BLOCK * BLOCK
        after = _starts(observer, piece[:, :whole].reshape(len(piece), -1, BLOCK), means[-1])[:, -1]
        means.append(after_rest(observer, piece[:, whole:], after))
    return means


def filter_run(observer: Observer, y: Run, prior: Prior, out: Array) -> tuple[Array, Prior]:
    """An unbroken stretch into `out` (joints, order, samples): stationary everywhere, then corrected where the start is felt."""
    kernel, samples, after = observer.kernel[2], y.samples, prior.mean
    head = np.empty((*out.shape[:2], min(samples, observer.settled)))  # before the first value is put back: it would cost digits
    for a, b in chunks(samples):
        piece = y.take(a, b)
        beside, after = block_starts(observer, piece, after)
        whole = beside.shape[1] * BLOCK
        if whole:
            np.matmul(beside[:, None], kernel, out=out[:, :, a:a + whole].reshape(*out.shape[:2], -1, BLOCK))
        rest = piece[:, whole:]
        if rest.size:
            size = rest.shape[1]
            out[:, :, b - size:b] = (rest[:, None, None] @ kernel[:, :, :size, :size]
                                     + after[:, None, None] @ kernel[:, :, BLOCK:, :size])[:, :, 0]
            after = after_rest(observer, rest, after)
        head[:, :, a:b] = out[:, :, a:min(b, head.shape[2])]
        out[:, 0, a:b] += y.offset[:, None]
    start, std = observer.opening(prior.excess, min(samples, observer.settled))
    offset, count = seg.offsets(observer, start, prior, y, head), head.shape[2]
    out[:, :, :count] += (start.felt[:, :count] @ offset[..., None])[..., 0].swapaxes(1, 2) * observer.rate[..., None]
    return std[:, :count], seg.after(start, offset[:, -1], after, samples)

"""Reconstruct position, speed and acceleration with a Kalman observer, many samples at once.

Kostić et al. 2004, eq. (16)-(21): each channel is a chain of integrators whose highest derivative,
the jerk for order 3, is white and held over a sample. The gain is the stationary one; what makes
the filter exact from its first sample on, and again after every gap, is the partitioning of
Lainiotis 1976 (IEEE Trans. Autom. Control 21, p. 677): the Kalman filter that starts with
covariance P_0 is the stationary filter plus the estimate of a constant offset δ of its first state,

    x_k = x_k^stationary + A^k δ_k,   δ_k = (I + D_0 G_k)^-1 D_0 g_k,   D_0 = P_0 - P,
    G_k = Σ_{j<=k} (c A^j)^T c A^j / S,   g_k = Σ_{j<=k} (c A^j)^T ν_j / S.

Missing samples are predicted through, never interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.estimation import chain
from pipelines.estimation.chain import Array, Stationary

Indices = npt.NDArray[np.intp]

BLOCK = 32  # numerics: samples; longer blocks cost arithmetic, shorter ones carries
CHUNK = 512 * BLOCK  # numerics: samples worked on at once
_DIFFUSE = 1e5  # numerics: noise in position, of a start that knows nothing; as much a derivative


@dataclass(frozen=True)
class Start:
    """The states before the first sample, in physical units; without it the start is diffuse."""

    mean: Array  # (joints, order)
    covariance: Array  # (joints, order, order)


@dataclass(frozen=True)
class Piece:
    """Standard deviations of the states over one stretch of samples, in physical units."""

    first: int
    joints: Indices
    std: Array  # (order, samples, joints)


@dataclass(frozen=True)
class Track:
    """Reconstructed states, and how well they are known: constant but for the stretches listed."""

    states: Array  # (order, samples, joints): position, speed, acceleration, ...
    std: Array  # (order, joints) where nothing is near
    stretches: tuple[Piece, ...]  # standard deviations near the ends and gaps

    def full_std(self) -> Array:
        """Return the standard deviation of every sample, the shape of `states`."""
        out = np.empty_like(self.states)
        out[:] = self.std[:, None, :]
        for piece in self.stretches:
            out[:, piece.first : piece.first + piece.std.shape[1], piece.joints] = piece.std
        return out


@dataclass(frozen=True)
class Run:
    """An unbroken stretch of measurements; the chain does not feel the constant `offset`."""

    values: Array  # (samples, joints)
    offset: Array  # (joints,)

    @property
    def samples(self) -> int:
        return len(self.values)

    def take(self, first: int, last: int) -> Array:
        """(joints, last - first), the offset taken off."""
        return np.subtract(self.values[first:last].T, self.offset[:, None], order="C")


@dataclass(frozen=True)
class Part:
    """Channels that miss the same samples."""

    joints: Indices
    samples: int
    runs: tuple[tuple[int, int], ...]  # stretches without a missing sample
    values: Array  # (samples, joints), as measured
    offset: Array  # (joints,)

    def run(self, first: int, last: int) -> Run:
        return Run(self.values[first:last], self.offset)


@dataclass(frozen=True)
class Prior:
    """Prediction of the next sample, and the excess of its covariance over the stationary one."""

    mean: Array  # (joints, order)
    excess: Array | None  # D (joints, order, order), scaled; None: a start that knows nothing


@dataclass(frozen=True)
class Gap:
    """States and covariances predicted over missing samples, scaled."""

    states: Array  # (joints, missing, order)
    covariance: Array  # (joints, missing, order, order)
    prior: Prior  # for the first sample after the gap


@dataclass(frozen=True)
class Opening:
    """The return to the stationary gain from an excess D: nothing here needs the data."""

    power: Array  # A^k (joints, count + 1, order, order)
    spread: Array  # covariance of δ after k samples (joints, count, order, order)
    felt: Array  # (I - k c) A^k: from δ to the reconstructed states
    std: Array  # of the states (order, count, joints), in physical units


@dataclass(frozen=True)
class Observer:
    """One stationary Kalman observer for each channel, of one order and one sample time."""

    sample_time: float  # T [s]
    jerk_std: Array  # σ of the held highest derivative, [unit / s^order] (joints,)
    noise_variance: Array  # R of the measured position [unit²] (joints,)
    filter: Stationary

    @property
    def order(self) -> int:
        return self.filter.order

    @cached_property
    def unit(self) -> Array:
        """One scaled state in physical units: √R (h / T)^i, (joints, order)."""
        return np.asarray(np.sqrt(self.noise_variance)[:, None] * self.rate)

    @cached_property
    def rate(self) -> Array:
        """(h / T)^i: from scaled to physical time, (joints, order)."""
        return np.asarray((self.filter.step[:, None] / self.sample_time) ** np.arange(self.order))

    @property
    def gain(self) -> Array:
        """K of eq. (20), [1, 1/s, 1/s²] (joints, order)."""
        return np.asarray(self.filter.gain * self.rate)

    @property
    def std(self) -> Array:
        """(joints, order) of the states after the start, noise and unknown jerk together."""
        return np.asarray(np.sqrt(np.einsum("njj->nj", self.filter.posterior)) * self.unit)

    def response(self, frequency: Array) -> npt.NDArray[np.complex128]:
        """Return the response of every state to the measured position at `frequency` [Hz].

        x(z) = (I - (I - k c) E z^-1)^-1 k y(z), eq. (20), (frequencies, joints, order).
        """
        f, hertz = self.filter, np.asarray(frequency, dtype=np.float64)
        late = np.exp(-2j * np.pi * hertz * self.sample_time)[:, None, None, None]
        matrix = np.eye(self.order) - late * (f.updater @ f.transition)
        return np.asarray(np.linalg.solve(matrix, f.gain[..., None] + 0j)[..., 0] * self.rate)

    @property
    def bandwidth_hz(self) -> Array:
        """Highest frequency passed with -3 dB (1/√2); half the rate where all are. (joints,)"""
        angle = np.pi * np.geomspace(1e-7, 1.0, 1500)
        passed = self.filter.position_gain(angle[:, None]) >= np.sqrt(0.5)
        last = len(angle) - 1 - np.argmax(passed[::-1], axis=0)
        low, _ = bisected(
            lambda x: self.filter.position_gain(np.exp(x)) >= np.sqrt(0.5),
            np.log(angle[last]),
            np.log(angle[np.minimum(last + 1, len(angle) - 1)]),
        )
        return np.asarray(np.exp(low) / (2.0 * np.pi * self.sample_time))

    @property
    def settled(self) -> int:
        """Samples after which the gain is stationary and the start forgotten."""
        return self.filter.settled

    @cached_property
    def kernel(self) -> tuple[Array, Array, Array]:
        """Return A^i (joints, B + 1, n, n); what a block's inputs leave at its end (joints, B, n);
        the matrix of all its outputs, in physical time.
        """
        f = self.filter
        power = chain.powers(f.predictor, BLOCK)
        entry = (f.transition @ f.gain[..., None])[:, None]
        leave = (power[:, BLOCK - 1 :: -1] @ entry)[..., 0]
        free = (f.updater[:, None] @ power[:, :BLOCK]).transpose(0, 2, 3, 1)
        behind = f.updater[:, None] @ (power[:, : BLOCK - 1] @ entry)
        pulse = np.concatenate([f.gain[:, None, :, None], behind], axis=1)[..., 0].swapaxes(1, 2)
        inside = chain.impulse_toeplitz(pulse)  # (joints, state, B, B)
        return power, leave, np.concatenate([inside, free], axis=2) * self.rate[..., None, None]

    def opening(self, excess: Array | None, count: int) -> Opening:
        """Return to the stationary gain over `count` samples from a start of covariance P + D."""
        f = self.filter
        power = chain.powers(f.predictor, count)
        row = power[:, :count, 0]  # c A^k
        known = row[..., :, None] * (row * f.remainder[:, None, None])[..., None, :]
        spread = spread_of(self.excess_of(excess), np.cumsum(known, axis=1))
        felt = f.updater[:, None] @ power[:, :count]
        covariance = f.posterior[:, None] + felt @ spread @ felt.swapaxes(2, 3)
        return Opening(power, spread, felt, self.deviations(covariance))

    def excess_of(self, excess: Array | None) -> Array:
        """Return the excess D of a start; of one that knows nothing for None."""
        if excess is not None:
            return excess
        f = self.filter
        wide = (_DIFFUSE / f.step[:, None] ** np.arange(f.order)) ** 2
        return np.asarray(wide[:, :, None] * np.eye(f.order) - f.prior)

    def deviations(self, covariance: Array) -> Array:
        """(order, samples, joints) in physical units of scaled covariances (joints, samples, …)."""
        variance = np.maximum(np.einsum("nkjj->jkn", covariance), 0.0)
        return np.asarray(np.sqrt(variance) * self.unit.T[:, None])

    def pick(self, joints: Indices) -> Observer:
        """Return the observer of some of the joints."""
        f = self.filter
        names = [name for name in Stationary.__dataclass_fields__ if name != "order"]
        part = replace(f, **{name: getattr(f, name)[joints] for name in names})
        sigma, variance = self.jerk_std[joints], self.noise_variance[joints]
        return Observer(self.sample_time, sigma, variance, part)


def design(
    sample_time: float, jerk_std: Array | float, noise_variance: Array | float, order: int = 3
) -> Observer:
    """Return the observer for jerk σ and measurement noise R (Δθ²/12 of a counted encoder).

    Raises:
        UsageError: C02, numbers that are not positive.
    """
    sigma, variance = np.broadcast_arrays(
        np.atleast_1d(np.asarray(jerk_std, dtype=np.float64)),
        np.asarray(noise_variance, dtype=np.float64),
    )
    if not (sample_time > 0.0 and np.all(sigma > 0.0) and np.all(variance > 0.0)):
        words = "sample time, jerk level and measurement noise of an observer must be positive"
        raise UsageError("C02", f"{words} numbers", remedy="correct them")
    index = sigma * sample_time**order / np.sqrt(variance)
    return Observer(sample_time, sigma.copy(), variance.copy(), chain.stationary(order, index))


def bisected(
    inside: Callable[[Array], npt.NDArray[np.bool_]], low: Array, high: Array, rounds: int = 45
) -> tuple[Array, Array]:
    """Return the bounds of where `inside` ends, from `low`, where it holds, to `high`."""
    for _ in range(rounds):
        middle = 0.5 * (low + high)
        holds = inside(middle)
        low, high = np.where(holds, middle, low), np.where(holds, high, middle)
    return low, high


def observe(y: Array, observer: Observer, start: Start | None = None) -> Track:
    """Reconstruct `y` (samples, joints), NaN where missing: equal to the Kalman filter throughout.

    Raises:
        UsageError: C02, another number of channels.
        InputRejected: T08, fewer than two samples; D02, a channel without any; D03, infinite ones.
    """
    return Track(*by_part(y, observer, start, _observe_part, observer.std.T))


Work = Callable[[Observer, Part, Prior, Array], list[Piece]]


def by_part(
    y: Array, observer: Observer, start: Start | None, work: Work, std: Array
) -> tuple[Array, Array, tuple[Piece, ...]]:
    """Let `work` fill the states of the channels of `y` that miss the same samples."""
    if y.ndim != 2 or y.shape[1] != len(observer.jerk_std):
        words = f"the observer has {len(observer.jerk_std)} channels, "
        words += f"the measurement has shape {y.shape}"
        raise UsageError("C02", words, remedy="tune the observer on the same joints")
    if len(y) < 2:
        words = f"{len(y)} samples: nothing can be reconstructed"
        raise InputRejected("T08", words, remedy="record at least two samples")
    states = np.empty((y.shape[1], observer.order, len(y)))
    pieces: list[Piece] = []
    for part in _parts(y):
        whole = len(part.joints) == y.shape[1]
        own = observer if whole else observer.pick(part.joints)
        room = states if whole else np.empty((len(part.joints), *states.shape[1:]))
        pieces += work(own, part, _begin(own, part, start), room)
        if not whole:
            states[part.joints] = room
    return states.transpose(1, 2, 0), std, tuple(pieces)


def _parts(y: Array) -> list[Part]:
    """Return the channels of `y` (samples, joints) grouped by the samples they miss."""
    with np.errstate(all="ignore"):
        if np.isfinite(y.sum()):  # half the time of asking every sample
            return [Part(np.arange(y.shape[1]), len(y), ((0, len(y)),), y, y[0])]
    valid = np.isfinite(y)
    if np.isinf(y).any():
        words = "infinite values among the measurements"
        raise InputRejected("D03", words, remedy="mark what is missing as NaN")
    if not valid.any(axis=0).all():
        words = f"channel {int(np.argmin(valid.any(axis=0))) + 1} has no sample at all"
        raise InputRejected("D02", words, remedy="leave the channel out, or record it again")
    groups: dict[bytes, list[int]] = {}
    for j in range(y.shape[1]):
        groups.setdefault(np.packbits(valid[:, j]).tobytes(), []).append(j)
    out = []
    for joints in groups.values():
        mask = valid[:, joints[0]]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.view(np.int8), [0]])))
        runs = tuple(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
        out.append(Part(np.array(joints), len(y), runs, y[:, joints], y[runs[0][0], joints]))
    return out


def _begin(observer: Observer, part: Part, start: Start | None) -> Prior:
    """Return the prediction of the first sample."""
    if start is None:
        return Prior(np.zeros((len(part.joints), observer.order)), None)
    mean = start.mean[part.joints].astype(np.float64)
    mean[:, 0] -= part.offset
    unit = observer.unit
    covariance = start.covariance[part.joints] / (unit[:, :, None] * unit[:, None, :])
    # the filter is linear in the means, which stay in the unit of position
    return Prior(mean / observer.rate, covariance - observer.filter.prior)


def _observe_part(observer: Observer, part: Part, prior: Prior, out: Array) -> list[Piece]:
    """Filter channels that miss the same samples into `out` (joints, order, samples)."""
    pieces, position = [], 0
    for first, last in [*part.runs, (part.samples, part.samples)]:
        if first > position:
            ahead = predict_gap(observer, prior, first - position)
            out[:, :, position:first] = ahead.states.swapaxes(1, 2) * observer.rate[..., None]
            out[:, 0, position:first] += part.offset[:, None]
            pieces.append(Piece(position, part.joints, observer.deviations(ahead.covariance)))
            prior = ahead.prior
        if last > first:
            std, prior = filter_run(observer, part.run(first, last), prior, out[:, :, first:last])
            pieces.append(Piece(first, part.joints, std))
        position = last
    return pieces


def gap_covariance(observer: Observer, count: int) -> tuple[Array, Array]:
    """E^i and Q_i for i = 0 .. count: (joints, count + 1, order, order) each."""
    f = observer.filter
    away = chain.transition(f.order, np.multiply.outer(f.step, np.arange(count + 1)))
    jerk = f.tracking_index / f.step**f.order
    return away, chain.input_covariance(f.order, f.step, count, jerk)


def predict_gap(observer: Observer, prior: Prior, count: int) -> Gap:
    """x_i = E^i x, P_i = E^i P E^iT + Q_i over `count` missing samples."""
    away, noise = gap_covariance(observer, count)
    states = (away @ prior.mean[:, None, :, None])[..., 0]
    start = observer.filter.prior + observer.excess_of(prior.excess)
    covariance = away @ start[:, None] @ away.swapaxes(2, 3) + noise
    after = Prior(states[:, -1], covariance[:, -1] - observer.filter.prior)
    return Gap(states[:, :-1], covariance[:, :-1], after)


def spread_of(excess: Array, known: Array) -> Array:
    """(I + D G)^-1 D for `known` G (joints, ..., n, n), D scaled: it may hold 1e20 and 1e-3."""
    scale = np.sqrt(np.maximum(np.abs(np.einsum("njj->nj", excess)), 1e-300))
    more = (slice(None),) + (None,) * (known.ndim - 3)
    across = (scale[:, :, None] * scale[:, None, :])[more]
    d = excess[more] / across
    system = np.eye(excess.shape[-1]) + d @ (known * across)
    return np.asarray(np.linalg.solve(system, np.broadcast_to(d, known.shape)) * across)


def block_starts(observer: Observer, y: Array, mean: Array, spare: int = 0) -> tuple[Array, Array]:
    """Return whole blocks of `y` (joints, samples) with the stationary predictions at their starts,
    and the prediction after them; `spare` columns more for what a smoother knows from behind.
    """
    joints, samples = y.shape
    count, n = samples // BLOCK, observer.order
    # inputs and start of a block side by side: one product gives all that follows from both
    blocks = np.empty((joints, count, BLOCK + n + spare))
    blocks[:, :, :BLOCK] = y[:, : count * BLOCK].reshape(joints, count, BLOCK)
    starts = _starts(observer, blocks[:, :, :BLOCK], mean)
    blocks[:, :, BLOCK : BLOCK + n] = starts[:, :-1]
    return blocks, starts[:, -1]


def _starts(observer: Observer, y: Array, mean: Array) -> Array:
    """Return the predictions at the start of every block of `y` (joints, blocks, BLOCK), and last
    the one after them.
    """
    power, leave, _ = observer.kernel
    starts = np.empty((len(y), y.shape[1] + 1, observer.order))
    starts[:, 0] = mean
    np.matmul(y, leave, out=starts[:, 1:])
    return chain.scan(power[:, BLOCK], starts)


def chunks(samples: int) -> list[tuple[int, int]]:
    """Return pieces of whole blocks and a last one, so that memory does not grow."""
    return [(at, min(samples, at + CHUNK)) for at in range(0, samples, CHUNK)]


def _after_rest(observer: Observer, rest: Array, mean: Array) -> Array:
    """Return the stationary prediction after less than a block, `rest` (joints, samples)."""
    size = rest.shape[1]
    if not size:
        return mean
    power, leave, _ = observer.kernel
    moved = (power[:, size] @ mean[..., None])[..., 0]
    return np.asarray(moved + (rest[:, None] @ leave[:, BLOCK - size :])[:, 0])


def advance(observer: Observer, y: Run, mean: Array) -> list[Array]:
    """Return the stationary predictions of the first sample of every chunk, and after the last."""
    means = [mean]
    for a, b in chunks(y.samples):
        piece = y.take(a, b)
        whole = (b - a) // BLOCK * BLOCK
        blocks = piece[:, :whole].reshape(len(piece), -1, BLOCK)
        after = _starts(observer, blocks, means[-1])[:, -1]
        means.append(_after_rest(observer, piece[:, whole:], after))
    return means


def filter_run(observer: Observer, y: Run, prior: Prior, out: Array) -> tuple[Array, Prior]:
    """Filter an unbroken stretch into `out` (joints, order, samples): stationary everywhere, then
    corrected where the start is felt. Returns the deviations there, and what follows.
    """
    kernel, samples, after = observer.kernel[2], y.samples, prior.mean
    count = min(samples, observer.settled)
    head = np.empty((*out.shape[:2], count))  # before the offset is put back: it would cost digits
    for a, b in chunks(samples):
        piece = y.take(a, b)
        blocks, after = block_starts(observer, piece, after)
        whole = blocks.shape[1] * BLOCK
        if whole:
            target = out[:, :, a : a + whole].reshape(*out.shape[:2], -1, BLOCK)
            np.matmul(blocks[:, None], kernel, out=target)
        rest = piece[:, whole:]
        if size := rest.shape[1]:
            forced = rest[:, None, None] @ kernel[:, :, :size, :size]
            free = after[:, None, None] @ kernel[:, :, BLOCK:, :size]
            out[:, :, b - size : b] = (forced + free)[:, :, 0]
            after = _after_rest(observer, rest, after)
        head[:, :, a:b] = out[:, :, a : min(b, count)]
        out[:, 0, a:b] += y.offset[:, None]
    start = observer.opening(prior.excess, count)
    offset = _offsets(observer, start, prior, y, head)
    felt = (start.felt[:, :count] @ offset[..., None])[..., 0].swapaxes(1, 2)
    out[:, :, :count] += felt * observer.rate[..., None]
    if samples > count:
        return start.std, Prior(after, np.zeros_like(start.spread[:, 0]))
    last = start.power[:, samples]
    excess = last @ start.spread[:, samples - 1] @ last.swapaxes(1, 2)
    return start.std, Prior(after + (last @ offset[:, -1, :, None])[..., 0], excess)


def _offsets(observer: Observer, opening: Opening, prior: Prior, y: Run, head: Array) -> Array:
    """δ_k = (I + D G_k)^-1 D g_k, (joints, count, order), from the innovations of the stationary
    filter whose states are `head`.
    """
    f, count = observer.filter, head.shape[2]
    surprise = y.take(0, count)
    surprise[:, 0] -= prior.mean[:, 0]
    ahead = (f.transition[:, 0] / observer.rate)[:, None] @ head[:, :, :-1]
    surprise[:, 1:] -= ahead[:, 0]
    drive = opening.power[:, :count, 0] * (surprise * f.remainder[:, None])[..., None]
    return np.asarray((opening.spread @ np.cumsum(drive, axis=1)[..., None])[..., 0])

"""Reconstruct position, speed and acceleration with a Kalman observer or smoother.

    observer = design(sample_time, jerk_std, noise_variance, order)
    observe(y, observer)     from past samples (Kostić et al. 2004, eq. (16)-(21))
    smooth(y, observer)      from all samples (fixed interval; Rauch, Tung & Striebel 1965)

Each channel is a chain of integrators whose highest derivative, the jerk for order 3, is white and
held over a sample. The gain is the stationary one. The Kalman filter that starts with covariance
P_0 is the stationary filter plus the estimate of a constant offset δ of its first state (Lainiotis
1976, IEEE Trans. Autom. Control 21, p. 677), here at the start and after every gap:

    x_k = x_k^stationary + A^k δ_k,   δ_k = (I + D_0 G_k)^-1 D_0 g_k,   D_0 = P_0 - P,
    G_k = Σ_{j<=k} (c A^j)^T c A^j / S,   g_k = Σ_{j<=k} (c A^j)^T ν_j / S.

The smoother has the form of Bryson & Frazier 1963, which inverts no covariance: with innovations ν
of the stationary filter run backwards

    λ_k = A^T λ_{k+1} + c^T ν_k / S,     x_k^smooth = x_k + P λ_k,     covariance P - P Λ_k P.

Across a gap later samples act as information (J, r) about the predicted state. Missing samples are
predicted through, never interpolated. Everything within a block of samples is one matrix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.estimation import chain
from pipelines.estimation.chain import Array, Stationary

Indices = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

BLOCK = 32  # numerics: samples; longer blocks cost arithmetic, shorter ones carries
_DIFFUSE = 1e5  # numerics: noise in position, of a start that knows nothing; as much a derivative


@dataclass(frozen=True)
class Start:
    """The states before the first sample, in physical units; without it the start is diffuse."""

    mean: Array  # (joints, order)
    covariance: Array  # (joints, order, order)


@dataclass(frozen=True)
class Track:
    """Reconstructed states and their standard deviations."""

    states: Array  # (order, samples, joints): position, speed, acceleration, ...
    std: Array  # the same


class _Block:
    """Effect of a block of `size` samples, as matrices over [inputs, prediction at its start]."""

    def __init__(self, f: Stationary, size: int) -> None:
        joints, order = f.gain.shape
        power = chain.powers(f.predictor, size)
        entry = (f.transition @ f.gain[..., None])[:, None]
        pulse = (power[:, :size] @ entry)[..., 0]  # of an input, 1 … size samples later
        late = np.concatenate([np.zeros((joints, 1, order)), pulse[:, :-1]], axis=1)
        free = power[:, :size].transpose(0, 2, 3, 1)
        self.f, self.size, self.power, self.across = f, size, power, power[:, size]
        # (joints, order, size + order, size): to the predictions of all its samples
        self.predicted = np.concatenate([chain.impulse_toeplitz(late.swapaxes(1, 2)), free], axis=2)
        self.after = pulse[:, ::-1]  # (joints, size, order): from the inputs to what follows

    @cached_property
    def filtered(self) -> Array:
        """(joints, order, size + order, size): to the filtered states."""
        out = np.einsum("nst,ntij->nsij", self.f.updater, self.predicted)
        sample = np.arange(self.size)
        out[:, :, sample, sample] += self.f.gain[:, :, None]
        return np.asarray(out)

    @cached_property
    def _backward(self) -> tuple[Array, Array]:
        """Return innovations of [inputs, start], and λ (joints, λ, innovation, sample) of them."""
        surprise = -self.predicted[:, :1]
        surprise[:, 0, : self.size] += np.eye(self.size)
        row = (self.power[:, : self.size, 0] * self.f.remainder[:, None, None]).swapaxes(1, 2)
        return surprise, chain.impulse_toeplitz(row).swapaxes(2, 3)

    @cached_property
    def smoothed(self) -> Array:
        """(joints, order, size + 2 order, size): from [inputs, start, λ after]."""
        surprise, backward = self._backward
        spread = np.einsum("nst,ntji->nsji", self.f.prior, backward)
        end = np.einsum("nst,niut->nsui", self.f.prior, self.power[:, self.size : 0 : -1])
        return np.concatenate([self.predicted + surprise @ spread, end], axis=2)

    @cached_property
    def adjoint(self) -> Array:
        """(joints, size + order, order): from [inputs, start] to the block's part of λ."""
        surprise, backward = self._backward
        return np.asarray((surprise @ backward[..., :1])[..., 0].transpose(0, 2, 1))


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
    def rate(self) -> Array:
        """(h / T)^i: from scaled to physical time, (joints, order)."""
        return np.asarray((self.filter.step[:, None] / self.sample_time) ** np.arange(self.order))

    @cached_property
    def unit(self) -> Array:
        """One scaled state in physical units: √R (h / T)^i, (joints, order)."""
        return np.asarray(np.sqrt(self.noise_variance)[:, None] * self.rate)

    @cached_property
    def block(self) -> _Block:
        return _Block(self.filter, BLOCK)

    @property
    def gain(self) -> Array:
        """K of eq. (20), [1, 1/s, 1/s²] (joints, order)."""
        return np.asarray(self.filter.gain * self.rate)

    @property
    def std(self) -> Array:
        """(joints, order) of the filtered states after the start."""
        return np.asarray(np.sqrt(np.einsum("njj->nj", self.filter.posterior)) * self.unit)

    @cached_property
    def smoothed_std(self) -> Array:
        """(joints, order) of the smoothed states far from ends and gaps."""
        f = self.filter
        weight = _information(f, np.zeros_like(f.prior), f.settled)[:, -1]
        variance = np.einsum("njj->nj", f.prior - f.prior @ weight @ f.prior)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)) * self.unit)

    @property
    def settled(self) -> int:
        """Samples after which the gain is stationary and the start forgotten."""
        return self.filter.settled

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

    def pick(self, joints: Indices) -> Observer:
        """Return the observer of some of the joints."""
        f = self.filter
        names = [name for name in Stationary.__dataclass_fields__ if name != "order"]
        part = replace(f, **{name: getattr(f, name)[joints] for name in names})
        return Observer(self.sample_time, self.jerk_std[joints], self.noise_variance[joints], part)


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
    inside: Callable[[Array], Mask], low: Array, high: Array, rounds: int = 45
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
    return _track(y, observer, start, _observe)


def smooth(y: Array, observer: Observer, start: Start | None = None) -> Track:
    """Return the best reconstruction of `y` (samples, joints), NaN where missing.

    Raises:
        UsageError, InputRejected: as `observe`.
    """
    return _track(y, observer, start, _smooth)


@dataclass(frozen=True)
class _Prior:
    """Prediction of the next sample, scaled, and the excess D of its covariance over P."""

    mean: Array  # (joints, order)
    excess: Array  # (joints, order, order)
    shift: Array | float = 0.0  # (joints, order) of `mean` from the stationary filter's


# a stretch of samples without, or of nothing but missing ones: first, last + 1, measured
Stretch = tuple[int, int, bool]
_Work = Callable[[Observer, Array, list[Stretch], _Prior, Array, Array], None]


def _track(y: Array, observer: Observer, start: Start | None, work: _Work) -> Track:
    """Let `work` fill states and deviations of channels that miss the same samples."""
    if y.ndim != 2 or y.shape[1] != len(observer.jerk_std):
        words = f"the observer has {len(observer.jerk_std)} channels, "
        words += f"the measurement has shape {y.shape}"
        raise UsageError("C02", words, remedy="tune the observer on the same joints")
    if len(y) < 2:
        words = f"{len(y)} samples: nothing can be reconstructed"
        raise InputRejected("T08", words, remedy="record at least two samples")
    shape = (y.shape[1], observer.order, len(y))
    states, std = np.empty(shape), np.empty(shape)
    for joints, stretches in _alike(y):
        whole = len(joints) == y.shape[1]
        own = observer if whole else observer.pick(joints)
        first = next(a for a, _, measured in stretches if measured)
        offset = y[first, joints]
        values = np.subtract(y[:, joints].T, offset[:, None], order="C")
        out = (states, std) if whole else (states[joints], std[joints])
        work(own, values, stretches, _prior(own, start, joints, offset), *out)
        out[0][...] *= own.rate[..., None]
        out[0][:, 0] += offset[:, None]
        if not whole:
            states[joints], std[joints] = out
    return Track(states.transpose(1, 2, 0), std.transpose(1, 2, 0))


def _alike(y: Array) -> list[tuple[Indices, list[Stretch]]]:
    """Return the channels of `y` (samples, joints) that miss the same samples, and stretches."""
    with np.errstate(all="ignore"):
        if np.isfinite(y.sum()):  # half the time of checking every sample
            return [(np.arange(y.shape[1]), [(0, len(y), True)])]
    valid = np.isfinite(y)
    if np.isinf(y).any():
        words = "infinite values among the measurements"
        raise InputRejected("D03", words, remedy="mark what is missing as NaN")
    if not valid.any(axis=0).all():
        words = f"channel {int(np.argmin(valid.any(axis=0))) + 1} has no sample at all"
        raise InputRejected("D02", words, remedy="leave the channel out, or record it again")
    patterns, group = np.unique(valid.T, axis=0, return_inverse=True)
    found = []
    for k, mask in enumerate(patterns):
        edges = [0, *(1 + np.flatnonzero(np.diff(mask))).tolist(), len(mask)]
        stretches = [(a, b, bool(mask[a])) for a, b in pairwise(edges)]
        found.append((np.flatnonzero(group.ravel() == k), stretches))
    return found


def _prior(observer: Observer, start: Start | None, joints: Indices, offset: Array) -> _Prior:
    """Return the prediction of the first sample; the filter is linear in the means, whose unit is
    that of position.
    """
    f = observer.filter
    if start is None:
        wide = (_DIFFUSE / f.step[:, None] ** np.arange(f.order)) ** 2
        return _Prior(np.zeros(wide.shape), wide[:, :, None] * np.eye(f.order) - f.prior)
    mean = start.mean[joints].astype(np.float64)
    mean[:, 0] -= offset
    unit = observer.unit
    covariance = start.covariance[joints] / (unit[:, :, None] * unit[:, None, :])
    return _Prior(mean / observer.rate, covariance - f.prior)


def _observe(
    observer: Observer, y: Array, stretches: list[Stretch], prior: _Prior, out: Array, std: Array
) -> None:
    """Filter `y` (joints, samples) into scaled states `out` and deviations `std`."""
    std[...] = observer.std[..., None]
    for first, last, measured in stretches:
        rows = slice(first, last)
        if measured:
            covariance, prior = _filter_run(observer, y[:, rows], prior, out[:, :, rows])
        else:
            states, covariance = _predicted(observer, prior, last - first)
            out[:, :, rows] = states[:, :-1].swapaxes(1, 2)
            prior = _Prior(states[:, -1], covariance[:, -1] - observer.filter.prior)
            covariance = covariance[:, :-1]
        near = slice(first, first + covariance.shape[1])
        std[:, :, near] = _deviations(observer, covariance)


def _deviations(observer: Observer, covariance: Array) -> Array:
    """(joints, order, samples) in physical units of scaled covariances (joints, samples, …)."""
    variance = np.einsum("nkjj->njk", covariance)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)) * observer.unit[..., None])


def _predicted(observer: Observer, prior: _Prior, count: int) -> tuple[Array, Array]:
    """x_i = E^i x, P_i = E^i P E^iT + Q_i for i = 0 .. count, over `count` missing samples."""
    away, noise = _gap(observer, count)
    covariance = (observer.filter.prior + prior.excess)[:, None]
    covariance = away @ covariance @ away.swapaxes(2, 3) + noise
    return (away @ prior.mean[:, None, :, None])[..., 0], covariance


def _gap(observer: Observer, count: int) -> tuple[Array, Array]:
    """E^i and Q_i for i = 0 .. count: (joints, count + 1, order, order) each."""
    f = observer.filter
    away = chain.transition(f.order, np.multiply.outer(f.step, np.arange(count + 1)))
    jerk = f.tracking_index / f.step**f.order
    return away, chain.input_covariance(f.order, f.step, count, jerk)


def _forward(observer: Observer, y: Array, mean: Array) -> tuple[list[tuple[_Block, Array]], Array]:
    """Run the stationary filter over `y` (joints, samples) from the prediction `mean`.

    Returns whole blocks and the rest, each (joints, blocks, size + 2 order) with [inputs,
    prediction at its start, room for λ], and the prediction after all.
    """
    parts, n, whole = [], observer.order, y.shape[1] // BLOCK * BLOCK
    for piece in (y[:, :whole], y[:, whole:]):
        if size := min(piece.shape[1], BLOCK):
            block = observer.block if size == BLOCK else _Block(observer.filter, size)
            rows = np.empty((len(y), piece.shape[1] // size, size + 2 * n))
            rows[:, :, :size] = piece.reshape(*rows.shape[:2], size)
            starts = np.empty((len(y), rows.shape[1] + 1, n))
            starts[:, 0] = mean
            np.matmul(rows[:, :, :size], block.after, out=starts[:, 1:])
            chain.scan(block.across, starts)
            rows[:, :, size : size + n] = starts[:, :-1]
            mean = starts[:, -1]
            parts.append((block, rows))
    return parts, mean


def _places(out: Array, parts: list[tuple[_Block, Array]]) -> list[Array]:
    """Return `out` (joints, order, samples) as (joints, order, blocks, size) of every part."""
    edges = np.cumsum([0, *(rows.shape[1] * block.size for block, rows in parts)]).tolist()
    return [
        out[:, :, a:b].reshape(*out.shape[:2], -1, block.size)
        for (block, _), a, b in zip(parts, edges[:-1], edges[1:], strict=True)
    ]


def _filter_run(observer: Observer, y: Array, prior: _Prior, out: Array) -> tuple[Array, _Prior]:
    """Filter samples without a gap into `out` (joints, order, samples).

    Returns the covariances where the start is felt, and the prediction of the next sample.
    """
    f, samples = observer.filter, y.shape[1]
    parts, after = _forward(observer, y, prior.mean)
    for (block, rows), target in zip(parts, _places(out, parts), strict=True):
        np.matmul(rows[:, None, :, : -f.order], block.filtered, out=target)
    count = min(samples, f.settled)
    surprise = y[:, :count].copy()
    surprise[:, 0] -= prior.mean[:, 0]
    surprise[:, 1:] -= np.einsum("ni,nik->nk", f.transition[:, 0], out[:, :, : count - 1])
    power = chain.powers(f.predictor, count)
    row = power[:, :count, 0]  # c A^k
    weighed = row * f.remainder[:, None, None]
    known = np.cumsum(row[..., :, None] * weighed[..., None, :], axis=1)
    spread = _spread(prior.excess, known)
    offset = spread @ np.cumsum(weighed * surprise[..., None], axis=1)[..., None]
    felt = f.updater[:, None] @ power[:, :count]
    out[:, :, :count] += (felt @ offset)[..., 0].swapaxes(1, 2)
    covariance = f.posterior[:, None] + felt @ spread @ felt.swapaxes(2, 3)
    last = power[:, count]
    shift = (last @ offset[:, -1])[..., 0]
    return covariance, _Prior(after + shift, last @ spread[:, -1] @ last.swapaxes(1, 2), shift)


def _spread(excess: Array, known: Array) -> Array:
    """(I + D G)^-1 D for `known` G (joints, ..., n, n), D scaled: it may hold 1e20 and 1e-3."""
    scale = np.sqrt(np.maximum(np.abs(np.einsum("njj->nj", excess)), 1e-300))
    more = (slice(None),) + (None,) * (known.ndim - 3)
    across = (scale[:, :, None] * scale[:, None, :])[more]
    d = excess[more] / across
    system = np.eye(excess.shape[-1]) + d @ (known * across)
    return np.asarray(np.linalg.solve(system, np.broadcast_to(d, known.shape)) * across)


def _smooth(
    observer: Observer, y: Array, stretches: list[Stretch], prior: _Prior, out: Array, std: Array
) -> None:
    """Smooth `y` (joints, samples) into `out` and `std`: forward for the priors, then backward."""
    f = observer.filter
    priors, room = [prior], np.empty((0, 0))
    if len(stretches) > 1:
        room = np.empty_like(out)
    for first, last, measured in stretches[:-1]:
        if measured:
            rows = slice(first, last)
            priors.append(_filter_run(observer, y[:, rows], priors[-1], room[:, :, rows])[1])
        else:
            states, covariance = _predicted(observer, priors[-1], last - first)
            priors.append(_Prior(states[:, -1], covariance[:, -1] - f.prior))
    information, pull = np.zeros_like(f.prior), np.zeros_like(prior.mean)
    shifts = [*(one.shift for one in priors[1:]), 0.0]
    for (first, last, measured), before, shift in zip(
        stretches[::-1], priors[::-1], shifts[::-1], strict=True
    ):
        rows = slice(first, last)
        if measured:
            pull = pull + (information @ np.broadcast_to(shift, pull.shape)[..., None])[..., 0]
            target = (out[:, :, rows], std[:, :, rows])
            later = (information, pull)
            information, pull = _smooth_run(observer, y[:, rows], before, later, target)
            continue
        states, covariance = _predicted(observer, before, last - first)
        away, noise = (x[:, :0:-1] for x in _gap(observer, last - first))  # to the end of the gap
        carry = away.swapaxes(2, 3) @ np.linalg.inv(np.eye(f.order) + information[:, None] @ noise)
        known, pulled = carry @ information[:, None] @ away, carry @ pull[:, None, :, None]
        system = np.eye(f.order) + covariance[:, :-1] @ known
        spread = np.asarray(np.linalg.solve(system, covariance[:, :-1]))
        out[:, :, rows] = (states[:, :-1, :, None] + spread @ pulled)[..., 0].swapaxes(1, 2)
        std[:, :, rows] = _deviations(observer, spread)
        information, pull = known[:, 0], pulled[:, 0, :, 0]


def _smooth_run(
    observer: Observer,
    y: Array,
    prior: _Prior,
    later: tuple[Array, Array],
    out: tuple[Array, Array],
) -> tuple[Array, Array]:
    """Smooth samples without a gap: by the stationary filter, then by the offset of its start.

    Args:
        later: J (joints, order, order) and r (joints, order) about the prediction after its end.

    Returns the same about the prediction of its first sample.
    """
    f, n, samples, (states, std) = observer.filter, observer.order, y.shape[1], out
    weigh = np.linalg.inv(np.eye(n) + later[0] @ f.prior)
    end = (weigh @ later[1][..., None])[..., 0]
    parts, _ = _forward(observer, y, prior.mean)
    for (block, rows), target in reversed(list(zip(parts, _places(states, parts), strict=True))):
        drive = np.empty((len(y), rows.shape[1] + 1, n))  # from the last block to the first
        drive[:, 0] = end
        drive[:, 1:] = (rows[:, :, :-n] @ block.adjoint)[:, ::-1]
        chain.scan(block.across.swapaxes(1, 2), drive)
        rows[:, :, -n:] = drive[:, -2::-1]
        np.matmul(rows[:, None], block.smoothed, out=target)
        end = drive[:, -1]
    count = min(samples, f.settled)
    known = _information(f, weigh @ later[0], count)
    near = np.unique(np.r_[0:count, samples - count : samples])
    weight, prior_covariance = known[:, np.minimum(samples - near, count)], f.prior[:, None]
    power = chain.powers(f.predictor, count)[:, :count]
    felt = (np.eye(n) - prior_covariance @ weight[:, :count]) @ power
    spread = _spread(prior.excess, known[:, -1])
    offset = felt @ (spread @ end[..., None])[:, None]
    states[:, :, :count] += offset[..., 0].swapaxes(1, 2)
    covariance = prior_covariance - prior_covariance @ weight @ prior_covariance
    covariance[:, :count] += felt @ spread[:, None] @ felt.swapaxes(2, 3)
    std[:, :, count : samples - count] = observer.smoothed_std[..., None]
    std[:, :, near] = _deviations(observer, covariance)
    back = np.linalg.inv(np.eye(n) - known[:, -1] @ f.prior)
    return back @ known[:, -1], (back @ end[..., None])[..., 0]


def _information(f: Stationary, end: Array, count: int) -> Array:
    """Λ seen from m = 0 .. count samples before an end that knows `end`:

    Σ_{i<m} (c A^i)^T c A^i / S + A^mT Λ_end A^m.
    """
    power = chain.powers(f.predictor, count)
    row = power[:, :count, 0]
    weighed = row * f.remainder[:, None, None]
    total = power.swapaxes(2, 3) @ end[:, None] @ power
    total[:, 1:] += np.cumsum(row[..., :, None] * weighed[..., None, :], axis=1)
    return np.asarray(total)

"""Tune observer and smoother: from a rule, from a bandwidth, or from the data themselves.

The paper's rule (largest jerk of the reference) hardly filters and is only a first guess (Kostić et
al. 2004, sec. IV-C.2). The data give the likelihood of the innovations (prediction error
decomposition, Schweppe 1965); whether they agree with the observer is seen in the whiteness of the
innovations. A smoother needs another jerk level: on a smooth excitation the likelihood looks one
sample ahead and asks for 20 to 50 times more jerk than is best for a filter that sees both sides,
which cross-validation finds (Craven & Wahba 1979).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.estimation import chain
from pipelines.estimation.chain import ORDERS, Array, stationary
from pipelines.estimation.config import TuningConfig
from pipelines.estimation.state_estimation import BLOCK, Observer, bisected, observe

_CONFIG = TuningConfig()
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Tuned:
    """Jerk level and measurement noise that the data of each channel ask for."""

    jerk_std: Array  # σ (channels,); the slowest one tried of a channel that stood still
    noise_variance: Array  # R (channels,)


def paper_rule(reference: Array, sample_time: float, order: int = 3) -> Array:
    """σ = largest highest derivative of the reference (samples, channels).

    Kostić et al. 2004, sec. IV-C.2, after its [34].
    """
    if len(reference) <= order:
        words = f"{len(reference)} samples of a reference have no derivative of order {order}"
        raise InputRejected("T08", words, remedy="give a longer reference")
    steepest = np.nanmax(np.abs(np.diff(reference, n=order, axis=0)), axis=0)
    return np.asarray(steepest / sample_time**order)


def smoother_bandwidth(observer: Observer, twice: bool = False) -> Array:
    """Return the frequency [Hz] (channels,) to which the smoother passes the position with -3 dB.

    G = Λ² N / (w^n + Λ² N) = 1/√2, see `sigma_for_bandwidth`.

    Args:
        twice: where it goes over what it left once more: 1 - (1 - G)² = 1/√2.
    """
    f, root = observer.filter, np.sqrt(0.5)
    left = np.sqrt(1.0 - root) if twice else 1.0 - root  # 1 - G
    limit = left / (1.0 - left) * f.tracking_index**2
    start = np.full(len(limit), np.log(1e-12))
    low, _ = bisected(
        lambda x: np.exp(x) ** f.order <= limit * f.numerator(np.exp(x)),
        start,
        np.full(len(limit), np.log(4.0)),
        60,
    )
    half = np.minimum(np.exp(low / 2.0) / 2.0, 1.0)
    return np.asarray(np.arcsin(half) / (np.pi * observer.sample_time))


def sigma_for_bandwidth(
    bandwidth_hz: Array | float,
    sample_time: float,
    noise_variance: Array | float,
    order: int = 3,
    smoother: bool = False,
) -> Array:
    """Return the jerk level whose observer (or smoother) passes -3 dB at `bandwidth_hz`.

    The smoother passes Λ² N / (w^n + Λ² N) with N = |numerator|², w = 4 sin²(π f T): solved for Λ.

    Raises:
        UsageError: C02, a bandwidth out of reach.
    """
    hz, variance = np.broadcast_arrays(
        np.atleast_1d(np.asarray(bandwidth_hz, dtype=np.float64)), noise_variance
    )
    if not np.all((hz > 0.0) & (hz < 0.5 / sample_time)):
        remedy = f"choose one between 0 and half the rate, {0.5 / sample_time:g} Hz"
        raise UsageError("C02", "the bandwidth of an observer", remedy=remedy)
    angle = 2.0 * np.pi * hz * sample_time
    if smoother:
        w = 4.0 * np.sin(angle / 2.0) ** 2
        numerator = stationary(order, np.ones(1)).numerator(w)
        index = np.sqrt(w**order / ((np.sqrt(2.0) - 1.0) * numerator))
        return np.asarray(index * np.sqrt(variance) / sample_time**order)

    def slow(log_index: Array) -> Mask:
        gain = stationary(order, np.exp(log_index)).position_gain(angle)
        return np.asarray(gain < np.sqrt(0.5))

    low, high = np.full(hz.shape, np.log(1e-14)), np.full(hz.shape, np.log(1e6))
    if slow(high).any():
        words = f"no observer of order {order} is that fast"
        raise UsageError("C02", words, remedy="choose a smaller bandwidth")
    high = bisected(slow, low, high, 40)[1]
    return np.asarray(np.exp(high) * np.sqrt(variance) / sample_time**order)


def innovations(y: Array, observer: Observer) -> Array:
    """Return what each measurement adds to its prediction, over its expected deviation.

    NaN at missing samples and while settling.
    """
    f, track, index = observer.filter, observe(y, observer), np.arange(len(y))[:, None]
    ahead = np.full(y.shape, np.nan)
    row = f.transition[:, 0] / observer.rate
    ahead[1:] = np.einsum("ni,ikn->kn", row, track.states[:, :-1])
    surprise = (y - ahead) / np.sqrt(observer.noise_variance / f.remainder)
    # the covariance settles twice as fast as the states, and 1e-8 will do
    wait = min(observer.settled // 4 + observer.order, len(y) // 2)
    since = index - np.maximum.accumulate(np.where(np.isfinite(y), -1, index), axis=0)
    surprise[since <= wait] = np.nan
    return np.asarray(surprise)


def whiteness(innovation: Array, lags: int = 30) -> tuple[Array, Array]:
    """Return how far (samples, channels) is from white noise, and its autocorrelation (lags, …).

    Portmanteau statistic Q = N (N + 2) Σ r_k² / (N - k). Ljung & Box 1978, Biometrika 65, p. 297.
    Q is χ² with `lags` degrees of freedom for white noise, here made standard: (Q - lags) / √(2
    lags). Missing samples (NaN) drop out of the sums.
    """
    present = np.isfinite(innovation)
    count = present.sum(axis=0)
    mean = np.where(present, innovation, 0.0).sum(axis=0) / np.maximum(count, 1)
    rest = np.where(present, innovation - mean, 0.0)
    steps = range(1, min(lags, len(rest) - 1) + 1)
    pairs = np.stack([np.count_nonzero(present[k:] & present[:-k], axis=0) for k in steps])
    product = np.stack([np.einsum("kn,kn->n", rest[k:], rest[:-k]) for k in steps])
    correlation = product / np.maximum((rest**2).sum(axis=0), 1e-300)
    q = count * (count + 2.0) * (correlation**2 / np.maximum(pairs, 1)).sum(axis=0)
    return (q - len(steps)) / np.sqrt(2.0 * len(steps)), correlation


def tune_jerk(y: Array, sample_time: float, resolution: Array | float, order: int = 3) -> Tuned:
    """Return σ of every channel of `y` (samples, channels) by the likelihood of its innovations.

    R is Δθ²/12 (Kostić et al. 2004, sec. IV-C.2) unless the data show more than twice as much: an
    encoder that counts more coarsely than described, or a noisy one. It is never set below Δθ²/12:
    the quantisation of slow motion is no white noise and would feign less. A channel that stands
    still for a while is judged by the rest. Spikes must have been marked missing (NaN).

    Raises:
        UsageError: C02, an order or a resolution that is none.
        InputRejected: T04, no stretch without gaps is long enough.
    """
    if order not in ORDERS:
        words = f"an observer of order {order} is not known"
        raise UsageError("C02", words, remedy="choose order 2, 3 or 4")
    step = np.broadcast_to(np.asarray(resolution, dtype=np.float64), y.shape[1:])
    if not np.all(step > 0.0):
        words = "the resolution of an encoder must be a positive number"
        raise UsageError("C02", words, remedy="give its smallest step")
    found, banks = [], dict[float, _Bank]()
    for j in range(y.shape[1]):
        values, lively = _window(y[:, j], float(step[j]))
        slowest = min((8.0 * 37.0 / len(values)) ** order, 1e-2)  # settles within the window
        if slowest not in banks:
            banks[slowest] = _Bank(order, np.geomspace(slowest, 1e4, 30))
        found.append(_most_likely(values, lively, banks[slowest], float(step[j]) ** 2 / 12.0))
    index, variance = (np.array(column) for column in zip(*found, strict=True))
    return Tuned(index * np.sqrt(variance) / sample_time**order, variance)


def tune_smoother(y: Array, sample_time: float, resolution: Array | float, order: int = 3) -> Tuned:
    """Return σ of the smoother of every channel by generalised cross-validation, without any R.

    Craven & Wahba 1979. The smoother leaves (1 - G) y, 1 - G = w^n / (w^n + Λ² |numerator|²), so
    from the n-th difference d of the signal alone

        V(Λ) = mean [w^n / (w^n + Λ² |numerator|²)² |d|²] / (mean [1 - G])²,
        R = that sum / mean [1 - G].
    """
    step = np.broadcast_to(np.asarray(resolution, dtype=np.float64), y.shape[1:])
    unit, found = stationary(order, np.ones(1)), []
    for j in range(y.shape[1]):
        values = _window(y[:, j], float(step[j]))[0]
        d = np.diff(values, n=order)
        taper = np.sin(np.pi * (np.arange(len(d)) + 0.5) / len(d)) ** 2
        power = np.abs(np.fft.rfft(d * taper)) ** 2 / (taper**2).sum()
        # at zero frequency the smoother leaves nothing
        w = 4.0 * np.sin(np.pi * np.fft.rfftfreq(len(d))[1:]) ** 2
        passed, weight = unit.numerator(w) / w**order, power[1:] / w**order
        grid = np.geomspace(min((8.0 * 37.0 / len(values)) ** order, 1e-2), 1e4, 30)
        for _ in range(3):
            left = np.multiply.outer(grid**2, passed)
            left += 1.0
            np.divide(1.0, left, out=left)  # 1 - G
            free = left.sum(axis=1) / len(power)
            rest = np.square(left, out=left) @ weight / len(power)
            best = int(np.argmin(rest / free**2))
            index, ratio = float(grid[best]), grid[1] / grid[0]
            grid = np.geomspace(index / ratio, index * ratio, 13)
        given = float(step[j]) ** 2 / 12.0
        variance = float(np.clip(rest[best] / free[best], given, _CONFIG.noise_cap * given))
        found.append((index, variance if variance > _CONFIG.noisier * given else given))
    every, variances = (np.array(column) for column in zip(*found, strict=True))
    return Tuned(every * np.sqrt(variances) / sample_time**order, variances)


def _most_likely(values: Array, lively: Mask, bank: _Bank, given: float) -> tuple[float, float]:
    """Return Λ and R of one channel, `given` the variance that counting in steps leaves."""
    grid, index, variance = bank.filter.tracking_index, 0.0, given
    if not lively.any():
        return float(grid[0]), given
    for finer in range(3):  # twice finer around the best of either criterion
        if finer:
            ratio = grid[1] / grid[0]
            grid = np.geomspace(index / ratio, index * ratio, 13)
            bank = _Bank(bank.filter.order, grid)
        mean_square, remainder = bank.mean_square(values, lively), bank.filter.remainder
        expected = given / remainder
        fixed = np.log(expected) + mean_square / expected  # -2 log likelihood a sample, R given
        noise = np.clip(mean_square * remainder, given, _CONFIG.noise_cap * given)
        free = np.log(noise / remainder) + mean_square * remainder / noise  # R the data's
        best = int(np.argmin(free))
        clearly = free[best] < fixed.min() - 20.0 / np.count_nonzero(lively)
        noisy = bool(noise[best] > _CONFIG.noisier * given and clearly)
        best = best if noisy else int(np.argmin(fixed))
        index, variance = float(grid[best]), float(noise[best] if noisy else given)
    return index, variance


def _window(y: Array, step: float) -> tuple[Array, Mask]:
    """Return the liveliest unbroken stretch of a channel, and which of its samples move."""
    valid = np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], valid.view(np.int8), [0]])))
    lengths = edges[1::2] - edges[::2]
    if not lengths.size or lengths.max() < 3 * BLOCK:
        words = "no stretch without gaps is long enough to tune an observer on"
        remedy = f"record {3 * BLOCK} samples without a gap, or give the bandwidth"
        raise InputRejected("T04", words, remedy=remedy)
    first = int(edges[2 * int(np.argmax(lengths))])
    run, window = y[first : first + int(lengths.max())], _CONFIG.window
    if len(run) > window:
        travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(run)))])
        begin = int(np.argmax(travel[window - 1 :] - travel[: len(run) - window + 1]))
        run = run[begin : begin + window]
    run = run[: len(run) // BLOCK * BLOCK]
    parts = np.array_split(np.arange(len(run)), max(1, len(run) // _CONFIG.still))
    starts, sizes = [part[0] for part in parts], [len(part) for part in parts]
    travelled = np.maximum.reduceat(run, starts) - np.minimum.reduceat(run, starts)
    return run, np.repeat(travelled > 2.5 * step, sizes)


class _Bank:
    """Many stationary filters and what a block of each does."""

    def __init__(self, order: int, index: Array) -> None:
        f = self.filter = stationary(order, index)
        self.power = chain.powers(f.predictor, BLOCK)
        into = (f.transition @ f.gain[..., None])[:, None]
        self.entry = (self.power[:, :BLOCK] @ into)[..., 0]  # A^i E k
        late = np.concatenate([np.zeros((len(index), 1)), self.entry[:, :-1, 0]], axis=1)
        self.inside = np.eye(BLOCK) - chain.impulse_toeplitz(late)
        self.free = -self.power[:, :BLOCK, 0].swapaxes(1, 2)

    def mean_square(self, values: Array, lively: Mask) -> Array:
        """Return the mean squared innovation (filters,), over motion, a quarter left out."""
        counted = lively.copy()
        if np.count_nonzero(lively[len(values) // 4 :]) > len(values) // 16:
            counted[: len(values) // 4] = False  # long enough for the slowest filter to settle
        surprise = self._surprise(values)
        total = np.square(surprise, out=surprise) @ counted.astype(np.float64)
        return np.asarray(np.maximum(total / np.count_nonzero(counted), 1e-300))

    def _surprise(self, values: Array) -> Array:
        """Return the innovations (filters, samples) of one channel; whole blocks only."""
        y = (values - values[0]).reshape(1, -1, BLOCK)
        drive = np.zeros((len(self.entry), y.shape[1], self.filter.order))
        away = np.arange(BLOCK) - (BLOCK - 1) / 2.0
        slope = float(away @ y[0, 0] / (away @ away))  # start on the line through the first block
        drive[:, 0, 0], drive[:, 0, 1] = y[0, 0].mean() + slope * away[0], slope / self.filter.step
        drive[:, 1:] = y[:, :-1] @ self.entry[:, ::-1]
        chain.scan(self.power[:, BLOCK], drive)
        found = y @ self.inside
        found += drive @ self.free
        return np.asarray(found).reshape(len(self.entry), -1)

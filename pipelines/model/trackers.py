"""Ways to get from the positions on a grid to motion: Kalman observer and smoother, and the textbook's differences.

    track = filter_tracker(tuned, how)           smoother or observer, with deviations
    track = difference_tracker(seen, how)        central differences, of what a zero-phase low-pass leaves or of the samples
    states, std = track(y)                       (samples, joints), NaN where missing -> (3 or more, samples, joints) each
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from pipelines.errors import UsageError
from pipelines.io.log import Array
from pipelines.model.measured import Measured
from pipelines.model.tuned import Observers, Reconstruction, tuned_observers
from pipelines.quality.segments import Mask, long_blocks
from pipelines.signal.grid import Tracker
from pipelines.signal.observer import Observer, Track, observe
from pipelines.signal.smoother import Smoother, smooth, twicing_growth

__all__ = ["difference_tracker", "filter_tracker"]

Indices = npt.NDArray[np.intp]
Run = Callable[[Array], tuple[Array, Array]]

_LEAD = 2  # missing samples at the very start that are predicted from what comes after
_CUTOFF_HZ = 100.0  # of the zero-phase filter where no bandwidth is asked for
_FASTEST = 0.4  # of the rate, its cut-off


def filter_tracker(tuned: Observers, how: Reconstruction) -> Tracker:
    """The filter of one grid: (samples, joints) with NaN where missing -> (3 or more, samples, joints) and deviations."""
    if how.method == "observer":
        return _padded(tuned.causal, lambda y, joints: observe(y, tuned.causal if joints is None else tuned.causal.pick(joints)))
    inner, outer = _smoother(tuned.smoothing), _smoother(tuned.causal)
    if not tuned.twice:
        return inner
    inner = _twice(inner, tuned.smoothing.order)

    def run(y: Array) -> tuple[Array, Array]:
        (states, std), (ends, ends_std) = inner(y), outer(y)
        for j, reach in enumerate(_reach(tuned.smoothing).tolist()):
            near = _near_ends(np.isnan(y[:, j]), reach)
            states[:, near, j], std[:, near, j] = ends[:, near, j], ends_std[:, near, j]
        return states, std

    return run


def _twice(run: Run, order: int) -> Run:
    """What `run` leaves of the samples goes through it once more, and is added. See `Observers`."""

    def again(y: Array) -> tuple[Array, Array]:
        states, std = run(y)
        more, _ = run(y - states[0])
        growth = np.ones(len(states))
        growth[:order] = twicing_growth(order)
        return states + more, std * growth[:, None, None]

    return again


def _smoother(observer: Observer) -> Run:
    own = Smoother(observer)
    return _padded(observer, lambda y, joints: smooth(y, own if joints is None else own.pick(joints)))


def _padded(observer: Observer, filter_: Callable[[Array, Indices | None], Track]) -> Run:
    """`filter_` over the joints and samples that it can know; NaN elsewhere; and an acceleration whatever the order."""
    order = observer.order

    def run(y: Array) -> tuple[Array, Array]:
        states, std = (np.full((max(3, order), *y.shape), np.nan) for _ in range(2))
        present = np.isfinite(y)
        lead = present.argmax(axis=0)
        lead[lead <= _LEAD] = 0
        lead[present.sum(axis=0) <= order] = len(y)  # fewer samples than states: the joint is not known here
        for first in np.unique(lead[lead < len(y)]).tolist():
            joints = np.flatnonzero(lead == first)
            whole = len(joints) == y.shape[1]
            track = filter_(y[first:], None) if whole else filter_(y[first:, joints], joints)
            where = slice(None) if whole else joints
            states[:order, first:, where] = track.states
            std[:order, first:, where] = track.full_std()
        if order == 2:  # the held acceleration itself, known as well as it is bounded
            states[2] = np.gradient(states[1], observer.sample_time, axis=0)
            std[2] = np.where(np.isfinite(std[1]), observer.jerk_std, np.nan)
        return states, std

    return run


def _reach(observer: Observer) -> Indices:
    """(joints,) samples after which an end is forgotten to about 1/1000."""
    samples = 7.0 / -np.log(np.abs(observer.filter.poles).max(axis=1))
    return np.asarray(np.ceil(samples), dtype=np.intp)


def _near_ends(lost: Mask, reach: int) -> Mask:
    """Samples within `reach` of an end or of a long block that is missing."""
    near = np.zeros(len(lost), dtype=bool)
    for a, b in [(0, 0), (len(lost), len(lost)), *long_blocks(lost)]:
        near[max(0, a - reach):b + reach] = True
    return near


def difference_tracker(seen: Measured, how: Reconstruction) -> Tracker:
    """Central differences, of the samples or of what a zero-phase low-pass leaves of them: textbook methods without deviations."""
    lowest, highest = 1.0 / (seen.longest.size * seen.step), _FASTEST / seen.step
    if how.method == "zero-phase" and not all(lowest <= hz <= highest for hz in how.bandwidth or ()):
        raise UsageError("C02", "a cut-off whose period is longer than the log, or near half the rate", where="--bandwidth",
                         remedy=f"choose between {lowest:.2g} and {highest:.3g} Hz")

    def central(y: Array) -> tuple[Array, Array | None]:
        dq, ddq = np.full_like(y, np.nan), np.full_like(y, np.nan)
        dq[1:-1] = (y[2:] - y[:-2]) / (2.0 * seen.step)
        ddq[1:-1] = (y[2:] - 2.0 * y[1:-1] + y[:-2]) / seen.step**2
        return np.stack([y, dq, ddq]), None

    def zero_phase_central(y: Array) -> tuple[Array, Array | None]:
        from pipelines.signal.filters import design_low_pass, zero_phase

        whole = y if np.isfinite(y).all() else _completed(seen, y)
        cutoff = _CUTOFF_HZ if how.bandwidth is None else max(how.bandwidth)
        low_pass = design_low_pass(min(cutoff, highest), 1.0 / seen.step)
        return central(zero_phase(whole, low_pass) if len(y) > low_pass.padding else whole)

    return zero_phase_central if how.method == "zero-phase" else central


def _completed(seen: Measured, y: Array) -> Array:
    """Missing samples as the smoother predicts them."""
    how = Reconstruction()
    states, _ = filter_tracker(tuned_observers(seen.good, seen.y, seen.longest, seen.step, how), how)(y)
    whole, at = np.where(np.isfinite(y), y, states[0]), np.arange(len(y))
    for column in whole.T:  # before the first sample, or a joint without any
        known = np.isfinite(column)
        column[~known] = np.interp(at[~known], at[known], column[known]) if known.any() else 0.0
    return whole

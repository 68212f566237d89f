"""Condition torque and columns alike before they become equations: low-pass, decimation, no slow samples."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.estimation.filters import (
    KEEP,
    LowPass,
    choose_decimation,
    choose_step,
    design_low_pass,
)
from pipelines.io.limits import GAP_TICKS

__all__ = ["HIGHEST", "Conditioning", "condition", "cutoff_at", "wanted_cutoff"]

HIGHEST = 0.4  # of the rate: a low-pass from there on takes nothing away that would be worth it
_SPEED_SHARE = 0.999  # of the power of the speed, below the highest frequency of a motion
_DRY_SHARE = 0.99  # of the power of dry friction: of a square wave 40 harmonics
_REVERSAL = 0.01  # of its largest speed: where a joint is slower, it reverses; as the friction that is fitted, at 1 rad/s
_STIFF_HZ = 10.0  # [Hz] arms do not bend below (Kostić et al. 2004, Section IV.C.3)
_SHORT = 0.5  # of the longest stretch without a gap


@dataclass(frozen=True)
class Conditioning:
    """The filter and decimation of torque and columns. See `condition` for the defaults."""

    low_pass: LowPass | None
    cutoff_hz: float | None
    decimation: int
    step: Fraction  # samples between rows that are thinned out in the frequency domain; may be fractional
    min_speed: tuple[float, ...]  # [rad/s] slower samples of a joint are left out of its own equations


def condition(motion: Motion, rate: float, cutoff_hz: float | None, decimation: int | None, min_speed: Array,
              keep: float = KEEP) -> Conditioning:
    """The filter for a log, its cut-off from the motion where none is given; none where the rate is too low for it.

    Args:
        keep: samples left in a period of the cut-off, where no decimation is given.
    """
    cutoff = cutoff_at(wanted_cutoff(motion, rate) if cutoff_hz is None else cutoff_hz, rate)
    speeds = tuple(map(float, min_speed))
    if cutoff is None:
        return Conditioning(None, None, decimation or 1, Fraction(decimation or 1), speeds)
    every = decimation or choose_decimation(cutoff, rate, keep)
    step = Fraction(decimation) if decimation else choose_step(cutoff, rate, keep)
    return Conditioning(design_low_pass(cutoff, rate), cutoff, every, step, speeds)


def cutoff_at(cutoff_hz: float | None, rate: float) -> float | None:
    """Return the cut-off that several logs share, for a log of `rate`; None where it lies above the band of that log."""
    return cutoff_hz if cutoff_hz is not None and cutoff_hz < HIGHEST * rate else None


def wanted_cutoff(motion: Motion, rate: float) -> float:
    """The cut-off [Hz] that leaves all that `motion` excites; from `HIGHEST` of the rate on it asks for none.

    The torque of the rigid body has harmonics of the motion: five times f keeps them, where 99.9 % of the power of the speed is
    below f, and leaves out what only noise and structure fill. Dry friction follows the direction of motion alone, and its
    harmonics end nowhere: of a square wave those from the n-th on hold 4 / (π² n) of the power. They tell friction from weight
    where the motion is slow, and are kept as far as arms do not bend.
    """
    known = np.isfinite(motion.dq).all(axis=1)
    t, dq = motion.t[known], motion.dq[known]
    size = dq.std(axis=0)
    dq, size = dq[:, size > 0.0], size[size > 0.0]
    rigid = 5.0 * _highest_frequency(t, (dq - dq.mean(axis=0)) / size, rate, _SPEED_SHARE)
    if rigid >= _STIFF_HZ or not size.size:
        return rigid
    # joints by their speed: the noise of one that is held has no direction
    direction = np.tanh(dq / (_REVERSAL * np.abs(dq).max(axis=0))) * size
    dry = _highest_frequency(t, direction - direction.mean(axis=0), rate, _DRY_SHARE)
    return max(rigid, min(dry, _STIFF_HZ))


def _highest_frequency(t: Array, x: Array, rate: float, share: float) -> float:
    """Below it lies `share` of the power of `x` (samples, joints) [Hz].

    Of stretches without a gap, each by itself: laid end to end, a jump would count as the fastest motion. Short ones, whose own
    ends are that as well, count only where there are no longer ones; where a few samples are lost, a straight line does.
    """
    cut = 1 + np.flatnonzero(np.diff(t) > GAP_TICKS / rate)
    stretches = [_even(own, some, rate) for own, some in zip(np.split(t, cut), np.split(x, cut), strict=True)]
    longest = max(map(len, stretches))
    power = np.sum([np.sum(np.abs(np.fft.rfft(some * np.hanning(len(some))[:, None], longest, axis=0)) ** 2, axis=1)
                    for some in stretches if len(some) >= _SHORT * longest], axis=0)
    total = np.cumsum(power)
    return float(np.searchsorted(total, share * total[-1]) + 1) * rate / longest if total[-1] > 0.0 else rate


def _even(t: Array, x: Array, rate: float) -> Array:
    """`x` (samples, joints) at an even rate."""
    if len(t) < 2 or np.diff(t).max() < 1.5 / rate:
        return x
    every = np.arange(t[0], t[-1] + 0.5 / rate, 1.0 / rate)
    return np.stack([np.interp(every, t, column) for column in x.T], axis=1)

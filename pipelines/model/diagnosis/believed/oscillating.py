"""What is left of a joint oscillates by itself: a line in its spectrum, which no noise of an arm in order has.

    seen = oscillation(data, left)          seen.stands (joints,) times what lies beside it, seen.hertz, seen.rms

The noise of a drive, white or slow, has a smooth spectrum, and what a law of friction leaves follows the motion, whose frequencies
are many. A current loop that hunts, or a controller at the edge of what is stable, has one, whatever the arm does. Its power may
pass for noise of the drive, so that no floor tells it; its line does not. The spectrum is averaged over stretches of time (Welch
1967), and held against the greater of its medians below and above.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.rows.data import Data
from pipelines.signal.spectra import welch

__all__ = ["Oscillation", "oscillation"]

_SECONDS = 2.5  # of a stretch: lines are told to half a hertz
_LOWEST = 2.0  # [Hz]
_HIGHEST = 0.4  # of the rate of rows
_BESIDE, _WIDE = 1.8, 0.25  # up to so many times the frequency, and down, but nearer than a fourth
_FEWEST = 4  # stretches, two of each half
_ALIKE = 0.02  # of the spacing of rows, by which that of other logs may differ


@dataclass(frozen=True, eq=False)
class Oscillation:
    """The line of each joint that stands out most. Arrays (joints,)."""

    stands: Array  # times the spectrum beside it, the less of both halves of the stretches; 0 where nothing can be said
    hertz: Array
    rms: Array  # [N m]


def oscillation(data: Data, left: Array) -> Oscillation:
    """Of a residual `left` (rows,) [N m]."""
    found = [_of_joint(data, left, joint) for joint in range(data.n_joints)]
    return Oscillation(*(np.array(each) for each in zip(*found, strict=True)))


def _of_joint(data: Data, left: Array, joint: int) -> tuple[float, float, float]:
    step = float(np.median(np.diff(data.logs[0].t)))
    size = round(_SECONDS / step)
    seen = [welch(piece, 1.0 / step, size) for piece in _pieces(data, left, joint, step, size)]
    if len(seen) < _FEWEST or _HIGHEST / step <= _LOWEST:
        return 0.0, np.nan, 0.0
    hertz, powers = seen[0].frequency, np.array([one.density * one.resolution for one in seen])  # [N m^2] by frequency
    stands = [_stands(hertz, half.mean(axis=0), _HIGHEST / step) for half in (powers, powers[::2], powers[1::2])]
    at = int(np.argmax(stands[0]))
    near = np.abs(hertz / max(hertz[at], _LOWEST) - 1.0) < _WIDE
    power = powers.mean(axis=0)[near]
    return (float(min(one[near].max() for one in stands)), float(hertz[near] @ power / max(power.sum(), 1e-300)),
            float(np.sqrt(power.sum())))


def _pieces(data: Data, left: Array, joint: int, step: float, size: int) -> Iterator[Array]:
    """Stretches without a gap, each by half a length after the one before."""
    for one, rows in zip(data.logs, data.split(left), strict=True):
        if one.rows < size or abs(float(np.median(np.diff(one.t))) / step - 1.0) > _ALIKE:
            continue
        for stretch in one.stretches[joint]:
            if one.weighed[joint, stretch.start]:
                yield from (rows[joint, k:k + size] for k in range(stretch.start, stretch.stop - size + 1, size // 2))


def _stands(hertz: Array, power: Array, highest: float) -> Array:
    """(frequencies,) how many times each stands above what lies beside it; 0 out of the range that is asked."""
    smooth, out = np.convolve(power, np.ones(3) / 3.0, mode="same"), np.zeros(len(power))
    for k in np.flatnonzero((hertz > _LOWEST) & (hertz < highest)):
        away = hertz / hertz[k]
        below = smooth[(away > 1.0 / _BESIDE) & (away < 1.0 - _WIDE)]
        above = smooth[(away < _BESIDE) & (away > 1.0 + _WIDE)]
        if len(below) and len(above):
            out[k] = smooth[k] / max(float(np.median(below)), float(np.median(above)), 1e-300)
    return out

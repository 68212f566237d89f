"""What is done alike to torque and columns before they become equations: low-pass, decimation, slow samples left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.model.rigid.body import Array, Motion
from pipelines.signal.filters import LowPass, choose_decimation, design_low_pass

__all__ = ["HIGHEST", "Conditioning", "condition", "cutoff_at", "wanted_cutoff"]

HIGHEST = 0.4  # of the rate: a low-pass from there on takes nothing away that would be worth it
_GAP = 1.5  # sample times between two samples: one is missing


@dataclass(frozen=True)
class Conditioning:
    """What is done alike to torque and columns. See `condition` for the defaults."""

    low_pass: LowPass | None
    cutoff_hz: float | None
    decimation: int
    min_speed: tuple[float, ...]  # [rad/s] slower samples of a joint are left out of its own equations


def condition(motion: Motion, rate: float, cutoff_hz: float | None, decimation: int | None, min_speed: Array) -> Conditioning:
    """The filter for a log, its cut-off from the motion where none is given; none where the rate is too low for it."""
    cutoff = cutoff_at(wanted_cutoff(motion, rate) if cutoff_hz is None else cutoff_hz, rate)
    speeds = tuple(map(float, min_speed))
    if cutoff is None:
        return Conditioning(None, None, decimation or 1, speeds)
    return Conditioning(design_low_pass(cutoff, rate), cutoff, decimation or choose_decimation(cutoff, rate), speeds)


def cutoff_at(cutoff_hz: float | None, rate: float) -> float | None:
    """What a log of `rate` feels of a cut-off that several logs share: nothing where it lies above all that it holds."""
    return cutoff_hz if cutoff_hz is not None and cutoff_hz < HIGHEST * rate else None


def wanted_cutoff(motion: Motion, rate: float) -> float:
    """The cut-off [Hz] that leaves all that `motion` excites; from `HIGHEST` of the rate on it asks for none.

    The motion excites what lies below f, where 99.9 % of the power of its speed is; torque has harmonics of it, and
    friction that changes sign has many. Five times f keeps them and leaves out what only noise and structure fill.
    """
    return 5.0 * _highest_frequency(motion, rate)


def _highest_frequency(motion: Motion, rate: float) -> float:
    """Below it lies 99.9 % of the power of the speed, joints scaled alike [Hz]."""
    finite = np.isfinite(motion.dq).all(axis=1)
    known = _bridged(motion.t[finite], motion.dq[finite], rate)
    scale = known.std(axis=0)
    x = (known - known.mean(axis=0))[:, scale > 0.0] / scale[scale > 0.0]
    power = np.sum(np.abs(np.fft.rfft(x * np.hanning(len(x))[:, None], axis=0)) ** 2, axis=1)
    total = np.cumsum(power)
    return float(np.searchsorted(total, 0.999 * total[-1]) + 1) * rate / len(x) if total[-1] > 0.0 else rate


def _bridged(t: Array, x: Array, rate: float) -> Array:
    """`x` (samples, joints) with straight lines over the gaps of `t`: laid end to end, a jump would count as the fastest motion."""
    if len(t) < 2 or np.diff(t).max() < _GAP / rate:
        return x
    even = np.arange(t[0], t[-1], 1.0 / rate)
    return np.stack([np.interp(even, t, column) for column in x.T], axis=1)

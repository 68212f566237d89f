"""Say how much may be wrong with the samples of a log: the same for import and for inspection.

`import` repairs a recording by these limits and `inspect` judges the log by them: the log that the
one writes passes the other.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.io.config import LIMITS
from pipelines.io.log import Array

FEWEST = LIMITS.fewest
SHORTEST = LIMITS.shortest
GAP_LIMIT = LIMITS.gap
GAP_TICKS = LIMITS.gap + LIMITS.lost
MOST_STEPS = LIMITS.steps
LARGEST_JITTER = LIMITS.jitter
ABSURD = LIMITS.absurd


def sentinels(x: Array) -> npt.NDArray[np.bool_]:
    """Return which samples of `x` (samples, joints) hold a filler such as -999 (D03).

    A filler is far from all measurements, and exactly that number.
    """
    suspect = np.isin(np.abs(x), LIMITS.sentinels)
    for column in np.flatnonzero(suspect.any(axis=0)):
        rest = x[~suspect[:, column] & np.isfinite(x[:, column]), column]
        rest = rest[np.abs(rest) < LIMITS.absurd]
        low, high = (rest.min(), rest.max()) if rest.size else (0.0, 0.0)
        reach = max(high - low, LIMITS.reach)
        suspect[:, column] &= (x[:, column] < low - reach) | (x[:, column] > high + reach)
    return suspect


def recorded_span(t: Array, sample_time: float) -> float:
    """Return the time of the samples at `t` [s]: the last one lasts until the next is due."""
    return float(t.max() - t.min()) + sample_time if t.size else 0.0


def shorter_than_period(t: Array, sample_time: float, period: float) -> bool:
    """Return whether N samples are less than a period (T07); N sample times are a whole one."""
    return recorded_span(t, sample_time) < period * (1.0 - 1e-6) - 0.5 * sample_time


def jitter(ticks: Array) -> tuple[float, float]:
    """Return how regular intervals of `ticks` sample times vary: rms and largest (T05)."""
    near = ticks[(ticks > 0.0) & (ticks <= GAP_TICKS)]
    regular = near[np.abs(near - 1.0) < LIMITS.half]
    regular = regular if regular.size > near.size / 2 else near
    off = np.abs(regular - np.median(regular)) if regular.size else np.zeros(1)
    return float(np.sqrt(np.mean(off**2))), float(off.max())


def late(ticks: Array, rms: float) -> npt.NDArray[np.intp]:
    """Return the intervals of `ticks` sample times in which a few samples were lost (T03).

    Where the clock itself varies by half a sample, a long interval is no lost sample.
    """
    found = (ticks > 1.0 + LIMITS.half) & (ticks <= GAP_TICKS)
    return np.flatnonzero(found) if rms < LIMITS.varying else np.zeros(0, dtype=np.intp)


def percent(share: float, digits: int = 3) -> str:
    """Return "1.5 %"; a share without digits that count is "below 0.001 %"."""
    # as many digits before the point as are asked for: "100", not "1e+02"
    whole = abs(100.0 * share) >= 10.0**digits - 0.5
    return (
        "below 0.001 %"
        if abs(share) < LIMITS.shown
        else f"{100.0 * share:.{'0f' if whole else f'{digits}g'}} %"
    )

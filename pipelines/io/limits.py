"""Say how much may be wrong with the samples of a log: one set of limits for who writes logs and for who examines them.

`import` mends a recording by these limits and `inspect` judges the log by the same ones, so that what the one writes
the other finds in order.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.io.experiment import Array

__all__ = [
    "ABSURD",
    "FEWEST",
    "GAP_LIMIT",
    "GAP_TICKS",
    "LARGEST_JITTER",
    "MOST_STEPS",
    "SHORTEST",
    "jitter",
    "late",
    "percent",
    "recorded_span",
    "sentinels",
    "shorter_than_period",
]

FEWEST = 20  # samples; fewer have no statistics, and show no motion (T08)
SHORTEST = (
    100  # samples; a shorter stretch is over before an observer or a filter has settled (T04)
)

# A model-based observer predicts through this many missing samples; beyond, the log is taken apart (T03, T04).
GAP_LIMIT = 10
GAP_TICKS = (
    GAP_LIMIT + 1.5
)  # sample times; the longest interval with at most so many samples missing, half a one to spare

MOST_STEPS = 5  # a clock that was set back more often than this is not a clock (T01)
LARGEST_JITTER = 0.05  # of the sample time (T05)
_WANDERING = 0.15  # the same; intervals of one and a half sample times are then nothing special

ABSURD = 1e9  # no joint is there, in any SI unit (D03)
_SENTINELS = np.array(
    [
        999.0,
        9999.0,
        99999.0,
        999999.0,
        32767.0,
        32768.0,
        65535.0,
        2147483647.0,
        2147483648.0,
        4294967295.0,
    ]
)


def sentinels(x: Array) -> npt.NDArray[np.bool_]:
    """Samples of `x` (samples, joints) that hold a filler such as -999 instead of a measurement (D03): far from all
    others, and exactly that number."""
    suspect = np.isin(np.abs(x), _SENTINELS)
    for column in np.flatnonzero(suspect.any(axis=0)):
        rest = x[~suspect[:, column] & np.isfinite(x[:, column]), column]
        rest = rest[np.abs(rest) < ABSURD]
        low, high = (rest.min(), rest.max()) if rest.size else (0.0, 0.0)
        reach = max(high - low, 10.0)
        suspect[:, column] &= (x[:, column] < low - reach) | (x[:, column] > high + reach)
    return suspect


def recorded_span(t: Array, sample_time: float) -> float:
    """What time the samples at `t` stand for [s]: the last one holds until the next would have come."""
    return float(t.max() - t.min()) + sample_time if t.size else 0.0


def shorter_than_period(t: Array, sample_time: float, period: float) -> bool:
    """T07. N samples of a period of N sample times are a whole period; one sample less is not."""
    return recorded_span(t, sample_time) < period * (1.0 - 1e-6) - 0.5 * sample_time


def jitter(ticks: Array) -> tuple[float, float]:
    """How the regular ones among intervals of `ticks` sample times vary: rms and largest deviation (T05)."""
    near = ticks[(ticks > 0.0) & (ticks <= GAP_TICKS)]
    regular = near[np.abs(near - 1.0) < 0.5]
    regular = regular if regular.size > near.size / 2 else near
    off = np.abs(regular - np.median(regular)) if regular.size else np.zeros(1)
    return float(np.sqrt(np.mean(off**2))), float(off.max())


def late(ticks: Array, rms: float) -> npt.NDArray[np.intp]:
    """The intervals of `ticks` sample times in which a few samples were lost (T03). Where the clock itself wanders by half
    a sample, a long interval says nothing about a lost one."""
    found = (ticks > 1.5) & (ticks <= GAP_TICKS)
    return np.flatnonzero(found) if rms < _WANDERING else np.zeros(0, dtype=np.intp)


def percent(share: float, digits: int = 3) -> str:
    """ "1.5 %"; what rounding leaves of nothing is "below 0.001 %", for its digits say nothing."""
    whole = (
        abs(100.0 * share) >= 10.0**digits - 0.5
    )  # more digits before the point than are asked for: "100", not "1e+02"
    return (
        "below 0.001 %"
        if abs(share) < 1e-5
        else f"{100.0 * share:.{'0f' if whole else f'{digits}g'}} %"
    )

"""The figure that proves a finding: the residual before and after, over the signal that the cause depends on.

    proof(before, after, joint, …)     of the joint that shows most of it
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.result import Proof
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.rows.signals import Signal, binned, signals
from pipelines.model.diagnosis.worth.evidence import over_frequency

__all__ = ["proof"]

_AS_MUCH = 0.9  # of what a part tells over time
_BINS, _MOST_BINS = 96, 768  # a figure is six inches wide
_FOUR, _PAIR = 4, 2  # rows of a bin, at least; where finer ones show more: of a narrow low-pass there are few a period
_MORE = 0.02  # of the power that is predicted, that twice as many bins have to show: eleven in a period do
_BY_CHANCE = 4.0  # deviations of what they show of mere scatter
_TELLS = 0.2  # of the predicted part, that it is in its means over a signal: what less tells, no signal does
_STRETCH = 2.0  # [s] of a proof in time


def proof(before: Refined, after: Refined, joint: int | None, log: int | None = None, event: bool = False) -> Proof:
    """Over the signal that tells the predicted part best, of the joint that shows most of it; over frequency where none does:
    what a resonance adds is nowhere alike along an angle or a speed. What happened once is over the time of its log, an event that
    comes in every log over that of all.

    Args:
        log: place of the log it happened in, among those of the rows; `event`: whether it happened.
    """
    data = before.data
    predicted = before.left - after.left
    shown = joint - 1 if joint is not None else int(np.argmax(data.rms(predicted) / before.rms))
    own = data.joint == shown
    parts = [x[own] for x in (before.left, after.left, predicted)]
    t, rows = _stretch(data, shown, parts[2])
    if log is not None:
        there = data.log_of[own] == log
        best = Signal("time", "s", data.logs[log].t)
        return _over(best, [x[there] for x in parts], shown, t, [x[rows] for x in parts])

    def told(values: Array) -> float:
        means = binned(values, parts[2])
        return float(np.sum(means.count * means.mean**2))

    every = {signal: told(signal.values) for signal in signals(data, shown, data.y - before.left)}
    best = max(every, key=lambda signal: every[signal])
    # In a log that goes once through its range anything is told over time, which says when and not by what.
    other = max((signal for signal in every if signal.name != "time"), key=lambda signal: every[signal])
    best = other if every[other] >= _AS_MUCH * every[best] else best
    if event:
        best = next(signal for signal in every if signal.name == "time")
    elif every[best] < _TELLS * float(parts[2] @ parts[2]):
        lines = _lines(data, shown, (before.left, after.left, predicted))
        if lines:
            (hertz, without), (_, left), (_, alone) = lines
            return Proof(shown + 1, "frequency", "Hz", hertz, without, left, alone, np.zeros(len(hertz)), t,
                         *(part[rows] for part in parts))
    return _over(best, parts, shown, t, [x[rows] for x in parts])


def _over(signal: Signal, parts: list[Array], joint: int, t: Array, stretch: list[Array]) -> Proof:
    """Over a signal; `parts` without the finding, with it and what it predicts, and the same of a `stretch` of time `t`."""
    bins = _fine_enough(signal.values, parts[2])
    b, a, p = (binned(signal.values, x, bins, _PAIR) for x in parts)
    return Proof(joint + 1, signal.name, signal.unit, b.x, b.mean, a.mean, p.mean, b.spread / np.sqrt(b.count), t, *stretch)


def _fine_enough(x: Array, predicted: Array) -> int:
    """As many bins as show what a cause predicts over x, as far as there are rows: a wave has several of them a period, and a touch
    of a tenth of a second is as high as it was. What scatters within a bin, and not along x, makes none of them finer."""
    bins, least = min(_BINS, max(1, len(x) // _FOUR)), _MORE * float(predicted @ predicted)
    here, _ = _told_surely(x, predicted, bins)
    while bins < _MOST_BINS:
        finer, chance = _told_surely(x, predicted, 2 * bins)
        if finer - here <= max(least, _BY_CHANCE * chance):
            break
        bins, here = 2 * bins, finer
    return bins


def _told_surely(x: Array, y: Array, bins: int) -> tuple[float, float]:
    """Power of the means of y in bins of x, less what they have by chance; and how far chance alone scatters it."""
    means = binned(x, y, bins, _PAIR)
    chance = means.spread**2 * means.count / np.maximum(means.count - 1.0, 1.0)
    # of pairs of rows one squared deviation is far from its mean, and so the mean of all bins is taken
    return float(np.sum(means.count * means.mean**2 - chance)), float(np.sqrt(2.0 * len(chance)) * np.mean(chance))


def _lines(data: Data, joint: int, three: tuple[Array, Array, Array]) -> list[tuple[Array, Array]]:
    """Frequencies and amplitudes of each of the three, of the log that shows most of the last; empty of too short a one."""
    split = [list(data.split(x)) for x in three]
    place = max(range(len(data.logs)), key=lambda k: float(np.sum(np.square(split[2][k][joint]))))
    found = [over_frequency(data.logs[place], parts[place][joint]) for parts in split]
    return [one for one in found if one is not None]


def _stretch(data: Data, joint: int, predicted: Array) -> tuple[Array, slice]:
    """Time and rows of the stretch in which the predicted part varies most."""
    first, best, found = 0, -1.0, slice(0, 0)
    times = np.concatenate([one.t for one in data.logs])
    for one in data.logs:
        step = float(np.median(np.diff(one.t))) if one.rows > 1 else 1.0
        size = max(2, min(one.rows, round(_STRETCH / step)))
        for start in range(first, first + one.rows - size + 1, max(1, size // 2)):
            power = float(np.var(predicted[start:start + size]))  # a joint at rest shows a constant, which proves nothing
            if power > best:
                best, found = power, slice(start, start + size)
        first += one.rows
    return times[found], found

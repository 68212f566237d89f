"""The picture of what is wrong, before any name, and the figure that proves a finding.

    evidence(data, left, ...)       the residual over time, and against all that it may depend on
    proof(before, after, joint)     before and after, over the signal that the cause depends on
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.floor.calibration import Floors
from pipelines.model.diagnosis.result import Curve, Evidence, Proof, Spectrum
from pipelines.model.diagnosis.rows.data import Data, LogData
from pipelines.model.diagnosis.rows.signals import binned, signals
from pipelines.signal.spectra import welch

__all__ = ["evidence", "floors_of", "proof"]

_POINTS = 3000  # of a series
_AS_MUCH = 0.9  # of what a part tells over time
_FINE = 96  # bins of a proof: a wave of order 18 over half a turn has ten of them a period
_TELLS = 0.2  # of the predicted part, that it is in its means over a signal: what less tells, no signal does
_STRETCH = 2.0  # [s] of a proof in time
_SEGMENT = 512  # rows of a spectrum
_MOST = 0.8  # of the excess that the band holds
_ORDERS = np.arange(0.5, 80.25, 0.25)


def floors_of(data: Data, left: Array) -> tuple[Floors, ...]:
    """Of each joint; `left` (rows,) [N m]."""
    found = [(_frequency(data, left, joint), _orders(data, left, joint)) for joint in range(data.n_joints)]
    return tuple(Floors(None if one is None else one[1], orders) for one, orders in found)


def evidence(done: Refined, floor: Array, floors: Sequence[Floors]) -> Evidence:
    """Of the first log that was fitted; curves and spectra of all.

    Args:
        done: the nominal model.
        floors: of each joint, where they are known.
    """
    data, left = done.data, done.left
    predicted = data.y - left
    measured, modelled, rest = (next(iter(data.split(x))).T for x in (data.y, predicted, left))
    every = max(1, -(-len(measured) // _POINTS))
    curves, spectra = [], []
    for joint in range(data.n_joints):
        own = left[data.joint == joint]
        for signal in signals(data, joint, predicted):
            means = binned(signal.values, own)
            share = float(np.sum(means.count * means.mean**2) / max(float(own @ own), 1e-300))
            curves.append(Curve(joint + 1, signal.name, signal.unit, means.x, means.mean, means.spread, share))
        spectra += _spectra(data, left, joint, floors[joint] if floors else None)
    table = np.array([[_correlation(left[data.joint == i], data.y[data.joint == j]) for j in range(data.n_joints)]
                      for i in range(data.n_joints)])
    above = np.clip(1.0 - np.square(floor / done.rms), 0.0, 1.0)
    return Evidence(data.logs[0].log.name, data.logs[0].t[::every], measured[::every], modelled[::every], rest[::every], None, None,
                    tuple(curves), tuple(spectra), above, _bands(spectra, data.n_joints), table,
                    _torques(data, predicted))


def _correlation(x: Array, y: Array) -> float:
    return float(np.corrcoef(x, y)[0, 1]) if x.std() > 0.0 and y.std() > 0.0 else 0.0


def _torques(data: Data, predicted: Array) -> Array:
    """(joints, joints): each measured torque by all modelled ones; near the identity where nothing is mixed up."""
    table = np.array([predicted[data.joint == j] for j in range(data.n_joints)])
    return np.array([np.linalg.lstsq(table.T, data.y[data.joint == j], rcond=None)[0] for j in range(data.n_joints)])


def _spectra(data: Data, left: Array, joint: int, floor: Floors | None) -> list[Spectrum]:
    """Over frequency and over orders of the joint's angle, beside those of an arm in order."""
    turning = data.logs[0].log.robot.revolute[joint]
    own = _frequency(data, left, joint)
    found = []
    if own is not None:
        beside = None if floor is None or floor.frequency is None or len(floor.frequency) != len(own[0]) else floor.frequency
        found.append(Spectrum(joint + 1, "frequency", "Hz", own[0], own[1], beside))
    orders = _orders(data, left, joint)
    below = None if floor is None else floor.orders
    found.append(Spectrum(joint + 1, "order", "1/rev" if turning else "1/(2 pi m)", _ORDERS, orders, below))
    return found


def _frequency(data: Data, left: Array, joint: int) -> tuple[Array, Array] | None:
    """Frequencies [Hz] and amplitudes [N m] of bins, of the longest log."""
    parts = [(one, x[joint]) for one, x in zip(data.logs, data.split(left), strict=True)]
    return _amplitudes(*max(parts, key=lambda part: len(part[1])))


def _amplitudes(one: LogData, x: Array) -> tuple[Array, Array] | None:
    """Frequencies [Hz] and amplitudes of bins, whose squares add up to the mean square of x (rows,); None of too short a log."""
    if len(x) < 64:
        return None
    step = float(np.median(np.diff(one.t)))
    found = welch(x[:, None], 1.0 / step, min(_SEGMENT, len(x) // 2))
    width = float(found.frequency[1] - found.frequency[0])
    return found.frequency, np.sqrt(found.density[:, 0] * width)


def _orders(data: Data, left: Array, joint: int) -> Array:
    """(orders,) [N m] amplitude of each wave along the turn."""
    q = np.concatenate([one.at_rows(one.motion.q)[:, joint] for one in data.logs])
    own = left[data.joint == joint]
    return np.array([2.0 * abs(np.mean(own * np.exp(-1j * k * q))) for k in _ORDERS.tolist()])


def _bands(spectra: list[Spectrum], joints: int) -> Array:
    """(joints, 2) [Hz] where most of what stands above the floor lies."""
    out = np.full((joints, 2), np.nan)
    for one in spectra:
        if one.over == "frequency":
            power = np.square(one.amplitude) - (0.0 if one.floor is None else np.square(one.floor))
            power = np.maximum(power, 0.0)
            total = np.cumsum(power) / max(float(power.sum()), 1e-300)
            low, high = np.searchsorted(total, (0.5 - 0.5 * _MOST, 0.5 + 0.5 * _MOST))
            out[one.joint - 1] = one.x[min(low, len(one.x) - 1)], one.x[min(high, len(one.x) - 1)]
    return out


def proof(before: Refined, after: Refined, joint: int | None) -> Proof:
    """Over the signal that tells the predicted part best, of the joint that shows most of it; over frequency where none does:
    what a resonance adds is nowhere alike along an angle or a speed."""
    data = before.data
    predicted = before.left - after.left
    shown = joint - 1 if joint is not None else int(np.argmax(data.rms(predicted) / before.rms))
    own = data.joint == shown
    parts = [x[own] for x in (before.left, after.left, predicted)]

    def told(values: Array) -> float:
        means = binned(values, parts[2])
        return float(np.sum(means.count * means.mean**2))

    every = {signal: told(signal.values) for signal in signals(data, shown, data.y - before.left)}
    best = max(every, key=lambda signal: every[signal])
    # In a log that goes once through its range anything is told over time, which says when and not by what.
    other = max((signal for signal in every if signal.name != "time"), key=lambda signal: every[signal])
    best = other if every[other] >= _AS_MUCH * every[best] else best
    t, rows = _stretch(data, shown, parts[2])
    if every[best] < _TELLS * float(parts[2] @ parts[2]):
        lines = _lines(data, shown, (before.left, after.left, predicted))
        if lines:
            (hertz, without), (_, left), (_, alone) = lines
            return Proof(shown + 1, "frequency", "Hz", hertz, without, left, alone, np.zeros(len(hertz)), t,
                         *(part[rows] for part in parts))
    b, a, p = (binned(best.values, x, _FINE) for x in parts)
    return Proof(shown + 1, best.name, best.unit, b.x, b.mean, a.mean, p.mean, b.spread / np.sqrt(b.count), t,
                 *(part[rows] for part in parts))


def _lines(data: Data, joint: int, three: tuple[Array, Array, Array]) -> list[tuple[Array, Array]]:
    """Frequencies and amplitudes of each of the three, of the log that shows most of the last; empty of too short a one."""
    split = [list(data.split(x)) for x in three]
    place = max(range(len(data.logs)), key=lambda k: float(np.sum(np.square(split[2][k][joint]))))
    found = [_amplitudes(data.logs[place], parts[place][joint]) for parts in split]
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

"""The picture of what is wrong, before any name.

    evidence(data, left, ...)       the residual over time, and against all that it may depend on
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.floor.calibration import Floors
from pipelines.model.diagnosis.result import Curve, Evidence, Spectrum
from pipelines.model.diagnosis.rows.data import Data, LogData
from pipelines.model.diagnosis.rows.signals import binned, signals
from pipelines.model.diagnosis.worth.orders import amplitudes, least_order
from pipelines.signal.spectra import welch

__all__ = ["evidence", "floors_of", "over_frequency"]

_POINTS = 3000  # of a series
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
    told = least_order(_angle(data, joint)) <= _ORDERS
    if told.any():
        below = None if floor is None else floor.orders[told]
        found.append(Spectrum(joint + 1, "order", "1/rev" if turning else "1/(2 pi m)", _ORDERS[told],
                              _orders(data, left, joint)[told], below))
    return found


def _frequency(data: Data, left: Array, joint: int) -> tuple[Array, Array] | None:
    """Frequencies [Hz] and amplitudes [N m] of bins, of the longest log."""
    parts = [(one, x[joint]) for one, x in zip(data.logs, data.split(left), strict=True)]
    return over_frequency(*max(parts, key=lambda part: len(part[1])))


def over_frequency(one: LogData, x: Array) -> tuple[Array, Array] | None:
    """Frequencies [Hz] and amplitudes of bins, whose squares add up to the mean square of x (rows,); None of too short a log."""
    if len(x) < 64:
        return None
    step = float(np.median(np.diff(one.t)))
    found = welch(x[:, None], 1.0 / step, min(_SEGMENT, len(x) // 2))
    width = float(found.frequency[1] - found.frequency[0])
    return found.frequency, np.sqrt(found.density[:, 0] * width)


def _orders(data: Data, left: Array, joint: int) -> Array:
    """(orders,) [N m] amplitude of each wave along the turn."""
    return amplitudes(_angle(data, joint), left[data.joint == joint], _ORDERS)


def _angle(data: Data, joint: int) -> Array:
    """(rows of the joint,) [rad] or [m]"""
    return np.concatenate([one.at_rows(one.motion.q)[:, joint] for one in data.logs])


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

"""The picture of what is wrong, before any name.

    evidence(data, left, ...)       the residual over time, and against all that it may depend on
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.result import Curve, Evidence, Spectrum
from pipelines.model.diagnosis.rows.data import Data, LogData
from pipelines.model.diagnosis.rows.signals import binned, signals
from pipelines.model.diagnosis.worth.orders import amplitudes, least_order
from pipelines.signal.spectra import welch

__all__ = ["evidence", "over_frequency"]

_POINTS = 3000  # of a series
_SEGMENT = 512  # rows of a spectrum
_MOST = 0.8  # of the excess that the band holds
_ORDERS = np.arange(0.5, 80.25, 0.25)


def evidence(done: Refined, floor: Array) -> Evidence:
    """Return the residual of the nominal model over the first log, and its curves and spectra over all."""
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
        spectra += _spectra(data, left, joint)
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


def _spectra(data: Data, left: Array, joint: int) -> list[Spectrum]:
    """Return the spectra over frequency and over orders of the joint's angle."""
    turning = data.logs[0].log.robot.revolute[joint]
    own = _frequency(data, left, joint)
    found = []
    if own is not None:
        found.append(Spectrum(joint + 1, "frequency", "Hz", own[0], own[1]))
    told = least_order(_angle(data, joint)) <= _ORDERS
    if told.any():
        found.append(Spectrum(joint + 1, "order", "1/rev" if turning else "1/(2 pi m)", _ORDERS[told],
                              _orders(data, left, joint)[told]))
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
            power = np.square(one.amplitude)
            total = np.cumsum(power) / max(float(power.sum()), 1e-300)
            low, high = np.searchsorted(total, (0.5 - 0.5 * _MOST, 0.5 + 0.5 * _MOST))
            out[one.joint - 1] = one.x[min(low, len(one.x) - 1)], one.x[min(high, len(one.x) - 1)]
    return out

"""Amplitudes over the orders of a joint's angle, as far as the range of the angle tells orders apart.

    amplitude = amplitudes(q, x, orders)     (orders,) of the wave of each order in x
    least = least_order(q)                   lower ones are not told from what does not come again

Of a joint that goes to and fro over a part of a turn, and is longer at some angles than at others, the mean of x e^(-jkq) shows the
shape of that dwelling about every order that there is. So every angle counts alike, however long the joint was there, and less
towards the ends of the range (von Hann's window): what is left about an order is some 3 % of it, beyond two waves of the range
on either side. With these weights a constant and one wave are fitted at a time:

    min Σ w(q) (x - a - b cos kq - c sin kq)²        amplitude √(b² + c²)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipelines.log.experiment import Array

__all__ = ["amplitudes", "least_order"]

_WAVES = 2.0  # in the range of the angle, of the lowest order that is told from a constant: half the width of the window's line
_PART = 0.25  # of a wave of the highest order: angles are counted in parts as wide
_ALIKE = 1e-6  # of the largest eigenvalue: a wave as long as that is not told from a constant
_MOST = 10.0  # times as much as in the mean counts a row at an angle where the joint was hardly ever


def least_order(q: Array) -> float:
    """[1/rev] of the lowest that are told apart; infinite where the joint stood still."""
    span = float(np.ptp(q)) if len(q) else 0.0
    return _WAVES * 2.0 * np.pi / span if span > 0.0 else np.inf


def amplitudes(q: Array, x: Array, orders: Array) -> Array:
    """(orders,) in the unit of x (rows,), over the angle q (rows,) [rad]; zero of a joint that stood still."""
    if not np.isfinite(least_order(q)):
        return np.zeros(len(orders))
    weight = _weights(q, float(np.max(orders)))
    # By their sums, whose Σ w cos² kq and the like are those at twice the order: of twenty replicas a fit each takes seconds.
    turned, twice, own = np.transpose([_sums(weight, x, wave) for wave in _waves(q, orders)])
    whole, level = np.full(len(orders), weight.sum()), np.full(len(orders), weight @ x)
    c, s, cc, cs, ss = turned.real, turned.imag, 0.5 * (whole + twice.real), 0.5 * twice.imag, 0.5 * (whole - twice.real)
    normal = np.moveaxis(np.array([[whole, c, s], [c, cc, cs], [s, cs, ss]]), -1, 0)
    fitted = np.linalg.pinv(normal, rcond=_ALIKE, hermitian=True) @ np.stack([level, own.real, own.imag], axis=1)[:, :, None]
    return np.asarray(np.hypot(fitted[:, 1, 0], fitted[:, 2, 0]))


def _waves(q: Array, orders: Array) -> Iterator[NDArray[np.complex128]]:
    """e^(jkq) (rows,) of one order after the other, each from the one before it: evenly spaced, two exponentials will do."""
    wave, by, turn = np.exp(1j * orders[0] * q), 0.0, np.ones(len(q), dtype=complex)
    yield wave
    for step in np.diff(orders).tolist():
        if step != by:
            by, turn = step, np.exp(1j * step * q)
        wave = wave * turn
        yield wave


def _sums(weight: Array, x: Array, wave: NDArray[np.complex128]) -> tuple[complex, complex, complex]:
    """Of w e^(jkq), w e^(2jkq) and w x e^(jkq)."""
    weighted = weight * wave
    return complex(weighted.sum()), complex(weighted @ wave), complex(weighted @ x)


def _weights(q: Array, highest: float) -> Array:
    """(rows,) what each counts: von Hann's window over the range, shared by the rows at the same angle."""
    low, span = float(q.min()), float(np.ptp(q))
    along = (q - low) / span
    parts = max(1, int(np.ceil(span * highest / (2.0 * np.pi * _PART))))
    part = np.minimum((along * parts).astype(int), parts - 1)
    count = np.bincount(part, minlength=parts)[part]
    return np.asarray(np.sin(np.pi * along) ** 2 * np.minimum(1.0 / count, _MOST * parts / len(q)))

"""Verify a finished motion on a fine grid: its peaks between samples too.

The bound of position, speed and acceleration of a periodic motion holds rigorously
(`fourier.periodic_peak`). To samples of torque and tip half the step to their neighbour is added,
which on a grid of 0.1 ms exceeds what can lie between.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.kinematics import SerialChain, tip_position
from pipelines.excitation.config import CONFIG
from pipelines.excitation.constraints import Limit
from pipelines.simulation import fourier_series as fourier

__all__ = ["Peak", "peaks", "torque_of", "worst"]

MOTION = ("position", "speed", "acceleration")


@dataclass(frozen=True)
class Peak:
    """The peak of one signal of a motion."""

    joint: int | None  # counted from 1; None of the tip
    quantity: str
    peak: float  # the value that is nearer to its limit, the lowest or the highest
    limit: float  # that end
    unit: str
    share: float  # 1 is the limit: of the way from the middle of the range, or from zero


def peaks(limits: Iterable[Limit], chain: SerialChain, motion: Array, arm: Arm | None, *,
          periodic: bool) -> tuple[Peak, ...]:
    """Return the peaks of motion (3, joints, samples) on the grid of `CONFIG.grid`.

    Args:
        arm: predicts the torque, where that is limited.
        periodic: the samples are one period, the first of them once.
    """
    limits = tuple(limits)
    quantities = {one.quantity for one in limits}
    tau = torque_of(arm, motion) if arm is not None and "torque" in quantities else motion[0]
    signals = dict(zip((*MOTION, "torque"), (*motion, tau), strict=True))
    if any(one.joint is None for one in limits):
        tip = tip_position(chain, motion[0].T).T
        signals |= {f"tip {axis}": place[None] for axis, place in zip("xyz", tip, strict=True)}
    found = []
    for one in limits:
        exact = periodic and one.quantity in MOTION
        bound = fourier.periodic_peak if exact else _between
        low, high = map(float, bound(signals[one.quantity][(one.joint or 1) - 1]))
        found.append(_peak(one, low, high))
    return tuple(found)


def torque_of(arm: Arm, motion: Array) -> Array:
    """Return the torque (joints, samples) of a model on the grid of `CONFIG.grid`."""
    t = CONFIG.grid * np.arange(motion.shape[2], dtype=np.float64)
    return arm.torque(Motion(t, *(part.T for part in motion))).T


def _between(signal: Array) -> tuple[float, float]:
    half = 0.5 * np.abs(np.diff(signal))
    slack = np.maximum(np.append(half, 0.0), np.append(0.0, half))
    return float((signal - slack).min()), float((signal + slack).max())


def _peak(one: Limit, low: float, high: float) -> Peak:
    middle = 0.5 * (one.low + one.high)
    if not np.isfinite(middle):  # open at one end
        middle = one.high - 1.0 if np.isfinite(one.high) else one.low + 1.0
    shares = [(value - middle) / (end - middle) if np.isfinite(end) else -np.inf
              for value, end in ((low, one.low), (high, one.high))]
    upper = shares[1] >= shares[0]
    return Peak(one.joint, one.quantity, high if upper else low, one.high if upper else one.low,
                one.unit, float(max(shares)))


def worst(found: Iterable[Peak]) -> Peak | None:
    """Return the peak that comes nearest to its limit."""
    return max(found, key=lambda peak: peak.share, default=None)

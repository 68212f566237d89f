"""Look at a finished motion on a fine grid: how near it comes to every limit, between samples too.

Position, speed and acceleration of a periodic motion are trigonometric polynomials: their bound holds rigorously
(`pipelines.signal.fourier.periodic_peak`). Torque and tip are smooth but no polynomials: to each of their samples half the
step to its neighbour is added, which on a grid of 0.1 ms exceeds what can lie between.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipelines.model.arm import Arm
from pipelines.model.excitation.limits import Limit, Limits
from pipelines.model.excitation.tip import tip_motion
from pipelines.model.rigid.body import Array, Motion
from pipelines.model.rigid.geometry import SerialChain
from pipelines.signal import fourier

__all__ = ["GRID", "Peak", "TorqueRange", "peaks", "torque_of", "worst"]

GRID = 1e-4  # [s]
TorqueRange = Callable[[Array], tuple[Array, Array]]  # lowest and highest τ (joints, samples) of a motion
_KINDS = ("position", "speed", "acceleration")


@dataclass(frozen=True)
class Peak:
    """How far one signal of a motion goes."""

    quantity: str
    joint: int | None  # 1-based
    peak: float  # of what lies nearer to its limit: the lowest value or the highest
    limit: float  # that end
    unit: str
    share: float  # 1 is the limit: of the way from the middle of the range, or from zero
    cost: float = 0.0  # share of what all limits together cost the design


def peaks(limits: Limits, chain: SerialChain, motion: Array, torque: TorqueRange | None, *, periodic: bool) -> tuple[Peak, ...]:
    """Of motion (3, joints, samples) on a grid of `GRID`; a periodic motion's samples do not hold its first one twice."""
    listed = limits.listed(torque is not None)
    tau = torque(motion) if torque is not None and any(one.quantity == "torque" for one in listed) else None
    tip = tip_motion(chain, motion[0], motion[1]) if any(one.joint is None for one in listed) else None
    found = []
    for one in listed:
        if one.quantity in _KINDS and one.joint is not None:
            signal = motion[_KINDS.index(one.quantity), one.joint - 1]
            low, high = (float(x) for x in fourier.periodic_peak(signal)) if periodic else _between(signal)
        elif one.quantity == "torque" and tau is not None and one.joint is not None:
            low, high = _between(tau[0][one.joint - 1])[0], _between(tau[1][one.joint - 1])[1]
        elif tip is not None and one.quantity == "tip speed":
            low, high = 0.0, _between(np.linalg.norm(tip.velocity, axis=0))[1]
        elif tip is not None:
            low, high = _between(tip.position["xyz".index(one.quantity[-1])])
        else:
            continue
        found.append(_peak(one, low, high))
    return tuple(found)


def torque_of(arm: Arm) -> TorqueRange:
    """The torque of a model on a grid of `GRID`: lowest and highest are one."""
    def torque(motion: Array) -> tuple[Array, Array]:
        t = GRID * np.arange(motion.shape[2], dtype=np.float64)
        tau = arm.torque(Motion(t, motion[0].T, motion[1].T, motion[2].T)).T
        return tau, tau

    return torque


def _between(signal: Array) -> tuple[float, float]:
    half = 0.5 * np.abs(np.diff(signal))
    slack = np.maximum(np.append(half, 0.0), np.append(0.0, half))
    return float((signal - slack).min()), float((signal + slack).max())


def _peak(one: Limit, low: float, high: float) -> Peak:
    closed = np.isfinite(one.low) and np.isfinite(one.high)
    middle = 0.5 * (one.low + one.high) if closed else (one.high - 1.0 if np.isfinite(one.high) else one.low + 1.0)
    shares = [(value - middle) / (end - middle) if np.isfinite(end) else -np.inf
              for value, end in ((low, one.low), (high, one.high))]
    upper = shares[1] >= shares[0]
    return Peak(one.quantity, one.joint, high if upper else low, one.high if upper else one.low, one.unit, float(max(shares)))


def worst(found: tuple[Peak, ...]) -> Peak | None:
    """What comes nearest to its limit."""
    return max(found, key=lambda peak: peak.share, default=None)

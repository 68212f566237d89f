"""Decide whether a torque has a sign, or is its magnitude alone.

One genuine negative value proves a sign. A torque that comes down to zero again and again and
never crosses it is a magnitude: of a smooth signal, zero is crossed where it is reached, except by
chance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.estimation.checks.config import BoundaryConfig
from pipelines.estimation.checks.torque_rows import Array
from pipelines.quality.segments import Usable

__all__ = ["touches_of_zero"]

_SHORT = 8  # numerics: samples: a shorter run tells neither noise nor motion


def touches_of_zero(logs: Sequence[Usable], config: BoundaryConfig) -> tuple[int | None, ...]:
    """Return how often each joint's torque comes down to zero from above.

    None where it is negative as well, or its noise hides whether it is.
    """
    joints = logs[0].log.n_joints
    return tuple(
        _touches(
            [(good.log.tau[run, j], good.log.q[run, j]) for good in logs for run in good.runs],
            config,
        )
        for j in range(joints)
    )


def _touches(parts: Sequence[tuple[Array, Array]], config: BoundaryConfig) -> int | None:
    size = np.sqrt(np.nanmean(np.concatenate([tau for tau, _ in parts]) ** 2)) if parts else 0.0
    count = 0
    for tau, q in parts:
        if tau.size < _SHORT:
            continue
        speed = np.abs(np.gradient(q))
        moving = speed > config.standing * np.sqrt(np.nanmean(speed**2))
        # of white noise the second difference has six times the variance
        noise = 1.4826 * _finite_median(np.abs(np.diff(tau, 2))) / np.sqrt(6.0)
        level = config.no_negative * noise
        if level > config.far * size and np.nanmin(tau) < 0.0:  # such noise would hide a sign
            return None
        if np.nansum(tau < -max(level, 1e-6 * size)) > max(2.0, 1e-3 * tau.size):
            return None
        # a magnitude is reflected at zero: it arrives there within one step of its own
        step = np.minimum(np.abs(np.diff(tau, prepend=tau[:1])), config.near * size)
        near, there = (tau < np.maximum(step, least) for least in (level, noise))
        if near.any() and np.mean(tau[near] < 0.0) > config.below:
            return None
        state = np.where(there & moving, 1, np.where(tau > config.far * size, -1, 0))
        state = state[state != 0]
        count += int(np.sum((state[1:] == 1) & (state[:-1] == -1)))
    return count


def _finite_median(x: Array) -> float:
    """Return the median of the finite values of `x`; 0 without any."""
    finite = x[np.isfinite(x)]
    return float(np.median(finite)) if finite.size else 0.0

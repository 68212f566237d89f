"""What a residual can be drawn against: time, and of each joint its angle, speed, load, and the travel since it last reversed.

    for signal in signals(data, load): signal.joint, signal.name, signal.values     (rows of a joint,)
    binned(x, y)                                                                    means in bins of equal count
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.rows.data import Data, LogData

__all__ = ["Binned", "Signal", "binned", "signals"]

_BINS = 48


@dataclass(frozen=True, eq=False)
class Signal:
    """One signal at the moments of one joint's rows, logs one behind the other."""

    name: str
    unit: str
    values: Array  # (rows of the joint,)


@dataclass(frozen=True, eq=False)
class Binned:
    """Means of one quantity over another. Each (bins,)."""

    x: Array
    mean: Array
    spread: Array  # standard deviation within the bin
    count: Array


def signals(data: Data, joint: int, load: Array) -> Iterator[Signal]:
    """What the residual of `joint` (from 0) may depend on; `load` (rows,) [N m] is the modelled torque."""
    revolute = data.logs[0].log.robot.revolute
    own = data.joint == joint
    angle, speed = ("rad", "rad/s") if revolute[joint] else ("m", "m/s")
    q, dq = _at_rows(data, "q"), _at_rows(data, "dq")
    yield Signal("time", "s", np.concatenate([one.t - one.t[0] for one in data.logs]))
    yield Signal("position", angle, q[:, joint])
    yield Signal("speed", speed, dq[:, joint])
    yield Signal("load", "N m" if revolute[joint] else "N", load[own])
    yield Signal("travel since reversal", angle, np.concatenate([_travel(one, joint) for one in data.logs]))
    for other in range(data.n_joints):
        if other != joint:
            yield Signal(f"position of joint {other + 1}", "rad" if revolute[other] else "m", q[:, other])
            yield Signal(f"speed of joint {other + 1}", "rad/s" if revolute[other] else "m/s", dq[:, other])


def _at_rows(data: Data, name: str) -> Array:
    return np.concatenate([one.at_rows(getattr(one.motion, name)) for one in data.logs])


def _travel(one: LogData, joint: int) -> Array:
    """Signed distance from where the joint last reversed."""
    q = one.motion.q[:, joint]
    turns = np.flatnonzero(np.diff(np.sign(one.motion.dq[:, joint])) != 0) + 1
    begin = np.concatenate([[0], turns])
    which = np.searchsorted(begin, np.arange(len(q)), side="right") - 1
    return np.asarray(one.at_rows(q - q[begin[which]]))


def binned(x: Array, y: Array, bins: int = _BINS, least: int = 4) -> Binned:
    """`y` over `x`, in bins of equal count, of `least` rows or more."""
    order = np.argsort(x, kind="stable")
    edges = np.linspace(0, len(x), min(bins, max(1, len(x) // least)) + 1).astype(int)
    first, count = edges[:-1], np.diff(edges).astype(np.float64)
    mean_x, mean, square = (np.add.reduceat(values[order], first) / count for values in (x, y, y**2))
    return Binned(mean_x, mean, np.sqrt(np.maximum(square - mean**2, 0.0)), count)

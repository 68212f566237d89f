"""The friction map without a friction law: torque at equal position and opposite speed, taken in pairs.

    ½ (τ(q, v) - τ(q, -v))     odd in speed: friction
    ½ (τ(q, v) + τ(q, -v))     even: gravity, offsets, whatever does not turn with the motion

What acceleration takes, J ddq and the sway of held joints, is subtracted first. Nothing is assumed of friction: the points
stand beside the fitted curve as a witness that never saw it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array

__all__ = ["SpeedMap", "speed_map"]

_CLASSES = 5  # of speed, a decade
_PLACES = 36  # of position, a turn
_SLOWEST = 1e-3  # of the fastest speed
_FEWEST = 2  # pairs for a point


@dataclass(frozen=True)
class SpeedMap:
    """A point for every class of speed that was driven both ways. (points,)"""

    speed: Array  # [rad/s] mean of the pairs
    odd: Array  # [N m]
    odd_std: Array  # [N m] of the mean
    even: Array  # [N m] mean over the positions
    pairs: Array


def speed_map(stretches: Sequence[Stretch], fit: LawFit) -> SpeedMap:
    """The map of one joint; its points are empty where no speed was driven both ways at one place."""
    rows = [_rows(stretch, fit) for stretch in stretches]
    q, v, torque, group = (np.concatenate([row[k] for row in rows]) for k in range(4))
    fastest = float(np.abs(v).max(initial=0.0))
    moving = np.abs(v) > max(_SLOWEST * fastest, 1e-12)
    q, v, torque, group = q[moving], v[moving], torque[moving], group[moving]
    step = 2.0 * np.pi / _PLACES if fit.joint.revolute else max(float(np.ptp(q)) if q.size else 1.0, 1e-9) / _PLACES
    place = np.floor(q / step).astype(np.intp) + (group * 10**6).astype(np.intp)
    level = np.floor(_CLASSES * np.log10(np.abs(v) / max(fastest, 1e-12))).astype(np.intp)
    found = [point for one in np.unique(level) if (point := _point(one == level, place, v, torque)) is not None]
    return SpeedMap(*(np.array([point[k] for point in found], dtype=np.float64) for k in range(5)))


def _rows(stretch: Stretch, fit: LawFit) -> tuple[Array, Array, Array, Array]:
    """Position, speed, torque less what acceleration takes, and which posture, of every row."""
    arm, coupling = fit.at(stretch)
    rigid = stretch.rigid
    first = rigid.shape[1] - len(coupling)
    q, v, _ = stretch.middle
    posture = float(min(range(len(fit.postures)), key=lambda k: sum(abs(a - b) for a, b in zip(
        stretch.posture, fit.postures[k], strict=True))))
    return q, v, stretch.torque - arm.inertia * rigid[:, 0] - rigid[:, first:] @ coupling, np.full(len(q), posture)


def _point(chosen: np.ndarray, place: np.ndarray, v: Array, torque: Array) -> tuple[float, ...] | None:
    """Mean over places of the halves of differences and sums."""
    odd, even, speed = [], [], []
    for here in np.unique(place[chosen]):
        at = chosen & (place == here)
        forth, back = at & (v > 0.0), at & (v < 0.0)
        if forth.any() and back.any():
            a, b = float(torque[forth].mean()), float(torque[back].mean())
            odd.append(0.5 * (a - b))
            even.append(0.5 * (a + b))
            speed.append(0.5 * float(v[forth].mean() - v[back].mean()))
    if len(odd) < _FEWEST:
        return None
    return (float(np.mean(speed)), float(np.mean(odd)), float(np.std(odd, ddof=1) / np.sqrt(len(odd))), float(np.mean(even)),
            float(len(odd)))

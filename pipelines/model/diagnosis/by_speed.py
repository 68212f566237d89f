"""The floor of a motion that the reference logs do not have, from what they leave where joints move as slowly or as fast.

    floor = floor_by_speed(reference, left, data)      (joints,) [N m]

What no law of a model has to the last, its friction above all, it lacks at some speeds more than at others. Logs of slow sweeps
stay where an excitation only passes: of eight arms in order they left 1.1 to 1.9 times what the excitations left, and 0.6 to 1.2
times what these left at such speeds.
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.data import Data

__all__ = ["floor_by_speed"]

_PARTS = 4  # of the rows, by speed, with as many of the later logs in each
_FEWEST = 30  # rows that tell
_MORE = 1.1  # times the floor as it is: less is chance, among motions of one kind


def floor_by_speed(reference: Data, left: Array, data: Data) -> Array:
    """What the arm in order would leave of `data`, root mean square; that of all reference logs where it is no more.

    Args:
        left: (rows,) [N m] what the model leaves of the reference logs.
    """
    floor = reference.rms(left)
    theirs, ours = _speeds(reference), _speeds(data)
    out = floor.copy()
    for joint in range(data.n_joints):
        known, asked = reference.counts[reference.joint == joint], data.counts[data.joint == joint]
        if not (known.any() and asked.any()):
            continue
        now, then, power = ours[asked, joint], theirs[known, joint], np.square(left[reference.joint == joint][known])
        there = float(np.sqrt(np.mean([_of_part(part, then, power) for part in np.array_split(np.sort(now), _PARTS) if len(part)])))
        out[joint] = there if there > _MORE * floor[joint] else floor[joint]
    return out


def _of_part(now: Array, then: Array, power: Array) -> float:
    """Mean `power` of the rows whose speed `then` is one of `now`, which is sorted; of the nearest, where these are few."""
    own = (then >= now[0]) & (then <= now[-1])
    if np.count_nonzero(own) < _FEWEST:
        own = np.argsort(np.abs(then - np.median(now)), kind="stable")[:_FEWEST]
    return float(np.mean(power[own]))


def _speeds(data: Data) -> Array:
    """(rows of a joint, joints) [rad/s] at every row, without sign."""
    return np.asarray(np.abs(np.concatenate([one.at_rows(one.motion.dq) for one in data.logs])))

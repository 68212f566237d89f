"""The floor of a motion at speeds that the reference logs only pass, from what they leave where joints move as slowly or as fast.

    floor = floor_by_speed(reference, left, data)      (joints,) [N m]

What no law of a model has to the last, its friction above all, it lacks at some speeds more than at others. Logs of slow sweeps
stay where an excitation only passes: of two arms in order they left 1.0 to 1.9 times what the excitations left, and 0.6 to 1.2
times what these left at such speeds.
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.rows.data import Data

__all__ = ["floor_by_speed"]

_PARTS = (4, 2, 1)  # of the rows, by speed, with as many of the later logs in each
_FEWEST = 30  # rows of the reference logs in each
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
        power = np.square(left[reference.joint == joint][known])
        there = np.sqrt(_power_at(ours[asked, joint], theirs[known, joint], power))
        out[joint] = there if there > _MORE * floor[joint] else floor[joint]
    return out


def _power_at(now: Array, then: Array, power: Array) -> float:
    """Mean `power` of rows of speed `then`, with as many slow and fast ones as there are `now`; of all, where hardly any was as
    slow, at rest say."""
    ordered = np.sort(now)
    for count in _PARTS:
        parts = [part for part in np.array_split(ordered, count) if len(part)]
        own = [(then >= part[0]) & (then <= part[-1]) for part in parts]
        if all(np.count_nonzero(each) >= _FEWEST for each in own):
            return float(np.mean([power[each].mean() for each in own]))
    return float(np.mean(power))


def _speeds(data: Data) -> Array:
    """(rows of a joint, joints) [rad/s], or [m/s], at every row, without sign."""
    return np.asarray(np.abs(np.concatenate([one.at_rows(one.motion.dq) for one in data.logs])))

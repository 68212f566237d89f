"""Where a joint stands and dry friction holds it: its torque is any that friction bears, and no law tells which.

    there = rests(motions, cutoff_hz, fastest)      (samples, joints) of each log
    which = sticking(every, moving, columns)        joints whose torque there is none that their law of friction tells

A point-to-point motion stands for a fifth of its time. What its controller happened to ask for then comes again wherever it stops
again, and passes for a spring, a hump of friction or a touch. Arms without dry friction stand by what carries them, and their rests
count as all else: it is asked whether a model leaves more there than where the joint moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.estimation.logs import Motions
from pipelines.model.estimation.nominal import nominal_columns
from pipelines.model.estimation.regression import Columns

__all__ = ["rests", "sticking"]

Mask = npt.NDArray[np.bool_]

_SLOW, _STILL = 0.02, 1e-3  # of the joint's largest speed: it may creep into a rest and out of it; three decades below, it stands
_MOSTLY = 0.5  # of a slow stretch that it has to stand: slow turns, which tell friction, do not
_MORE = 2.0  # times what is left where the joint moves


def rests(motions: Motions, cutoff_hz: float | None, fastest: Array) -> list[Mask]:
    """(samples, joints) of each log where a joint stands for a period of the low-pass or longer, and for another one to either
    side, over which the low-pass spreads what held it: at low speed that would be a hump of friction.

    Args:
        fastest: (joints,) [rad/s] largest speed in all logs.
    """
    return [_rests(np.abs(found.motion.dq[found.good.kept]), 1.0 / ((cutoff_hz or np.inf) * log.sample_time), fastest)
            for log, found in motions]


def _rests(speed: Array, least: float, fastest: Array) -> Mask:
    out, reach = np.zeros(speed.shape, dtype=bool), math.ceil(least)
    for j in range(speed.shape[1]):
        slow, still = speed[:, j] < _SLOW * fastest[j], np.cumsum(np.append(0, speed[:, j] < _STILL * fastest[j]))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(np.int8)))
        for start, stop in edges.reshape(-1, 2):
            if stop - start > least and still[stop] - still[start] > _MOSTLY * (stop - start):
                out[max(0, start - reach):stop + reach, j] = True
    return out


def sticking(every: Sequence[Data], moving: Sequence[Data], columns: Columns) -> Mask:
    """(joints,) whose rests leave more than twice what their motion does, by the nominal model with an offset, fitted to their
    motion: what is there at rest and in motion alike, of which an offset is the most, is no stiction.

    Args:
        every: rows of the fitted logs, and of others; `moving`: the same rows, of which those at rest do not count.
    """
    laws = {(law.name, law.joint): law for law in (*nominal_columns(columns.body.robot).laws, *columns.laws)}
    model = Exact.start(*fit_nominal(moving[0], replace(columns, laws=tuple(laws.values()))))
    power, count = np.zeros((2, every[0].n_joints)), np.zeros((2, every[0].n_joints))
    for whole, part in zip(every, moving, strict=True):
        left = np.square(whole.y - model.torque(whole))
        for k, rows in enumerate((whole.counts & ~part.counts, part.counts)):
            power[k] += np.bincount(whole.joint[rows], left[rows], whole.n_joints)
            count[k] += np.bincount(whole.joint[rows], minlength=whole.n_joints)
    rest, motion = power / np.maximum(count, 1.0)
    return np.asarray((rest > _MORE**2 * motion) & (count > 0.0).all(axis=0))

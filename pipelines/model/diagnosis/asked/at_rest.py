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
from pipelines.model.estimation.rests import RestConfig

__all__ = ["rests", "sticking"]

Mask = npt.NDArray[np.bool_]

_STILL = 1e-3  # of the joint's largest speed: it may creep into a rest and out of it; three decades below, it stands
_MORE = 2.0  # times what is left where the joint moves


def rests(motions: Motions, cutoff_hz: float | None, fastest: Array) -> list[Mask]:
    """(samples, joints) of each log where a joint stands for a period of the low-pass or longer, and for another one to either
    side, over which the low-pass spreads what held it: at low speed that would be a hump of friction.

    Args:
        fastest: (joints,) [rad/s] largest speed in all logs.
    """
    parts = [[np.abs(x[found.good.kept]) for x in (found.motion.dq, found.motion.ddq)] for _, found in motions]
    rms = [np.maximum(np.sqrt(np.mean(np.vstack(part) ** 2, axis=0)), 1e-300) for part in zip(*parts, strict=True)]
    return [_rests(speed, np.hypot(speed / rms[0], acceleration / rms[1]) < RestConfig().still,
                   1.0 / ((cutoff_hz or np.inf) * log.sample_time), fastest)
            for (log, _), (speed, acceleration) in zip(motions, parts, strict=True)]


def _rests(speed: Array, every_slow: Mask, least: float, fastest: Array) -> Mask:
    out, reach = np.zeros(speed.shape, dtype=bool), math.ceil(least)
    for j in range(speed.shape[1]):
        slow, still = every_slow[:, j], np.cumsum(np.append(0, speed[:, j] < _STILL * fastest[j]))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(np.int8)))
        for start, stop in edges.reshape(-1, 2):
            if still[stop] - still[start] > least:  # slow turns, which tell friction, do not stand
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

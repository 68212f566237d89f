"""Compare models on rows to which they were not fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.fit.bootstrap import apart
from pipelines.log.experiment import Array
from pipelines.model.rows.data import Data
from pipelines.model.rows.fit import Refined

__all__ = ["TorqueGain", "cross_validated", "torque_gain_of", "worse_log"]

@dataclass(frozen=True)
class TorqueGain:
    """Root mean square of the torque residual on held-out equations."""

    before: Array  # [N m]
    after: Array
    ci95: Array  # (joints, 2) [N m] in which `after` - `before` lies with 95 %: blocks of time drawn again


_BLOCKS = 20  # of the held-out time
_SEED = 20040509



_WORSE = 1.05  # times the error of a held-out log, that an extension must not exceed



def torque_gain_of(data: Data, before: Array, after: Array) -> TorqueGain:
    """Root mean square of held-out residuals (rows,) [N m], joint by joint, and how sure its change is."""
    place = data.blocks(_BLOCKS)
    count = int(place.max()) + 1
    ci = []
    for joint in range(data.n_joints):
        own = (data.joint == joint) & data.counts
        sums = [np.asarray(np.bincount(place[own], values, minlength=count), dtype=np.float64)
                for values in (before[own] ** 2, after[own] ** 2, np.ones(int(own.sum())))]
        ci.append(apart(sums[0], sums[1], sums[2], np.random.default_rng(_SEED)))
    return TorqueGain(data.rms(before), data.rms(after), np.array(ci))



def worse_log(data: Data, before: Array, after: Array) -> str:
    """In which held-out log the torque error grows by more than a tenth, of all joints together; empty where in none."""
    for place, one in enumerate(data.logs):
        own = (data.log_of == place) & data.counts
        joints = data.joint[own]
        overall = np.maximum(data.rms(before)[joints], 1e-12)
        for scale in (1.0, overall):  # as they are, and each joint in units of its own error
            was, now = (float(np.linalg.norm(x[own] / scale)) for x in (before, after))
            if now > _WORSE * was:
                return f"the torque error of {one.log.name}, held out, would be {100.0 * (now / was - 1.0):.0f} % larger"
    return ""


def cross_validated(done: Refined, blocks: int) -> Array:
    """(rows,) [N m] what is left of every stretch of time by the numbers that the rest asks for, to first order.

    What happened once, no other time asks for: the numbers of an event stay as they are.
    """
    once = {k for where, one in enumerate(done.model.effects) if one.log is not None for k in done.of_effect(where)}
    table, residual = np.delete(done.slopes, sorted(once), axis=0) * done.weights, done.residual
    size = np.linalg.norm(table, axis=1)
    unit = table / np.where(size > 0.0, size, 1.0)[:, None]
    place = done.data.blocks(blocks)
    left, gram, moment = np.empty_like(residual), unit @ unit.T, unit @ residual
    ridge = 1e-9 * np.eye(len(gram))
    for block in range(int(place.max()) + 1):
        held = place == block
        own = unit[:, held]
        square, asked = gram - own @ own.T + ridge, moment - own @ residual[held]
        left[held] = residual[held] - np.linalg.solve(square, asked) @ own
    return left / done.weights

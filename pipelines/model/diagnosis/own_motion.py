"""Whether what a model leaves of a joint follows from the motion of that joint, in a shape that no cause need have.

    share = following(fit, residuals)           (joints, residuals)

Gravity, damping, inertia and centrifugal torque of a joint are of the form g + B v + J a + D v². An arm in order leaves nothing of
that kind, nor where each of the four may go to and fro with the joint's own angle,

    τ = (g₀ + g₁ cos q + g₂ sin q) + (B₀ + …) v + (J₀ + …) a + (D₀ + …) v²

With c⊥ the part of these columns that the model cannot imitate, the share is what they take off the squared residual of the joint
over what they leave of it, up to a factor the F statistic of Seber & Lee 2003, (4.9). It does not hang on how large the noise is.
Noise of a drive has a colour and reversals leave something, so that no table of F is asked but the twin's replicas.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.nominal import Fit
from pipelines.model.rigid.body import Motion

__all__ = ["following", "put_right", "standing_out"]

_TIMES = 3.0  # the most that any replica shows: of 78 joints of arms in order none showed more than 1.6 times that
_LEAST = 0.1  # less is of no use to anybody
_SEEN = 1e-2  # of unit columns: directions that the model imitates farther are left alone


def following(fit: Fit, residuals: Array) -> Array:
    """(joints, residuals) of `residuals` (m, rows), weighted and orthogonal to the fit."""
    data = fit.data
    revolute = data.logs[0].log.robot.revolute
    found = np.zeros((data.n_joints, len(residuals)))
    for j in range(data.n_joints):
        table = data.lay(partial(_columns, joint=j, turning=revolute[j]))
        whole = np.linalg.norm(table * fit.weights, axis=1)
        unit = fit.project(table) / np.where(whole > 0.0, whole, 1.0)[:, None]
        values, vectors = np.linalg.eigh(unit @ unit.T)
        seen = values > _SEEN**2
        basis = (vectors[:, seen] / np.sqrt(values[seen])).T @ unit
        power = np.sum(np.square(residuals[:, data.joint == j]), axis=1)
        gain = np.sum(np.square(residuals @ basis.T), axis=1)
        found[j] = gain / np.maximum(power - gain, 1e-12 * power + 1e-300)
    return found


def standing_out(share: Array, usual: Array) -> list[int]:
    """Joints, from 0, of which `share` (joints,) is far above the most, `usual` (joints,), that arms in order show."""
    return np.flatnonzero(share > np.maximum(_TIMES * usual, _LEAST)).tolist()


def put_right(before: Fit, after: Fit, usual: Array) -> bool:
    """Whether what `before` leaves of some joint follows the joint's motion, and nothing that `after` leaves does: what was found
    explains it, however little it is. `usual` as in `standing_out`."""
    def out(fit: Fit) -> list[int]:
        return standing_out(following(fit, fit.residual[None])[:, 0], usual)

    return bool(out(before)) and not out(after)


def _columns(motion: Motion, joint: int, turning: bool) -> Array:
    """(samples, joints, 12)"""
    q, v, a = (x[:, joint] for x in (motion.q, motion.dq, motion.ddq))
    one = np.ones_like(q)
    along = (one, np.cos(q), np.sin(q)) if turning else (one, q, q**2)
    table = np.zeros((*motion.q.shape, 12))
    table[:, joint] = np.stack([place * force for place in along for force in (one, v, a, v**2)], axis=1)
    return table

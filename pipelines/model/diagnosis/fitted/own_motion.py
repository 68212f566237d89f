"""Whether what a model leaves of a joint follows from the motion of that joint, in a shape that no cause need have.

    share = following(fit, residuals)           (joints, residuals)
    joints = lasting(fit, residual, joints)     those of which all time tells the same

Gravity, damping, inertia and centrifugal torque of a joint are of the form g + B v + J a + D v². An arm in order leaves nothing of
that kind, nor where each of the four may go to and fro with the joint's own angle,

    τ = (g₀ + g₁ cos q + g₂ sin q) + (B₀ + …) v + (J₀ + …) a + (D₀ + …) v²

With c⊥ the part of these columns that the model cannot imitate, the share is what they take off the squared residual of the joint
over what they leave of it, up to a factor the F statistic of Seber & Lee 2003, (4.9). It does not hang on how large the noise is.
Noise of a drive has a colour and reversals leave something, so that no table of F is asked but the twin's replicas. Noise that is
slower than theirs follows some motion farther by chance, though not again: what is left of a block of time by the numbers that the
rest asks for (Stone 1974) has to be less then than with signs drawn at random.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

import numpy as np

from pipelines.fit.flips import by_flips
from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.nominal import Fit
from pipelines.model.rigid.body import Motion

__all__ = ["following", "lasting", "put_right", "standing_out"]

_TIMES = 3.0  # the most that any replica shows: of 78 joints of arms in order none showed more than 1.6 times that
_LEAST = 0.1  # less is of no use to anybody
_SEEN = 1e-2  # of unit columns: directions that the model imitates farther are left alone
_PARTS = 20  # blocks of time
_CHANCE = 0.05  # at most, that chance gains as much


def following(fit: Fit, residuals: Array) -> Array:
    """(joints, residuals) of `residuals` (m, rows), weighted and orthogonal to the fit."""
    data = fit.data
    found = np.zeros((data.n_joints, len(residuals)))
    for j in range(data.n_joints):
        power = np.sum(np.square(residuals[:, data.joint == j]), axis=1)
        gain = np.sum(np.square(residuals @ _basis(fit, j).T), axis=1)
        found[j] = gain / np.maximum(power - gain, 1e-12 * power + 1e-300)
    return found


def lasting(fit: Fit, residual: Array, joints: Iterable[int]) -> list[int]:
    """Those of the `joints`, from 0, of which `residual` (rows,), weighted and orthogonal to the fit, follows the motion in time
    that its numbers were not fitted to."""
    place = fit.data.blocks(_PARTS)
    blocks = [place == k for k in range(int(place.max()) + 1)]
    found = []
    for joint in joints:
        basis = _basis(fit, joint)
        gram = np.stack([basis[:, own] @ basis[:, own].T for own in blocks])
        moment = np.stack([basis[:, own] @ residual[own] for own in blocks])
        asked = [np.linalg.lstsq(gram.sum(axis=0) - g, moment.sum(axis=0) - m, rcond=_SEEN)[0]
                 for g, m in zip(gram, moment, strict=True)]
        gains = [2.0 * float(a @ m) - float(a @ g @ a) for a, g, m in zip(asked, gram, moment, strict=True)]
        if by_flips(np.array(gains)) <= _CHANCE:
            found.append(joint)
    return found


def _basis(fit: Fit, joint: int) -> Array:
    """(k, rows) orthonormal: of the columns at a joint, from 0, what the model cannot imitate."""
    table = fit.data.lay(partial(_columns, joint=joint, turning=fit.data.logs[0].log.robot.revolute[joint]))
    whole = np.linalg.norm(table * fit.weights, axis=1)
    unit = fit.project(table) / np.where(whole > 0.0, whole, 1.0)[:, None]
    values, vectors = np.linalg.eigh(unit @ unit.T)
    seen = values > _SEEN**2
    return np.asarray((vectors[:, seen] / np.sqrt(values[seen])).T @ unit)


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

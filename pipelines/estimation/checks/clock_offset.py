"""Measure how far torque and motion are apart in time, without knowing the arm.

τ(t + d) ≈ τ(t) + d τ̇(t). What a joint's row leaves of τ is compared with what it leaves of τ̇
(Gauss-Newton), in each quarter of the log and on each joint separately: their scatter says how sure
the answer is, and their trend is the drift. A delay of one joint alone makes scatter, not an
offset: a clock is common to all.

Friction lags as well: after a reversal it comes to its level over a presliding distance
(Armstrong-Hélouvry, Dupont & Canudas de Wit 1994). It does so near reversals alone, a clock
everywhere. So an offset is accepted only where the rest of the motion shows it too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import RigidBody
from pipelines.estimation.checks.joint_rows import Row, Sampled, row_fits
from pipelines.estimation.config import PlausibilityConfig
from pipelines.io.log import Array

_CONFIG = PlausibilityConfig()
_BLOCKS, _ROUNDS = 4, 6  # numerics
# Student's t for 99.5 % by degrees of freedom: few joints agree by chance more easily than many
# numerics
_STUDENT = (np.inf, 63.7, 9.92, 5.84, 4.60, 4.03, 3.71, 3.50)


@dataclass(frozen=True)
class Offset:
    """Torque lies `samples` later than its motion at mid-log; and how that changes over the log.

    The bounds are 99.5 % ones, from the scatter of the quarters and from that of the joints.
    """

    samples: float
    bound: float
    drift: float
    drift_bound: float
    joints: int  # how many joints' torques are understood well enough to say


def away_from_reversals(
    body: RigidBody, motion: Sampled, offset: float, joints: Sequence[int]
) -> Offset | None:
    """Return the offset from moments at which no joint has just turned round; None of too few.

    Args:
        offset: [samples] that all moments show.
    """
    reach = _CONFIG.lags * abs(offset) * motion.sample_time
    keep = np.ones(motion.dq.shape)
    for j in joints:
        turn = motion.t[:-1][np.diff(np.sign(motion.dq[:, j])) != 0.0]
        if turn.size:
            after = np.searchsorted(turn, motion.t)
            sides = (turn[np.maximum(after - 1, 0)], turn[np.minimum(after, turn.size - 1)])
            near = np.min([np.abs(motion.t - side) for side in sides], axis=0)
            keep[near < reach, j] = 0.0
    rows = row_fits(body, motion, keep)
    if min(keep[:, j].sum() for j in joints) < _CONFIG.moments * len(rows[0].solve):
        return None
    return clock_offset(rows, motion, joints, keep)


def clock_offset(
    rows: Sequence[Row],
    motion: Sampled,
    joints: Sequence[int] | None = None,
    keep: Array | None = None,
) -> Offset | None:
    """Return the offset between the clocks of torque and position; None where nothing tells.

    Args:
        joints: those that are used (from 0); all of them by default.
        keep: as in `row_fits`.
    """
    joints = range(len(rows)) if joints is None else joints
    keep = np.ones_like(motion.dq) if keep is None else keep
    time, span = motion.t - motion.t.mean(), float(np.ptp(motion.t))

    def left(j: int, tau: Array) -> float:
        own = tau[:, j]
        varies = keep[:, j] * (own - own.sum() / max(float(keep[:, j].sum()), 1.0))
        rest = float(np.linalg.norm(rows[j].residual(own)))
        return rest / max(float(np.linalg.norm(varies)), 1e-300)

    # the best of a few offsets, so that the linear steps start near
    offsets = np.linspace(-0.8, 0.8, 17) * motion.reach
    each = [keep * motion.shifted(float(x)) for x in offsets]
    offset = float(offsets[int(np.argmin([sum(left(j, x) ** 2 for j in joints) for x in each]))])
    tau, drift = keep * motion.shifted(offset), 0.0
    timed = [j for j in joints if left(j, tau) < _CONFIG.timed]
    if not timed or span <= 0:
        return None
    middle = np.array([float(part.mean()) for part in np.array_split(time, _BLOCKS)]) / span
    for _ in range(_ROUNDS):
        steps, weight = np.zeros((2, _BLOCKS, len(timed)))  # [samples], and 1 / their variance
        at = offset + drift * time / span
        tau = keep * motion.shifted(at)
        slope = 0.5 * keep * (motion.shifted(at + 1.0) - motion.shifted(at - 1.0))
        for place, j in enumerate(timed):
            rest, turn = rows[j].residual(tau[:, j]), rows[j].residual(slope[:, j])
            variance = max(float(rest @ rest) / len(rest), 1e-300)
            for b, part in enumerate(np.array_split(np.arange(len(rest)), _BLOCKS)):
                power = float(turn[part] @ turn[part])
                if power > 0:
                    steps[b, place] = -float(rest[part] @ turn[part]) / power
                    weight[b, place] = power / variance
        step, bound = _line(steps, weight, middle)
        offset, drift = offset + float(step[0]), drift + float(step[1])
        if np.abs(step).sum() < 1e-3:
            break
    return Offset(offset, float(bound[0]), drift, float(bound[1]), len(timed))


def _line(number: Array, weight: Array, middle: Array) -> tuple[Array, Array]:
    """Return a weighted straight line through the steps, (value, slope), and its bounds."""
    design = np.stack([np.ones_like(middle), middle], axis=-1)
    normal = np.einsum("bj,bk,bl->jkl", weight, design, design)  # of each joint
    right = np.einsum("bj,bk,bj->jk", weight, design, number)
    inverse = np.linalg.pinv(normal.sum(axis=0))
    line = inverse @ right.sum(axis=0)
    rest = weight * (number - (design @ line)[:, None]) ** 2
    freedom, joints = max(1, number.size - 2), number.shape[1]
    bound = 3.0 * np.sqrt(np.diag(inverse) * max(float(rest.sum()) / freedom, 1.0))
    if joints > 1:
        each = (np.linalg.pinv(normal) @ right[..., None])[..., 0]
        share = np.einsum("jkk->jk", normal)
        share = share / share.sum(axis=0)
        between = np.sum(share * (each - line) ** 2, axis=0) / (joints - 1)
        bound = bound + _STUDENT[min(joints - 1, len(_STUDENT) - 1)] * np.sqrt(between)
    return line, bound

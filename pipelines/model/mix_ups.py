"""Look for columns in the wrong place and angles in the wrong scale: other explanations on the same torque rows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations, permutations

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.errors import Check
from pipelines.model.evidence import Evidence
from pipelines.model.row_fit import Sampled, quick_residual, shared_residual
from pipelines.model.torque_scale import torque_scale

__all__ = ["ANGLE_UNITS", "UNIT_REMEDY", "encoder_scale", "position_columns", "torque_columns"]

_BAD, _GOOD, _MUCH_BETTER = 0.15, 0.3, 0.35  # relative residuals, and the ratio of two
# A wrong scale can hide well, but the right one then is far better.
_SCALE_BAD, _SHARED_BAD, _SCALE_BETTER = 0.02, 0.01, 0.25
_WORSE = 1.03  # times what a row left before: chance
_EITHER = 1.5  # of two explanations, neither leaves so much more than the other: these rows cannot tell them apart
_SCALES = {"0.5": 0.5, "2": 2.0, "0.1": 0.1, "10": 10.0, "pi/180 (degrees)": np.pi / 180, "180/pi": 180 / np.pi,
           "2 pi (turns)": 2 * np.pi, "1/(2 pi)": 0.5 / np.pi, "-1": -1.0}
ANGLE_UNITS = {name: factor for name, factor in _SCALES.items() if "pi" in name}  # what a file may have every angle in
UNIT_REMEDY = "correct the unit of the angles on import, rad or deg or turns: it is declared for all of them"


def torque_columns(e: Evidence) -> list[Check]:
    """S13: would the torques fit better in another order?"""
    square = e.table**2
    best = min(_orders(e, 6), key=lambda order: sum(square[j, k] for j, k in enumerate(order)))
    moved = [j for j in range(e.n_joints) if best[j] != j]
    if not moved:
        return []
    before, after = e.residual[moved], e.table[moved, [best[j] for j in moved]]
    if not _better(before, after) or (after > 0.6 * before).any():
        return []
    return [_swapped(e, "tau", moved, [best[j] for j in moved], before, after)]


def _swapped(e: Evidence, signal: str, moved: list[int], order: list[int], before: Array, after: Array) -> Check:
    columns = ",".join(str(j + 1) for j in moved)
    how = "swapped" if len(moved) == 2 else f"in the order {','.join(str(k + 1) for k in order)}"
    return e.subject.say("S13", "warn",
                         f"{signal}: columns {columns} fit {how}, residual {_rms(before):.2f} -> {_rms(after):.2f}",
                         signal=signal, joint=moved[0], gate=True,
                         remedy="correct the column map of the import, or the wiring of the drives")


def _orders(e: Evidence, every: int) -> list[tuple[int, ...]]:
    """Every order of the joints that move, of more than `every` of them every swap; first of all the log's own."""
    told = e.telling.tolist()
    orders = []
    for order in permutations(told) if len(told) <= every else _swaps(told):
        whole = list(range(e.n_joints))
        for place, joint in zip(told, order, strict=True):
            whole[place] = joint
        orders.append(tuple(whole))
    return orders


def _swaps(joints: list[int]) -> list[list[int]]:
    orders = [joints]
    for a, b in combinations(range(len(joints)), 2):
        order = joints.copy()
        order[a], order[b] = joints[b], joints[a]
        orders.append(order)
    return orders


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _better(before: Array, after: Array) -> bool:
    return _rms(before) > _BAD and _rms(after) < _GOOD and _rms(after) < _MUCH_BETTER * _rms(before)


def position_columns(e: Evidence) -> list[Check]:
    """S13: would the positions alone fit better in another order? Positions and torques together: the torque boundary."""
    told = e.telling
    if _rms(e.residual[told]) < _BAD or len(told) < 2:
        return []
    few = e.thinned()
    motion, n = few.motion, e.n_joints
    best: tuple[float, Array, tuple[int, ...]] | None = None
    for order in _orders(e, 3)[1:]:
        pick = list(order)
        turned = Sampled(motion.t, motion.q[:, pick], motion.dq[:, pick], motion.ddq[:, pick], motion.coulomb[:, pick],
                         motion.torque, motion.at, motion.reach, motion.sample_time)
        residual = np.diag(quick_residual(e.body, turned))[told]
        if best is None or _rms(residual) < best[0]:
            best = (_rms(residual), residual, order)
    if best is None or not _better(few.residual[told], best[1]):
        return []
    moved = [j for j in range(n) if best[2][j] != j]
    return [_swapped(e, "q", moved, [best[2][j] for j in moved], few.residual[told], best[1])]


def encoder_scale(e: Evidence) -> list[Check]:
    """S15: would one joint's angle fit better in another scale, or those of all in another unit?

    First with one set of rigid parameters for all rows, where the scale of a joint tells that bends nothing and moves little.
    Then with parameters of its own for each row, where a joint's angle bends the arm: that holds whatever the torques' scales.
    Where bending does not tell, the torque's own scale may explain as much: then that is said as well, or instead.
    """
    motion, told = e.thinned().motion, e.telling

    def together(**other: Array) -> Array:
        return shared_residual(e.body, motion, **other)[told]

    def alone(**other: Array) -> Array:
        return np.diag(quick_residual(e.body, motion, **other))[told]

    if (found := _scaled(e, together, alone, _SHARED_BAD)) is None:
        found = _scaled(e, alone, alone, _SCALE_BAD)
        return [] if found is None else [_angle(e, *found)]
    torque = torque_scale(e)
    if torque is None or torque.joint != found[2] or torque.after > _EITHER * found[1]:
        return [_angle(e, *found)]
    return [_angle(e, *found, f"; so does its tau divided by {torque.factor:.3g}")] if found[1] < _EITHER * torque.after else []


def _angle(e: Evidence, before: float, after: float, joint: int | None, factor: str, alternative: str = "") -> Check:
    if joint is None:
        return e.subject.say("S15", "warn",
                             f"q fits if every angle is multiplied by {factor}, residual {before:.2g} -> {after:.2g}",
                             signal="q", gate=True,
                             remedy=UNIT_REMEDY)
    return e.subject.say("S15", "warn",
                         f"q of joint {joint + 1} fits if multiplied by {factor}, residual {before:.2g} -> {after:.2g}"
                         f"{alternative}",
                         signal="q", joint=joint, gate=True,
                         remedy="correct the gear ratio, the direction or the counts per turn of this encoder"
                                + (", or the gear ratio or torque constant of this torque" if alternative else ""))


def _scaled(e: Evidence, residual: Callable[..., Array], alone: Callable[..., Array], bad: float,
            ) -> tuple[float, float, int | None, str] | None:
    """What the log as it is leaves, what the best angle and scale leave, the joint, None for all that turn, and the factor; None
    where the log leaves no more than `bad` or not far more than that.

    By the right scale no row fits worse `alone`, with its own parameters: a joint that hears of another drive may fit far better
    with an angle scaled down, but the other joints' rows, which are in order, do not.
    """
    motion, before, rows = e.thinned().motion, _rms(residual()), alone()
    if before < bad:
        return None
    found: list[tuple[float, int | None, str]] = []
    turning = np.array([one.revolute for one in e.subject.log.robot.joints])
    places = [(joint, _SCALES, np.arange(e.n_joints) == joint) for joint in e.telling.tolist()]
    for joint, scales, there in (*places, (None, ANGLE_UNITS, turning)):
        for name, factor in scales.items():
            scale = np.where(there, factor, 1.0)
            other = {"q": motion.q * scale, "dq": motion.dq * scale, "ddq": motion.ddq * scale}
            left = _rms(residual(**other))
            if left > min(_GOOD, _SCALE_BETTER * before):
                continue
            own = alone(**other)
            # The direction of a joint that bends nothing is that of its torque: S14 tells.
            if (own <= _WORSE * rows).all() and (factor > 0.0 or (own <= _MUCH_BETTER * rows).any()):
                found.append((left, joint, name))
    return (before, *min(found, key=lambda one: one[0])) if found else None

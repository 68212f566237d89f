"""Look for columns in the wrong place and angles in the wrong scale on the same torque rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from pipelines.errors import Check
from pipelines.estimation.checks.joint_rows import (
    Evidence,
    Sampled,
    quick_residual,
    shared_residual,
)
from pipelines.estimation.checks.torque_scale import torque_scale
from pipelines.estimation.config import PlausibilityConfig
from pipelines.io.log import Array

_CONFIG = PlausibilityConfig()
_SCALES = {
    "0.5": 0.5,
    "2": 2.0,
    "0.1": 0.1,
    "10": 10.0,
    "pi/180 (degrees)": np.pi / 180,
    "180/pi": 180 / np.pi,
    "2 pi (turns)": 2 * np.pi,
    "1/(2 pi)": 0.5 / np.pi,
    "-1": -1.0,
}
# what a file may have every angle in
ANGLE_UNITS = {name: factor for name, factor in _SCALES.items() if "pi" in name}
UNIT_REMEDY = "correct the unit of the angles on import, rad or deg or turns: "
UNIT_REMEDY += "it is declared for all of them"


def torque_columns(e: Evidence) -> list[Check]:
    """S13: would the torques fit better in another order?"""
    square = e.table**2
    best = min(_orders(e, 6), key=lambda order: sum(square[j, k] for j, k in enumerate(order)))
    moved = [j for j in range(e.n_joints) if best[j] != j]
    if not moved:
        return []
    order = [best[j] for j in moved]
    before, after = e.residual[moved], e.table[moved, order]
    if not _better(before, after) or (after > 0.6 * before).any():
        return []
    return [_swapped(e, "tau", moved, order, before, after)]


def position_columns(e: Evidence) -> list[Check]:
    """S13: would the positions alone fit better in another order?

    Positions and torques together: the torque boundary.
    """
    told = e.telling
    if _rms(e.residual[told]) < _CONFIG.bad or len(told) < 2:
        return []
    few, best = e.thinned(), None
    for order in _orders(e, 3)[1:]:
        pick, m = list(order), few.motion
        names = ("q", "dq", "ddq", "coulomb")
        turned = replace(m, **{name: getattr(m, name)[:, pick] for name in names})
        residual = np.diag(quick_residual(e.body, turned))[told]
        if best is None or _rms(residual) < _rms(best[0]):
            best = residual, order
    if best is None or not _better(few.residual[told], best[0]):
        return []
    moved = [j for j in range(e.n_joints) if best[1][j] != j]
    return [_swapped(e, "q", moved, [best[1][j] for j in moved], few.residual[told], best[0])]


def _swapped(
    e: Evidence, signal: str, moved: list[int], order: list[int], before: Array, after: Array
) -> Check:
    columns = ",".join(str(j + 1) for j in moved)
    how = f"in the order {','.join(str(k + 1) for k in order)}"
    if len(moved) == 2:
        how = "swapped"
    residual = f"residual {_rms(before):.2f} -> {_rms(after):.2f}"
    words = f"{signal}: columns {columns} fit {how}, {residual}"
    remedy = "correct the column map of the import, or the wiring of the drives"
    joint = moved[0]
    return e.subject.say("S13", "warn", words, signal=signal, joint=joint, gate=True, remedy=remedy)


def _orders(e: Evidence, every: int) -> list[tuple[int, ...]]:
    """Return every order of the joints that move, of many every swap; first the log's own."""
    told = e.telling.tolist()
    if len(told) <= every:
        moved = [list(order) for order in permutations(told)]
    else:
        moved = [told]
        for a, b in combinations(range(len(told)), 2):
            order = told.copy()
            order[a], order[b] = told[b], told[a]
            moved.append(order)
    orders = []
    for order in moved:
        whole = list(range(e.n_joints))
        for place, joint in zip(told, order, strict=True):
            whole[place] = joint
        orders.append(tuple(whole))
    return orders


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _better(before: Array, after: Array) -> bool:
    good = _rms(after) < _CONFIG.good and _rms(after) < _CONFIG.much_better * _rms(before)
    return _rms(before) > _CONFIG.bad and good


def encoder_scale(e: Evidence) -> list[Check]:
    """S15: would one joint's angle fit better in another scale, or those of all in another unit?

    First with one set of rigid parameters for all rows, where the scale of a joint tells that bends
    nothing and moves little. Then with parameters of its own for each row, where a joint's angle
    bends the arm: that holds whatever the torques' scales. Where bending does not tell, the
    torque's own scale may explain as much: then that is said as well, or instead.
    """
    told = e.telling

    def together(motion: Sampled) -> Array:
        return shared_residual(e.body, motion)[told]

    def alone(motion: Sampled) -> Array:
        return np.diag(quick_residual(e.body, motion))[told]

    found = _scaled(e, together, alone, _CONFIG.shared_bad)
    if found is None:
        found = _scaled(e, alone, alone, _CONFIG.scale_bad)
        return [] if found is None else [_angle(e, *found)]
    torque = torque_scale(e)
    if torque is None or torque.joint != found[2] or torque.after > _CONFIG.either * found[1]:
        return [_angle(e, *found)]
    if found[1] >= _CONFIG.either * torque.after:
        return []
    return [_angle(e, *found, f"; so does its tau divided by {torque.factor:.3g}")]


def _angle(
    e: Evidence, before: float, after: float, joint: int | None, factor: str, alternative: str = ""
) -> Check:
    residual = f"residual {before:.2g} -> {after:.2g}"
    if joint is None:
        words = f"q fits if every angle is multiplied by {factor}, {residual}"
        return e.subject.say("S15", "warn", words, signal="q", gate=True, remedy=UNIT_REMEDY)
    words = f"q of joint {joint + 1} fits if multiplied by {factor}, {residual}{alternative}"
    remedy = "correct the gear ratio, the direction or the counts per turn of this encoder"
    if alternative:
        remedy += ", or the gear ratio or torque constant of this torque"
    return e.subject.say("S15", "warn", words, signal="q", joint=joint, gate=True, remedy=remedy)


def _scaled(
    e: Evidence, residual: Callable[[Sampled], Array], alone: Callable[[Sampled], Array], bad: float
) -> tuple[float, float, int | None, str] | None:
    """Return what the log leaves, what the best scale leaves, the joint and the factor.

    The joint is None for all that turn. None where the log leaves no more than `bad` or not far
    more than that. By the right scale no row fits worse `alone`, with its own parameters: a joint
    that hears of another drive may fit far better with an angle scaled down, but the other joints'
    rows, which are correct, do not.
    """
    motion = e.thinned().motion
    before, rows = _rms(residual(motion)), alone(motion)
    if before < bad:
        return None
    found: list[tuple[float, int | None, str]] = []
    turning = np.array([one.revolute for one in e.subject.log.robot.joints])
    own = [(j, _SCALES, np.arange(e.n_joints) == j) for j in e.telling.tolist()]
    for joint, scales, there in (*own, (None, ANGLE_UNITS, turning)):
        for name, factor in scales.items():
            s = np.where(there, factor, 1.0)
            other = replace(motion, q=motion.q * s, dq=motion.dq * s, ddq=motion.ddq * s)
            left = _rms(residual(other))
            if left > min(_CONFIG.good, _CONFIG.scale_better * before):
                continue
            fits = alone(other)
            # the direction of a joint that bends nothing is that of its torque: S14 tells
            bends = factor > 0.0 or (fits <= _CONFIG.much_better * rows).any()
            if (fits <= _CONFIG.worse * rows).all() and bends:
                found.append((left, joint, name))
    return (before, *min(found, key=lambda one: one[0])) if found else None

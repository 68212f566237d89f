"""Ask whether the torque of a log fits its motion at all, before anyone fits a model to it.

    for check in plausibility(Subject(log)): ...

No parameter of the arm has to be known. Each joint's torque is explained by its own row of the rigid body with friction
(`row_fit`); then other explanations are tried on the same rows: the torque of another joint, the other sign, another
time. An alternative is reported only where the log as it stands is explained badly **and** the alternative explains it
well: an arm with friction the model lacks, with a worn gear or with a late drive is badly explained too, but nothing
explains it better, and what is wrong with it is for `diagnose` to say.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, permutations

import numpy as np

from pipelines.errors import Check
from pipelines.log.checks_subject import Subject
from pipelines.model.clock_offset import clock_offset
from pipelines.model.rigid.body import Array, RigidBody, rigid_body
from pipelines.model.row_fit import Row, Sampled, relative_residual, row_fits, sample_motion

__all__ = ["Evidence", "plausibility"]

_BAD, _GOOD, _MUCH_BETTER = 0.15, 0.3, 0.35  # relative residuals, and the ratio of two
_SCALE_BAD, _SCALE_BETTER = 0.03, 0.25  # a wrong scale can hide well, but the right one then is far better
_SURE = 5.0  # standard deviations that a wrong sign must stand below zero
_RATIO = 2.5  # a load of a quarter of the arm's mass doubles a joint's inertia at most
_RATIO_RESIDUAL = 0.25
_CONDITION = 1e4  # of unit columns: what 0.01 % of noise in the motion makes of a parameter
_SCALES = {"0.5": 0.5, "2": 2.0, "0.1": 0.1, "10": 10.0, "pi/180 (degrees)": np.pi / 180, "180/pi": 180 / np.pi,
           "2 pi (turns)": 2 * np.pi, "1/(2 pi)": 0.5 / np.pi, "-1": -1.0}


@dataclass(frozen=True, eq=False)
class Evidence:
    """The rows of one log, worked out once for all questions."""

    subject: Subject
    body: RigidBody
    motion: Sampled

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        return row_fits(self.body, self.motion)

    @cached_property
    def table(self) -> Array:
        """(rows, torques) relative residual of every torque on every joint's row."""
        return relative_residual(self.rows, self.motion.tau)

    @property
    def residual(self) -> Array:
        return np.diag(self.table)

    @property
    def n_joints(self) -> int:
        return int(self.motion.q.shape[1])


def plausibility(subject: Subject) -> tuple[Check, ...]:
    """S13, S14, S15, T06 and D09 of one log; nothing where it moves too little or too short to tell."""
    log = subject.log
    if not subject.sampled or log.experiment not in ("excitation", "free", "writing") or not subject.good.time.known:
        return ()
    if not subject.good.runs or (np.nanstd(log.tau, axis=0) == 0).any() or (subject.travel == 0).any():
        return ()
    motion = sample_motion(subject.good)
    body = rigid_body(log.robot)
    if motion is None or len(motion.t) < 4 * (len(body.parameters) + 4):
        return ()
    evidence = Evidence(subject, body, motion)
    swapped = _torque_columns(evidence) or _position_columns(evidence) or _encoder_scale(evidence)
    if swapped:
        return tuple(swapped)  # nothing else can be said of columns that are in the wrong place
    words = ", ".join(f"{v:.2g}" for v in evidence.residual)
    found = subject.ok("S13", f"each joint's torque fits its own motion best, relative residual {words}")
    return (*found, *_signs(evidence), *_ratios(evidence), *_clock(evidence), *_excited(evidence))


def _torque_columns(e: Evidence) -> list[Check]:
    """S13: would the torques fit better in another order?"""
    n, square = e.n_joints, e.table**2
    orders = permutations(range(n)) if n <= 6 else _pairs(n)
    best = min(orders, key=lambda order: sum(square[j, k] for j, k in enumerate(order)))
    moved = [j for j in range(n) if best[j] != j]
    if not moved:
        return []
    before, after = e.residual[moved], e.table[moved, [best[j] for j in moved]]
    if not _better(before, after) or (after > 0.6 * before).any():
        return []
    return [_swapped(e, "tau", moved, [best[j] for j in moved], before, after)]


def _swapped(e: Evidence, signal: str, moved: list[int], order: list[int], before: Array, after: Array) -> Check:
    columns = ",".join(str(j + 1) for j in moved)
    how = "swapped" if len(moved) == 2 else f"in the order {','.join(str(k + 1) for k in order)}"
    return e.subject.say("S13", "warn", f"{signal}: columns {columns} fit {how}, residual {_rms(before):.2f} -> {_rms(after):.2f}",
                         signal=signal, joint=moved[0], gate=True, remedy="correct the column map of the import, or "
                         "the wiring of the drives")


def _pairs(n: int) -> list[tuple[int, ...]]:
    orders = [tuple(range(n))]
    for a, b in combinations(range(n), 2):
        order = list(range(n))
        order[a], order[b] = b, a
        orders.append(tuple(order))
    return orders


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _better(before: Array, after: Array) -> bool:
    return _rms(before) > _BAD and _rms(after) < _GOOD and _rms(after) < _MUCH_BETTER * _rms(before)


def _thinned(e: Evidence) -> Evidence:
    """Fewer moments, for questions that need a new factorisation each."""
    motion = e.motion
    step = max(1, len(motion.t) // (5 * max(row.basis.shape[1] for row in e.rows)))
    few = {name: getattr(motion, name)[::step] for name in ("t", "q", "dq", "ddq", "coulomb", "at")}
    return Evidence(e.subject, e.body, Sampled(**few, torque=motion.torque, reach=motion.reach, sample_time=motion.sample_time))


def _position_columns(e: Evidence) -> list[Check]:
    """S13: would the positions fit better in another order, alone or with the torques?"""
    if _rms(e.residual) < _BAD or e.n_joints < 2:
        return []
    few = _thinned(e)
    motion, n = few.motion, e.n_joints
    best: tuple[float, Array, tuple[int, ...], str] | None = None
    for order in list(permutations(range(n)))[1:] if n <= 3 else _pairs(n)[1:]:
        pick = list(order)
        turned = Sampled(motion.t, motion.q[:, pick], motion.dq[:, pick], motion.ddq[:, pick], motion.coulomb[:, pick],
                         motion.torque, motion.at, motion.reach, motion.sample_time)
        table = relative_residual(row_fits(e.body, turned), motion.tau)
        for signal, residual in (("q", np.diag(table)), ("q and tau", table[np.arange(n), pick])):
            if best is None or _rms(residual) < best[0]:
                best = (_rms(residual), residual, order, signal)
    if best is None or not _better(few.residual, best[1]):
        return []
    moved = [j for j in range(n) if best[2][j] != j]
    return [_swapped(e, best[3], moved, [best[2][j] for j in moved], few.residual, best[1])]


def _encoder_scale(e: Evidence) -> list[Check]:
    """S15: would one joint's angle fit better in another scale? Only a joint whose angle bends the arm can tell."""
    if _rms(e.residual) < _SCALE_BAD:
        return []
    few = _thinned(e)
    best: tuple[float, Array, int, str] | None = None
    for joint in range(e.n_joints):
        for name, factor in _SCALES.items():
            scale = np.where(np.arange(e.n_joints) == joint, factor, 1.0)
            rows = row_fits(e.body, few.motion, q=few.motion.q * scale, dq=few.motion.dq * scale, ddq=few.motion.ddq * scale)
            residual = np.diag(relative_residual(rows, few.motion.tau))
            if best is None or _rms(residual) < best[0]:
                best = (_rms(residual), residual, joint, name)
    if best is None or best[0] > _GOOD or best[0] > _SCALE_BETTER * _rms(few.residual):
        return []
    return [e.subject.say("S15", "warn", f"q of joint {best[2] + 1} fits if multiplied by {best[3]}, residual "
                                         f"{_rms(few.residual):.2f} -> "
                          f"{best[0]:.2f}", signal="q", joint=best[2], gate=True,
                          remedy="correct the gear ratio, the direction or the counts per turn of this encoder")]


def _signs(e: Evidence) -> list[Check]:
    """S14: inertia is positive and friction takes power; a torque with its sign flipped says the opposite of both."""
    flipped = [j for j in range(e.n_joints) if _negative(e, j)]
    if not flipped:
        return e.subject.ok("S14", "inertia of every joint is positive", signal="tau")
    where = "all joints" if len(flipped) == e.n_joints > 1 else ", ".join(f"joint {j + 1}" for j in flipped)
    return [e.subject.say("S14", "warn", f"the torque of {where} looks flipped: inertia and friction come out negative",
                          signal="tau", joint=j,
                          gate=True, remedy="change the sign of this torque on import, or of its position") for j in flipped]


def _negative(e: Evidence, joint: int) -> bool:
    """Whether this row alone finds a negative inertia, in the whole log and in both halves, and no friction against it."""
    motion, row, n = e.motion, e.rows[joint], e.n_joints
    if e.residual[joint] > 0.7:
        return False
    unit = np.zeros_like(motion.q)
    unit[:, joint] = 1.0
    still = np.zeros_like(motion.q)
    mass = (e.body.regressor(motion.q, still, unit) - e.body.regressor(motion.q, still, still))[:, joint]
    direction = np.concatenate([mass.mean(axis=0), [1.0, 0.0, 0.0, 0.0]])
    power = np.concatenate([np.zeros(mass.shape[1] + 1),
                            [np.mean(motion.dq[:, joint] ** 2), np.mean(motion.coulomb[:, joint] * motion.dq[:, joint])], [0.0]])
    del n
    value, covariance = row.estimate(motion.tau[:, joint])
    inertia, friction = float(direction @ value), float(power @ value)
    inertia_std, friction_std = (float(np.sqrt(v @ covariance @ v)) for v in (direction, power))
    share = abs(inertia) * float(np.std(motion.ddq[:, joint])) / float(np.std(motion.tau[:, joint]))
    return inertia < -_SURE * inertia_std and share > 0.05 and friction < _SURE * friction_std


def _ratios(e: Evidence) -> list[Check]:
    """S15: the torque is as large as the described links need, within what load and friction can make of it."""
    known = e.body.known_parameters()
    if known is None:
        return []
    motion = e.motion
    expected = e.body.torque(motion.q, motion.dq, motion.ddq, known)
    found, seen = [], []
    for j in range(e.n_joints):
        friction = np.stack([motion.dq[:, j], motion.coulomb[:, j], np.ones(len(motion.t))], axis=-1)
        columns = np.concatenate([expected[:, j:j + 1], friction], axis=1)
        (slope, *_), without, left = *np.linalg.lstsq(columns, motion.tau[:, j], rcond=None)[:1], _unexplained(friction,
                                                                                                               motion.tau[:, j]), \
            _unexplained(columns, motion.tau[:, j])
        if left > _RATIO_RESIDUAL or left > 0.4 * without:
            continue  # the described links are not this arm's; they say nothing
        seen.append(f"joint {j + 1}: {slope:.3g}")
        if slope > _RATIO or 0 < slope < 1 / _RATIO:
            found.append(e.subject.say("S15", "warn", f"tau of joint {j + 1} is {slope:.3g} times what the described "
                           f"links need", signal="tau",
                                       joint=j, gate=True, remedy=f"look for a gear ratio or torque constant of about "
                                       f"{slope:.3g} or "
                                       f"{1 / slope:.3g} that was applied twice or not at all"))
    return found or e.subject.ok("S15", "torque over that of the described links: " + (", ".join(seen) or "not "
                   "comparable"),
                                                                                                          signal="tau")


def _unexplained(columns: Array, tau: Array) -> float:
    """Share of the variation of `tau` that `columns` leave."""
    rest = tau - columns @ np.linalg.lstsq(columns, tau, rcond=None)[0]
    return float(np.linalg.norm(rest) / np.linalg.norm(tau - tau.mean()))


def _clock(e: Evidence) -> list[Check]:
    """T06: position and torque were stamped by the same clock."""
    found = clock_offset(e.rows, e.motion)
    if found is None:
        return e.subject.ok("T06", "no torque follows its motion closely enough to time it", signal="tau")
    ms = 1e3 * e.motion.sample_time
    words = (f"torque lies {abs(found.samples):.2f} ± {found.bound:.2f} samples ({abs(found.samples) * ms:.3g} ms) "
             f"{'behind' if found.samples > 0 else 'ahead of'} the motion")
    drift = f"{found.drift:+.2f} ± {found.drift_bound:.2f} samples over the log"
    if found.joints > 1 and abs(found.drift) > 1.0 + found.drift_bound:
        return [e.subject.say("T06", "warn", f"the clocks of q and tau drift by {drift}", signal="tau", gate=True,
                              remedy="stamp position and torque by one clock")]
    if abs(found.samples) > 1.0 + found.bound:
        return [e.subject.say("T06", "warn", f"{words}, alike in {found.joints} joints; it drifts by {drift}", signal="tau",
                              remedy="look for a delay between the recorders of q and tau; 'diagnose' tells a late "
                                     "encoder from a late drive")]
    return e.subject.ok("T06", f"{words}, drift {drift}", signal="tau")


def _excited(e: Evidence) -> list[Check]:
    """D09: an excitation shows every base parameter."""
    if e.subject.log.experiment != "excitation":
        return []
    condition, hidden = excitation_condition(e)
    if not hidden:
        return e.subject.ok("D09", f"every base parameter and friction shows, condition number {condition:.3g} (unit columns)")
    return [e.subject.say("D09", "warn", f"insufficient excitation: {', '.join(hidden)} cannot be told (condition "
                                         f"number {condition:.3g})",
                          gate=True, remedy="move all joints at once, over more of their range and with more frequencies")]


def excitation_condition(e: Evidence) -> tuple[float, list[str]]:
    """Condition number of the unit columns of (8) with friction, and the parameters that its small directions mix."""
    motion, n = e.motion, e.n_joints
    weight = 1.0 / np.maximum(np.std(motion.tau, axis=0), 1e-12)
    rigid = (e.body.regressor(motion.q, motion.dq, motion.ddq) * weight[:, None]).reshape(len(motion.t) * n, -1)
    own = np.zeros((len(motion.t), n, 2 * n))
    each = np.arange(n)
    own[:, each, each] = motion.dq * weight
    own[:, each, n + each] = motion.coulomb * weight
    columns = np.concatenate([rigid, own.reshape(len(rigid), -1)], axis=1)
    names = [p.name for p in e.body.parameters] + [f"{what} of joint {j + 1}" for what in ("viscous", "Coulomb") for j in range(n)]
    size = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(size > 0, size, 1.0)
    _, s, vt = np.linalg.svd(np.linalg.qr(unit, mode="r"))
    small = vt[s < s[0] / _CONDITION]
    mixed = (np.abs(small) > 0.2).any(axis=0) if len(small) else np.zeros(len(names), dtype=bool)
    hidden = [name for name, bad in zip(names, mixed | (size == 0), strict=True) if bad]
    return float(s[0] / max(s[-1], 1e-300)), hidden

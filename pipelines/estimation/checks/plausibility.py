"""Test whether the torque of a log fits its motion at all, before a model is fitted to it.

    for check in plausibility(Subject(log)): ...

No parameter of the arm has to be known. Each joint's torque is explained by its own row of the
rigid body with friction (`joint_rows`); then other explanations are tried on the same rows: another
order of columns, another sign, scale or time. An alternative is reported only where the log as it
is is explained badly **and** the alternative explains it well: an arm with friction the model
lacks, with a worn gear or with a late drive is badly explained too, but nothing explains it better,
and what is wrong with it is for `diagnose` to say. Where the log describes its controller, that is
compared as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, permutations

import numpy as np

from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import Check
from pipelines.estimation.checks.clock_offset import away_from_reversals, clock_offset
from pipelines.estimation.checks.joint_rows import (
    Row,
    Sampled,
    SharedRows,
    relative_residual,
    row_fits,
    sample_motion,
)
from pipelines.estimation.config import PlausibilityConfig, TorqueScaleConfig
from pipelines.estimation.judgements import excited
from pipelines.estimation.least_squares import Indices
from pipelines.io.log import Array
from pipelines.quality.subject import NotTested, Subject, spread
from pipelines.simulation.commanded import against_command

_CONFIG, _SCALE = PlausibilityConfig(), TorqueScaleConfig()
Findings = Sequence[Check | NotTested]

_FACTORS = {
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
_ANGLE_UNITS = {name: factor for name, factor in _FACTORS.items() if "pi" in name}
_UNIT_REMEDY = "correct the unit of the angles on import, rad or deg or turns: it is declared for "
_UNIT_REMEDY += "all of them"
_GRID, _FINER = 25, 6  # numerics: points, and how often a grid is laid about the best of the last


@dataclass(frozen=True, eq=False)
class Evidence:
    """The rows of one log, computed once for all questions."""

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

    @cached_property
    def telling(self) -> Indices:
        """The joints (from 0) whose row can tell anything: those that move.

        A joint that is held sways within its dry friction, of which no row knows, while the moving
        joints' motion is in every row: another joint's row may explain its torque better.
        """
        travel = self.subject.travel
        return np.flatnonzero(travel >= _CONFIG.held * travel.max())

    @cached_property
    def few(self) -> Sampled:
        """Fewer moments, for questions that need a new factorisation each."""
        most = 5 * max(row.basis.shape[1] for row in self.rows)
        return self.motion.every(max(1, len(self.motion.t) // most))

    def alone(self, motion: Sampled) -> Array:
        """(telling joints,) residual of each by parameters of its own."""
        rows = row_fits(self.body, motion)
        return np.diag(relative_residual(rows, motion.tau))[self.telling]

    def together(self, motion: Sampled) -> Array:
        """(telling joints,) residual where all rows share the rigid body's parameters."""
        told = self.telling.tolist()
        return SharedRows.of(self.body, motion, told).left(np.ones(len(told)))


def plausibility(subject: Subject) -> tuple[Check, ...]:
    """Return S10, S13, S14, S15, T06 and D09 of one log; nothing where it tells nothing."""
    return tuple(found for found in plausibility_findings(subject) if isinstance(found, Check))


def plausibility_findings(subject: Subject) -> tuple[Check | NotTested, ...]:
    """Return the same, and which of these questions the log leaves open, and why."""
    evidence = _evidence(subject)
    found = _found(subject, evidence)
    if not isinstance(evidence, Evidence) or _closes(found):
        return found  # what such a torque leaves is no noise to hold the columns against
    return (*found, *excited(subject))


def mismatches(subject: Subject) -> tuple[Check, ...]:
    """Return the checks S10, S13, S14, S15 and T06 of a log that is fitted, other than "ok"."""
    found = _found(subject, _evidence(subject))
    return tuple(check for check in found if isinstance(check, Check) and check.level != "ok")


def _closes(found: Findings) -> bool:
    """Return whether a finding closes a gate."""
    return any(isinstance(one, Check) and one.gate and one.level != "ok" for one in found)


def _evidence(subject: Subject) -> Evidence | tuple[NotTested, ...]:
    """Return the torque rows of a log; or why there are none."""
    if not subject.sampled or not subject.good.time.known:  # a plan has no positions
        return ()
    log, good = subject.log, subject.good
    reason, body = "", rigid_body(log.robot)
    numbers = len(body.parameters) + 4
    if log.experiment not in ("excitation", "free", "writing"):
        reason = f"a '{log.experiment}' log does not move the whole arm"
    elif not good.runs:
        reason = "no stretch of even samples is long enough"
    elif (spread(good.log.tau) == 0).any() or (subject.travel == 0).any():
        reason = "a joint's position or torque never changes"
    else:
        motion = sample_motion(good)
        if motion is not None and len(motion.t) >= 4 * numbers:
            return Evidence(subject, body, motion)
        reason = f"too short for the {numbers} numbers that explain a joint's torque"
    codes = ("S13", "S14", "S15", "T06")
    return tuple(found for code in codes for found in subject.cannot_tell(code, reason))


def _found(
    subject: Subject, evidence: Evidence | tuple[NotTested, ...]
) -> tuple[Check | NotTested, ...]:
    """Return what motion shows of a torque; where that closes no gate, what the controller does.

    Of columns in the wrong place, or an angle in the wrong scale, nothing else is said.
    """
    found: Findings = ()
    if isinstance(evidence, Evidence):
        e = evidence
        if misplaced := _torque_columns(e) or _position_columns(e) or _encoder_scale(e):
            return tuple(misplaced)
        found = (*_explained(e), *_signs(e), *_sizes(e), *_clock(e))
    else:
        found = evidence
    if _closes(found):
        return tuple(found)
    clear = {one.code for one in found if isinstance(one, Check) and one.level == "ok"}
    if "RRID-S15" in clear:  # gains may be described wrong, and the torque be right
        clear.add("RRID-S10")
    told = [check for check in against_command(subject) if check.code not in clear - {"RRID-T06"}]
    codes = {check.code for check in told}
    return (*told, *(one for one in found if one.code not in codes))


def _torque_columns(e: Evidence) -> list[Check]:
    """S13: would the torques fit better in another order?"""
    square, n = e.table**2, len(e.table)
    best = min(_orders(e, 6), key=lambda order: square[np.arange(n), order].sum())
    moved = np.flatnonzero(best != np.arange(n))
    before, after = e.residual[moved], e.table[moved, best[moved]]
    if not len(moved) or not _better(before, after) or (after > 0.6 * before).any():
        return []
    return [_swapped(e, "tau", best, before, after)]


def _position_columns(e: Evidence) -> list[Check]:
    """S13: would the positions alone fit better in another order?

    Positions and torques together: the torque boundary.
    """
    if _rms(e.residual[e.telling]) < _CONFIG.bad or len(e.telling) < 2:
        return []
    m, names = e.few, ("q", "dq", "ddq", "coulomb")
    tried = []
    for order in _orders(e, 3)[1:]:
        turned = replace(m, **{name: getattr(m, name)[:, order] for name in names})
        tried.append((e.alone(turned), order))
    after, order = min(tried, key=lambda one: _rms(one[0]))
    before = e.alone(m)
    return [_swapped(e, "q", order, before, after)] if _better(before, after) else []


def _swapped(e: Evidence, signal: str, order: Indices, before: Array, after: Array) -> Check:
    moved = np.flatnonzero(order != np.arange(len(order))).tolist()
    how = f"in the order {','.join(str(order[j] + 1) for j in moved)}"
    if len(moved) == 2:
        how = "swapped"
    words = f"{signal}: columns {','.join(str(j + 1) for j in moved)} fit {how}, residual "
    words += f"{_rms(before):.2f} -> {_rms(after):.2f}"
    remedy = "correct the column map of the import, or the wiring of the drives"
    say = e.subject.say
    return say("S13", "warn", words, signal=signal, joint=moved[0], gate=True, remedy=remedy)


def _orders(e: Evidence, every: int) -> list[Indices]:
    """Return every order of the joints that move, of many every swap; first the log's own."""
    told = e.telling.tolist()
    moves = [list(order) for order in permutations(told)] if len(told) <= every else [told]
    for a, b in () if len(told) <= every else combinations(range(len(told)), 2):
        moves.append([told[{a: b, b: a}.get(k, k)] for k in range(len(told))])
    orders = []
    for moved in moves:
        order = np.arange(len(e.table))
        order[told] = moved
        orders.append(order)
    return orders


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _better(before: Array, after: Array) -> bool:
    good = _rms(after) < _CONFIG.good and _rms(after) < _CONFIG.much_better * _rms(before)
    return _rms(before) > _CONFIG.bad and good


def _encoder_scale(e: Evidence) -> list[Check]:
    """S15: would one joint's angle fit better in another scale, or those of all in another unit?

    First with one set of rigid parameters for all rows, where the scale of a joint tells that bends
    nothing and moves little. Then with parameters of its own for each row, where a joint's angle
    bends the arm: that holds whatever the torques' scales. Where bending does not tell, the
    torque's own scale may explain as much: then that is said as well, or instead.
    """
    shared = True
    found = _scaled(e, e.together, _CONFIG.shared_bad)
    if found is None:
        shared, found = False, _scaled(e, e.alone, _CONFIG.scale_bad)
    if found is None:
        return []
    before, after, joint, factor = found
    residual = f"residual {before:.2g} -> {after:.2g}"
    say = e.subject.say
    if joint is None:
        words = f"q fits if every angle is multiplied by {factor}, {residual}"
        return [say("S15", "warn", words, signal="q", gate=True, remedy=_UNIT_REMEDY)]
    words = f"q of joint {joint + 1} fits if multiplied by {factor}, {residual}"
    remedy = "correct the gear ratio, the direction or the counts per turn of this encoder"
    torque = torque_scale(e) if shared else None
    if torque and torque.joint == joint and torque.after <= _CONFIG.either * after:
        if after >= _CONFIG.either * torque.after:
            return []
        words += f"; so does its tau divided by {torque.factor:.3g}"
        remedy += ", or the gear ratio or torque constant of this torque"
    return [say("S15", "warn", words, signal="q", joint=joint, gate=True, remedy=remedy)]


def _scaled(
    e: Evidence, residual: Callable[[Sampled], Array], bad: float
) -> tuple[float, float, int | None, str] | None:
    """Return what the log leaves, what the best scale leaves, the joint and the factor.

    The joint is None for all that turn. None where the log leaves no more than `bad` or not far
    more than that. By the right scale no row fits worse with its own parameters: a joint that hears
    of another drive may fit far better with an angle scaled down, but the other joints' rows, which
    are correct, do not.
    """
    motion = e.few
    before = _rms(residual(motion))
    if before < bad:
        return None
    rows, found = e.alone(motion), list[tuple[float, int | None, str]]()
    turning = np.array([one.revolute for one in e.subject.log.robot.joints])
    own = [(j, _FACTORS, np.arange(len(turning)) == j) for j in e.telling.tolist()]
    for joint, factors, there in (*own, (None, _ANGLE_UNITS, turning)):
        for name, factor in factors.items():
            s = np.where(there, factor, 1.0)
            other = replace(motion, q=motion.q * s, dq=motion.dq * s, ddq=motion.ddq * s)
            left = _rms(residual(other))
            if left > min(_CONFIG.good, _CONFIG.scale_better * before):
                continue
            fits = e.alone(other)
            # the direction of a joint that bends nothing is that of its torque: S14 tells
            bends = factor > 0.0 or (fits <= _CONFIG.much_better * rows).any()
            if (fits <= _CONFIG.worse * rows).all() and bends:
                found.append((left, joint, name))
    return (before, *min(found, key=lambda one: one[0])) if found else None


@dataclass(frozen=True)
class TorqueScale:
    """The torque of `joint` (from 0) is `factor` times what the others' need."""

    joint: int
    factor: float
    before: float  # residual
    after: float  # the same where the torque is divided by the factor
    # joints and factors that explain as much: of two torques only the ratio shows
    others: tuple[tuple[int, float], ...] = ()


def torque_scale(e: Evidence) -> TorqueScale | None:
    """Return the joint and factor that leave least, where the log as it is leaves far more."""
    told = e.telling.tolist()
    if len(told) < 2:
        return None
    rows = SharedRows.of(e.body, e.motion, told)
    before = _rms(rows.left(np.ones(len(told))))
    if before < _SCALE.bad:
        return None
    found = sorted((*_least(rows, place, len(told)), joint) for place, joint in enumerate(told))
    after, factor, joint = found[0]
    # the end of the search is no finding
    inside = _SCALE.least < max(factor, 1.0 / factor) < _SCALE.most * (1.0 - 1e-9)
    if not inside or after > _SCALE.better * before:
        return None
    alike = [(other, by) for left, by, other in found[1:] if left < _SCALE.as_good * after]
    return TorqueScale(joint, factor, before, after, tuple(alike))


def _least(rows: SharedRows, place: int, n: int) -> tuple[float, float]:
    """Return residual and factor of one joint's torque by which all rows fit best."""

    def left(log_factor: float) -> float:
        factors = np.ones(n)
        factors[place] = np.exp(log_factor)
        return _rms(rows.left(factors))

    low, high = -np.log(_SCALE.most), np.log(_SCALE.most)
    for _ in range(_FINER):  # ever finer grids
        grid = np.linspace(low, high, _GRID)
        best, at = min((left(float(x)), k) for k, x in enumerate(grid))
        low, high = grid[max(at - 1, 0)], grid[min(at + 1, _GRID - 1)]
    return best, float(np.exp(grid[at]))


def _explained(e: Evidence) -> list[Check]:
    """S13: a joint whose torque nothing explains, where others are, has another channel's."""
    told, own = e.telling, e.residual[e.telling]
    lost = own > _CONFIG.unexplained
    rest = own[~lost]
    clear = lost.any() and rest.size and rest.max() < _CONFIG.explained
    if not clear or own[lost].min() <= _CONFIG.apart * rest.max():
        words = ", ".join(f"{v:.2g}" for v in own)
        held = "" if len(told) == len(e.table) else "; joints that are only held cannot tell"
        fine = f"each joint's torque fits its own motion best, relative residual {words}{held}"
        return e.subject.ok("S13", fine)
    others, found = ", ".join(f"{v:.2g}" for v in rest), []
    remedy = "unless a diagnosis names a cause there, look whether this column is that joint's "
    remedy += "torque, or repeats another's"
    for j in told[lost].tolist():
        residual = f"relative residual {e.residual[j]:.2g}, others {others}"
        words = f"joint {j + 1}'s torque is not explained by its motion: {residual}"
        found.append(e.subject.say("S13", "warn", words, signal="tau", joint=j, remedy=remedy))
    return found


def _signs(e: Evidence) -> list[Check]:
    """S14: inertia is positive and friction takes power; a flipped torque says neither."""
    flipped = [j for j in e.telling.tolist() if _negative(e, j)]
    if not flipped:
        return e.subject.ok("S14", "inertia of every joint is positive", signal="tau")
    where = ", ".join(f"joint {j + 1}" for j in flipped)
    if len(flipped) == len(e.table) > 1:
        where = "all joints"
    words = f"the torque of {where} looks flipped: inertia and friction come out negative"
    remedy = "change the sign of this torque on import, or of its position"
    say = e.subject.say
    return [
        say("S14", "warn", words, signal="tau", joint=j, gate=True, remedy=remedy) for j in flipped
    ]


def _negative(e: Evidence, joint: int) -> bool:
    """Return whether this row alone needs inertia or friction to be negative.

    And the other does not speak against it. Needs: without it the residual would be twice as large.
    Forcing d·x = 0 on least squares adds (d·x)² / var(d·x) · s² to the squared residual. A late
    torque can make friction negative, but never inertia.
    """
    motion, row = e.motion, e.rows[joint]
    if e.residual[joint] > 0.7:
        return False
    unit, still = np.zeros_like(motion.q), np.zeros_like(motion.q)
    unit[:, joint] = 1.0
    pushed = e.body.regressor(motion.q, still, unit) - e.body.regressor(motion.q, still, still)
    mass, speed = pushed[:, joint].mean(axis=0), motion.dq[:, joint]
    powers = [np.mean(speed**2), np.mean(motion.coulomb[:, joint] * speed)]
    inertia = np.concatenate([mass, [1.0, 0.0, 0.0, 0.0]])
    friction = np.concatenate([np.zeros(len(mass) + 1), powers, [0.0]])
    value, covariance = row.estimate(motion.tau[:, joint])
    mass_sigmas, friction_sigmas = (
        float(d @ value) / max(float(np.sqrt(d @ covariance @ d)), 1e-300)
        for d in (inertia, friction)
    )
    free = max(1, len(motion.t) - row.basis.shape[1])
    decisive, sure = -np.sqrt(_CONFIG.doubled * free), _CONFIG.sure
    light = mass_sigmas < decisive and friction_sigmas < sure
    return light or (friction_sigmas < decisive and mass_sigmas < -sure)


def _sizes(e: Evidence) -> Findings:
    """S15: the torque is as large as the described links need, or the other joints' torques.

    Within what load and friction can make of it.
    """
    subject, known = e.subject, e.body.known_parameters()
    if known is None:
        words = "the robot's description has no masses and inertias to compare with"
        return _against_the_others(e) or subject.cannot_tell("S15", words, signal="tau")
    slopes = _slopes(e, known)
    far = _far(slopes)
    if far and (unit := _angle_unit(e, known, slopes)):
        return [unit]
    found = []
    for j, slope in far.items():
        words = f"tau of joint {j + 1} is {slope:.3g} times what the described links need"
        remedy = _divided(j + 1, slope)
        found.append(
            subject.say("S15", "warn", words, signal="tau", joint=j, gate=True, remedy=remedy)
        )
    if found or (found := _against_the_others(e)):
        return found
    if not slopes:
        words = "the described masses and inertias do not explain the torque of any joint, so that "
        words += "a wrong gear ratio or unit would not show"
        return subject.cannot_tell("S15", words, signal="tau")
    seen = ", ".join(f"joint {j + 1}: {slope:.3g}" for j, slope in slopes.items())
    return subject.ok("S15", f"torque over that of the described links: {seen}", signal="tau")


def _slopes(e: Evidence, known: Array, angles: float = 1.0) -> dict[int, float]:
    """Return torque over that of the described links, of each joint that they explain.

    Args:
        angles: times which every angle is taken.
    """
    motion, slopes = e.motion, {}
    scale = np.where([one.revolute for one in e.subject.log.robot.joints], angles, 1.0)
    expected = e.body.torque(motion.q * scale, motion.dq * scale, motion.ddq * scale, known)
    for j in e.telling.tolist():
        tau, parts = motion.tau[:, j], (motion.dq[:, j], motion.coulomb[:, j])
        friction = np.stack([*parts, np.ones(len(tau))], axis=-1)
        columns = np.column_stack([expected[:, j], friction])
        (without, _), (left, fit) = (_unexplained(own, tau) for own in (friction, columns))
        # else the described links are not this arm's; they say nothing
        if left <= _CONFIG.ratio_residual and left <= 0.4 * without:
            slopes[j] = float(fit[0])
    return slopes


def _unexplained(columns: Array, tau: Array) -> tuple[float, Array]:
    """Return the share of the variation of `tau` that `columns` leave, and their numbers."""
    fit = np.linalg.lstsq(columns, tau, rcond=None)[0]
    left = float(np.linalg.norm(tau - columns @ fit) / np.linalg.norm(tau - tau.mean()))
    return left, np.asarray(fit, dtype=np.float64)


def _far(slopes: dict[int, float]) -> dict[int, float]:
    far = _CONFIG.ratio
    return {j: slope for j, slope in slopes.items() if slope > far or 0 < slope < 1 / far}


def _angle_unit(e: Evidence, known: Array, as_declared: dict[int, float]) -> Check | None:
    """S15: in another unit of angles the described links explain the torques of more joints.

    Each as large as they need. Where no more are explained, as of one joint that only turns
    inertia, a gear ratio would do the same.
    """
    joint, far = max(_far(as_declared).items(), key=lambda one: abs(np.log(one[1])))
    for name, factor in _ANGLE_UNITS.items():
        slopes = _slopes(e, known, factor)
        more = as_declared.keys() < slopes.keys() and not _far(slopes)
        if more and min(slopes.values()) > 0.0:
            times = f"{min(slopes.values()):.3g} to {max(slopes.values()):.3g} times"
            words = f"the unit of q looks wrong: as declared, tau of joint {joint + 1} is "
            words += f"{far:.3g} times what the described links need; with every angle "
            words += f"multiplied by {name}, {times}"
            return e.subject.say("S15", "warn", words, signal="q", gate=True, remedy=_UNIT_REMEDY)
    return None


def _against_the_others(e: Evidence) -> list[Check]:
    """S15 without a description: all torques come from one set of rigid parameters."""
    if (found := torque_scale(e)) is None:
        return []
    places = [f"joint {found.joint + 1} is {found.factor:.3g} times"]
    places += [f"joint {joint + 1} {factor:.3g} times" for joint, factor in found.others]
    ratio = ": only their ratio shows" if found.others else ""
    words = f"tau of {', or tau of '.join(places)} what the other joints' torques need{ratio}, "
    words += f"residual {found.before:.2g} -> {found.after:.2g}"
    remedy, say = _divided(found.joint + 1, found.factor), e.subject.say
    return [say("S15", "warn", words, signal="tau", joint=found.joint, gate=True, remedy=remedy)]


def _divided(joint: int, factor: float) -> str:
    """Return S15's remedy for a torque."""
    constants = f"about {factor:.3g} or {1 / factor:.3g}"
    fit = f"tau of joint {joint} divided by {factor:.3g} would fit"
    return (
        f"look for a gear ratio or torque constant of {constants} that was applied twice or not at "
        f"all; {fit}"
    )


def _clock(e: Evidence) -> Findings:
    """T06: position and torque were stamped by the same clock."""
    subject, told = e.subject, e.telling.tolist()
    found = clock_offset(e.rows, e.motion, told)
    if found is None:
        words = "no torque follows its motion closely enough to time it"
        return subject.cannot_tell("T06", words, signal="tau")
    if found.joints < 2:
        words = "one joint's torque alone is understood, and what its friction does at a reversal "
        words += "looks like an offset of the clocks"
        return subject.cannot_tell("T06", words, signal="tau")
    late, bound = abs(found.samples), found.bound
    size = f"{late:.2f} ± {bound:.2f} samples ({late * 1e3 * e.motion.sample_time:.3g} ms)"
    side = "behind" if found.samples > 0 else "ahead of"
    words = f"torque lies {size} {side} the motion"
    drift = f"{found.drift:+.2f} ± {found.drift_bound:.2f} samples over the log"
    if abs(found.drift) > 1.0 + found.drift_bound:
        gate = abs(found.drift) > 1.0 + _CONFIG.drifts * found.drift_bound
        remedy = "stamp position and torque by one clock"
        drifts = f"the clocks of q and tau drift by {drift}"
        return [subject.say("T06", "warn", drifts, signal="tau", gate=gate, remedy=remedy)]
    if late > 1.0 + bound:
        rest = away_from_reversals(e.body, e.motion, found.samples, told)
        if rest is None or abs(rest.samples - found.samples) > 1.0 + bound + rest.bound:
            words += ", but not away from reversals: friction that lags there looks like it"
            return subject.cannot_tell("T06", words, signal="tau")
        words += f", alike in {found.joints} joints; it drifts by {drift}"
        remedy = "look for a delay between the recorders of q and tau; 'diagnose' tells a late "
        remedy += "encoder from a late drive"
        return [subject.say("T06", "warn", words, signal="tau", remedy=remedy)]
    if bound > _CONFIG.timed_bound:
        words += ": an offset of one sample would not show"
        return subject.cannot_tell("T06", words, signal="tau")
    return subject.ok("T06", f"{words}, drift {drift}", signal="tau")

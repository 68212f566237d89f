"""The result of a friction fit: everything computed, nothing drawn."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pipelines.errors import Check
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.model_file import ModelFile
from pipelines.log.results import NOT_STORED
from pipelines.model.arm import Arm
from pipelines.model.estimation.logs import Fitted, Motions
from pipelines.model.friction.joint import JointFit, fractions
from pipelines.model.friction.ladder import Ladder
from pipelines.model.friction.one_joint import gravity_names
from pipelines.model.friction.ripple import Along, Ripple
from pipelines.model.friction.several import SeveralFit
from pipelines.model.friction.undecided import undecided
from pipelines.model.friction.weak_form import Course, moved

__all__ = ["CandidateLaw", "Drift", "Event", "JointResult", "Posture", "Result", "Rippled", "Series", "Sticking", "Validation",
           "Value", "drift_of_joint", "joint_result", "several_results"]

_POINTS = 1500  # of a figure
_CURVE = 401
_DRIVE = "record it while it is driven through its range, its brake released"


@dataclass(frozen=True)
class Value:
    """A number with its uncertainty."""

    value: float
    std: float | None
    unit: str


@dataclass(frozen=True)
class Validation:
    """Root mean square errors of the simulated speed [rad/s]: Kostić et al. 2004, Fig. 6."""

    velocity_error_with: float | None  # None: the simulation ran away
    velocity_error_without: float | None
    by: str  # the log
    held_out: bool
    torque_error: float | None = None  # what the chosen law leaves of torque that was held out, over that torque, both rms


@dataclass(frozen=True)
class CandidateLaw:
    """A law of the ladder. Torques are means over windows."""

    law: str
    size: int  # numbers that were fitted
    identify_rms: float  # [N m]
    validate_rms: float
    alike: bool  # not measurably worse than the best
    chosen: bool
    reason: str  # why it cannot be chosen


@dataclass(frozen=True)
class Posture:
    """What depends on where the other joints stand."""

    others: tuple[float, ...]  # [rad]
    inertia: Value
    gravity: dict[str, Value]


@dataclass(frozen=True)
class Event:
    """Break-away torque in one direction."""

    direction: int
    torque: Value
    events: int


@dataclass(frozen=True)
class Drift:
    """Friction that changes in time."""

    kind: str  # "trend" | "step"
    form: str  # "whole" friction, its "viscous" part, or its "coulomb" part
    when: float  # [s] since the start of the log: of a step; of a trend its time constant
    change: Value  # relative to the law, from the start of a log to its end; of a step, after it
    speed: float  # [rad/s] at which
    holds_at: float  # [s] since the start of a log, when friction is the law; of a step, before it
    log: str
    when_std: float | None = None  # [s] of a time constant; null of a step, and of a trend that runs straight


@dataclass(frozen=True)
class Sticking:
    """Rows in which the joint does not slide: no law of sliding friction is fitted to them."""

    share: float  # of all rows
    seconds: float  # [s]
    distance: float  # [rad] of travel after a rest or reversal from which it slides
    window: float  # [s] of the equations
    slips: int  # times that it stuck amid motion one way


@dataclass(frozen=True)
class Missing:
    """Something these logs do not show, and what to record."""

    what: str
    record: str


@dataclass(frozen=True)
class Rippled:
    """Torque that depends on the angle of the joint alone: no law of friction holds it."""

    rms: Value  # [N m], of a slide [N]: rms of what it explains of what the law leaves
    share: float  # of what the law leaves of blocks held out (mean square)
    orders: tuple[float, ...]  # [1/rev] waves in a turn, of a slide [1/(2π m)] in 2π m; the largest first
    inertia: Value | None  # of the joint, with the ripple known; null where the law was fitted by another method
    along: Along
    largest_share: float = math.nan  # of the largest wave in all of them (mean square); not known of results stored before it was


@dataclass(frozen=True)
class Series:
    """What figures are drawn from."""

    speed: Array  # [rad/s] (points,) of the curve
    curve: Array  # [N m]
    band: Array  # [N m] one standard deviation
    map_speed: Array  # [rad/s] (classes,)
    map_odd: Array  # [N m]
    map_std: Array
    map_even: Array
    t: Array  # [s] (samples,) of the judged log, thinned out
    torque: Array  # [N m]
    friction: Array  # simulated
    gravity: Array
    inertial: Array
    q: Array  # [rad] measured
    dq: Array  # [rad/s]
    q_with: Array  # simulated with friction
    dq_with: Array
    q_without: Array
    dq_without: Array


@dataclass(frozen=True)
class JointResult:
    """One joint."""

    joint: int
    name: str
    law: str
    method: str
    parameters: dict[str, Value]
    inertia: Value
    gravity: dict[str, Value]  # c of sin q, c' of cos q; a prismatic joint's weight
    postures: tuple[Posture, ...]
    validation: Validation
    candidate_laws: tuple[CandidateLaw, ...]
    judged_by: str  # "logs" | "blocks"
    unseen: tuple[Missing, ...]
    break_away: tuple[Event, ...]
    held: tuple[float, float] | None  # [N m] carried at rest
    driven: tuple[float, float]  # [rad/s] slowest and fastest
    logs: tuple[str, ...]
    series: Series
    ripple: Rippled | None = None
    moved: bool = True  # whether the logs move it at all
    drift: Drift | None = None  # of friction in time
    sticking: Sticking | None = None  # rows that were left out

    @property
    def revolute(self) -> bool:
        """Return whether it turns; else it slides."""
        return self.inertia.unit == "kg m^2"


@dataclass(frozen=True)
class Result:
    """Every joint that was driven."""

    robot: str
    joints: tuple[JointResult, ...]
    source: str  # "one joint at a time" | "all joints at once"
    checks: tuple[Check, ...]  # of the logs, and what the fit says of them
    model: ModelFile = field(metadata=NOT_STORED, repr=False)
    derived: tuple[tuple[str, ExperimentLog], ...] = field(metadata=NOT_STORED, repr=False)


def several_results(found: SeveralFit, arm: Arm, validate: Motions) -> tuple[JointResult, ...]:
    """One result a joint of a fit of all at once. Nothing was simulated: the joints did not move alone."""
    motions = found.fitted.motions
    q = np.concatenate([motion.motion.q[motion.good.kept[motion.good.fit]] for _, motion in motions])
    dq = np.concatenate([motion.motion.dq[motion.good.kept[motion.good.fit]] for _, motion in motions])
    middle = np.median(q, axis=0)
    names = tuple(log.name for log, _ in (*motions, *validate))
    moves = moved([motion for _, motion in motions]).tolist()
    return tuple(_several(found, arm, j, middle, np.abs(dq[:, j]), names, moves[j]) for j in range(arm.n_joints))


def _several(found: SeveralFit, arm: Arm, j: int, middle: Array, speed: Array, names: tuple[str, ...],
             moves: bool) -> JointResult:
    ladder = found.ladders[j]
    law, first = ladder.chosen.law, f":{j + 1}:"
    known = {key.replace(first, "."): value for key, value in arm.parameters.items() if first in key}
    members = set(law.members)
    # the fit of all joints takes the non-linear numbers as known: their deviations are those of the joint's own rows
    std = {number.name: number.std for number in ladder.chosen.fit.numbers if number.known}
    std |= {key: p.std for key, p in known.items() if p.std is not None}
    numbers = {key if len(members) > 1 else key.partition(".")[2]: Value(p.value, std.get(key), p.unit)
               for key, p in known.items() if key.partition(".")[0] in members}
    laws = _candidates(ladder)
    fastest, slowest = float(speed.max()), float(np.quantile(speed, 0.02))
    side = np.concatenate([[0.0], np.geomspace(1e-3 * fastest, fastest, _CURVE // 2)])
    axis = np.concatenate([-side[:0:-1], side])
    nothing = np.zeros(0)
    series = Series(axis, ladder.chosen.fit.curve(axis), ladder.chosen.fit.curve_std(axis), *(nothing,) * 15)
    inertia = _inertia(found.fitted, arm, j, middle)
    ripple = _rippled(found.ripples[j], None if found.beside_ripples is None else _inertia(found.beside_ripples, arm, j, middle),
                      arm.robot.joints[j].revolute)
    open_ = (tuple(Missing(*words) for words in undecided(ladder, slowest, fastest, alone=False)) if moves else
             (Missing("the joint does not move in these logs: neither its inertia nor its friction is shown", _DRIVE),))
    return JointResult(j + 1, arm.robot.joints[j].name, law.name, "varpro", numbers, inertia, {},
                       (Posture(tuple(map(float, middle)), inertia, {}),),
                       Validation(None, None, "", False, _torque_error(ladder)), laws, ladder.by, open_, (), None,
                       (slowest, fastest), names, series, ripple if moves else None, moves)


def _inertia(fitted: Fitted, arm: Arm, j: int, q: Array) -> Value:
    """D_jj at the middle posture."""
    push = np.zeros((1, arm.n_joints))
    push[0, j] = 1.0
    still = 0.0 * push
    row = (arm.body.regressor(q[None], still, push) - arm.body.regressor(q[None], still, still))[0, j]
    estimate = fitted.estimate
    kept = list(estimate.columns.kept)
    spread = estimate.robust.covariance[:len(kept), :len(kept)]
    std = float(np.sqrt(row[kept] @ spread @ row[kept])) if np.isfinite(spread).all() else None
    return Value(float(row[kept] @ estimate.beta[:len(kept)]), std, "kg m^2" if arm.robot.joints[j].revolute else "kg")


def joint_result(joint: JointFit, name: str, method: str) -> JointResult:
    """What is kept of one joint's fit."""
    fit, ladder = joint.fit, joint.ladder
    unit = "N m" if fit.joint.revolute else "N"
    several = len(fit.law.members) > 1
    parameters = {number.name if several else number.name.partition(".")[2]:
                  Value(number.value, number.std if number.known else None, number.unit) for number in fit.numbers}
    postures = tuple(_posture(joint, k) for k in range(len(fit.postures)))
    driven = joint.driven
    errors = [_finite(driven.error(simulated)) for simulated in (driven.with_friction, driven.without)]
    laws = _candidates(ladder)
    events = tuple(Event(event.direction, Value(event.torque, event.std, unit), event.events) for event in joint.break_away)
    return JointResult(
        joint.logs.joint, name, fit.law.name, method, parameters, postures[0].inertia, postures[0].gravity, postures,
        Validation(errors[0], errors[1], driven.stretch.name, driven.judging, _torque_error(ladder)), laws, ladder.by,
        (*(Missing(gap.what, gap.record) for gap in joint.unseen), *_not_excluded(joint)), events, joint.held,
        (joint.covered.slowest, joint.covered.fastest),
        tuple(log.name for log, _ in (*joint.logs.identify, *joint.logs.validate)), _series(joint),
        _rippled(joint.ripple, _beside_ripple(joint), fit.joint.revolute), True, drift_of_joint(joint), _sticking(joint))


def drift_of_joint(joint: JointFit) -> Drift | None:
    """The change of friction that is named; None where the logs show none."""
    return _drift(joint, joint.course) if joint.course is not None and joint.course.named else None


def _not_excluded(joint: JointFit) -> tuple[Missing, ...]:
    """A change of friction that takes part in the fit: the logs neither show nor exclude it."""
    if joint.course is None or joint.course.named:
        return ()
    change = _drift(joint, joint.course).change
    size = f"{100.0 * change.value:.2g} ± {100.0 * (change.std or 0.0):.2g} %"
    return (Missing(f"whether friction changes in the course of a log (by {size} if the law is right) "
                    "or with speed alone: these logs do not tell", "drive every speed early and late in the log"),)


def _drift(joint: JointFit, course: Course) -> Drift:
    """The change of friction at half of the fastest speed, relative to the law."""
    fit = joint.fit
    speed = 0.5 * joint.covered.fastest
    level = float(np.mean(np.abs(fit.curve(np.array([speed, -speed])))))
    own = joint.stretches[0].course or course
    share = float(np.mean(np.abs(own.shape(np.array([speed, -speed]))))) / level
    place = fit.rigid_size - (2 if own.change != 0.0 else 1)
    change = Value(share * float(fit.found.beta[place]), abs(share) * float(fit.std[place]), "1")
    when_std = course.time * float(fit.std[fit.rigid_size - 1]) if own.change != 0.0 else None
    return Drift(course.kind, course.form, course.time, change, speed, course.holds, joint.stretches[course.part].name, when_std)


def _sticking(joint: JointFit) -> Sticking | None:
    """How much of the logs was left out, for the joint stuck or bent its contacts."""
    left, kept, seconds = 0, 0, 0.0
    for stretch in joint.stretches:
        sticks = int(0 if stretch.sticks is None else stretch.sticks.sum())
        left, kept = left + sticks, kept + stretch.rows
        seconds += sticks * float(stretch.length.mean())
    if not left:
        return None
    return Sticking(left / (left + kept), seconds, joint.sliding.distance, joint.window, _stick_slips(joint))


def _stick_slips(joint: JointFit) -> int:
    """Times that the joint stuck amid motion one way: it slides, rests and slides on in the same direction."""
    count = 0
    for stretch in joint.stretches:
        if stretch.sticks is None:
            continue
        speed = np.add.reduceat(stretch.dq, stretch.edges[:-1]) * (stretch.sticks == 0)
        side = np.sign(speed)
        moving = np.flatnonzero(side)
        again = (np.diff(moving) > 1) & (side[moving[1:]] == side[moving[:-1]])
        count += int(again.sum())
    return count


def _candidates(ladder: Ladder) -> tuple[CandidateLaw, ...]:
    return tuple(CandidateLaw(one.law.name, one.law.size, one.identify_rms, one.validate_rms, ladder.alike(one),
                              one is ladder.chosen, one.reason) for one in ladder.tried)


def _torque_error(ladder: Ladder) -> float | None:
    return ladder.chosen.validate_rms / ladder.torque if ladder.torque > 0.0 else None


def _rippled(ripple: Ripple | None, inertia: Value | None, revolute: bool) -> Rippled | None:
    if ripple is None:
        return None
    unit = "N m" if revolute else "N"
    largest = ripple.along.share_of(ripple.orders[0])
    return Rippled(Value(ripple.rms, ripple.std, unit), ripple.share, ripple.orders, inertia, ripple.along, largest)


def _beside_ripple(joint: JointFit) -> Value | None:
    """J of the first posture with the ripple known."""
    if joint.beside_ripple is None:
        return None
    return Value(float(joint.beside_ripple.beta[0]), float(np.sqrt(max(joint.beside_ripple.covariance[0, 0], 0.0))),
                 "kg m^2" if joint.fit.joint.revolute else "kg")


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _posture(joint: JointFit, k: int) -> Posture:
    fit = joint.fit
    names = gravity_names(fit.joint.revolute)
    first = fit.rigid_size * k
    inertia, torque = ("kg m^2", "N m") if fit.joint.revolute else ("kg", "N")
    gravity = {}
    for i, name in enumerate(names):
        value, std = float(fit.found.beta[first + 1 + i]), float(fit.std[first + 1 + i])
        gravity[name] = Value(value if joint.stretches[0].weighs else 0.0, std, torque)
    return Posture(fit.postures[k], Value(float(fit.found.beta[first]), float(fit.std[first]), inertia), gravity)


def _series(joint: JointFit) -> Series:
    driven, points = joint.driven, joint.map
    stretch = driven.stretch
    fastest = joint.covered.fastest
    side = np.concatenate([[0.0], np.geomspace(1e-3 * fastest, fastest, _CURVE // 2)])
    speed = np.concatenate([-side[:0:-1], side])
    friction, gravity, inertial = fractions(joint)
    every = max(1, len(stretch.t) // _POINTS)
    thin = [np.asarray(x[::every]) for x in (
        stretch.t - stretch.t[0], stretch.tau, friction, gravity, inertial, stretch.q, stretch.dq, driven.with_friction.q,
        driven.with_friction.dq, driven.without.q, driven.without.dq)]
    return Series(speed, joint.fit.curve(speed), joint.fit.curve_std(speed), points.speed, points.odd, points.odd_std, points.even,
                  *thin)

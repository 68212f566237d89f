"""Put what a friction fit found into its result: everything computed, nothing drawn."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import Check
from pipelines.estimation.estimate import Fitted
from pipelines.estimation.motion import Motions
from pipelines.friction.config import DriftConfig
from pipelines.friction.fit import LawFit, Value
from pipelines.friction.joint import JointFit, fractions
from pipelines.friction.laws import gravity_names
from pipelines.friction.model_selection import Ladder, Missing, undecided
from pipelines.friction.several import SeveralFit
from pipelines.friction.weak_form import moved
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.model_file import ModelFile
from pipelines.io.results import NOT_STORED

__all__ = ["CandidateLaw", "Drift", "JointResult", "Posture", "Result", "Series",
           "Sticking", "Validation", "joint_result", "several_results"]

POINTS, CURVE = 1500, 401  # numerics: of a figure
_UNMOVED = Missing("the joint does not move in these logs: neither its inertia nor its friction is "
                   "shown", "record it while it is driven through its range, its brake released")


@dataclass(frozen=True)
class Validation:
    """Root mean square errors of the simulated speed [rad/s]: Kostić et al. 2004, Fig. 6."""

    velocity_error_with: float | None  # None: the simulation ran away
    velocity_error_without: float | None
    by: str  # the log
    held_out: bool
    torque_error: float | None = None  # residual of held-out torque, over that torque (rms)


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
    """Inertia and gravity in one posture of the other joints."""

    others: tuple[float, ...]  # [rad]
    inertia: Value
    gravity: dict[str, Value]


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
    when_std: float | None = None  # [s] of a time constant


@dataclass(frozen=True)
class Sticking:
    """Rows in which the joint does not slide: no law of sliding friction is fitted to them."""

    share: float  # of all rows
    seconds: float  # [s]
    distance: float  # [rad] of travel after a rest or reversal from which it slides
    window: float  # [s] of the equations


@dataclass(frozen=True)
class Series:
    """Curves and samples for figures."""

    speed: Array  # [rad/s] (points,) of the curve
    curve: Array  # [N m]
    band: Array  # [N m] one standard deviation
    # (samples,) of the judged log, thinned out; empty where nothing was simulated
    t: Array  # [s]
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
    parameters: dict[str, Value]
    inertia: Value
    gravity: dict[str, Value]  # c of sin q, c' of cos q; a prismatic joint's weight
    postures: tuple[Posture, ...]
    validation: Validation
    candidate_laws: tuple[CandidateLaw, ...]
    judged_by: str  # "logs" | "blocks"
    unseen: tuple[Missing, ...]
    driven: tuple[float, float]  # [rad/s] slowest and fastest
    logs: tuple[str, ...]
    series: Series
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


def joint_result(joint: JointFit, name: str) -> JointResult:
    """Return what is kept of the fit of a joint that was driven alone."""
    fit, ladder, driven = joint.fit, joint.ladder, joint.driven
    several, errors = len(fit.law.members) > 1, []
    parameters = {number.name if several else number.name.partition(".")[2]:
                  Value(number.value, number.std if number.known else None, number.unit)
                  for number in fit.numbers}
    postures = tuple(_posture(joint, k) for k in range(len(fit.postures)))
    for simulated in (driven.with_friction, driven.without):
        error = driven.error(simulated)
        errors.append(error if np.isfinite(error) else None)
    drift = _drift(joint)
    return JointResult(
        joint.logs.joint, name, fit.law.name, parameters, postures[0].inertia,
        postures[0].gravity, postures,
        Validation(errors[0], errors[1], driven.stretch.name, driven.judging,
                   _torque_error(ladder)),
        _candidates(ladder), ladder.by, joint.unseen,
        (joint.covered.slowest, joint.covered.fastest),
        tuple(log.name for log, _ in (*joint.logs.identify, *joint.logs.validate)),
        _series(joint), True, drift, _sticking(joint))


def _posture(joint: JointFit, k: int) -> Posture:
    fit, (torque, _, inertia) = joint.fit, joint.fit.joint.units
    first, names = fit.rigid_size * k, gravity_names(fit.joint.revolute)
    values, std = (x[first:first + 1 + len(names)].tolist() for x in (fit.found.beta, fit.std))
    weighs = joint.stretches[0].weighs
    gravity = {name: Value(value if weighs else 0.0, deviation, torque)
               for name, value, deviation in zip(names, values[1:], std[1:], strict=True)}
    return Posture(fit.postures[k], Value(values[0], std[0], inertia), gravity)


def _drift(joint: JointFit) -> Drift | None:
    """Return the change of friction at half of the fastest speed, relative to the law."""
    fit, course = joint.fit, joint.stretches[0].course
    if course is None:
        return None
    speed = 0.5 * joint.covered.fastest
    both, last = np.array([speed, -speed]), fit.rigid_size - 1
    share = float(np.mean(np.abs(course.shape(both)))) / float(np.mean(np.abs(fit.curve(both))))
    change, std = share * float(fit.found.beta[last]), abs(share) * float(fit.std[last])
    if abs(change) <= DriftConfig().sure * std:  # the law that was chosen does not show it
        return None
    name = joint.stretches[course.part].name
    size = Value(change, std, "1")
    return Drift(course.kind, course.form, course.time, size, speed, course.holds, name,
                 course.time_std)


def _sticking(joint: JointFit) -> Sticking | None:
    """Return how much of the logs was left out, for the joint stuck or bent its contacts."""
    sticking = [stretch for stretch in joint.stretches if stretch.sticks is not None]
    left = [int(stretch.sticks.sum()) for stretch in sticking if stretch.sticks is not None]
    if not sum(left):
        return None
    seconds = sum(n * float(one.length.mean()) for n, one in zip(left, sticking, strict=True))
    share = sum(left) / (sum(left) + sum(stretch.rows for stretch in joint.stretches))
    return Sticking(share, seconds, joint.sliding.distance, joint.window)


def _candidates(ladder: Ladder) -> tuple[CandidateLaw, ...]:
    return tuple(CandidateLaw(one.law.name, one.law.size, one.fit.found.rms, one.validate_rms,
                              ladder.alike(one), one is ladder.chosen, one.reason)
                 for one in ladder.tried)


def _torque_error(ladder: Ladder) -> float | None:
    return ladder.chosen.validate_rms / ladder.torque if ladder.torque > 0.0 else None


def _curve(fit: LawFit, fastest: float) -> tuple[Array, Array, Array]:
    """Return speeds up to the fastest, dense about zero, the curve and its deviation (points,)."""
    side = np.concatenate([[0.0], np.geomspace(1e-3 * fastest, fastest, CURVE // 2)])
    speed = np.concatenate([-side[:0:-1], side])
    return speed, fit.curve(speed), fit.curve_std(speed)


def _series(joint: JointFit) -> Series:
    driven, stretch = joint.driven, joint.driven.stretch
    every = max(1, len(stretch.t) // POINTS)
    friction, gravity, inertial = fractions(joint)
    samples = {"t": stretch.t - stretch.t[0], "torque": stretch.tau, "friction": friction,
               "gravity": gravity, "inertial": inertial, "q": stretch.q, "dq": stretch.dq,
               "q_with": driven.with_friction.q, "dq_with": driven.with_friction.dq,
               "q_without": driven.without.q, "dq_without": driven.without.dq}
    return Series(*_curve(joint.fit, joint.covered.fastest),
                  **{name: np.asarray(x[::every]) for name, x in samples.items()})


def several_results(found: SeveralFit, arm: Arm, validate: Motions) -> tuple[JointResult, ...]:
    """Return one result a joint of a fit of all at once.

    Nothing was simulated: the joints did not move alone.
    """
    motions = [motion for _, motion in found.fitted.motions]
    rows = [motion.good.kept[motion.good.fit] for motion in motions]
    q, dq = (np.concatenate([x[own] for x, own in zip(parts, rows, strict=True)]) for parts in (
        [motion.motion.q for motion in motions], [motion.motion.dq for motion in motions]))
    names = tuple(log.name for log, _ in (*found.fitted.motions, *validate))
    moves, middle = moved(motions).tolist(), np.median(q, axis=0)
    return tuple(_several(found, arm, j, middle, np.abs(dq[:, j]), names, moves[j])
                 for j in range(arm.n_joints))


def _several(found: SeveralFit, arm: Arm, j: int, middle: Array, speed: Array,
             names: tuple[str, ...], moves: bool) -> JointResult:
    ladder = found.ladders[j]
    fit, law, first = ladder.chosen.fit, ladder.chosen.law, f":{j + 1}:"
    known = {key.replace(first, "."): parameter for key, parameter in arm.parameters.items()
             if first in key}
    # non-linear numbers were known to the fit of all joints: deviations are of the joint's own rows
    std = {number.name: number.std for number in fit.numbers if number.known}
    std |= {key: p.std for key, p in known.items() if p.std is not None}
    several = len(set(law.members)) > 1
    numbers = {key if several else key.partition(".")[2]: Value(p.value, std.get(key), p.unit)
               for key, p in known.items() if key.partition(".")[0] in law.members}
    fastest, slowest = float(speed.max()), float(np.quantile(speed, 0.02))
    inertia, none = _inertia(found.fitted, arm, j, middle), np.zeros(0)  # nothing was simulated
    missing: tuple[Missing, ...] = (_UNMOVED,)
    if moves:
        missing = undecided(ladder, slowest, fastest)
    return JointResult(
        j + 1, arm.robot.joints[j].name, law.name, numbers, inertia, {},
        (Posture(tuple(map(float, middle)), inertia, {}),),
        Validation(None, None, "", False, _torque_error(ladder)), _candidates(ladder), ladder.by,
        missing, (slowest, fastest), names,
        Series(*_curve(fit, fastest), t=none, torque=none, friction=none, gravity=none,
               inertial=none, q=none, dq=none, q_with=none, dq_with=none, q_without=none,
               dq_without=none), moves)


def _inertia(fitted: Fitted, arm: Arm, j: int, q: Array) -> Value:
    """Return D_jj at a posture (joints,)."""
    push = np.zeros((1, arm.n_joints))
    push[0, j] = 1.0
    still = 0.0 * push
    regressor = arm.body.regressor
    row = (regressor(q[None], still, push) - regressor(q[None], still, still))[0, j]
    estimate = fitted.estimate
    own = row[list(estimate.columns.kept)]
    spread = estimate.robust.covariance[:len(own), :len(own)]
    std = float(np.sqrt(own @ spread @ own)) if np.isfinite(spread).all() else None
    unit = "kg m^2" if arm.robot.joints[j].revolute else "kg"
    return Value(float(own @ estimate.beta[:len(own)]), std, unit)

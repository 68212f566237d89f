"""Put what a friction fit found into its result: everything computed, nothing drawn."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import Check
from pipelines.estimation.estimate import Fitted
from pipelines.estimation.motion import Motions
from pipelines.friction.config import FRICTION
from pipelines.friction.fit import LawFit, Value
from pipelines.friction.joint import JointFit
from pipelines.friction.laws import gravity_names
from pipelines.friction.model_selection import Ladder, Missing, undecided
from pipelines.friction.several import SeveralFit
from pipelines.friction.weak_form import moved
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.model_file import ModelFile
from pipelines.io.results import NOT_STORED

__all__ = ["CandidateLaw", "Drift", "JointResult", "Result", "Series", "Sticking", "Validation"]
__all__ += ["joint_result", "several_results"]

POINTS, CURVE = 1500, 401  # numerics: of a figure
_UNMOVED = Missing(
    "the joint does not move in these logs: neither its inertia nor its friction is shown",
    "record it while it is driven through its range, its brake released",
)


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
class Drift:
    """Friction that changes in the course of each log, and its law in the middle of it."""

    kind: str  # "trend"
    when: float  # [s] time constant
    when_std: float | None  # [s]
    change: Value  # relative to the law, from the start of a log to its end
    holds_at: float  # [s] since the start of a log, when friction is the law


@dataclass(frozen=True)
class Sticking:
    """Rows in which the joint does not slide: no law of sliding friction is fitted to them."""

    share: float  # of all rows
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
    dq: Array  # [rad/s] measured
    dq_with: Array  # simulated with friction
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
    checks: tuple[Check, ...]  # of the logs and of the fit
    model: ModelFile = field(metadata=NOT_STORED, repr=False)
    derived: tuple[tuple[str, ExperimentLog], ...] = field(metadata=NOT_STORED, repr=False)


def joint_result(joint: JointFit, name: str) -> JointResult:
    """Return what is kept of the fit of a joint that was driven alone."""
    fit, ladder, driven = joint.fit, joint.ladder, joint.driven
    several = len(fit.law.members) > 1
    parameters = {
        number.name if several else number.name.partition(".")[2]: Value(
            number.value, number.std if number.known else None, number.unit
        )
        for number in fit.numbers
    }
    torque, _, unit = fit.joint.units
    names = gravity_names(fit.joint.revolute)
    weighs = joint.stretches[0].weighs
    gravity = {
        name: Value(value if weighs else 0.0, float(std), torque)
        for name, value, std in zip(names, fit.gravity, fit.std[1:], strict=False)
    }
    each = (driven.error(one) for one in (driven.with_friction, driven.without))
    errors = [error if np.isfinite(error) else None for error in each]
    judged_by, error = driven.stretch.name, ladder.torque_error
    return JointResult(
        joint.logs.joint,
        name,
        fit.law.name,
        parameters,
        Value(fit.inertia, float(fit.std[0]), unit),
        gravity,
        Validation(errors[0], errors[1], judged_by, driven.judging, error),
        _candidates(ladder),
        ladder.by,
        joint.unseen,
        (joint.covered.slowest, joint.covered.fastest),
        tuple(log.name for log, _ in (*joint.logs.identify, *joint.logs.validate)),
        _series(joint),
        True,
        _drift(joint),
        _sticking(joint),
    )


def _drift(joint: JointFit) -> Drift | None:
    course, last = joint.stretches[0].course, joint.fit.width - 1
    if course is None:
        return None
    change, std = float(joint.fit.found.beta[last]), float(joint.fit.std[last])
    if abs(change) <= FRICTION.sure * std:  # the law that was chosen does not show it
        return None
    return Drift("trend", course.time, course.time_std, Value(change, std, "1"), course.holds)


def _sticking(joint: JointFit) -> Sticking | None:
    left = sum(int(one.sticks.sum()) for one in joint.stretches if one.sticks is not None)
    if not left:
        return None
    share = left / (left + sum(stretch.rows for stretch in joint.stretches))
    return Sticking(share, joint.sliding.distance, joint.window)


def _candidates(ladder: Ladder) -> tuple[CandidateLaw, ...]:
    return tuple(
        CandidateLaw(
            one.law.name,
            one.law.size,
            one.fit.found.rms,
            one.validate_rms,
            ladder.alike(one),
            one is ladder.chosen,
            one.reason,
        )
        for one in ladder.tried
    )


def _curve(fit: LawFit, fastest: float) -> tuple[Array, Array, Array]:
    """Return speeds up to the fastest, dense about zero, the curve and its deviation (points,)."""
    side = np.concatenate([[0.0], np.geomspace(1e-3 * fastest, fastest, CURVE // 2)])
    speed = np.concatenate([-side[:0:-1], side])
    return speed, fit.curve(speed), fit.curve_std(speed)


def _series(joint: JointFit) -> Series:
    driven, stretch = joint.driven, joint.driven.stretch
    every = max(1, len(stretch.t) // POINTS)
    samples = (stretch.t - stretch.t[0], stretch.dq, driven.with_friction.dq, driven.without.dq)
    thin = (np.asarray(x[::every]) for x in samples)
    return Series(*_curve(joint.fit, joint.covered.fastest), *thin)


def several_results(found: SeveralFit, arm: Arm, validate: Motions) -> tuple[JointResult, ...]:
    """Return one result a joint of a fit of all at once.

    Nothing was simulated: the joints did not move alone.
    """
    motions = [motion for _, motion in found.fitted.motions]
    rows = [motion.good.kept[motion.good.fit] for motion in motions]
    pairs = list(zip(motions, rows, strict=True))
    q = np.concatenate([motion.motion.q[own] for motion, own in pairs])
    dq = np.concatenate([motion.motion.dq[own] for motion, own in pairs])
    names = tuple(log.name for log, _ in (*found.fitted.motions, *validate))
    moves, middle = moved(motions).tolist(), np.median(q, axis=0)
    results = []
    for j, ladder in enumerate(found.ladders):
        fit, law, first = ladder.chosen.fit, ladder.chosen.law, f":{j + 1}:"
        known = {
            key.replace(first, "."): parameter
            for key, parameter in arm.parameters.items()
            if first in key
        }
        # non-linear numbers were known to the fit of all joints: deviations are of its own rows
        std = {number.name: number.std for number in fit.numbers if number.known}
        std |= {key: p.std for key, p in known.items() if p.std is not None}
        several = len(set(law.members)) > 1
        numbers = {
            key if several else key.partition(".")[2]: Value(p.value, std.get(key), p.unit)
            for key, p in known.items()
            if key.partition(".")[0] in law.members
        }
        speed = np.abs(dq[:, j])
        fastest, slowest = float(speed.max()), float(np.quantile(speed, 0.02))
        result = JointResult(
            j + 1,
            arm.robot.joints[j].name,
            law.name,
            numbers,
            _inertia(found.fitted, arm, j, middle),
            {},
            Validation(None, None, "", False, ladder.torque_error),
            _candidates(ladder),
            ladder.by,
            undecided(ladder, slowest, fastest) if moves[j] else (_UNMOVED,),
            (slowest, fastest),
            names,
            Series(*_curve(fit, fastest), *np.zeros((4, 0))),
            moves[j],
        )
        results.append(result)
    return tuple(results)


def _inertia(fitted: Fitted, arm: Arm, j: int, q: Array) -> Value:
    """Return D_jj at a posture (joints,)."""
    push = np.zeros((1, arm.n_joints))
    push[0, j] = 1.0
    still = 0.0 * push
    regressor = arm.body.regressor
    row = (regressor(q[None], still, push) - regressor(q[None], still, still))[0, j]
    estimate = fitted.estimate
    own = row[list(estimate.columns.kept)]
    spread = estimate.robust.covariance[: len(own), : len(own)]
    std = float(np.sqrt(own @ spread @ own)) if np.isfinite(spread).all() else None
    unit = "kg m^2" if arm.robot.joints[j].revolute else "kg"
    return Value(float(own @ estimate.beta[: len(own)]), std, unit)

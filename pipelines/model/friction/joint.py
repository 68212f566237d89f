"""Everything that friction logs of one joint show: its law and how it was chosen, what judges it, what is not seen.

    motion by the smoother → refined about a flexible law → ladder → refined about the chosen law → the fit

Rows in which the joint rests are left out, of all but laws that know these: torque at rest is an inequality (Karnopp 1985).
So are other rows in which it does not slide (sliding.py), where the flexible law does not follow them as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.fit.varpro import SeparableFit, with_block_covariance
from pipelines.log.experiment import ExperimentLog
from pipelines.model.friction.break_away import BreakAway, break_away, held_at_least
from pipelines.model.friction.coverage import Coverage, Unseen, coverage, unseen
from pipelines.model.friction.drift import DriftConfig, drift_of
from pipelines.model.friction.equations import LawEquations
from pipelines.model.friction.fit_law import fit_law
from pipelines.model.friction.ladder import Judge, Ladder, climb, no_worse
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import LADDER, Law
from pipelines.model.friction.one_joint import OneJoint, gravity_columns
from pipelines.model.friction.postures import alike
from pipelines.model.friction.refine import refined
from pipelines.model.friction.ripple import Ripple, refitted, ripple_of
from pipelines.model.friction.simulate import Simulated, simulate_joint
from pipelines.model.friction.sliding import Mask, Sliding, SlidingConfig, free_curve, left_out, sliding_rows
from pipelines.model.friction.speed_map import SpeedMap, speed_map
from pipelines.model.friction.weak_form import Course, Stretch, blocks_of_time, stretches_of, swaying
from pipelines.model.motion import Reconstructed, encoder_resolution
from pipelines.model.rigid.body import Array, Motion

__all__ = ["JointConfig", "JointFit", "JointLogs", "Seen", "fit_joint", "fractions", "with_fit"]

_FLEXIBLE = Law("flexible", ("three_sigmoid", "asymmetric_friction"))  # follows any curve: no law of the ladder is favoured


@dataclass(frozen=True)
class JointConfig:
    """Numbers of the fit of one joint.

    Attributes:
        bent: of friction; a curve that departs less from straight lines does not show whether it lags
        memory: [s] over which errors of a law may depend on one another: a joint moves some of its travel in it
        courses: steps of Gauss and Newton for the time constant of a drift
        rounds: of refining before laws are compared
        curve: points of a curve, each way, from 1e-3 of the fastest speed on
        fastest: of them, over which its slope at the highest speeds is taken: the upper half of the speeds
    """

    bent: float = 1e-3
    memory: float = 1.0
    courses: int = 5
    rounds: int = 2
    curve: int = 100
    fastest: int = 9


_CONFIG = JointConfig()

Seen = tuple[ExperimentLog, Reconstructed]


@dataclass(frozen=True, eq=False)
class JointLogs:
    """The logs of one joint, counted from 1."""

    joint: int
    identify: tuple[Seen, ...]
    validate: tuple[Seen, ...] = ()
    hold: tuple[Seen, ...] = ()


@dataclass(frozen=True, eq=False)
class Driven:
    """A judged stretch beside its simulation."""

    stretch: Stretch
    judging: bool  # of a validate log
    with_friction: Simulated
    without: Simulated

    def error(self, simulated: Simulated) -> float:
        """Root mean square of the simulated speed's error [rad/s]; infinite where the simulation ran away."""
        apart = simulated.dq - self.stretch.dq
        return float(np.sqrt(np.mean(np.square(apart)))) if np.isfinite(apart).all() else float("inf")


@dataclass(frozen=True, eq=False)
class JointFit:
    """The fit of one joint."""

    logs: JointLogs
    fit: LawFit
    ladder: Ladder
    stretches: tuple[Stretch, ...]
    driven: Driven
    covered: Coverage
    unseen: tuple[Unseen, ...]
    map: SpeedMap
    break_away: tuple[BreakAway, ...]
    held: tuple[float, float] | None  # [N m] friction carried at rest, back and forth
    window: float  # [s]
    ripple: Ripple | None
    sliding: Sliding
    course: Course | None  # of friction that changes in time
    beside_ripple: SeparableFit | None  # the law and the rigid numbers, the rigid ones first, with the ripple known


def fit_joint(logs: JointLogs, window: float, law: Law | None = None, config: SlidingConfig | None = None) -> JointFit:
    """Fit `law`, or choose one.

    Args:
        window: of the equations [s], the shortest: a coarse encoder needs longer ones.
    """
    robot = logs.identify[0][0].robot
    arm = OneJoint.of(robot, logs.joint)
    resolution = max(float(encoder_resolution(found.good)[logs.joint - 1]) for _, found in logs.identify)
    beside = _swaying(logs)
    config = config or SlidingConfig()
    rows = _usable_rows(logs, window, beside, arm, config)
    moves = ~rows.sliding.resting if rows.any_slide and (law is None or law.pointwise) else np.ones_like(rows.sliding.resting)
    stretches, fit = _about_a_flexible_law(left_out(rows.stretches, moves), rows.fitted, arm, resolution)
    if rows.any_slide and not _followed(stretches, fit, rows.sliding, moves, config):
        stretches = left_out(rows.stretches, rows.sliding.slides)
    found = _course(stretches, rows, arm, config, DriftConfig())
    course = found if found is not None and found.named else None
    choice = _chosen(stretches, rows.fitted, course, fit, arm, law)
    if found is not course:
        other = _chosen(stretches, rows.fitted, found, fit, arm, choice.ladder.chosen.law)
        if not no_worse(choice.ladder.chosen.residual, other.ladder.chosen.residual):
            choice = _chosen(stretches, rows.fitted, found, fit, arm, law)
    identify, validate, ladder, course = choice.identify, choice.validate, choice.ladder, choice.course
    sticks = any(stretch.sticks is not None for stretch in identify)
    chosen = ladder.chosen.fit
    if not sticks:  # reversals are kinks of the speed, and where it sticks they are left out
        identify, validate = (tuple(refined(stretch, chosen, resolution) for stretch in part) for part in (identify, validate))
    for _ in range(_CONFIG.courses if course is not None else 1):
        both = _along((*identify, *validate), course, chosen)  # the same columns in both
        identify, validate = both[:len(identify)], both[len(identify):]
        final = fit_law(LawEquations.of(identify, arm), chosen.law, [chosen.theta])
        course, chosen = _next(course, final), final
    if sticks:
        robust = with_block_covariance(final.found, blocks_of_time(identify, _CONFIG.memory))
        final = _with_errors_in_variables(replace(final, found=robust), rows.sliding.attenuation)
    ripple = ripple_of(LawEquations.of(identify, arm), final)
    judging = max(validate or identify, key=lambda stretch: len(stretch.t))
    driven = Driven(judging, bool(validate), simulate_joint(judging, final), simulate_joint(judging, final, friction=False))
    covered = coverage(identify)
    at_rest = [stretch for stretch in _stretches(logs.hold, logs.joint, rows.window, beside)
               if any(alike(stretch.posture, posture) for posture in final.postures)]
    return JointFit(logs, final, ladder, identify, driven, covered, unseen(covered, ladder), speed_map(identify, final),
                    break_away((*identify, *at_rest), final), held_at_least(at_rest, final), rows.window, ripple,
                    rows.sliding, course,
                    None if ripple is None else refitted(LawEquations.of(identify, arm), final, ripple))


@dataclass(frozen=True, eq=False)
class _Rows:
    """Stretches to fit and to judge, and which of their rows slide."""

    stretches: tuple[Stretch, ...]  # the fitted ones first
    fitted: int
    window: float  # [s]
    sliding: Sliding

    @property
    def any_slide(self) -> bool:
        """Return whether rows of the fitted stretches slide."""
        return bool(self.sliding.slides[:sum(stretch.rows for stretch in self.stretches[:self.fitted])].any())


def _usable_rows(logs: JointLogs, window: float, beside: tuple[int, ...], arm: OneJoint, config: SlidingConfig) -> _Rows:
    """The shortest windows over which the encoder shows the acceleration."""
    found: _Rows | None = None
    for factor in config.windows:
        identify, validate = (_stretches(part, logs.joint, factor * window, beside) for part in (logs.identify, logs.validate))
        if not identify:
            break
        both = tuple(replace(stretch, part=k) for k, stretch in enumerate((*identify, *validate)))
        rows = _Rows(both, len(identify), factor * window, sliding_rows(both, arm, config))
        if found is None or rows.sliding.attenuation < found.sliding.attenuation:  # longer ones may all hold a reversal
            found = rows
        if found.sliding.attenuation <= config.attenuation:
            break
    if found is None:
        raise InputRejected("T08", f"joint {logs.joint}: no log has enough windows of {window:g} s to fit a law to",
                            remedy="record a few seconds at least")
    return found


def _about_a_flexible_law(stretches: tuple[Stretch, ...], fitted: int, arm: OneJoint,
                          resolution: float) -> tuple[tuple[Stretch, ...], LawFit]:
    """The motion refined about a law that follows any curve, and that law."""
    fit = fit_law(LawEquations.of(stretches[:fitted], arm), _FLEXIBLE)
    for _ in range(_CONFIG.rounds):
        before, stretches = fit, tuple(refined(stretch, fit, resolution) for stretch in stretches)
        fit = fit_law(LawEquations.of(stretches[:fitted], arm), _FLEXIBLE, [before.theta])
    return stretches, fit


def _followed(stretches: tuple[Stretch, ...], fit: LawFit, sliding: Sliding, moves: Mask,
              config: SlidingConfig) -> bool:
    """Return whether one curve fits the other rows as well as those that slide, or these make most of its residual.

    Args:
        moves: which rows of all are those of `stretches`.
    """
    square = np.square(LawEquations.of(stretches, fit.joint).predicted(fit).residual)
    doubt, sure = square[~sliding.slides[moves]], square[sliding.slides[moves]]
    return not doubt.size or float(doubt.mean()) <= config.worse * float(sure.mean()) or float(doubt.sum()) <= float(sure.sum())


def _course(stretches: tuple[Stretch, ...], rows: _Rows, arm: OneJoint, config: SlidingConfig, drift: DriftConfig) -> Course | None:
    """How friction changes in time over the logs that are fitted; None where it does not."""
    if not rows.any_slide:
        return None
    fitted = left_out(stretches, rows.sliding.slides)[:rows.fitted]
    equations, speed = LawEquations.of(fitted, arm), np.concatenate([stretch.middle[1] for stretch in fitted])
    return drift_of(fitted, equations.y, equations.fixed, free_curve(speed, config), drift)


@dataclass(frozen=True, eq=False)
class _Choice:
    """A law chosen with a course of friction in time, or without."""

    identify: tuple[Stretch, ...]
    validate: tuple[Stretch, ...]
    ladder: Ladder
    course: Course | None


def _chosen(stretches: tuple[Stretch, ...], fitted: int, course: Course | None, fit: LawFit,
            arm: OneJoint, law: Law | None) -> _Choice:
    """Choose among laws, or fit `law`, while friction changes along `course`."""
    stretches, fit, course = _with_course(stretches, fitted, course, fit, arm)
    identify = stretches[:fitted]
    validate = tuple(stretch for stretch in stretches[fitted:] if stretch.rows)
    judged = LawEquations.of(validate, arm) if validate else None
    judge = Judge(LawEquations.of(identify, arm), judged)
    sticks = any(stretch.sticks is not None for stretch in identify)
    laws = tuple(one for one in LADDER if one.pointwise or not sticks)  # presliding is left out
    return _Choice(identify, validate, climb(judge, (law,) if law is not None else laws), course)


def _with_course(stretches: tuple[Stretch, ...], fitted: int, course: Course | None, fit: LawFit,
                 arm: OneJoint) -> tuple[tuple[Stretch, ...], LawFit, Course | None]:
    """The stretches along `course`, its time constant fitted, and the flexible law fitted to these very stretches."""
    stretches = _along(stretches, course, fit)
    for k in range(_CONFIG.courses if course is not None else 0):
        fit = fit_law(LawEquations.of(stretches[:fitted], arm), fit.law, [fit.theta])
        if k + 1 < _CONFIG.courses:
            course = _next(course, fit)
            stretches = _along(stretches, course, fit)
    return stretches, fit, course


def _along(stretches: tuple[Stretch, ...], course: Course | None, fit: LawFit) -> tuple[Stretch, ...]:
    """The stretches with columns of `course`, a change of the curve of `fit`, and of friction that lags behind its speed.

    f(v(t - T)) = f - T df/dt to first order (Armstrong-Hélouvry et al. 1994, Section 2.1). Of f counts what departs from the slope
    at the highest speeds: viscous friction does not lag, and its lag would be inertia. T < 0 where bristles straighten.
    """
    if not stretches:
        return stretches
    rows = np.abs(np.concatenate([stretch.middle[1] for stretch in stretches]))
    fastest = float(max(np.abs(stretch.dq).max() for stretch in stretches))
    side = np.geomspace(max(float(rows.min()), 1e-3 * float(rows.max())), fastest, _CONFIG.curve)
    speed = np.concatenate([-side[::-1], side])
    curve = fit.curve(speed)
    ends = (curve[_CONFIG.fastest] - curve[0], curve[-1] - curve[-1 - _CONFIG.fastest])
    bent = curve - np.where(speed < 0.0, *ends) / (side[-1] - side[-1 - _CONFIG.fastest]) * speed
    lags = max(np.ptp(bent[:_CONFIG.curve]), np.ptp(bent[_CONFIG.curve:])) > _CONFIG.bent * float(np.abs(curve).max())
    lags = lags and any(stretch.sticks is not None for stretch in stretches)
    own = None if course is None else replace(course, curve=(speed, curve))
    return tuple(replace(stretch, course=own, lag=(speed, bent) if lags else None) for stretch in stretches)


def _next(course: Course | None, fit: LawFit) -> Course | None:
    """The course with the time constant of a fit, one step of Gauss and Newton on."""
    if course is None or course.kind == "step":
        return course
    if course.change == 0.0:
        return replace(course, change=float(fit.found.beta[fit.rigid_size - 1]))
    change, step = fit.found.beta[fit.rigid_size - 2:fit.rigid_size]
    time = float(np.clip(course.time * np.exp(np.clip(step, -0.5, 0.5)), 0.05 * course.until, 10.0 * course.until))
    return replace(course, change=float(change), time=time)


def _with_errors_in_variables(fit: LawFit, attenuation: float) -> LawFit:
    """`fit` with every inertia as uncertain as noise of the acceleration may have made it too small: J times that share."""
    covariance = fit.found.covariance.copy()
    places = fit.rigid_size * np.arange(len(fit.postures))
    covariance[places, places] += np.square(min(attenuation, 1.0) * fit.found.beta[places])
    return replace(fit, found=replace(fit.found, covariance=covariance))


def _swaying(logs: JointLogs) -> tuple[int, ...]:
    """Joints that give way in any of the logs that are fitted."""
    found = {joint for _, motion in logs.identify for joint in swaying(motion, logs.joint, encoder_resolution(motion.good))}
    return tuple(sorted(found))


def _stretches(seen: Sequence[Seen], joint: int, window: float, beside: tuple[int, ...]) -> tuple[Stretch, ...]:
    return tuple(stretch for log, found in seen for stretch in stretches_of(log, joint, found, window, beside))


def with_fit(joint: JointFit, fit: LawFit) -> JointFit:
    """The same with numbers from another method, judged again. What a ripple does to its inertia that method does not say."""
    stretch = joint.driven.stretch
    driven = replace(joint.driven, with_friction=simulate_joint(stretch, fit), without=simulate_joint(stretch, fit, friction=False))
    return replace(joint, fit=fit, driven=driven, map=speed_map(joint.stretches, fit), beside_ripple=None)


def fractions(joint: JointFit) -> tuple[Array, Array, Array]:
    """Friction, gravity and inertial torque (samples,) [N m] along the simulated motion, Fig. 5.

    Gravity is that of the measured position, as in the simulation.
    """
    stretch, simulated, fit = joint.driven.stretch, joint.driven.with_friction, joint.fit
    arm, _ = fit.at(stretch)
    ddq = np.gradient(simulated.dq, stretch.t)
    motion = Motion(stretch.t, simulated.q[:, None], simulated.dq[:, None], ddq[:, None])
    friction = np.asarray(fit.law.columns(motion, arm, fit.theta) @ fit.amplitudes)
    gravity = np.asarray(gravity_columns(stretch.q, stretch.revolute) @ np.array(arm.gravity))
    return friction, gravity, np.asarray(arm.inertia * ddq)

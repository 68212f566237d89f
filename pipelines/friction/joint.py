"""Fit everything that friction logs of one joint show: its law, what judges it, what is not seen.

    smoothed motion → refined about a flexible law → ladder → refined about the chosen law → fit

Rows in which the joint rests are left out, of all but laws that know these: torque at rest is an
inequality (Karnopp 1985). So are other rows in which it does not slide (sliding.py), where the
flexible law does not follow them as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Array, Motion
from pipelines.effects import find_effect
from pipelines.errors import InputRejected
from pipelines.estimation.motion import Reconstructed, encoder_resolution
from pipelines.estimation.varpro import with_block_covariance
from pipelines.friction.breakaway import Event, break_away, held_at_least
from pipelines.friction.config import JointConfig, SlidingConfig
from pipelines.friction.ekf import filtered
from pipelines.friction.fit import LawEquations, LawFit, fit_law, same_posture
from pipelines.friction.laws import LADDER, Law, OneJoint, gravity_columns
from pipelines.friction.model_selection import Ladder, Missing, climb, no_worse
from pipelines.friction.refine import refined
from pipelines.friction.simulation import Simulated, simulate_joint
from pipelines.friction.sliding import (
    Sliding,
    drift_of,
    left_out,
    sliding_rows,
)
from pipelines.friction.speed_map import Coverage, coverage, speed_map, unseen
from pipelines.friction.weak_form import (
    Course,
    Mask,
    Stretch,
    blocks_of_time,
    stretches_of,
    swaying,
)
from pipelines.io.log import ExperimentLog
from pipelines.io.robot import RobotDescription

__all__ = ["METHODS", "JointFit", "JointLogs", "Seen", "by_method", "fit_joint", "fractions",
           "friction_of"]

METHODS = ("varpro", "ekf")
# follows any curve: no law of the ladder is favoured
_FLEXIBLE = Law("flexible", ("three_sigmoid", "asymmetric_friction"))

Seen = tuple[ExperimentLog, Reconstructed]
Stretches = tuple[Stretch, ...]


_CONFIG, _SLIDING = JointConfig(), SlidingConfig()


@dataclass(frozen=True, eq=False)
class JointLogs:
    """The logs of one joint, counted from 1."""

    joint: int
    identify: tuple[Seen, ...]
    validate: tuple[Seen, ...] = ()
    hold: tuple[Seen, ...] = ()

    @property
    def resolution(self) -> float:
        """Return the largest step of its encoder [rad]."""
        return max(float(encoder_resolution(motion.good)[self.joint - 1])
                   for _, motion in self.identify)

    def stretches(self, logs: Sequence[Seen], window: float) -> Stretches:
        """Return the stretches of some of the logs in windows of `window` [s]."""
        sways = sorted({k for _, motion in self.identify for k in swaying(motion, self.joint)})
        return tuple(stretch for log, motion in logs
                     for stretch in stretches_of(log, self.joint, motion, window, sways))


@dataclass(frozen=True, eq=False)
class Driven:
    """The judged stretch and its simulation."""

    stretch: Stretch
    judging: bool  # of a validate log
    with_friction: Simulated
    without: Simulated

    def error(self, simulated: Simulated) -> float:
        """Return the rms error of the simulated speed [rad/s]; infinite where it ran away."""
        error = float(np.sqrt(np.mean(np.square(simulated.dq - self.stretch.dq))))
        return error if np.isfinite(error) else float("inf")


def _simulated(stretch: Stretch, judging: bool, fit: LawFit) -> Driven:
    return Driven(stretch, judging, simulate_joint(stretch, fit),
                  simulate_joint(stretch, fit, friction=False))


@dataclass(frozen=True, eq=False)
class JointFit:
    """The fit of one joint."""

    logs: JointLogs
    fit: LawFit
    ladder: Ladder
    stretches: Stretches
    driven: Driven
    covered: Coverage
    unseen: tuple[Missing, ...]
    map: Array  # (4, points) of `speed_map`
    break_away: tuple[Event, ...]
    held: tuple[float, float] | None  # [N m] friction carried at rest, back and forth
    window: float  # [s]
    sliding: Sliding
    course: Course | None  # of friction that changes in time


def fit_joint(logs: JointLogs, window: float, law: Law | None = None) -> JointFit:
    """Fit `law`, or choose one.

    Args:
        window: of the equations [s], the shortest: a coarse encoder needs longer ones.

    Raises:
        InputRejected: T08, too few windows.
    """
    arm = OneJoint.of(logs.identify[0][0].robot, logs.joint)
    usable, fitted, window, sliding = _usable_rows(logs, window, arm)
    slide = bool(sliding.slides[:sum(stretch.rows for stretch in usable[:fitted])].any())
    moves = np.ones_like(sliding.resting)
    if slide and (law is None or law.pointwise):
        moves = ~sliding.resting
    stretches, fit = _refined(left_out(usable, moves), fitted, arm, logs.resolution)
    if slide and not _followed(stretches, fit, sliding.slides[moves]):
        stretches = left_out(usable, sliding.slides)
    shown = drift_of(left_out(stretches, sliding.slides)[:fitted], arm) if slide else None
    course = shown if shown is not None and shown.named else None
    choice = _choice(stretches, fitted, course, fit, arm, law)
    if shown is not course:  # neither shown nor excluded: it takes part where the law is better
        other = _choice(stretches, fitted, shown, fit, arm, choice.ladder.chosen.law)
        if not no_worse(choice.ladder.chosen.residual, other.ladder.chosen.residual):
            choice = _choice(stretches, fitted, shown, fit, arm, law)
    both, course, chosen = choice.stretches, choice.course, choice.ladder.chosen.fit
    sticks = any(stretch.sticks is not None for stretch in both[:fitted])
    if not sticks:  # reversals are kinks of the speed, and where it sticks they are left out
        both = tuple(refined(stretch, chosen, logs.resolution) for stretch in both)
    for _ in range(_CONFIG.courses if course is not None else 1):
        both = _along(both, course, chosen)  # the same columns in both
        final = fit_law(LawEquations.of(both[:fitted], arm), chosen.law, [chosen.theta])
        course, chosen = _next(course, final), final
    identify, validate = both[:fitted], both[fitted:]
    if sticks:
        final = _with_dependent_errors(final, identify, sliding.attenuation)
    covered = coverage(identify)
    judging = max(validate or identify, key=lambda stretch: len(stretch.t))
    at_rest = [stretch for stretch in logs.stretches(logs.hold, window)
               if any(same_posture(stretch.posture, posture) for posture in final.postures)]
    return JointFit(
        logs, final, choice.ladder, identify, _simulated(judging, bool(validate), final), covered,
        unseen(covered, choice.ladder), speed_map(identify, final),
        break_away((*identify, *at_rest), final), held_at_least(at_rest, final), window, sliding,
        course)


def _usable_rows(logs: JointLogs, window: float,
                 arm: OneJoint) -> tuple[Stretches, int, float, Sliding]:
    """Return stretches, the fitted first, how many these are, their window [s], and what slides.

    Windows are the shortest over which the encoder shows the acceleration; longer ones may all hold
    a reversal.
    """
    best: tuple[Stretches, int, float, Sliding] | None = None
    for size in (factor * window for factor in _SLIDING.windows):
        identify, validate = (logs.stretches(part, size) for part in (logs.identify, logs.validate))
        if not identify:
            break
        both = tuple(replace(stretch, part=k) for k, stretch in enumerate((*identify, *validate)))
        sliding = sliding_rows(both, arm)
        if best is None or sliding.attenuation < best[-1].attenuation:
            best = both, len(identify), size, sliding
        if best[-1].attenuation <= _SLIDING.attenuation:
            break
    if best is None:
        raise InputRejected("T08", f"joint {logs.joint}: no log has enough windows of {window:g} s "
                            "to fit a law to", remedy="record a few seconds at least")
    return best


def _refined(stretches: Stretches, fitted: int, arm: OneJoint,
             resolution: float) -> tuple[Stretches, LawFit]:
    """Return the motion refined about a law that follows any curve, and that law."""
    fit = fit_law(LawEquations.of(stretches[:fitted], arm), _FLEXIBLE)
    for _ in range(_CONFIG.rounds):
        stretches = tuple(refined(stretch, fit, resolution) for stretch in stretches)
        fit = fit_law(LawEquations.of(stretches[:fitted], arm), _FLEXIBLE, [fit.theta])
    return stretches, fit


def _followed(stretches: Stretches, fit: LawFit, slides: Mask) -> bool:
    """Return whether one curve fits the other rows as well as those that slide.

    True also where those that slide make most of its residual.
    """
    square = np.square(LawEquations.of(stretches, fit.joint).residual(fit))
    doubt, sure = square[~slides], square[slides]
    return (not doubt.size or doubt.mean() <= _SLIDING.worse * sure.mean()
            or doubt.sum() <= sure.sum())


@dataclass(frozen=True, eq=False)
class _Choice:
    """A law chosen with a course of friction in time, or without."""

    stretches: Stretches  # the fitted ones first; of the others those with rows
    ladder: Ladder
    course: Course | None


def _choice(stretches: Stretches, fitted: int, course: Course | None, fit: LawFit, arm: OneJoint,
            law: Law | None) -> _Choice:
    """Choose among laws, or fit `law`, while friction changes along `course`.

    The time constant is fitted first, with the flexible law `fit`.
    """
    stretches = _along(stretches, course, fit)
    for k in range(_CONFIG.courses if course is not None else 0):
        fit = fit_law(LawEquations.of(stretches[:fitted], arm), fit.law, [fit.theta])
        if k + 1 < _CONFIG.courses:
            course = _next(course, fit)
            stretches = _along(stretches, course, fit)
    identify = stretches[:fitted]
    validate = tuple(stretch for stretch in stretches[fitted:] if stretch.rows)
    sticks = any(stretch.sticks is not None for stretch in identify)
    laws = tuple(one for one in LADDER if one.pointwise or not sticks) if law is None else (law,)
    ladder = climb(LawEquations.of(identify, arm),
                   LawEquations.of(validate, arm) if validate else None, laws)
    return _Choice((*identify, *validate), ladder, course)


def _along(stretches: Stretches, course: Course | None, fit: LawFit) -> Stretches:
    """Return the stretches with columns of `course`, and of friction that lags behind its speed.

    f(v(t - T)) = f - T df/dt to first order (Armstrong-Hélouvry et al. 1994, Section 2.1). Of f,
    the curve of `fit`, counts what departs from the slope at the highest speeds: viscous friction
    does not lag, and its lag would be inertia. T < 0 where bristles straighten.
    """
    rows = np.abs(np.concatenate([stretch.middle[1] for stretch in stretches]))
    fastest = float(max(np.abs(stretch.dq).max() for stretch in stretches))
    side = np.geomspace(max(float(rows.min()), 1e-3 * float(rows.max())), fastest, _CONFIG.curve)
    speed = np.concatenate([-side[::-1], side])
    curve, k = fit.curve(speed), _CONFIG.fastest
    ends = (curve[k] - curve[0], curve[-1] - curve[-1 - k])
    bent = curve - np.where(speed < 0.0, *ends) / (side[-1] - side[-1 - k]) * speed
    reach = max(np.ptp(part) for part in np.split(bent, 2))
    lags = (reach > _CONFIG.bent * float(np.abs(curve).max())
            and any(stretch.sticks is not None for stretch in stretches))
    own = None if course is None else replace(course, curve=(speed, curve))
    lag = (speed, bent) if lags else None
    return tuple(replace(stretch, course=own, lag=lag) for stretch in stretches)


def _next(course: Course | None, fit: LawFit) -> Course | None:
    """Return the course with the time constant of a fit, one step of Gauss and Newton on."""
    if course is None or course.kind == "step":
        return course
    if course.change == 0.0:
        return replace(course, change=float(fit.rigid[0, -1]))
    change, step = fit.rigid[0, -2:]
    time = float(np.clip(course.time * np.exp(np.clip(step, -0.5, 0.5)), 0.05 * course.until,
                         10.0 * course.until))
    return replace(course, change=float(change), time=time)


def _with_dependent_errors(fit: LawFit, stretches: Stretches, attenuation: float) -> LawFit:
    """Return `fit` with a covariance for errors that depend on one another within a block of time.

    Every inertia is as uncertain as noise of the acceleration may have made it too small: J times
    `attenuation` (errors in variables).
    """
    found = with_block_covariance(fit.found, blocks_of_time(stretches, _CONFIG.memory))
    covariance = found.covariance.copy()
    places = fit.rigid_size * np.arange(len(fit.postures))
    covariance[places, places] += np.square(min(attenuation, 1.0) * found.beta[places])
    return replace(fit, found=replace(found, covariance=covariance))


def by_method(joint: JointFit, method: str) -> JointFit:
    """Return `joint`, which was fitted by variable projection, with the numbers of `method`.

    Raises:
        UsageError: C02, a prismatic joint for the filter.
    """
    if method == "varpro":
        return joint
    fit = filtered(joint.stretches, joint.fit.joint, joint.logs.resolution)
    driven = _simulated(joint.driven.stretch, joint.driven.judging, fit)
    return replace(joint, fit=fit, driven=driven, map=speed_map(joint.stretches, fit))


def fractions(joint: JointFit) -> tuple[Array, Array, Array]:
    """Return friction, gravity and inertial torque along the simulated motion (samples,) [N m].

    Kostić et al. 2004, Fig. 5. Gravity is that of the measured position, as in the simulation.
    """
    stretch, simulated, fit = joint.driven.stretch, joint.driven.with_friction, joint.fit
    arm, _ = fit.at(stretch)
    ddq = np.gradient(simulated.dq, stretch.t)
    motion = Motion(stretch.t, simulated.q[:, None], simulated.dq[:, None], ddq[:, None])
    friction = np.asarray(fit.law.columns(motion, arm, fit.theta) @ fit.amplitudes)
    gravity = np.asarray(gravity_columns(stretch.q, stretch.revolute) @ np.array(arm.gravity))
    return friction, gravity, np.asarray(arm.inertia * ddq)


def friction_of(joints: Sequence[JointFit],
                robot: RobotDescription) -> tuple[tuple[Acting, ...], tuple[Acting, ...]]:
    """Return the friction laws of an arm's joints, and what acts at rest as well: offsets."""
    laws: list[Acting] = []
    at_rest: list[Acting] = []
    still = Motion(np.arange(2.0), *np.zeros((3, 2, 1)))
    for joint in joints:
        fit = joint.fit
        std = {number.name: number.std for number in fit.numbers}
        shared = {name.partition(".")[2]: value for name, value in std.items()
                  if name.endswith(".sharpness")}
        values = fit.law.values(fit.theta, fit.amplitudes)
        for effect, numbers in zip(fit.law.shaped(fit.theta), values, strict=True):
            known = {name: std.get(f"{effect.name}.{name}", shared.get(name)) for name in numbers}
            acting = Acting.of(find_effect(effect.name)(joint=joint.logs.joint), numbers,
                               {name: one for name, one in known.items() if one is not None},
                               revolute=fit.joint.revolute)
            acts = effect.columns(still, OneJoint.of(robot, 1, 1.0)).any()
            (at_rest if acts else laws).append(acting)
    return tuple(laws), tuple(at_rest)

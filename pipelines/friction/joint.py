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
from pipelines.friction.config import JointConfig, SlidingConfig
from pipelines.friction.coverage import Coverage, coverage, unseen
from pipelines.friction.fit import LawEquations, LawFit, fit_law
from pipelines.friction.laws import LADDER, Law, OneJoint, gravity_columns
from pipelines.friction.model_selection import Ladder, Missing, climb
from pipelines.friction.refine import refined
from pipelines.friction.simulation import Simulated, simulate_joint
from pipelines.friction.sliding import (
    Sliding,
    drift_of,
    left_out,
    sliding_rows,
)
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

__all__ = ["JointFit", "JointLogs", "Seen", "fit_joint", "fractions", "friction_of"]

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
    course = drift_of(left_out(stretches, sliding.slides)[:fitted], arm) if slide else None
    stretches, _ = _with_course(stretches, fitted, course, fit, arm)
    identify = stretches[:fitted]
    validate = tuple(stretch for stretch in stretches[fitted:] if stretch.rows)
    sticks = any(stretch.sticks is not None for stretch in identify)
    laws = tuple(one for one in LADDER if one.pointwise or not sticks) if law is None else (law,)
    judging = LawEquations.of(validate, arm) if validate else None
    ladder = climb(LawEquations.of(identify, arm), judging, laws)
    both, chosen = (*identify, *validate), ladder.chosen.fit
    if not sticks:  # reversals are kinks of the speed, and where it sticks they are left out
        both = tuple(refined(stretch, chosen, logs.resolution) for stretch in both)
    both, final = _with_course(both, fitted, course, chosen, arm)
    identify, validate = both[:fitted], both[fitted:]
    if sticks:
        final = _with_dependent_errors(final, identify, sliding.attenuation)
    covered = coverage(identify)
    longest = max(validate or identify, key=lambda stretch: len(stretch.t))
    driven = _simulated(longest, bool(validate), final)
    gaps = unseen(covered, ladder)
    return JointFit(logs, final, ladder, identify, driven, covered, gaps, window, sliding, course)


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
    stretches = tuple(refined(stretch, fit, resolution) for stretch in stretches)
    return stretches, fit_law(LawEquations.of(stretches[:fitted], arm), _FLEXIBLE, [fit.theta])


def _followed(stretches: Stretches, fit: LawFit, slides: Mask) -> bool:
    """Return whether one curve fits the other rows as well as those that slide.

    True also where those that slide make most of its residual.
    """
    square = np.square(LawEquations.of(stretches, fit.joint).residual(fit))
    doubt, sure = square[~slides], square[slides]
    return (not doubt.size or doubt.mean() <= _SLIDING.worse * sure.mean()
            or doubt.sum() <= sure.sum())


def _with_course(stretches: Stretches, fitted: int, course: Course | None, fit: LawFit,
                 arm: OneJoint) -> tuple[Stretches, LawFit]:
    """Return the stretches with the column of `course`, and the law of `fit` fitted to them.

    What changes as a whole is the curve of the law itself, so that it is fitted in rounds.
    """
    fastest = float(max(np.abs(stretch.dq).max() for stretch in stretches))
    side = np.geomspace(1e-3 * fastest, fastest, _CONFIG.curve)
    speed = np.concatenate([-side[::-1], side])
    for _ in range(_CONFIG.courses if course is not None else 1):
        own = None if course is None else replace(course, curve=(speed, fit.curve(speed)))
        stretches = tuple(replace(stretch, course=own) for stretch in stretches)
        fit = fit_law(LawEquations.of(stretches[:fitted], arm), fit.law, [fit.theta])
    return stretches, fit


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

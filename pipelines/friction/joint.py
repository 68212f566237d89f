"""Fit everything that friction logs of one joint show: its law, what judges it, what is not seen.

    smoothed motion → refined about a flexible law → ladder → refined about the chosen law → fit

Rows in which the joint rests are left out, of all but laws that know these: torque at rest is an
inequality (Karnopp 1985). So are other rows in which it does not slide (sliding.py), where the
flexible law does not follow them as well.

A reversal of friction is a kink of the speed. A smoother that knows nothing of it rounds it off,
and an inertia fitted to a rounded motion comes out too large. So the observer of Kostić et al.
2004, eq. (16)-(17), is given the reference it was made for: the motion that torque and fitted law
imply,

    ddq_r = (τ - c sin q - c' cos q - τ_f)/J,     e = q - q_r,     ë = white torque noise / J

and only the deviation e is smoothed, of order 2, for its acceleration is noise of the torque, held
over a sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Array, Motion
from pipelines.effects import find_effect
from pipelines.errors import Check, InputRejected
from pipelines.estimation.motion import Reconstructed, encoder_resolution
from pipelines.estimation.state_estimation import design, smooth
from pipelines.estimation.varpro import with_block_covariance
from pipelines.friction.config import FRICTION
from pipelines.friction.fit import Equations, LawFit, fit_law
from pipelines.friction.laws import LADDER, Law, OneJoint, gravity_columns
from pipelines.friction.model_selection import Coverage, Ladder, Missing, climb, coverage, unseen
from pipelines.friction.simulation import Simulated, simulate_joint
from pipelines.friction.sliding import Sliding, drift_of, left_out, sliding_rows
from pipelines.friction.weak_form import Course, Stretch, blocks_of_time, stretches_of, swaying
from pipelines.io.log import ExperimentLog
from pipelines.io.robot import RobotDescription

__all__ = ["JointFit", "JointLogs", "Seen", "fit_joint", "friction_of", "logs_by_joint", "refined"]

ORDER = 2  # numerics: of the smoother of the deviation

Seen = tuple[ExperimentLog, Reconstructed]
Stretches = tuple[Stretch, ...]


@dataclass(frozen=True, eq=False)
class JointLogs:
    """The logs of one joint, counted from 1."""

    joint: int
    identify: tuple[Seen, ...]
    validate: tuple[Seen, ...] = ()

    @property
    def resolution(self) -> float:
        """Return the largest step of its encoder [rad]."""
        steps = [encoder_resolution(motion.good)[self.joint - 1] for _, motion in self.identify]
        return float(max(steps))

    def stretches(self, logs: Sequence[Seen], window: float) -> Stretches:
        """Return the stretches of some of the logs in windows of `window` [s]."""
        sways = sorted({k for _, motion in self.identify for k in swaying(motion, self.joint)})
        return tuple(
            stretch
            for log, motion in logs
            for stretch in stretches_of(log, self.joint, motion, window, sways)
        )


def logs_by_joint(seen: Sequence[Seen]) -> tuple[list[JointLogs], list[Check]]:
    """Sort logs by the joint that moves; with a warning for each that is left out.

    Inertia and gravity depend on where the other joints are held: logs of another posture than the
    first one's are left out.
    """
    parts: dict[int, dict[str, list[Seen]]] = {}
    checks = []
    for log, motion in sorted(seen, key=lambda pair: pair[0].role != "identify"):
        joint, role = log.joint, log.role
        if joint is None or (role != "identify" and joint not in parts):
            continue
        own = parts.setdefault(joint, {"identify": [], "validate": []})
        apart = 0.0
        if own["identify"]:
            first = own["identify"][0][0]
            postures = np.nanmedian(log.q, axis=0) - np.nanmedian(first.q, axis=0)
            apart = float(np.abs(np.delete(postures, joint - 1)).max(initial=0.0))
        if apart < FRICTION.alike:
            own[role].append((log, motion))
            continue
        words = f"left out: its other joints are held {apart:.2g} rad from those of {first.name}"
        remedy = "fit logs of one posture at a time"
        where = log.source or log.name
        checks.append(Check.of("D16", "warn", words, where=where, remedy=remedy))
    logs = [
        JointLogs(joint, tuple(own["identify"]), tuple(own["validate"]))
        for joint, own in sorted(parts.items())
    ]
    return logs, checks


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
    joint, resolution = OneJoint.of(logs.identify[0][0].robot, logs.joint), logs.resolution
    usable, fitted, window, sliding = _usable_rows(logs, window, joint)
    slide = bool(sliding.slides[: sum(one.rows for one in usable[:fitted])].any())
    moves = np.ones_like(sliding.resting)
    if slide and (law is None or law.pointwise):
        moves = ~sliding.resting
    stretches = left_out(usable, moves)
    flexible = LADDER[-1]
    fit = fit_law(Equations(stretches[:fitted], joint), flexible)
    stretches = tuple(refined(stretch, fit, resolution) for stretch in stretches)
    fit = fit_law(Equations(stretches[:fitted], joint), flexible, [fit.theta])
    if slide:
        square = np.square(Equations(stretches, joint).residual(fit))
        doubt, sure = square[~sliding.slides[moves]], square[sliding.slides[moves]]
        follow = doubt.sum() <= sure.sum() or doubt.mean() <= FRICTION.worse * sure.mean()
        if not follow:  # one curve does not fit the other rows as well as those that slide
            stretches = left_out(usable, sliding.slides)
    course = None
    if slide:
        course = drift_of(left_out(stretches, sliding.slides)[:fitted], joint)
        if course is not None:
            stretches, _ = _with_course(stretches, fitted, course, fit)
    identify = stretches[:fitted]
    validate = tuple(stretch for stretch in stretches[fitted:] if stretch.rows)
    sticks = any(stretch.sticks is not None for stretch in identify)
    laws = (
        (law,) if law is not None else tuple(one for one in LADDER if one.pointwise or not sticks)
    )
    judging = Equations(validate, joint) if validate else None
    ladder = climb(Equations(identify, joint), judging, laws, fit.theta)
    both, chosen = (*identify, *validate), ladder.chosen.fit
    if not sticks:  # reversals are kinks of the speed, and where it sticks they are left out
        both = tuple(refined(stretch, chosen, resolution) for stretch in both)
    both, final = _with_course(both, fitted, course, chosen)
    identify, validate = both[:fitted], both[fitted:]
    if sticks:
        final = _with_dependent_errors(final, identify, sliding.attenuation)
    covered = coverage(identify)
    longest = max(validate or identify, key=lambda stretch: len(stretch.t))
    driven = Driven(
        longest,
        bool(validate),
        simulate_joint(longest, final),
        simulate_joint(longest, final, friction=False),
    )
    gaps = unseen(covered, ladder)
    return JointFit(logs, final, ladder, identify, driven, covered, gaps, window, sliding, course)


def _usable_rows(
    logs: JointLogs, window: float, joint: OneJoint
) -> tuple[Stretches, int, float, Sliding]:
    """Return stretches, the fitted first, how many these are, their window [s], and what slides.

    Windows are the shortest over which the encoder shows the acceleration; longer ones may all hold
    a reversal.
    """
    best: tuple[Stretches, int, float, Sliding] | None = None
    for size in (factor * window for factor in FRICTION.windows):
        identify = logs.stretches(logs.identify, size)
        if not identify:
            break
        both = (*identify, *logs.stretches(logs.validate, size))
        sliding = sliding_rows(both, joint)
        if best is None or sliding.attenuation < best[-1].attenuation:
            best = both, len(identify), size, sliding
        if best[-1].attenuation <= FRICTION.attenuation:
            break
    if best is None:
        words = f"joint {logs.joint}: no log has enough windows of {window:g} s to fit a law to"
        raise InputRejected("T08", words, remedy="record a few seconds at least")
    return best


def refined(stretch: Stretch, fit: LawFit, resolution: float) -> Stretch:
    """Smooth the motion of `stretch` about that which `fit` implies, where that is possible.

    Args:
        resolution: step of the encoder [rad].
    """
    if fit.inertia <= 0.0 or not stretch.rows:
        return stretch
    q, dq = _implied_motion(stretch, fit)
    deviation = stretch.measured - q
    if not np.isfinite(deviation[~stretch.spoilt]).all():
        return stretch
    step = float(stretch.t[-1] - stretch.t[0]) / (len(stretch.t) - 1)
    # Were it white by samples: what the law misses makes it look larger and is let through
    noise = max(fit.found.rms, FRICTION.noise * float(np.abs(stretch.torque).max()))
    jerk = np.array([noise * np.sqrt(stretch.window) / fit.inertia])
    # Δθ²/12, or more where second differences show it; they are 6 R + σ² T⁴/2
    second = np.diff(deviation, n=2)
    shown = (np.mean(np.square(second[np.isfinite(second)])) - 0.5 * jerk**2 * step**4) / 6.0
    observer = design(step, jerk, np.maximum(shown, resolution**2 / 12.0), ORDER)
    states = smooth(deviation[:, None], observer).states[:, :, 0]
    return replace(stretch, q=q + states[0], dq=dq + states[1])


def _implied_motion(stretch: Stretch, fit: LawFit) -> tuple[Array, Array]:
    """Return q_r and dq_r (samples,): what the fitted joint does under the measured torque.

    Friction is that along the motion so far.
    """
    nodes = stretch.nodes
    load = gravity_columns(nodes.q[:, 0], stretch.revolute) @ np.array(fit.gravity)
    load = load + fit.law.columns(nodes, fit.joint, fit.theta) @ fit.amplitudes
    momentum = stretch.impulse - stretch.accumulated(load) - stretch.pushed @ fit.more
    dq = momentum / fit.inertia
    if stretch.sticks is not None:  # no law holds there: the motion is as it was seen
        change = np.diff(dq)
        rests = np.repeat(stretch.sticks, stretch.window)[: len(change)]
        change[: len(rests)][rests] = np.diff(stretch.dq)[: len(rests)][rests]
        dq = dq[0] + np.concatenate([[0.0], np.cumsum(change)])
    path = np.cumsum(0.5 * np.diff(stretch.t) * (dq[1:] + dq[:-1]))
    q = np.concatenate([[0.0], path])
    early = stretch.measured[:50] - q[:50]
    return q + (np.nanmedian(early) if np.isfinite(early).any() else 0.0), dq


def _with_course(
    stretches: Stretches, fitted: int, course: Course | None, fit: LawFit
) -> tuple[Stretches, LawFit]:
    """Return the stretches with the column of `course`, and the law of `fit` fitted to them.

    What changes as a whole is the curve of the law itself, so that it is fitted in rounds.
    """
    fastest = float(max(np.abs(stretch.dq).max() for stretch in stretches))
    side = np.geomspace(1e-3 * fastest, fastest, FRICTION.curve)
    speed = np.concatenate([-side[::-1], side])
    for _ in range(1 if course is None else FRICTION.rounds):
        own = None if course is None else replace(course, curve=(speed, fit.curve(speed)))
        stretches = tuple(replace(stretch, course=own) for stretch in stretches)
        joint = fit.joint.carrying(0.0 * fit.found.beta)
        fit = fit_law(Equations(stretches[:fitted], joint), fit.law, [fit.theta])
    return stretches, fit


def _with_dependent_errors(fit: LawFit, stretches: Sequence[Stretch], attenuation: float) -> LawFit:
    """Return `fit` with a covariance for errors that depend on one another within a block of time.

    The inertia is as uncertain as noise of the acceleration may have made it too small: J times
    `attenuation` (errors in variables).
    """
    found = with_block_covariance(fit.found, blocks_of_time(stretches, FRICTION.memory))
    covariance = found.covariance.copy()
    covariance[0, 0] += (min(attenuation, 1.0) * fit.inertia) ** 2
    return replace(fit, found=replace(found, covariance=covariance))


def friction_of(
    joints: Sequence[JointFit], robot: RobotDescription
) -> tuple[tuple[Acting, ...], tuple[Acting, ...]]:
    """Return the friction laws of an arm's joints, and what acts at rest as well: offsets."""
    laws: list[Acting] = []
    at_rest: list[Acting] = []
    still = Motion(np.arange(2.0), *np.zeros((3, 2, 1)))
    for joint in joints:
        fit = joint.fit
        std = {number.name: number.std for number in fit.numbers}
        shared = {
            name.partition(".")[2]: value
            for name, value in std.items()
            if name.endswith(".sharpness")
        }
        values = fit.law.values(fit.theta, fit.amplitudes)
        for effect, numbers in zip(fit.law.shaped(fit.theta), values, strict=True):
            known = {name: std.get(f"{effect.name}.{name}", shared.get(name)) for name in numbers}
            acting = Acting.of(
                find_effect(effect.name)(joint=joint.logs.joint),
                numbers,
                {name: one for name, one in known.items() if one is not None},
                revolute=fit.joint.revolute,
            )
            acts = effect.columns(still, OneJoint.of(robot, 1, 1.0)).any()
            (at_rest if acts else laws).append(acting)
    return tuple(laws), tuple(at_rest)

"""Everything that friction logs of one joint show: its law and how it was chosen, what judges it, what is not seen.

    motion by the smoother → refined about a flexible law → ladder → refined about the chosen law → the fit
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.fit.varpro import SeparableFit
from pipelines.log.experiment import ExperimentLog
from pipelines.model.friction.break_away import BreakAway, break_away, held_at_least
from pipelines.model.friction.coverage import Coverage, Unseen, coverage, unseen
from pipelines.model.friction.equations import LawEquations
from pipelines.model.friction.fit_law import fit_law
from pipelines.model.friction.ladder import Judge, Ladder, climb
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import LADDER, Law, law_named
from pipelines.model.friction.one_joint import OneJoint, gravity_columns
from pipelines.model.friction.postures import alike
from pipelines.model.friction.refine import refined
from pipelines.model.friction.ripple import Ripple, refitted, ripple_of
from pipelines.model.friction.simulate import Simulated, simulate_joint
from pipelines.model.friction.speed_map import SpeedMap, speed_map
from pipelines.model.friction.weak_form import Stretch, stretches_of, swaying
from pipelines.model.motion import Reconstructed, encoder_resolution
from pipelines.model.rigid.body import Array, Motion

__all__ = ["JointFit", "JointLogs", "Seen", "fit_joint", "fractions", "with_fit"]

_ROUNDS = 2  # of refining before laws are compared
_FLEXIBLE = "three_sigmoid"  # follows any curve that a healthy joint has: no law of the ladder is favoured

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
    beside_ripple: SeparableFit | None  # the law and the rigid numbers, the rigid ones first, with the ripple known


def fit_joint(logs: JointLogs, window: float, law: Law | None = None) -> JointFit:
    """Fit `law`, or choose one.

    Args:
        window: of the equations [s].
    """
    robot = logs.identify[0][0].robot
    arm = OneJoint.of(robot, logs.joint)
    resolution = max(float(encoder_resolution(found.good)[logs.joint - 1]) for _, found in logs.identify)
    beside = _swaying(logs)
    identify, validate = (_stretches(part, logs.joint, window, beside) for part in (logs.identify, logs.validate))
    flexible = law_named(_FLEXIBLE) or LADDER[-1]
    fit = fit_law(LawEquations.of(identify, arm), flexible)
    for _ in range(_ROUNDS):
        identify = tuple(refined(stretch, fit, resolution) for stretch in identify)
        fit = fit_law(LawEquations.of(identify, arm), flexible, [fit.theta])
    validate = tuple(refined(stretch, fit, resolution) for stretch in validate)
    judge = Judge(LawEquations.of(identify, arm), LawEquations.of(validate, arm) if validate else None)
    ladder = climb(judge, (law,) if law is not None else LADDER)
    chosen = ladder.chosen.fit
    identify, validate = (tuple(refined(stretch, chosen, resolution) for stretch in part) for part in (identify, validate))
    final = fit_law(LawEquations.of(identify, arm), chosen.law, [chosen.theta])
    ripple = ripple_of(LawEquations.of(identify, arm), final)
    judging = max(validate or identify, key=lambda stretch: len(stretch.t))
    driven = Driven(judging, bool(validate), simulate_joint(judging, final), simulate_joint(judging, final, friction=False))
    covered = coverage(identify)
    at_rest = [stretch for stretch in _stretches(logs.hold, logs.joint, window, beside)
               if any(alike(stretch.posture, posture) for posture in final.postures)]
    return JointFit(logs, final, ladder, identify, driven, covered, unseen(covered, ladder), speed_map(identify, final),
                    break_away((*identify, *at_rest), final), held_at_least(at_rest, final), window, ripple,
                    None if ripple is None else refitted(LawEquations.of(identify, arm), final, ripple))


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

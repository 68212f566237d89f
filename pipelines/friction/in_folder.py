"""Fit the model that the logs of a folder give, where a stage needs one: friction, base parameters.

    arm = fitted_in_folder(logs)            None where no log can be fitted

Where every joint was driven alone, friction is what fit-friction finds. Where none was, it is
fitted along: Coulomb and viscous as estimate-bps does, or three sigmoids, Kostić et al. 2004, eq.
(10), where these explain the same logs better: on a writing task the arm reverses often and goes
slowly in places, and there a Stribeck curve counts.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.parameter import Parameter
from pipelines.estimation.estimate import Fitted, Recipe, fit_logs, motions_of, with_cutoff
from pipelines.estimation.motion import Motions, Reconstruction, reconstruct
from pipelines.estimation.nominal import fitted_arm, nominal_columns
from pipelines.estimation.periods import averaged
from pipelines.friction.config import FolderConfig
from pipelines.friction.joint import JointLogs, fit_joint, friction_of
from pipelines.friction.laws import law_named
from pipelines.friction.several import fit_several
from pipelines.io.log import ExperimentLog

__all__ = ["fitted_in_folder"]

_CONFIG = FolderConfig()


def fitted_in_folder(logs: Iterable[ExperimentLog]) -> Arm | None:
    """Return the arm with the covariance of its numbers; None without a log that moves all joints.

    Raises:
        RrridError: the stages' reasons why these logs cannot be fitted.
    """
    known = [log for log in logs if log.origin != "planned" and log.role == "identify"]
    identify = [log for log in known if log.experiment in ("excitation", "free")]
    if not identify:
        return None
    how = Reconstruction()
    motions, friction = motions_of(identify, how), _driven_alone(known, how)
    fitted = _fit(motions, how, friction)
    if not friction:
        flexible = fit_several(motions, (), Recipe(how), law_named("three_sigmoid"))
        fitted = min(fitted, flexible.fitted, key=_error)
    return fitted_arm(fitted.estimate, identify[0].robot_name, friction)


def _fit(motions: Motions, how: Reconstruction, friction: tuple[Acting, ...]) -> Fitted:
    """Fit as estimate-bps does, with known friction, or Coulomb and viscous friction along."""
    robot = motions[0][0].robot
    columns = nominal_columns(robot, friction=not friction)
    recipe = Recipe(how)
    if friction:
        unknown = tuple(Parameter(p.name, 0.0, None, p.unit, origin="assumed")
                        for p in columns.body.parameters)
        recipe = Recipe(how, known=Arm(robot.name, columns.body, unknown, friction).friction_torque)
    recipe = with_cutoff(recipe, motions)
    means, _ = averaged(motions, recipe.cutoff_hz)
    return fit_logs(means, columns, recipe)


def _error(fitted: Fitted) -> float:
    """Return the relative torque error; a more flexible law must be worth its numbers."""
    numbers = len(fitted.estimate.columns.names)
    return fitted.errors.relative_error * (1.0 + _CONFIG.dear * numbers)


def _driven_alone(logs: Sequence[ExperimentLog], how: Reconstruction) -> tuple[Acting, ...]:
    """Return the laws of all joints, where every one was driven alone; none otherwise."""
    alone = [log for log in logs if log.experiment == "friction" and log.joint is not None]
    joints = range(1, logs[0].n_joints + 1)
    if {log.joint for log in alone} != set(joints):
        return ()
    moved = [(log, reconstruct(log, how)) for log in alone]
    fits = []
    for j in joints:
        own = tuple(pair for pair in moved if pair[0].joint == j)
        fits.append(fit_joint(JointLogs(j, own), _CONFIG.window))
    return friction_of(fits, logs[0].robot)[0]

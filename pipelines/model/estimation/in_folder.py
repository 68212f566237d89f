"""The model that the logs of a folder give, where a stage needs one and nobody has fitted it: friction, then base parameters.

    arm = fitted_in_folder(logs)            None where no log can be fitted

Where every joint was driven alone, friction is what fit-friction finds. Where none was, it is fitted along: Coulomb and viscous as
estimate-bps does, or three sigmoids, eq. (10) of Kostić et al. 2004, where these explain the same logs better: on a writing task
the arm reverses often and goes slowly in places, and there a Stribeck curve counts.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.parameter import Parameter
from pipelines.io.log import ExperimentLog
from pipelines.model.estimation.floor import averaged
from pipelines.model.estimation.logs import (
    Fitted,
    Motions,
    Recipe,
    fit_logs,
    motions_of,
    with_cutoff,
)
from pipelines.model.estimation.nominal import fitted_arm, nominal_columns
from pipelines.model.friction.joint import JointLogs, fit_joint, friction_of
from pipelines.model.friction.laws import law_named
from pipelines.model.friction.several import fit_several
from pipelines.model.motion import Reconstruction, reconstruct

__all__ = ["fitted_in_folder"]

_FITTED = ("excitation", "free")
_WINDOW = 0.02  # [s] of the equations of friction
_FLEXIBLE = "three_sigmoid"  # follows any curve that a healthy joint has
_DEAR = 1e-3  # of the error, by which each further number must lower it


def fitted_in_folder(logs: Iterable[ExperimentLog]) -> Arm | None:
    """The arm, with the covariance of its numbers; None without an excitation or free log of role identify.

    Raises:
        RrridError: what these logs cannot be fitted for, as the stages say it.
    """
    known = [log for log in logs if log.origin != "planned" and log.role == "identify"]
    identify = [log for log in known if log.experiment in _FITTED]
    if not identify:
        return None
    how = Reconstruction()
    motions, friction = motions_of(identify, how), _driven_alone(known, how)
    fitted = _fit(motions, how, friction)
    if not friction:
        fitted = min(fitted, fit_several(motions, (), Recipe(how), law_named(_FLEXIBLE)).fitted, key=_missed)
    return fitted_arm(fitted.estimate, identify[0].robot_name, friction)


def _fit(motions: Motions, how: Reconstruction, friction: tuple[Acting, ...]) -> Fitted:
    """As estimate-bps does: with friction that is known, or Coulomb and viscous friction fitted along."""
    robot = motions[0][0].robot
    columns = nominal_columns(robot, friction=not friction)
    unknown = tuple(Parameter(p.name, 0.0, None, p.unit, origin="assumed") for p in columns.body.parameters)
    recipe = Recipe(how, known=Arm(robot.name, columns.body, unknown, friction).friction_torque if friction else None)
    recipe = with_cutoff(recipe, motions)
    means, _ = averaged(motions, how, recipe.cutoff_hz)
    return fit_logs(means, columns, recipe)


def _missed(fitted: Fitted) -> float:
    """Relative torque error on what was fitted; a more flexible law must be worth its numbers."""
    numbers = len(fitted.estimate.columns.names)
    return fitted.errors.relative_error * (1.0 + _DEAR * numbers)


def _driven_alone(logs: Sequence[ExperimentLog], how: Reconstruction) -> tuple[Acting, ...]:
    """The laws of all joints, where every one was driven alone; none otherwise."""
    alone = [log for log in logs if log.experiment == "friction" and log.joint is not None]
    joints = range(1, logs[0].n_joints + 1)
    if {log.joint for log in alone} != set(joints):
        return ()
    still = tuple((log, reconstruct(log, how)) for log in logs if log.experiment == "hold")
    moved = [(log, reconstruct(log, how)) for log in alone]
    fits = [fit_joint(JointLogs(j, tuple(pair for pair in moved if pair[0].joint == j), (), still), _WINDOW) for j in joints]
    return friction_of(fits, logs[0].robot)[0]

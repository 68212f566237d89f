"""The model that the logs of a folder give, where a stage needs one and nobody has fitted it: friction, then base parameters.

    arm = fitted_in_folder(logs)            as fit-friction and estimate-bps fit it by default; None where no log can be fitted
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pipelines.log.experiment import ExperimentLog
from pipelines.model.arm import Acting, Arm
from pipelines.model.estimation.floor import averaged
from pipelines.model.estimation.logs import Recipe, fit_logs, motions_of, with_cutoff
from pipelines.model.estimation.nominal import fitted_arm, nominal_columns
from pipelines.model.friction.acting import friction_of
from pipelines.model.friction.joint import JointLogs, fit_joint
from pipelines.model.motion import Reconstruction, reconstruct
from pipelines.model.parameter import Parameter

__all__ = ["fitted_in_folder"]

_FITTED = ("excitation", "free")
_WINDOW = 0.02  # [s] of the equations of friction


def fitted_in_folder(logs: Iterable[ExperimentLog]) -> Arm | None:
    """The arm, with the covariance of its numbers; None without an excitation or free log of role identify.

    Raises:
        RrridError: what these logs cannot be fitted for, as the stages say it.
    """
    known = [log for log in logs if log.origin != "planned" and log.role == "identify"]
    identify = [log for log in known if log.experiment in _FITTED]
    if not identify:
        return None
    how, first = Reconstruction(), identify[0]
    friction = _friction(known, how)
    columns = nominal_columns(first.robot, friction=not friction)
    unknown = tuple(Parameter(p.name, 0.0, None, p.unit, origin="assumed") for p in columns.body.parameters)
    given = Arm(first.robot_name, columns.body, unknown, friction)
    recipe = Recipe(how, known=given.friction_torque if friction else None)
    motions = motions_of(identify, how)
    recipe = with_cutoff(recipe, motions, columns)
    means, _ = averaged(motions, how, recipe.cutoff_hz)
    return fitted_arm(fit_logs(means, columns, recipe).estimate, first.robot_name, friction)


def _friction(logs: Sequence[ExperimentLog], how: Reconstruction) -> tuple[Acting, ...]:
    """The laws of all joints, where every one was driven alone; none otherwise."""
    alone = [log for log in logs if log.experiment == "friction" and log.joint is not None]
    joints = range(1, logs[0].n_joints + 1)
    if {log.joint for log in alone} != set(joints):
        return ()
    still = tuple((log, reconstruct(log, how)) for log in logs if log.experiment == "hold")
    moved = [(log, reconstruct(log, how)) for log in alone]
    fits = [fit_joint(JointLogs(j, tuple(pair for pair in moved if pair[0].joint == j), (), still), _WINDOW) for j in joints]
    return friction_of(fits, logs[0].robot)[0]

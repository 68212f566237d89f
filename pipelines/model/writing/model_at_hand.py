"""The model that is to be judged: handed on, given, left in the folder, or fitted to its logs; never to those that judge."""

from __future__ import annotations

from collections.abc import Sequence

from pipelines.errors import InputRejected, NothingMatched, UsageError
from pipelines.io.log import ExperimentLog, digest_of, recording
from pipelines.io.model_file import ModelFile
from pipelines.model.arm import Arm
from pipelines.model.estimation.in_folder import fitted_in_folder

__all__ = ["given_model", "handed_on", "model_fitted_here"]


def handed_on(arm: Arm, log: ExperimentLog) -> Arm | None:
    """What an earlier stage found; None where it is friction alone."""
    return _fits(arm, log) if arm.p.any() else None


def given_model(model: ModelFile, judges: Sequence[ExperimentLog], where: str) -> Arm:
    """The arm of a model file.

    Raises:
        UsageError: C02, it is of another robot, or holds friction alone.
        InputRejected: D14, it was fitted to a log that shall judge it; S18, it does not fit its robot.
    """
    fitted = {source.sha256 for source in model.sources if source.role == "identify"}
    for log in judges:
        if digest_of(recording(log)) in fitted:
            raise _leak(log)
    arm = Arm.from_model(model, where)
    if not arm.p.any():
        raise UsageError("C02", "the model holds friction alone, no inertia", where="--model",
                         remedy="name the model.json of estimate-bps")
    return _fits(arm, judges[0])


def model_fitted_here(logs: Sequence[ExperimentLog], judges: Sequence[ExperimentLog], label: str) -> Arm:
    """The arm that the logs of role identify give.

    Raises:
        NothingMatched: C06, there is none to fit.
        InputRejected: D14, the same recording would be fitted and judge.
    """
    seen = {log.q.tobytes() + log.tau.tobytes() for log in logs if log.role == "identify" and log.origin != "planned"}
    for log in judges:
        if log.q.tobytes() + log.tau.tobytes() in seen:
            raise _leak(log)
    if (arm := fitted_in_folder(logs)) is None:
        raise NothingMatched("C06", "no model to validate, and no excitation or free log of role identify to fit one",
                             where=label, remedy="give --model model.json, or the folder that has such logs")
    return arm


def _fits(arm: Arm, log: ExperimentLog) -> Arm:
    if arm.n_joints != log.n_joints:
        raise UsageError("C02", f"the model has {arm.n_joints} joints, {log.name} has {log.n_joints}", where="--model",
                         remedy="give a model of this robot")
    return arm


def _leak(log: ExperimentLog) -> InputRejected:
    return InputRejected("D14", f"leak: the model was fitted to {log.name}, which shall judge it", where=log.source or log.name,
                         remedy="judge on another recording")

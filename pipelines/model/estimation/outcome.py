"""What an estimate comes to: its parameters in words, the torques it gives, the range it holds for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.model_file import Validity
from pipelines.model.arm import Arm, ArmTorque
from pipelines.model.estimation.logs import Fitted, Motions
from pipelines.model.estimation.regression import Columns
from pipelines.model.motion import Reconstructed

__all__ = ["Course", "Direction", "Estimated", "course", "parameters", "torques", "validity"]

_POINTS = 1500  # of a figure


@dataclass(frozen=True)
class Estimated:
    """One parameter. `value` is None where the logs do not determine it."""

    name: str
    value: float | None
    std: float | None
    unit: str
    visible: bool
    combination: str  # of link parameters; the law's meaning for the others
    known: float | None  # from the description's links


@dataclass(frozen=True)
class Direction:
    """A combination of parameters that these logs show badly."""

    singular_value: float
    parameters: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Course:
    """One log's torques, thinned out for the figures."""

    name: str
    role: str
    t: Array  # [s] (points,)
    measured: Array  # [N m] (points, joints)
    model: Array
    friction: Array


def parameters(fitted: Fitted, arm: Arm) -> tuple[Estimated, ...]:
    """Every parameter of the fit, in words; without a value where these logs do not determine it."""
    found, known, rows = fitted.estimate, arm.body.known_parameters(), []
    meanings = _meanings(found.columns)
    for k, column in enumerate(found.columns.names):
        sure = bool(found.trusted[k])
        place = found.columns.kept[k] if k < len(found.columns.kept) else None
        rows.append(Estimated(column.name, float(found.beta[k]) if sure else None,
                              float(found.std[k]) if sure else None, column.unit,
                              bool(found.visible[k]), meanings[k], None if known is None or place is None else float(known[place])))
    return tuple(rows)


def _meanings(columns: Columns) -> list[str]:
    """What each column stands for: the combination of link parameters, or "Coulomb friction, waist: friction torque …"."""
    joints = columns.body.robot.joints
    laws = [f"{law.title}{'' if law.joint is None else f', {joints[law.joint - 1].name}'}: {quantity.meaning}"
            for law in columns.laws for quantity in law.parameters if not quantity.shape]
    return [*(columns.body.parameters[i].combination for i in columns.kept), *laws]


def torques(arm: Arm, log: ExperimentLog, motion: Reconstructed) -> ArmTorque:
    """The model's torque as the log counts it: a held command is the average over its sample."""
    parts = arm.torque_parts(motion.motion)
    if log.torque == "measured":
        return parts
    return ArmTorque(*(np.vstack([0.5 * (x[1:] + x[:-1]), x[-1:]]) for x in
                       (parts.inertia, parts.coriolis, parts.gravity, parts.friction, parts.effects)))


def course(log: ExperimentLog, parts: ArmTorque) -> Course:
    every = max(1, log.n_samples // _POINTS)
    return Course(log.name, log.role, log.t[::every] - log.t[0], log.tau[::every], parts.total[::every], parts.friction[::every])


def validity(motions: Motions) -> Validity:
    """The range that the fitted logs covered."""
    def ranges(name: str) -> tuple[tuple[float, float], ...]:
        values = np.concatenate([getattr(found.motion, name)[found.good.kept[found.good.fit]] for _, found in motions])
        return tuple((float(low), float(high)) for low, high in zip(values.min(axis=0), values.max(axis=0), strict=True))

    return Validity(speed=ranges("dq"), acceleration=ranges("ddq"), posture=ranges("q"))

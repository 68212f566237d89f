"""What an estimate comes to: its parameters in words, the torques it gives, the range it holds for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.arm import Arm, ArmTorque
from pipelines.estimation.filters import choose_decimation, design_low_pass, zero_phase
from pipelines.estimation.motion import Reconstructed
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.model_file import Validity
from pipelines.model.estimation.conditioning import cutoff_at
from pipelines.model.estimation.logs import Fitted, Motions
from pipelines.model.estimation.peaks import bridged
from pipelines.model.estimation.regression import Columns

__all__ = ["Course", "Direction", "Estimated", "course", "parameters", "torques", "validity"]

_POINTS = 6000  # of a figure


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
    """One log's torques for the figures, after the low-pass of the fit; NaN between stretches and where torque is spoilt.

    Of a long log the lowest and the highest of each stretch of time, so that nothing is hidden and nothing aliased.
    """

    name: str
    role: str
    t: Array  # [s] (points,)
    measured: Array  # [N m] (points, joints)
    model: Array
    friction: Array
    left: Array  # measured - model


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
    laws = [f"{law.words.title}{'' if law.joint is None else f', {joints[law.joint - 1].name}'}: {quantity.meaning}"
            for law in columns.laws for quantity in law.parameters if not quantity.shape]
    return [*(columns.body.parameters[i].combination for i in columns.kept), *laws]


def torques(arm: Arm, log: ExperimentLog, motion: Reconstructed) -> ArmTorque:
    """The model's torque as the log counts it: a held command is the average over its sample."""
    parts = arm.torque_parts(motion.motion)
    if log.torque == "measured":
        return parts
    return ArmTorque(*(np.vstack([0.5 * (x[1:] + x[:-1]), x[-1:]]) for x in
                       (parts.inertia, parts.coriolis, parts.gravity, parts.friction, parts.effects)))


def course(log: ExperimentLog, found: Reconstructed, parts: ArmTorque, cutoff_hz: float | None) -> Course:
    """The torques of `log` along its time, as the fit saw them."""
    good, rate = found.good, 1.0 / log.sample_time
    cutoff_hz = cutoff_at(cutoff_hz, rate)
    low_pass = None if cutoff_hz is None else design_low_pass(cutoff_hz, rate)
    every = 1 if cutoff_hz is None else max(1, choose_decimation(cutoff_hz, rate) // 2)
    pieces = []
    for run in good.runs:
        rows = good.kept[run]
        tau, spoilt = good.log.tau[run], (good.missing | good.spikes | good.saturated)[run]
        torques = np.hstack([bridged(tau, spoilt), parts.total[rows], parts.friction[rows]])
        if low_pass is not None and len(torques) > low_pass.padding:
            torques = zero_phase(torques, low_pass)
        torques[:, :log.n_joints][spoilt] = np.nan
        left = torques[:, :log.n_joints] - torques[:, log.n_joints:2 * log.n_joints]
        piece = np.column_stack([log.t[rows] - log.t[0], torques, left])[::every]
        pieces += [piece, np.full((1, piece.shape[1]), np.nan)]
    whole = _extremes(np.concatenate(pieces[:-1]), _POINTS)
    t, torques = whole[:, 0], whole[:, 1:]
    measured, model, friction, left = (np.ascontiguousarray(part) for part in np.split(torques, 4, axis=1))
    return Course(log.name, log.role, t, measured, model, friction, left)


def _extremes(rows: Array, points: int) -> Array:
    """Time beside columns (samples, 1 + columns), thinned to the lowest and the highest of each column in a bucket of time."""
    size = 2 * -(-len(rows) // points)
    if len(rows) <= points:
        return rows
    buckets = rows[:len(rows) // size * size].reshape(-1, size, rows.shape[1])
    low, high = np.fmin.reduce(buckets, axis=1), np.fmax.reduce(buckets, axis=1)
    low[:, 0], high[:, 0] = buckets[:, size // 4, 0], buckets[:, 3 * size // 4, 0]
    return np.stack([low, high], axis=1).reshape(-1, rows.shape[1])


def validity(motions: Motions) -> Validity:
    """The range that the fitted logs covered."""
    def ranges(name: str) -> tuple[tuple[float, float], ...]:
        values = np.concatenate([getattr(found.motion, name)[found.good.kept[found.good.fit]] for _, found in motions])
        return tuple((float(low), float(high)) for low, high in zip(values.min(axis=0), values.max(axis=0), strict=True))

    return Validity(speed=ranges("dq"), acceleration=ranges("ddq"), posture=ranges("q"))

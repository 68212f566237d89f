"""Describe the result of an estimate: parameters in words, torques, the range it holds for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipelines.dynamics.arm import Arm, ArmTorque
from pipelines.errors import Check, UsageError
from pipelines.estimation.checks.boundary import Boundary
from pipelines.estimation.consistency import Consistent
from pipelines.estimation.estimate import Fitted
from pipelines.estimation.filters import choose_decimation, zero_phase
from pipelines.estimation.motion import Motions, Reconstructed, Reconstruction
from pipelines.estimation.periods import PeriodicLog
from pipelines.estimation.regression import bridged, cutoff_at
from pipelines.io.log import Array, ExperimentLog, derive
from pipelines.io.model_file import ModelFile, Validity
from pipelines.io.output import slug
from pipelines.io.results import NOT_STORED

_POINTS = 6000  # numerics: of a figure


@dataclass(frozen=True)
class Estimated:
    """One parameter. It has no `value` where the logs do not determine it."""

    name: str
    value: float | None
    std: float | None
    unit: str
    visible: bool
    combination: str  # of link parameters; the law's meaning for the others
    known: float | None  # from the description's links


@dataclass(frozen=True)
class Course:
    """One log's torques for the figures, after the low-pass of the fit; NaN between stretches.

    Of a long log the lowest and the highest of each stretch of time, so that nothing is hidden and
    nothing aliased.
    """

    name: str
    role: str
    t: Array  # [s] (points,)
    measured: Array  # [N m] (points, joints)
    model: Array
    friction: Array
    left: Array  # measured - model


@dataclass(frozen=True)
class Result:
    """Everything estimated. What these logs do not determine has no value."""

    robot: str
    joints: tuple[str, ...]
    torque_units: tuple[str, ...]  # per joint: "N m", or "N" of a prismatic one
    parameters: tuple[Estimated, ...]
    condition_number: float  # of Φ in Kostić et al. 2004, eq. (13): rigid columns, unweighted, SI
    condition_number_fit: float  # of the weighted columns at unit length
    rank: int
    relative_error: dict[str, float]  # identify, validate
    torque_rms: dict[str, tuple[float, ...]]  # [torque_units] of the residual, per joint
    torque_signal_rms: dict[str, tuple[float, ...]]  # [torque_units]
    held_out: str  # "logs" | "blocks"
    filter_hz: float | None  # low-pass over torque and columns
    equations: tuple[int, ...]  # of each joint, too slow samples left out
    friction: str  # "fitted" | "given"
    physically_consistent: bool | None  # None: not all parameters are determined
    consistency: Consistent | None
    unresolved: str  # words; empty where everything shows
    # parameters determined only together
    not_separated: tuple[tuple[str, ...], ...] = field(default=(), kw_only=True)
    # [torque_units] held-out rms, no friction
    rigid_body_alone: tuple[float, ...] | None = field(default=None, kw_only=True)
    # what the logged torque is; null: no log tells
    boundary: Boundary | None = field(default=None, kw_only=True)
    # given: the model file, or "fit-friction" of the same run
    friction_of: str = field(default="", kw_only=True)
    # of logs that hold two periods or more
    noise_floor: tuple[PeriodicLog, ...] = field(default=(), kw_only=True)
    convergence_samples: tuple[int, ...]
    convergence: Array  # (counts, parameters)
    convergence_std: Array
    courses: tuple[Course, ...]
    # of the logs, but "ok"
    data_quality: tuple[Check, ...] = field(
        default=(), metadata=NOT_STORED, repr=False, kw_only=True
    )
    # the model with the covariance of its numbers
    arm: Arm = field(metadata=NOT_STORED, repr=False)
    model: ModelFile = field(metadata=NOT_STORED, repr=False)
    derived: tuple[tuple[str, ExperimentLog], ...] = field(metadata=NOT_STORED, repr=False)


def parameters(fitted: Fitted, arm: Arm) -> tuple[Estimated, ...]:
    """Return every parameter of the fit, in words; without a value where it is not determined."""
    found, known = fitted.estimate, arm.body.known_parameters()
    columns, joints = found.columns, arm.robot.joints
    meanings = [arm.body.parameters[i].combination for i in columns.kept]
    for law in columns.laws:  # "Coulomb friction, waist: friction torque …"
        place = "" if law.joint is None else f", {joints[law.joint - 1].name}"
        amplitudes = (q for q in law.parameters if not q.shape)
        meanings += [f"{law.words.title}{place}: {q.meaning}" for q in amplitudes]
    rows = []
    for k, column in enumerate(columns.names):
        sure, links = bool(found.trusted[k]), None
        if known is not None and k < len(columns.kept):
            links = float(known[columns.kept[k]])
        value, std = (float(x[k]) if sure else None for x in (found.beta, found.std))
        seen = bool(found.visible[k])
        rows.append(Estimated(column.name, value, std, column.unit, seen, meanings[k], links))
    return tuple(rows)


def of_this_robot(arm: Arm, log: ExperimentLog) -> Arm:
    """Return a model that was given; C02 where it has other joints than the log."""
    if arm.n_joints != log.n_joints:
        words = f"the model has {arm.n_joints} joints, {log.name} has {log.n_joints}"
        raise UsageError("C02", words, where="--model", remedy="give a model of this robot")
    return arm


def torques(arm: Arm, log: ExperimentLog, motion: Reconstructed) -> ArmTorque:
    """Return the model's torque as the log counts it: a held command is averaged over samples."""
    parts = arm.torque_parts(motion.motion)
    if log.torque == "measured":
        return parts
    each = (parts.inertia, parts.coriolis, parts.gravity, parts.friction, parts.effects)
    return ArmTorque(*(np.vstack([0.5 * (x[1:] + x[:-1]), x[-1:]]) for x in each))


def with_torques(
    log: ExperimentLog,
    motion: Reconstructed,
    how: Reconstruction,
    parts: ArmTorque,
    command: str,
    settings: Mapping[str, Any],
) -> tuple[str, ExperimentLog]:
    """Return the file name of a derived log, and the log with its motion and the model's torque.

    Args:
        how: how the motion was reconstructed.
        command, settings: what derived the torque.
    """
    signals = {
        "tau_model": parts.total,
        "tau_inertia": parts.inertia,
        "tau_coriolis": parts.coriolis,
        "tau_gravity": parts.gravity,
        "tau_friction_model": parts.friction,
        "tau_effects": parts.effects,
        "tau_residual": log.tau - parts.total,
    }
    moved = derive(log, "reconstruct", how.as_settings(), motion.signals())
    return slug(log.name), derive(moved, command, settings, signals)


def course(
    log: ExperimentLog, found: Reconstructed, parts: ArmTorque, cutoff_hz: float | None
) -> Course:
    """Return the torques of `log` along its time, as the fit saw them."""
    good, rate, n = found.good, 1.0 / log.sample_time, log.n_joints
    cutoff_hz = cutoff_at(cutoff_hz, rate)
    every = 1 if cutoff_hz is None else max(1, choose_decimation(cutoff_hz, rate) // 2)
    pieces = []
    for run in good.runs:
        rows = good.kept[run]
        spoilt = (good.missing | good.spikes | good.saturated)[run]
        measured = bridged(good.log.tau[run], spoilt)
        torque = np.hstack([measured, parts.total[rows], parts.friction[rows]])
        if cutoff_hz is not None:
            torque = zero_phase(torque, cutoff_hz, rate)
        torque[:, :n][spoilt] = np.nan
        left = torque[:, :n] - torque[:, n : 2 * n]
        piece = np.column_stack([log.t[rows] - log.t[0], torque, left])[::every]
        pieces += [piece, np.full((1, piece.shape[1]), np.nan)]
    whole = _extremes(np.concatenate(pieces[:-1]))
    columns = (np.ascontiguousarray(part) for part in np.split(whole[:, 1:], 4, axis=1))
    return Course(log.name, log.role, whole[:, 0], *columns)


def _extremes(rows: Array) -> Array:
    """Return time and columns, thinned to the lowest and highest of each column in a bucket."""
    size = 2 * -(-len(rows) // _POINTS)
    if len(rows) <= _POINTS:
        return rows
    buckets = rows[: len(rows) // size * size].reshape(-1, size, rows.shape[1])
    low, high = np.fmin.reduce(buckets, axis=1), np.fmax.reduce(buckets, axis=1)
    low[:, 0], high[:, 0] = buckets[:, size // 4, 0], buckets[:, 3 * size // 4, 0]
    return np.stack([low, high], axis=1).reshape(-1, rows.shape[1])


def validity(motions: Motions) -> Validity:
    """Return the range that the fitted logs covered."""

    def ranges(name: str) -> tuple[tuple[float, float], ...]:
        parts = [
            getattr(found.motion, name)[found.good.kept[found.good.fit]] for _, found in motions
        ]
        x = np.concatenate(parts)
        return tuple(zip(x.min(axis=0).tolist(), x.max(axis=0).tolist(), strict=True))

    return Validity(speed=ranges("dq"), acceleration=ranges("ddq"), posture=ranges("q"))

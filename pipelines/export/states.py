"""States and motions at which an exported file is compared, within the range of the logs."""

from __future__ import annotations

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.export.config import EXPORT
from pipelines.io.model_file import Validity
from pipelines.io.robot import RobotDescription

__all__ = ["course", "peak", "random_states"]


def peak(robot: RobotDescription, validity: Validity | None, key: str) -> Array:
    """Return the largest speed or acceleration (joints,) of the logs, else of the description."""
    ranges = getattr(validity, key, None) or (None,) * robot.n_joints
    found, own = [], {"speed": "velocity"}.get(key, key)
    for limits, joint in zip(ranges, robot.joints, strict=True):
        most = getattr(joint, own) if limits is None else max(map(abs, limits))
        found.append(most if np.isfinite(most) and most > 0.0 else getattr(EXPORT, key))
    return np.array(found)


def _travel(robot: RobotDescription) -> tuple[Array, Array]:
    """Return lowest and highest position (joints,): a turn, or some travel, without limits."""
    wide = np.array([np.pi if revolute else EXPORT.travel for revolute in robot.revolute])
    low, high = np.array([joint.position for joint in robot.joints]).T
    low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - wide, -wide))
    return low, np.where(np.isfinite(high), high, low + 2.0 * wide)


def random_states(robot: RobotDescription, validity: Validity | None) -> Motion:
    """Return states that have nothing to do with each other."""
    rng, (low, high) = np.random.default_rng(EXPORT.seed), _travel(robot)
    shape = EXPORT.states, robot.n_joints
    q = low + (high - low) * rng.random(shape)
    dq, ddq = (
        peak(robot, validity, key) * rng.uniform(-1.0, 1.0, shape)
        for key in ("speed", "acceleration")
    )
    return Motion(np.arange(EXPORT.states) / EXPORT.rate, q, dq, ddq)


def course(robot: RobotDescription, validity: Validity | None) -> Motion:
    """Return sums of sines, as wide as the limits of each joint allow."""
    rng, t = np.random.default_rng(EXPORT.seed), np.arange(EXPORT.samples) / EXPORT.rate
    w = 2.0 * np.pi * np.arange(1, EXPORT.waves + 1) * EXPORT.rate / EXPORT.samples
    phase = rng.uniform(0.0, 2.0 * np.pi, (robot.n_joints, len(w)))
    size = rng.uniform(0.5, 1.0, phase.shape) / w
    angle = np.multiply.outer(t, w)[:, None] + phase
    q = np.einsum("sjk,jk->sj", np.sin(angle), size)
    dq = np.einsum("sjk,jk->sj", np.cos(angle), size * w)
    ddq = np.einsum("sjk,jk->sj", -np.sin(angle), size * w**2)
    low, high = _travel(robot)
    speed, acceleration = (peak(robot, validity, key) for key in ("speed", "acceleration"))
    room = (high - low) / np.ptp(q, axis=0), speed / np.abs(dq).max(axis=0)
    by = np.minimum(np.minimum(*room), acceleration / np.abs(ddq).max(axis=0))
    middle = 0.5 * (low + high - by * (q.max(axis=0) + q.min(axis=0)))
    return Motion(t, middle + by * q, by * dq, by * ddq)

"""The equations of an arm along a motion: rigid columns and friction columns, joint by joint, with their adjoint.

Friction acts on its own joint alone. Of every joint: Coulomb's tanh(w q̇), with w small enough to be followed by an optimiser,
viscous friction q̇ and a constant offset.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipelines.io.robot import RobotDescription
from pipelines.model.excitation.chain_rows import ChainRows
from pipelines.model.excitation.rrr_rows import RRRRows
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Array, RigidBody
from pipelines.model.rigid.rrr import RRR

__all__ = ["SHARPNESS", "ArmColumns", "arm_columns"]

SHARPNESS = 20.0  # w [s/rad] of Coulomb friction: its change of sign then takes several samples of the design


class Rows(Protocol):
    """A regressor as rows of each joint, and its adjoint."""

    columns: tuple[np.ndarray, ...]  # of each joint: which parameters its rows belong to

    def rows(self, motion: Array) -> tuple[Array, ...]: ...

    def adjoint(self, motion: Array, bars: tuple[Array, ...]) -> Array: ...


@dataclass(frozen=True, eq=False)
class ArmColumns:
    """τ_j = rows_jᵀ β[columns_j]: what is estimated from a motion."""

    rigid: Rows
    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[np.ndarray, ...]  # of each joint
    rigid_count: int
    friction: bool

    def rows(self, motion: Array) -> tuple[Array, ...]:
        """Each (columns of the joint, samples) for motion (3, joints, samples)."""
        rigid = self.rigid.rows(motion)
        if not self.friction:
            return rigid
        return tuple(np.concatenate([own, np.stack([np.tanh(SHARPNESS * v), v, np.ones_like(v)])])
                     for own, v in zip(rigid, motion[1], strict=True))

    def adjoint(self, motion: Array, bars: tuple[Array, ...]) -> Array:
        """Derivatives by the motion (3, joints, samples) from those by each row; after `rows` of the same motion."""
        if not self.friction:
            return self.rigid.adjoint(motion, bars)
        out = self.rigid.adjoint(motion, tuple(bar[:-3] for bar in bars))
        for j, bar in enumerate(bars):
            level = np.tanh(SHARPNESS * motion[1, j])
            out[1, j] += bar[-3] * SHARPNESS * (1.0 - level * level) + bar[-2]
        return out


def arm_columns(body: RigidBody, *, friction: bool) -> ArmColumns:
    """The columns of `body`, closed form or recursion, with those of friction if wanted."""
    rigid: Rows = RRRRows(body) if isinstance(body, RRR) else ChainRows(_general(body))
    names, units = [p.name for p in body.parameters], [p.unit for p in body.parameters]
    columns = rigid.columns
    count = len(names)
    if friction:
        columns = tuple(np.concatenate([own, count + 3 * j + np.arange(3)]) for j, own in enumerate(columns))
        for j, unit in enumerate(_torque_units(body.robot)):
            names += [f"coulomb:{j + 1}", f"viscous:{j + 1}", f"torque_offset:{j + 1}"]
            units += [unit, f"{unit} s/{'rad' if unit == 'N m' else 'm'}", unit]
    return ArmColumns(rigid, tuple(names), tuple(units), columns, count, friction)


def _general(body: RigidBody) -> BaseArm:
    return body if isinstance(body, BaseArm) else BaseArm(body.robot)


def _torque_units(robot: RobotDescription) -> list[str]:
    return ["N m" if revolute else "N" for revolute in robot.revolute]

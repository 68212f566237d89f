"""Coupled transmission."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import LARGE, ArmModel, Effect, Hooks, Parameters, Quantity, Values

__all__ = ["TransmissionCoupling"]


@dataclass(frozen=True)
class TransmissionCoupling(Effect):
    """τ_s = J ds/dt + B s + C tanh(w s), s = v_j + ρ v_i.

    It is a load of τ_s on joint j and of ρ τ_s on joint i. ρ is what the robot's transmission
    matrix N says of the motor that both share: N_ki/N_kj, k one of the two; 1 without one. Of the
    two joints j is the later, for s does not tell them apart.
    """

    with_joint: float = 0.0  # i, 1-based; the joint before, if none is given
    sharpness: float = 100.0  # w [s/rad]

    name = "transmission_coupling"
    parameters = Parameters(
        Quantity("with_joint", "1", 1.0, 100.0, "the other joint", shape=True, discrete=True,
                 joint=True, earlier=True),
        Quantity("inertia", "kg m^2", 0.0, 0.1 * LARGE, "of the motor, at joint side"),
        Quantity("viscous", "N m s/rad", 0.0, LARGE,
                 "viscous friction of the motor, at joint side"),
        Quantity("coulomb", "N m", 0.0, LARGE, "dry friction of the motor, at joint side"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0,
                 "inverse of the speed over which dry friction changes sign", shape=True))

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        other, ratio = int(self.with_joint) - 1, self._ratio(arm)
        speed, acceleration = (self.own(x) + ratio * x[..., other] for x in (motion.dq, motion.ddq))
        table = self.on_own_row(arm, acceleration, speed, np.tanh(self.sharpness * speed))
        table[:, other] = ratio * table[:, self._index]
        return table

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Return the joints that share a motor by the transmission matrix.

        Where there is none, it is the joint before.
        """
        matrix = arm.robot.drive.transmission if arm.robot.drive is not None else None
        own, earlier = self._index, range(self._index)
        shared = [i for i in earlier if matrix is not None and (matrix[own][i] or matrix[i][own])]
        for other in shared or [own - 1 if own else 1]:
            for sharpness in (20.0, 100.0, 500.0):
                yield replace(self, with_joint=other + 1.0, sharpness=sharpness)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Its inertia belongs to the arm's: J (1, ρ)ᵀ (1, ρ)."""
        shaped = self.at(values)
        own = np.zeros(arm.n_joints)
        own[self._index], own[int(shaped.with_joint) - 1] = 1.0, shaped._ratio(arm)
        b, c, w = values["viscous"], values["coulomb"], values["sharpness"]

        def load(motion: Motion, _: Array) -> Array:
            speed = motion.dq @ own
            return np.asarray((b * speed + c * np.tanh(w * speed))[:, None] * own)

        return Hooks(load=load, inertia=values["inertia"] * np.outer(own, own))

    def _ratio(self, arm: ArmModel) -> float:
        matrix = arm.robot.drive.transmission if arm.robot.drive is not None else None
        j, i = self._index, int(self.with_joint) - 1
        if matrix is None:
            return 1.0
        for motor in (i, j):
            if matrix[motor][i] and matrix[motor][j]:
                return matrix[motor][i] / matrix[motor][j]
        return 1.0

"""The inertia of a motor's rotor, seen through its gear."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import LARGE, ArmModel, Effect, Hooks, Parameters, Quantity, Values

__all__ = ["RotorInertia"]


@dataclass(frozen=True)
class RotorInertia(Effect):
    """τ = I ddq, on its own joint only: a rotor turns with its joint, whatever the arm's posture.

    At joint side: gear ratio squared times the rotor's own inertia. Its gyroscopic torques are
    small beside it.
    """

    name = "rotor_inertia"
    parameters = Parameters(Quantity("inertia", "kg m^2", 0.0, 0.1 * LARGE,
                                     "inertia at joint side"))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self.own(motion.ddq))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        import numpy as np

        added = np.zeros((arm.n_joints, arm.n_joints))
        added[self._index, self._index] = values["inertia"]
        return Hooks(inertia=added)

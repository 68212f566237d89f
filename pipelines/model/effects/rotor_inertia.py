"""The inertia of a motor's rotor, seen through its gear."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.dynamics.body import Array, Motion
from pipelines.model.effects.base import LARGE, ArmModel, Hooks, Parameters, Quantity, Values, Words
from pipelines.model.effects.fast import Fast

__all__ = ["RotorInertia"]


@dataclass(frozen=True)
class RotorInertia(Fast):
    """τ = I ddq, on its own joint only: a rotor turns with its joint, whatever the arm's posture.

    At joint side: gear ratio squared times the rotor's own inertia. Its gyroscopic torques are small beside it.
    """

    name = "rotor_inertia"
    parameters = Parameters(Quantity("inertia", "kg m^2", 0.0, 0.1 * LARGE, "inertia at joint side"))
    words = Words("Rotor inertia", size="inertia",
        signature="A torque in proportion to the joint's own acceleration, the same in every posture.",
        explanation="The rotor and the gear's fast shaft turn with the motor; the gear ratio enters squared.",
        remedy="Add it to the model; it is a property of the machine, not a fault.",
        experiment="Accelerate the joint in two postures with different load inertia.")
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self.own(motion.ddq))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        import numpy as np

        added = np.zeros((arm.n_joints, arm.n_joints))
        added[self._index, self._index] = values["inertia"]
        return Hooks(inertia=added)

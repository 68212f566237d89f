"""Pinocchio as the judge of motions of the tip: placements, speeds and an inverse found by iteration."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from pipelines.dynamics.body import Array
from tests.dynamics.serial_arms import Arm

# eighth-order central difference: weights of the points h apart, themselves left out
OFFSETS = np.array([-4, -3, -2, -1, 1, 2, 3, 4])
WEIGHTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


class TipJudge:
    """An arm of Pinocchio with a frame at its tip."""

    def __init__(self, arm: Arm) -> None:
        self.arm, self.model = arm, arm.model.copy()
        frame = pin.Frame("the tip", self.model.njoints - 1, 0, arm.tip_in_joint, pin.FrameType.OP_FRAME)
        self.frame = self.model.addFrame(frame)
        self.data: Any = self.model.createData()

    def tip(self, q: Array) -> Array:
        found = []
        for row in self.arm.offset(q):
            pin.framesForwardKinematics(self.model, self.data, row)
            found.append(self.data.oMf[self.frame].translation.copy())
        return np.array(found)

    def rates(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        """Velocity and acceleration of the tip, each (samples, 3), in the base frame."""
        velocity, acceleration = [], []
        for row in zip(self.arm.offset(q), dq, ddq, strict=True):
            pin.forwardKinematics(self.model, self.data, *row)
            pin.updateFramePlacements(self.model, self.data)
            where = (self.model, self.data, self.frame, pin.LOCAL_WORLD_ALIGNED)
            velocity.append(pin.getFrameVelocity(*where).linear.copy())
            acceleration.append(pin.getFrameClassicalAcceleration(*where).linear.copy())
        return np.array(velocity), np.array(acceleration)

    def inverse(self, tip: Array, start: Array) -> Array:
        """q (samples, joints) by Newton's method, every sample from the one before. Arms of three joints."""
        found, q = [], self.arm.offset(start).copy()
        for wanted in tip:
            for _ in range(50):
                pin.framesForwardKinematics(self.model, self.data, q)
                missed = wanted - self.data.oMf[self.frame].translation
                if np.abs(missed).max() < 1e-14:
                    break
                jacobian = pin.computeFrameJacobian(self.model, self.data, q, self.frame, pin.LOCAL_WORLD_ALIGNED)[:3]
                q = q + np.linalg.solve(jacobian, missed)
            found.append(q)
        return self.arm.offset(np.array(found)) - 2.0 * (self.arm.offset(np.zeros(self.arm.n)))

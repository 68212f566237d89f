"""A model for the controller out of disturbed links, by MuJoCo: feed-forward that owes nothing to a
fit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.dynamics import RigidDynamics
from bench.machine import Machine
from bench.plan import Solid
from pipelines.io.log import Array

__all__ = ["LinkModel"]

Floats = list[float]


class LinkModel:
    """Links and friction of a machine, each number within ± `error` of the truth. It has no text:
    the log cannot say it.
    """

    text: str | None = None

    def __init__(self, machine: Machine, seed: int = 0, error: float = 0.05) -> None:
        rng = np.random.default_rng([25, seed])
        joints = tuple(
            replace(joint, link=Solid.of_link(joint.link).drawn(rng, error).as_link())
            for joint in machine.robot.joints
            if joint.link is not None
        )
        self._rigid = RigidDynamics(replace(machine.robot, joints=joints))
        self._friction = [law.drawn(rng, error).law() for law in machine.friction]

    def parts(self, q: Floats, dq: Floats, ddq: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Friction, inertia, Coriolis and gravity of one sample [N m]."""
        friction = [law(v) for law, v in zip(self._friction, dq, strict=True)]
        return friction, *self._rigid.parts(q, dq, ddq)

    def along(self, q: Array, dq: Array, ddq: Array) -> Array:
        """The same of a whole motion (4, samples, n)."""
        rows = zip(q.tolist(), dq.tolist(), ddq.tolist(), strict=True)
        return np.array([self.parts(*row) for row in rows]).transpose(1, 0, 2)

"""Link length: a link is not as long as the drawing says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from bench.fault import Case, Fault, Parameters
from bench.machine import Machine
from bench.plan import Plan, plan_of
from pipelines.io.experiment import Array

__all__ = ["LinkLength"]


@dataclass(frozen=True)
class LinkLength(Fault):
    """All that hangs on link k sits `error` further along it: along x of its frame, or in a URDF towards the next joint.

    The link's own body stays where it is on its axis.
    """

    error: float  # [m] true minus nominal
    link: int  # k, 1-based: from joint k to joint k + 1

    name = "link_length"
    scope = "arm"

    @classmethod
    def full(cls, case: Case) -> Self:
        """At the longest link between two moving joints; how long the last one is, torque does not tell."""
        joints = plan_of(case.machine.robot).joints
        between = range(1, len(joints) - 1) if len(joints) > 2 else range(len(joints) - 1)
        longest = max(between, key=lambda k: float(np.abs(_along(joints[k + 1].position, case.machine) @ joints[k + 1].position)))
        return cls(None, 0.012 * case.sign(), longest + 1)

    def scaled(self, factor: float) -> Self:
        return replace(self, error=factor * self.error)

    def parameters(self) -> Parameters:
        return {"error": self.error, "link": self.link}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        beyond = plan.joints[self.link]
        moved = beyond.position + self.error * _along(beyond.position, machine)
        return plan.with_joint(self.link, replace(beyond, position=moved))


def _along(position: Array, machine: Machine) -> Array:
    """Unit vector (3,) along a link, in its body frame, where `position` (3,) is that of the next joint."""
    length = float(np.linalg.norm(position))
    if machine.robot.convention != "urdf" or length == 0.0:
        return np.array([1.0, 0.0, 0.0])
    return position / length

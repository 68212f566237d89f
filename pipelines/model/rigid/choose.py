"""Choose between the closed form and the general recursion."""

from __future__ import annotations

from functools import lru_cache

from pipelines.io.robot import RobotDescription
from pipelines.model.rigid import rrr
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import RigidBody

__all__ = ["rigid_body"]


@lru_cache(maxsize=64)
def rigid_body(robot: RobotDescription) -> RigidBody:
    """The closed form (A1)-(A5) where `robot` has the RRR arm's geometry, the general recursion otherwise."""
    if rrr.fits(robot):
        return rrr.RRR(robot)
    return BaseArm(robot)

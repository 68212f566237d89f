"""The law that was fitted to each joint, as part of the model of an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.log.robot import RobotDescription
from pipelines.model.arm import Acting
from pipelines.model.effects import find_effect
from pipelines.model.effects.base import Effect
from pipelines.model.friction.joint import JointFit
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.rigid.body import Motion

__all__ = ["friction_of"]


def friction_of(joints: Sequence[JointFit], robot: RobotDescription) -> tuple[tuple[Acting, ...], tuple[Acting, ...]]:
    """The laws of friction of an arm's joints, and apart from them what acts at rest as well: offsets."""
    laws = [acting for joint in joints for acting in _acting_laws(joint.fit, joint.logs.joint)]
    at_rest = [_acts_at_rest(law.effect, robot) for law in laws]
    return (tuple(law for law, still in zip(laws, at_rest, strict=True) if not still),
            tuple(law for law, still in zip(laws, at_rest, strict=True) if still))


def _acts_at_rest(effect: Effect, robot: RobotDescription) -> bool:
    """An offset is no friction: its torque is there without motion."""
    joint = replace(effect, joint=1)
    still = np.zeros((2, 1))
    return bool(joint.columns(Motion(np.arange(2.0), still, still, still), OneJoint.of(robot, 1, 1.0)).any())


def _acting_laws(fit: LawFit, joint: int) -> list[Acting]:
    """The law's effects at their joint of the arm, with their numbers."""
    std = {number.name: number.std for number in fit.numbers}
    shared = {name.partition(".")[2]: value for name, value in std.items() if name.endswith(".sharpness")}
    found = []
    for effect, values in zip(fit.law.shaped(fit.theta), fit.law.values(fit.theta, fit.amplitudes), strict=True):
        own = {name: std.get(f"{effect.name}.{name}", shared.get(name)) for name in values}
        found.append(Acting.of(find_effect(effect.name)(joint=joint), values, {k: s for k, s in own.items() if s is not None},
                               revolute=fit.joint.revolute))
    return found

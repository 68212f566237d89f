"""Arms and their exports, for the tests of export."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.dynamics.parameter import Parameter
from pipelines.dynamics.rrr import rigid_body
from pipelines.effects import find_effect
from pipelines.estimation.consistency import Links, consistent_links
from pipelines.export.states import course
from pipelines.export.target import Held, Target, folded, held_by
from pipelines.export_model import TARGETS
from pipelines.io.robot import RobotDescription


def arm_of(robot: RobotDescription, phi: np.ndarray) -> Arm:
    """The rigid arm of standard parameters phi (10 joints,)."""
    body = rigid_body(robot)
    p = body.combine @ phi
    named = zip(body.parameters, p, strict=True)
    return Arm(robot.name, body, tuple(Parameter(k.name, float(v), None, k.unit) for k, v in named))


def caused(name: str, joint: int | None, **values: float) -> Acting:
    """A cause with these numbers; all others are zero or as by default."""
    effect = find_effect(name)(joint=joint)
    zeros = {q.name: float(getattr(effect, q.name)) if q.shape else 0.0 for q in effect.parameters}
    return Acting.of(effect, zeros | values)


def with_exact(arm: Arm) -> Arm:
    """The arm with what URDF and MJCF hold exactly: viscous friction and rotor inertia everywhere."""
    joints = range(1, arm.n_joints + 1)
    return replace(arm, friction=tuple(caused("viscous", j, coefficient=0.2 * j) for j in joints),
                   effects=tuple(caused("rotor_inertia", j, inertia=0.1 * j) for j in joints))


@dataclass(frozen=True, eq=False)
class Exported:
    """An arm in a target."""

    target: Target
    arm: Arm  # folded
    links: Links
    held: Held
    texts: dict[str, str]
    notes: tuple[str, ...]

    def torque(self, motion: Motion) -> np.ndarray:
        """What the target makes of the text."""
        loaded = self.target.load(self.texts, self.held, motion)
        assert loaded is not None
        assert not loaded.says
        return loaded.torque


def exported(arm: Arm, to: str) -> Exported:
    """An arm written for a target."""
    target, flat = TARGETS[to](), folded(arm)
    links = consistent_links(flat.body, flat.p, np.full((len(flat.p),) * 2, np.nan))
    motion = course(arm.robot, None)
    held = held_by(target, flat, links, motion, motion)
    texts, notes = target.write(held)
    return Exported(target, flat, links, held, texts, (*held.notes, *notes))


def off(found: np.ndarray, wanted: np.ndarray) -> float:
    """The largest difference of torque, by the largest torque of its joint."""
    return float((np.abs(found - wanted).max(axis=0) / np.abs(wanted).max(axis=0)).max())

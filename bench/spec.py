"""A plan as a MuJoCo model: no contact, no limit, no friction of MuJoCo's own; springs and dampers where a plan has them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from bench.plan import Plan
from bench.solid import Solid, disc
from pipelines.io.experiment import Array

__all__ = ["Built", "build"]

_LIGHT = 1e-9  # [kg] of a motor's disc: its mass stays with the link
_OFF = (mujoco.mjtDisableBit.mjDSBL_CONTACT, mujoco.mjtDisableBit.mjDSBL_CONSTRAINT, mujoco.mjtDisableBit.mjDSBL_LIMIT,
        mujoco.mjtDisableBit.mjDSBL_EQUALITY, mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS, mujoco.mjtDisableBit.mjDSBL_AUTORESET)


@dataclass(frozen=True, eq=False)
class Built:
    """A compiled model and where its degrees of freedom are. Every joint has one, so position and speed share an index."""

    model: Any  # mujoco.MjModel
    dofs: dict[str, int]  # "joint 1", "twist 1", "base 1", and the names of mobilities
    joints: tuple[int, ...]  # where torque acts and encoders read
    tip_body: int
    tip: Array  # (3,) [m] in that body's frame


def build(plan: Plan, time_step: float) -> Built:
    """Compile `plan` for steps of `time_step` [s] with RK4."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = time_step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.gravity = plan.gravity
    spec.option.disableflags = int(np.bitwise_or.reduce([int(flag) for flag in _OFF]))
    bodies = _chain(spec, plan)
    for extra in plan.attached:
        _attach(bodies[extra.joint], extra)
    for number, shaft in enumerate(plan.shafts, start=1):
        rotor = spec.add_tendon(name=f"shaft {number}", armature=shaft.inertia)
        for index in shaft.joints:
            rotor.wrap_joint(f"joint {index + 1}", 1.0)
    bodies[-1].name = "tip"
    model = spec.compile()
    names = [model.joint(i).name for i in range(model.njnt)]
    dofs = {name: int(model.joint(name).dofadr[0]) for name in names}
    return Built(model, dofs, tuple(dofs[f"joint {j + 1}"] for j in range(len(plan.joints))), int(model.body("tip").id), plan.tip)


def _chain(spec: Any, plan: Plan) -> list[Any]:
    """The bodies of the arm, one a joint, each on the one before."""
    parent = spec.worldbody
    for number, base in enumerate(plan.bases, start=1):
        parent = _body(parent, np.eye(3), np.zeros(3), Solid(1.0, np.zeros(3), base.inertia * np.eye(3)))
        _joint(parent, f"base {number}", base.axis, True, base.stiffness, base.damping)
    bodies = []
    for number, joint in enumerate(plan.joints, start=1):
        solid, place = joint.solid, (joint.rotation, joint.position)
        if joint.twist is None:
            parent = _body(parent, *place, solid)
            _joint(parent, f"joint {number}", joint.axis, joint.revolute, armature=joint.armature)
        else:
            turning = joint.twist.motor_inertia
            if joint.revolute:
                motor, rest = Solid(_LIGHT, np.zeros(3), disc(joint.axis, turning)), solid.without_disc(joint.axis, turning)
            else:  # a slide: the motor is a mass, spread as the link is
                share = turning / solid.mass
                motor, rest = (Solid(part * solid.mass, solid.com, part * solid.inertia) for part in (share, 1.0 - share))
            shaft = _body(parent, *place, motor)
            _joint(shaft, f"joint {number}", joint.axis, joint.revolute, armature=joint.armature)
            parent = _body(shaft, np.eye(3), np.zeros(3), rest)
            _joint(parent, f"twist {number}", joint.axis, joint.revolute, joint.twist.stiffness, joint.twist.damping)
        bodies.append(parent)
    return bodies


def _attach(parent: Any, extra: Any) -> None:
    if extra.solid.mass <= 0.0:
        return
    pivot = np.zeros(3) if extra.pivot is None else extra.pivot
    solid = Solid(extra.solid.mass, extra.solid.com - pivot, extra.solid.inertia)
    body = _body(parent, np.eye(3), pivot, solid)
    if extra.mobility is not None:
        free = extra.mobility
        _joint(body, free.name, free.axis, free.revolute, free.stiffness, free.damping)


def _body(parent: Any, rotation: Array, position: Array, solid: Solid) -> Any:
    """A body with its inertia along principal axes, found here: MuJoCo's own eigenvectors are less exact."""
    moments, axes = np.linalg.eigh(solid.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    return parent.add_body(pos=position, quat=_quaternion(rotation), mass=solid.mass, ipos=solid.com, iquat=_quaternion(axes),
                           inertia=moments, explicitinertial=True)


def _joint(body: Any, name: str, axis: Array, revolute: bool, stiffness: float = 0.0, damping: float = 0.0,
           armature: float = 0.0) -> None:
    kind = mujoco.mjtJoint.mjJNT_HINGE if revolute else mujoco.mjtJoint.mjJNT_SLIDE
    joint = body.add_joint(name=name, type=kind, axis=axis, armature=armature)
    # Newer versions of MuJoCo take a polynomial, its linear coefficient first.
    joint.stiffness = [stiffness, 0.0, 0.0] if np.ndim(joint.stiffness) else stiffness
    joint.damping = [damping, 0.0, 0.0] if np.ndim(joint.damping) else damping


def _quaternion(rotation: Array) -> Array:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion / np.linalg.norm(quaternion)

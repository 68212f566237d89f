"""The plan as a MuJoCo model, and rigid-body dynamics by it for gains, limits and feed-forward."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from bench.config import CONFIG
from bench.plan import Plan, PlannedJoint, Solid, disc, plan_of
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription


@dataclass(frozen=True, eq=False)
class Built:
    """A compiled model. Each joint has one degree of freedom: q and v share an index."""

    model: Any  # mujoco.MjModel
    dofs: dict[str, int]  # "joint 1", "twist 1", "base 1", and the names of mobilities
    joints: tuple[int, ...]  # where torque acts and encoders read
    tip_body: int
    tip: Array  # (3,) [m] in that body's frame


def build(plan: Plan, time_step: float) -> Built:
    """Compile `plan` for steps of `time_step` [s] with RK4.

    There is no contact, no limit and no friction of MuJoCo's own; springs and dampers where a plan
    has them.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = time_step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.gravity = plan.gravity
    switched_off = ("CONTACT", "CONSTRAINT", "LIMIT", "EQUALITY", "FRICTIONLOSS", "AUTORESET")
    bits = [int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")) for name in switched_off]
    spec.option.disableflags = int(np.bitwise_or.reduce(bits))
    parent = spec.worldbody
    for number, base in enumerate(plan.bases, start=1):
        parent = _body(
            parent, np.eye(3), np.zeros(3), Solid(1.0, np.zeros(3), base.inertia * np.eye(3))
        )
        _add_joint(parent, f"base {number}", base.axis, True, (base.stiffness, base.damping))
    bodies = []
    for number, joint in enumerate(plan.joints, start=1):
        parent = _link(parent, number, joint)
        bodies.append(parent)
    for extra in plan.attached:
        if extra.solid.mass <= 0.0:
            continue
        pivot = np.zeros(3) if extra.pivot is None else extra.pivot
        solid = Solid(extra.solid.mass, extra.solid.com - pivot, extra.solid.inertia)
        body, free = _body(bodies[extra.joint], np.eye(3), pivot, solid), extra.mobility
        if free is not None:
            _add_joint(body, free.name, free.axis, free.revolute, (free.stiffness, free.damping))
    for number, shaft in enumerate(plan.shafts, start=1):
        rotor = spec.add_tendon(name=f"shaft {number}", armature=shaft.inertia)
        for index in shaft.joints:
            rotor.wrap_joint(f"joint {index + 1}", 1.0)
    bodies[-1].name = "tip"
    model = spec.compile()
    names = [model.joint(i).name for i in range(model.njnt)]
    dofs = {name: int(model.joint(name).dofadr[0]) for name in names}
    joints = tuple(dofs[f"joint {j + 1}"] for j in range(len(plan.joints)))
    return Built(model, dofs, joints, int(model.body("tip").id), plan.tip)


def _link(parent: Any, number: int, joint: PlannedJoint) -> Any:
    """Add the body of one joint, or motor and link apart from each other; return the link."""
    solid, twist = joint.solid, joint.twist
    if twist is None:
        body = _body(parent, joint.rotation, joint.position, solid)
        _add_joint(body, f"joint {number}", joint.axis, joint.revolute, armature=joint.armature)
        return body
    turning = twist.motor_inertia
    if joint.revolute:
        motor = Solid(CONFIG.motor_mass, np.zeros(3), disc(joint.axis, turning))
        rest = solid.without_disc(joint.axis, turning)
    else:  # a slide: the motor is a mass, spread as the link is
        share = turning / solid.mass
        motor = Solid(share * solid.mass, solid.com, share * solid.inertia)
        rest = Solid((1.0 - share) * solid.mass, solid.com, (1.0 - share) * solid.inertia)
    shaft = _body(parent, joint.rotation, joint.position, motor)
    _add_joint(shaft, f"joint {number}", joint.axis, joint.revolute, armature=joint.armature)
    body = _body(shaft, np.eye(3), np.zeros(3), rest)
    _add_joint(
        body, f"twist {number}", joint.axis, joint.revolute, (twist.stiffness, twist.damping)
    )
    return body


def _body(parent: Any, rotation: Array, position: Array, solid: Solid) -> Any:
    """Add a body, its principal axes found here: MuJoCo's own eigenvectors are less exact."""
    moments, axes = np.linalg.eigh(solid.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    return parent.add_body(
        pos=position,
        quat=_quaternion(rotation),
        mass=solid.mass,
        ipos=solid.com,
        iquat=_quaternion(axes),
        inertia=moments,
        explicitinertial=True,
    )


def _quaternion(rotation: Array) -> Array:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion / np.linalg.norm(quaternion)


def _add_joint(
    body: Any,
    name: str,
    axis: Array,
    revolute: bool,
    spring: tuple[float, float] = (0.0, 0.0),
    armature: float = 0.0,
) -> None:
    """Let `body` move about or along `axis` (3,), with the stiffness and damping of `spring`."""
    kind = mujoco.mjtJoint.mjJNT_HINGE if revolute else mujoco.mjtJoint.mjJNT_SLIDE
    joint = body.add_joint(name=name, type=kind, axis=axis, armature=armature)
    stiffness, damping = spring
    # Newer versions of MuJoCo take a polynomial, its linear coefficient first.
    joint.stiffness = [stiffness, 0.0, 0.0] if np.ndim(joint.stiffness) else stiffness
    joint.damping = [damping, 0.0, 0.0] if np.ndim(joint.damping) else damping


class RigidDynamics:
    """D(q) ddq + c(q, dq) + h(q) of a robot with described links; not for two threads at once."""

    def __init__(self, robot: RobotDescription) -> None:
        built = build(plan_of(robot), 1e-3)
        self._model = built.model
        self._data = mujoco.MjData(built.model)
        self._out = np.zeros((3, built.model.nv))

    def mass_matrix(self, q: Array) -> Array:
        """Return D (n, n) [kg m^2] at `q` (n,)."""
        self._data.qpos[:] = q
        mujoco.mj_fwdPosition(self._model, self._data)
        columns = np.zeros((self._model.nv, self._model.nv))
        for column, unit in zip(columns, np.eye(self._model.nv), strict=True):
            mujoco.mj_mulM(self._model, self._data, column, unit)
        return columns

    def parts(
        self, q: list[float], dq: list[float], ddq: list[float]
    ) -> tuple[list[float], list[float], list[float]]:
        """Return D ddq, c and h of one sample [N m], each a list of n."""
        model, data, (inertia, bias, gravity) = self._model, self._data, self._out
        data.qpos[:] = q
        data.qvel[:] = 0.0
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, gravity)
        data.qvel[:] = dq
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, bias)
        mujoco.mj_mulM(model, data, inertia, np.asarray(ddq, dtype=np.float64))
        return inertia.tolist(), (bias - gravity).tolist(), gravity.tolist()

    def gravity(self, q: Array) -> list[float]:
        """Return h of `q` (n,) [N m], a list of n."""
        still = [0.0] * len(q)
        return self.parts(q.tolist(), still, still)[2]

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torque (samples, n) [N m] along a motion, each argument (samples, n)."""
        model, data, out = self._model, self._data, np.zeros(np.shape(q))
        position, speed, acceleration = data.qpos, data.qvel, data.qacc
        for row, q_k, dq_k, ddq_k in zip(out, q, dq, ddq, strict=True):
            position[:], speed[:], acceleration[:] = q_k, dq_k, ddq_k
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            mujoco.mj_rne(model, data, 1, row)
        return out


def _postures(robot: RobotDescription) -> Array:
    """Return 60 postures (60, n) all over the joints' ranges, the same for the same ranges."""
    rng = np.random.default_rng(7)
    low, high = np.array([joint.position for joint in robot.joints]).T
    reach = np.array([np.pi if joint.revolute else 0.3 for joint in robot.joints])
    low, high = np.maximum(low, -reach), np.minimum(high, reach)
    return np.asarray(low + (high - low) * rng.random((60, robot.n_joints)))


def typical_inertia(robot: RobotDescription) -> tuple[float, ...]:
    """Return the mean over postures of the diagonal of D [kg m^2], other joints held."""
    rigid = RigidDynamics(robot)
    return tuple(
        np.mean([np.diag(rigid.mass_matrix(q)) for q in _postures(robot)], axis=0).tolist()
    )


def typical_torque(robot: RobotDescription, acceleration: float) -> tuple[float, ...]:
    """Return the largest over postures of gravity plus own inertia at `acceleration` [N m]."""
    rigid = RigidDynamics(robot)
    needed = [
        np.abs(rigid.gravity(q)) + np.diag(rigid.mass_matrix(q)) * acceleration
        for q in _postures(robot)
    ]
    return tuple(np.max(needed, axis=0).tolist())


def motor_share(robot: RobotDescription, index: int) -> float:
    """Return the inertia [kg m^2] (a slide: kg) of joint `index` that moves with its motor."""
    joint = plan_of(robot).joints[index]
    if not joint.revolute:
        return CONFIG.motor_share * joint.solid.mass
    return joint.solid.largest_disc(joint.axis, CONFIG.motor_share * joint.solid.about(joint.axis))

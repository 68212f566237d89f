"""Rigid-body dynamics of a robot by MuJoCo: mass matrix and inverse dynamics, for gains, limits and feed-forward."""

from __future__ import annotations

import mujoco
import numpy as np

from bench.plan import plan_of
from bench.spec import build
from pipelines.io.experiment import Array
from pipelines.io.robot import RobotDescription

__all__ = ["RigidDynamics", "motor_share", "typical_inertia", "typical_torque"]

_MOTOR_SHARE = 0.2  # of the link's own inertia about its axis, at most


class RigidDynamics:
    """D(q) ddq + c(q, dq) + h(q) of a robot whose links are described; not for two threads at once."""

    def __init__(self, robot: RobotDescription) -> None:
        built = build(plan_of(robot), 1e-3)
        self._model = built.model
        self._data = mujoco.MjData(built.model)
        self._out = np.zeros((3, built.model.nv))

    def mass_matrix(self, q: Array) -> Array:
        """D (n, n) [kg m^2]."""
        self._data.qpos[:] = q
        mujoco.mj_fwdPosition(self._model, self._data)
        columns = np.zeros((self._model.nv, self._model.nv))
        for column, unit in zip(columns, np.eye(self._model.nv), strict=True):
            mujoco.mj_mulM(self._model, self._data, column, unit)
        return columns

    def parts(self, q: list[float], dq: list[float], ddq: list[float]) -> tuple[list[float], list[float], list[float]]:
        """D ddq, c and h of one sample [N m], each a list of n."""
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

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torque (samples, n) [N m] along a motion, each argument (samples, n)."""
        model, data, out = self._model, self._data, np.zeros(np.shape(q))
        position, speed, acceleration = data.qpos, data.qvel, data.qacc
        for row, q_k, dq_k, ddq_k in zip(out, q, dq, ddq, strict=True):
            position[:], speed[:], acceleration[:] = q_k, dq_k, ddq_k
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            mujoco.mj_rne(model, data, 1, row)
        return out


def _postures(robot: RobotDescription, number: int) -> Array:
    """Postures all over the joints' ranges, (number, n); the same for every robot of the same ranges."""
    rng = np.random.default_rng(7)
    low, high = np.array([joint.position for joint in robot.joints]).T
    reach = np.array([np.pi if joint.revolute else 0.3 for joint in robot.joints])
    low, high = np.maximum(low, -reach), np.minimum(high, reach)
    return np.asarray(low + (high - low) * rng.random((number, robot.n_joints)))


def typical_inertia(robot: RobotDescription) -> tuple[float, ...]:
    """Mean over postures of the diagonal of D [kg m^2], what a motor feels when the other joints are held."""
    rigid = RigidDynamics(robot)
    return tuple(np.mean([np.diag(rigid.mass_matrix(q)) for q in _postures(robot, 60)], axis=0).tolist())


def typical_torque(robot: RobotDescription, acceleration: float) -> tuple[float, ...]:
    """Largest over postures of gravity plus each joint's own inertia at `acceleration` [rad/s^2], [N m]."""
    rigid, still = RigidDynamics(robot), [0.0] * robot.n_joints
    found = [np.abs(rigid.parts(q.tolist(), still, still)[2]) + np.diag(rigid.mass_matrix(q)) * acceleration
             for q in _postures(robot, 60)]
    return tuple(np.max(found, axis=0).tolist())


def motor_share(robot: RobotDescription, index: int) -> float:
    """[kg m^2] (prismatic: kg) of the inertia of joint `index` that moves with its motor: at most what the link can spare."""
    joint = plan_of(robot).joints[index]
    if not joint.revolute:
        return _MOTOR_SHARE * joint.solid.mass
    return joint.solid.largest_disc(joint.axis, _MOTOR_SHARE * joint.solid.about(0.0 * joint.axis, joint.axis))

"""The same arm with other gravity, another length, or a body at its tip.

    tilted = with_gravity(body, gravity)
    p = carry_over(body, tilted) @ p            the same links, as far as torque tells them
    p = p + tip_parameters(body) @ [m, mx, my, mz, Ixx, …]        of a body held at the tip

Of the links behind base parameters those are taken that are zero where torque tells nothing: what
another choice would change lies in the span of the other body's regressor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.chain import inverse_dynamics, regressor, spatial_inertia
from pipelines.dynamics.kinematics import Placement, SerialChain, serial_chain
from pipelines.dynamics.rrr import rigid_body

__all__ = [
    "carry_over", "chain_of", "gravity_torque", "masses_beyond", "standard_of", "tip_parameters",
    "with_gravity", "with_longer_link"
]

_STATES = 40  # numerics: more rows than any arm has parameters
_STEP = 1e-3  # numerics: [m] of the difference by a length
_NONE = 1e-4  # numerics: of the largest: what rounding leaves


def chain_of(body: RigidBody) -> SerialChain:
    return body.chain if isinstance(body, BaseArm) else serial_chain(body.robot)


def _states(body: RigidBody) -> tuple[Array, Array, Array]:
    """Return random q, dq, ddq (states, joints)."""
    shape, rng = (_STATES, body.robot.n_joints), np.random.default_rng(7)
    return rng.uniform(-3.0, 3.0, shape), rng.normal(size=shape), rng.normal(size=shape)


def _in_base(body: RigidBody, torque: Array) -> Array:
    """Return the base parameters (parameters, k) with this torque (states, joints, k) there."""
    ours = body.regressor(*_states(body))
    flat = torque.reshape(-1, torque.shape[2])
    return np.asarray(np.linalg.lstsq(ours.reshape(len(flat), -1), flat, rcond=None)[0])


def standard_of(body: RigidBody, p: Array) -> Array:
    """Return standard parameters (10 · joints,) with the torques of p."""
    return np.asarray(body.links_behind @ p)


def with_gravity(body: RigidBody, gravity: Array) -> RigidBody:
    """Return the same arm under `gravity` (3,) [m/s^2]."""
    x, y, z = gravity.tolist()
    robot = replace(body.robot, gravity=(x, y, z))
    if isinstance(body, BaseArm):
        return BaseArm(robot, replace(body.chain, gravity=np.array(gravity)))
    return rigid_body(robot)


def with_longer_link(body: RigidBody, link: int, by: float) -> RigidBody:
    """Return the same arm, all beyond link `link` (1-based) `by` [m] further along it.

    Along x of its frame, of a URDF towards the next joint; the link's own body keeps its place.

    Raises:
        ValueError: nothing is beyond that link.
    """
    if not 1 <= link < body.robot.n_joints:
        raise ValueError(f"link {link} has no joint beyond it")
    if body.robot.convention == "urdf":
        chain = chain_of(body)
        step = chain.before[link].position
        length = float(np.linalg.norm(step))
        along = step / length if length else np.array([1.0, 0.0, 0.0])
        moved = Placement(chain.before[link].rotation, step + by * along)
        before = (*chain.before[:link], moved, *chain.before[link + 1:])
        return BaseArm(body.robot, replace(chain, before=before))
    place = link - 1 if body.robot.convention == "dh" else link  # whose a it is
    joints = list(body.robot.joints)
    joints[place] = replace(joints[place], a=joints[place].a + by)
    return rigid_body(replace(body.robot, joints=tuple(joints)))


def carry_over(body: RigidBody, other: RigidBody) -> Array:
    """Return the base parameters of the same links in the other arm, as a matrix by those of
    body."""
    shifted = _shifted(chain_of(body), chain_of(other))
    return np.asarray(other.combine @ shifted @ body.links_behind)


def masses_beyond(body: RigidBody, link: int) -> Array:
    """Return directions (parameters, k) of base parameters that a longer link moves, beyond others.

    By masses of the links behind it that the base parameters of the arm as described do not tell.
    """
    _, size, directions = np.linalg.svd(body.combine)
    untold = directions[int(np.sum(size > 1e-9 * size[0])):].T

    def torque(by: float) -> Array:
        chain = chain_of(with_longer_link(body, link, by))
        moved = _shifted(chain_of(body), chain) @ untold
        return np.asarray(regressor(chain, *_states(body)) @ moved)

    moved = _in_base(body, (torque(_STEP) - torque(-_STEP)) / (2.0 * _STEP))
    found, size, _ = np.linalg.svd(moved, full_matrices=False)
    return np.asarray(found[:, size > _NONE * max(float(size.max(initial=0.0)), _NONE)])


def _shifted(chain: SerialChain, other: SerialChain) -> Array:
    """Return the parameters of the same bodies in the other's link frames, a matrix (10 n, 10
    n)."""
    n = chain.n_joints
    out = np.zeros((10 * n, 10 * n))
    for i, (one, two) in enumerate(zip(chain.after, other.after, strict=True)):
        own = slice(10 * i, 10 * i + 10)
        out[own, own] = _moved(one.rotation.T @ (one.position - two.position))
    return out


def _moved(by: Array) -> Array:
    """Return (10, 10): parameters about a point from which the old origin is `by` (3,) [m].

    M' = Xᵀ M X, X what carries a twist about the point to the old origin.
    """
    x = Placement(np.eye(3), by).twist_matrix
    moved = np.array([x.T @ spatial_inertia(unit) @ x for unit in np.eye(10)])
    moment = [moved[:, 5, 5], moved[:, 2, 4], moved[:, 0, 5], moved[:, 1, 3]]  # m, h of h ×
    inertia = [moved[:, k, k] for k in range(3)]
    products = [-moved[:, i, j] for i, j in ((0, 1), (0, 2), (1, 2))]
    return np.array([*moment, *inertia, *products])


def tip_parameters(body: RigidBody) -> Array:
    """Return what each parameter of a body at the tip, in axes of the last frame, adds to p."""
    return np.asarray(body.combine[:, -10:] @ _moved(chain_of(body).tip))


def gravity_torque(body: RigidBody, q: Array, phi: Array, field: Array) -> Array:
    """Return the torque (samples, joints) at rest, of phi (10 · joints,) in a `field` (3,)."""
    still = np.zeros_like(q)
    return inverse_dynamics(chain_of(body), q, still, still, phi, field)

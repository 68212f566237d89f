"""The same arm with other gravity, another length, or a body at its tip.

Its base parameters are carried over.

    tilted = with_gravity(body, gravity)
    p = carry_over(body, tilted) @ p            the same links, as far as torque tells them
    p = p + tip_parameters(body) @ [m, mx, my, mz, Ixx, …]        of a body held at the tip

Which links lie behind base parameters is not known. Those taken have zero where torque tells
nothing; what another choice would change lies in the span of the other body's regressor, so that a
fit of its base parameters makes up for it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.chain import inverse_dynamics, regressor
from pipelines.dynamics.kinematics import Placement, SerialChain, serial_chain
from pipelines.dynamics.rrr import rigid_body

__all__ = [
    "carry_over", "chain_of", "gravity_torque", "masses_beyond", "standard_of", "tip_parameters",
    "with_gravity", "with_longer_link"
]

_STATES = 40  # numerics: more rows than any arm has parameters
_STEP = 1e-3  # numerics: [m] of the difference by a length
_NONE = 1e-4  # numerics: of the largest: what rounding leaves
_ROUNDED = 1e-12  # numerics: rounding
_MOMENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # numerics: xx … yz


def chain_of(body: RigidBody) -> SerialChain:
    return body.chain if isinstance(body, BaseArm) else serial_chain(body.robot)


def _standard_to_base(body: RigidBody) -> Array:
    """B (parameters, 10 · joints): base parameters p = B φ of standard parameters φ."""
    if isinstance(body, BaseArm):
        return body.base.combine
    found = _in_base(body, regressor(chain_of(body), *_states(body)))
    found[np.abs(found) < _ROUNDED] = 0.0
    return found


def _states(body: RigidBody) -> tuple[Array, Array, Array]:
    n, rng = body.robot.n_joints, np.random.default_rng(7)
    return rng.uniform(-3.0, 3.0,
                       (_STATES, n)), rng.normal(size=(_STATES, n)), rng.normal(size=(_STATES, n))


def _in_base(body: RigidBody, torque: Array) -> Array:
    """(parameters, columns).

    The base parameters that have these torques (states, joints, columns) at `_states`.
    """
    ours = body.regressor(*_states(body))
    return np.asarray(
        np.linalg.lstsq(ours.reshape(-1, ours.shape[2]), torque.reshape(-1, torque.shape[2]),
                        rcond=None)[0])


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

    Along x of its frame, of a URDF towards the next joint. The link's own body keeps its place on
    its axis.

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
        return BaseArm(
            body.robot,
            replace(chain, before=(*chain.before[:link], moved, *chain.before[link + 1:])))
    place = link - 1 if body.robot.convention == "dh" else link  # whose a it is
    joints = list(body.robot.joints)
    joints[place] = replace(joints[place], a=joints[place].a + by)
    return rigid_body(replace(body.robot, joints=tuple(joints)))


def carry_over(body: RigidBody, other: RigidBody) -> Array:
    """(parameters of other, parameters of body).

    Base parameters of the same links in the other arm.
    """
    return np.asarray(
        _standard_to_base(other) @ _shifted(chain_of(body), chain_of(other)) @ body.links_behind)


def masses_beyond(body: RigidBody, link: int) -> Array:
    """(parameters, k).

    The directions in which a longer link `link` moves the base parameters beyond `carry_over`, by
    masses of the links behind it that the base parameters of the arm as described do not tell.
    """
    bare = _standard_to_base(body)
    _, size, directions = np.linalg.svd(bare)
    untold = directions[int(np.sum(size > 1e-9 * size[0])):].T

    def torque(by: float) -> Array:
        chain = chain_of(with_longer_link(body, link, by))
        return np.asarray(
            regressor(chain, *_states(body)) @ _shifted(chain_of(body), chain) @ untold)

    moved = _in_base(body, (torque(_STEP) - torque(-_STEP)) / (2.0 * _STEP))
    found, size, _ = np.linalg.svd(moved, full_matrices=False)
    return np.asarray(found[:, size > _NONE * max(float(size.max(initial=0.0)), _NONE)])


def _shifted(chain: SerialChain, other: SerialChain) -> Array:
    """(10 · joints, 10 · joints).

    Parameters of the same bodies, at the same places on their axes, in the other's link frames.
    """
    n = chain.n_joints
    out = np.zeros((10 * n, 10 * n))
    for i, (one, two) in enumerate(zip(chain.after, other.after, strict=True)):
        own = slice(10 * i, 10 * i + 10)
        out[own, own] = _moved(one.rotation.T @ (one.position - two.position))
    return out


def _moved(by: Array) -> Array:
    """(10, 10): parameters of a body about a point from which its old origin is `by` (3,) [m].

        h' = h + m r,   P' = P + h rᵀ + r hᵀ + m r rᵀ,   P = ∫ x xᵀ dm
    """
    if not by.any():
        return np.eye(10)
    out = np.zeros((10, 10))
    for k in range(10):
        unit = np.zeros(10)
        unit[k] = 1.0
        m, h, second = unit[0], unit[1:4], _second_moments(unit[4:])
        second = second + np.outer(h, by) + np.outer(by, h) + m * np.outer(by, by)
        out[:, k] = (m, *(h + m * by), *_inertia(second))
    return out


def _second_moments(inertia: Array) -> Array:
    """P (3, 3) = ∫ x xᵀ dm of Ixx Iyy Izz Ixy Ixz Iyz, products with positive sign.

    P = ½ tr(I) 1 - I on the diagonal.
    """
    xx, yy, zz, xy, xz, yz = inertia
    half = 0.5 * (xx + yy + zz)
    return np.array([[half - xx, xy, xz], [xy, half - yy, yz], [xz, yz, half - zz]])


def _inertia(second: Array) -> Array:
    trace = np.trace(second)
    return np.array([(trace if i == j else 0.0) + (-1.0 if i == j else 1.0) * second[i, j]
                     for i, j in _MOMENTS])


def tip_parameters(body: RigidBody) -> Array:
    """(parameters, 10).

    What each standard parameter of a body at the tip, in axes of the last frame, adds to p.
    """
    chain = chain_of(body)
    return np.asarray(_standard_to_base(body)[:, -10:] @ _moved(chain.tip))


def gravity_torque(body: RigidBody, q: Array, phi: Array, field: Array) -> Array:
    """Return the torque (samples, joints) at rest, of phi (10 · joints,) in a `field` (3,)."""
    still = np.zeros_like(q)
    return inverse_dynamics(chain_of(body), q, still, still, phi, field)

"""Standard parameters of links that could exist, behind the base parameters of an arm.

Torque tells p = B φ alone. Of all φ with these p the one is taken that is nearest to the described
links in the log-determinant divergence, which no choice of frames or units changes (Lee & Park
2018; Lee, Wensing & Park 2020). Where no links have p, those are taken whose p is nearest to it in
standard deviations (`pipelines.estimation.consistency`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.altered import chain_of
from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.chain import STANDARD
from pipelines.dynamics.kinematics import SerialChain
from pipelines.estimation.config import UncertaintyConfig
from pipelines.estimation.consistency import (
    PSEUDO,
    barrier,
    closest,
    physical_consistency,
    pseudo_inertia,
    standard,
)
from pipelines.io.robot import RobotDescription, inconsistency_of_link

__all__ = ["Links", "carried", "consistent_links", "prior_links"]

_CONFIG = UncertaintyConfig()
_DEPENDENT = 1e-9  # numerics: rounding of a projection
_SINGULAR = 1e-12  # numerics: rounding of an eigenvalue of correlations
_UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)


@dataclass(frozen=True, eq=False)
class Links:
    """Standard parameters of all links, and where they come from.

    Each about a frame with the link's axes whose origin lies on its joint's axis, as targets have
    it: in DH a link's own frame lies at its other end.
    """

    phi: Array  # (joints, 10) in the order of dynamics.chain.STANDARD
    base: Array  # B (base parameters, 10 joints)
    covariance: Array  # (10 joints, 10 joints) of what the logs tell; NaN where nothing is known
    exact: bool  # the base parameters are met; else those of the nearest links that could exist
    distance: float  # [standard deviations] from the base parameters
    conflicts: tuple[str, ...]  # joints whose links keep them apart; none within the uncertainty
    origin: tuple[str, ...]  # of each parameter: "logs", "description", "assumed", or "logs and …"

    @property
    def names(self) -> tuple[str, ...]:
        """Return "m1", "mx1", … of all parameters."""
        return tuple(f"{name}{i + 1}" for i in range(len(self.phi)) for name in STANDARD)

    @property
    def std(self) -> Array:
        """Return their standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def units(self) -> tuple[str, ...]:
        """Return their units."""
        return _UNITS * len(self.phi)


def prior_links(robot: RobotDescription) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
    """Return pseudo-inertias (joints, 4, 4) to stay near to, joints without one, impossible ones.

    A link that nothing describes is a ball; of one that could not exist what is possible is kept.
    """
    ball = np.diag([_CONFIG.mass * _CONFIG.radius**2 / 5.0] * 3 + [_CONFIG.mass])
    found, assumed, impossible = [], [], []
    for joint in robot.joints:
        link = joint.link
        if link is None or link.mass <= 0.0:
            assumed.append(joint.name)
            found.append(ball)
            continue
        phi = np.array([link.mass, *(link.mass * c for c in link.com), *link.inertia])
        own = pseudo_inertia(phi[None])[0]
        center = np.eye(4)
        center[:3, 3] = link.com
        about = np.linalg.inv(center) @ own @ np.linalg.inv(center).T
        values, axes = np.linalg.eigh(about[:3, :3])
        if inconsistency_of_link(link):
            impossible.append(joint.name)
        # a point or a rod of mathematics has no width: a thousandth of the ball's is given to it
        least = _CONFIG.thin * max(float(values.max()), link.mass * _CONFIG.radius**2 / 5.0)
        about[:3, :3] = axes @ np.diag(np.maximum(values, least)) @ axes.T
        about[:3, 3] = about[3, :3] = 0.0
        found.append(center @ about @ center.T)
    return np.array(found), tuple(assumed), tuple(impossible)


def consistent_links(body: RigidBody, p: Array, covariance: Array) -> Links:
    """Return links that could exist and have the base parameters `p`, or the nearest to them.

    Args:
        p: (k,) base parameters.
        covariance: (k, k); not finite where nothing is known.
    """
    prior, assumed, _ = prior_links(body.robot)
    moved = _onto_axes(chain_of(body))
    base = body.combine @ np.linalg.inv(moved)
    prior = pseudo_inertia((moved @ standard(prior)).reshape(-1, 10))
    variance = np.diag(covariance)
    usual = _CONFIG.relative * max(float(np.abs(p).max()), 1e-9)
    weighed = np.diag(np.where(variance > 0.0, variance, usual**2))
    if np.isfinite(covariance).all() and (variance > 0.0).all():
        weighed = covariance
    whiten = 1.0 / np.sqrt(np.diag(weighed))
    a, b = whiten[:, None] * base, whiten * p
    phi = closest(a, b, prior)
    distance, conflicts, exact = 0.0, tuple[int, ...](), phi is not None
    if phi is None:
        nearest = physical_consistency(p, weighed, base, prior)
        phi, conflicts = nearest.inner.ravel(), nearest.violating
        # rootᵀ root = C⁻¹, or C⁺ where C is singular
        values, axes = np.linalg.eigh(weighed * whiten * whiten[:, None])
        kept = values > _SINGULAR * values.max()
        root = (axes[:, kept] / np.sqrt(values[kept])).T * whiten
        distance = float(np.linalg.norm(root @ (base @ phi - p)))
    # how φ moves with p, all else held: the shortest way in the metric at the described links
    across = np.einsum(
        "kia,iab->kib", a.reshape(len(a), -1, 10), barrier(standard(prior), prior)[2]
    )
    across = across.reshape(len(a), -1)
    onto = across.T @ np.linalg.inv(across @ a.T)
    names = [joint.name for joint in body.robot.joints]
    return Links(
        phi.reshape(-1, 10),
        base,
        carried(covariance, onto * whiten),
        exact,
        distance,
        tuple(names[i] for i in conflicts),
        tuple(_origins(base, [name in assumed for name in names])),
    )


def carried(covariance: Array, slope: Array) -> Array:
    """Return S C Sᵀ (n, n) of a slope S (n, k); NaN where what is not known has a part in it."""
    unknown = ~np.isfinite(np.diag(covariance))
    found = slope @ np.where(np.isfinite(covariance), covariance, 0.0) @ slope.T
    rows = (np.abs(slope[:, unknown]) > _DEPENDENT * np.abs(slope).max()).any(axis=1)
    found[rows], found[:, rows] = np.nan, np.nan
    return np.asarray(found)


def _onto_axes(chain: SerialChain) -> Array:
    """Return (10 joints, 10 joints): from the frames of the links to frames on their joints' axes.

    J' = T J Tᵀ with T the shift of the origin.
    """
    n = chain.n_joints
    out = np.zeros((10 * n, 10 * n))
    for i, after in enumerate(chain.after):
        shift = np.eye(4)
        shift[:3, 3] = after.rotation.T @ after.position
        block = slice(10 * i, 10 * i + 10)
        out[block, block] = standard(shift @ PSEUDO @ shift.T).reshape(10, 10).T
    return out


def _origins(base: Array, assumed: list[bool]) -> list[str]:
    """Return of each standard parameter whether torque tells it, a part of it, or nothing."""
    told = np.diag(np.linalg.pinv(base) @ base)
    found = []
    for k, share in enumerate(told):
        other = "assumed" if assumed[k // 10] else "description"
        if share > 1.0 - _DEPENDENT:
            found.append("logs")
        else:
            found.append(other if share < _DEPENDENT else f"logs and {other}")
    return found

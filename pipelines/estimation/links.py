"""Standard parameters of links that could exist, behind the base parameters of an arm.

A rigid body exists exactly if its pseudo-inertia is positive definite (Wensing, Kim & Slotine 2018,
Theorem 1),

    J = [ Σ  h ]      Σ = ∫ r rᵀ dm,  h = ∫ r dm,  m = ∫ dm
        [ hᵀ m ]

Torque tells p = B φ alone. Of all φ with these p the one is taken that is nearest to the described
links in the log-determinant divergence, which no choice of frames or units changes (Lee & Park
2018; Lee, Wensing & Park 2020):

    minimise  Σ_i tr(J0_i⁻¹ J_i) - log det J_i     where  B φ = p

It is its own barrier. Where no links have p, those are taken whose p is nearest to it in standard
deviations (`pipelines.estimation.consistency`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.altered import chain_of
from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.chain import STANDARD
from pipelines.dynamics.kinematics import SerialChain
from pipelines.estimation.config import LinksConfig
from pipelines.estimation.consistency import physical_consistency, pseudo_inertia
from pipelines.io.robot import RobotDescription, inconsistency_of_link

__all__ = ["Links", "carried", "consistent_links", "prior_links"]

_CONFIG = LinksConfig()
_STEPS = 300  # numerics: Newton steps at most; thirty are usual
_CLOSE, _WAY = 0.3, 0.6  # numerics: size of a step back, and share of the way ahead
_STUCK = 3e-4  # numerics: of the way; where less of it is left at each step there is no more
_SETTLED = 1e-9  # numerics: Newton decrement, where the search ends
_DEPENDENT = 1e-9  # numerics: rounding of a projection
_SINGULAR = 1e-12  # numerics: rounding of an eigenvalue of correlations
_UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)
# J = Σ_k _PSEUDO[k] φ_k
_PSEUDO = np.array([pseudo_inertia(row[None])[0] for row in np.eye(10)])
_AT_ONE = np.linalg.inv(np.einsum("kab,lba->kl", _PSEUDO, _PSEUDO))  # inverse Hessian at J = 1


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
    prior = pseudo_inertia((moved @ _standard(prior)).reshape(-1, 10))
    variance = np.diag(covariance)
    usual = _CONFIG.relative * max(float(np.abs(p).max()), 1e-9)
    weighed = np.diag(np.where(variance > 0.0, variance, usual**2))
    if np.isfinite(covariance).all() and (variance > 0.0).all():
        weighed = covariance
    whiten = 1.0 / np.sqrt(np.diag(weighed))
    # rootᵀ root = C⁻¹, or C⁺ where C is singular
    values, axes = np.linalg.eigh(weighed * whiten * whiten[:, None])
    kept = values > _SINGULAR * values.max()
    root = (axes[:, kept] / np.sqrt(values[kept])).T * whiten
    a, b = whiten[:, None] * base, whiten * p
    described = _standard(prior)
    phi, exact = _closest(a, b, prior)
    nearest = None if exact else physical_consistency(p, weighed, base)
    if nearest is not None:
        # inside of what exists: towards the described links as far as it costs little
        far = float(np.linalg.norm(a @ described - whiten * nearest.nearest))
        share = min(_CONFIG.inside * (nearest.distance + 1.0) / far, 0.5)
        inner = (1.0 - share) * nearest.parameters.ravel() + share * described
        phi, met = _closest(a, a @ inner, prior)
        phi = phi if met else inner
    inverse = _barrier(described, _pull(prior))[1]
    # how φ moves with p, all else held: the shortest way in the metric at the described links
    onto = inverse @ a.T @ np.linalg.inv(a @ inverse @ a.T)
    spread = carried(covariance, onto * whiten)
    names = [joint.name for joint in body.robot.joints]
    return Links(
        phi.reshape(-1, 10),
        base,
        spread,
        exact,
        0.0 if exact else float(np.linalg.norm(root @ (base @ phi - p))),
        () if nearest is None else tuple(names[i] for i in nearest.violating),
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
        out[block, block] = _standard(shift @ _PSEUDO @ shift.T).reshape(10, 10).T
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


def _closest(a: Array, b: Array, prior: Array) -> tuple[Array, bool]:
    """Return φ with a φ = b at the least divergence from the described links, and whether there is.

    Where there are such φ, there are some on all of the line from the described a φ0 to b. Newton's
    method goes along it: most of the way to where a body ceases to exist, then back to the least
    divergence at that place.
    """
    phi, pull, back, before = _standard(prior), _pull(prior), np.linalg.pinv(a), 0.0
    described = phi
    for _ in range(_STEPS):
        gradient, inverse = _barrier(phi, pull)
        across, off = a @ inverse, b - a @ phi
        both = np.stack([across @ gradient, off], axis=1)
        schur = across @ a.T
        size = np.sqrt(np.diag(schur))[:, None]
        sideways, ahead = (
            across.T @ (np.linalg.solve(schur / size / size.T, both / size) / size)
        ).T
        sideways = sideways - inverse @ gradient
        sideways -= back @ (a @ sideways)
        ahead += back @ (off - a @ ahead)
        far = float(np.linalg.norm(_changes(phi, sideways)))
        room = 1.0 / max(-float(_changes(phi, ahead).min()), _SETTLED)
        step = sideways / (1.0 + far)
        if far < _CLOSE:
            if room < before and room < _STUCK:  # the way ends at the boundary
                break
            before, step = room, sideways + min(1.0, _WAY * room) * ahead
        if not _changes(described, phi + step).min() > _SETTLED:
            break  # so close to the boundary rounding leaves no step
        phi = phi + step
        if _WAY * room >= 1.0 and far**2 < _SETTLED:
            return phi, True
    return phi, False


def _changes(phi: Array, step: Array) -> Array:
    """Return the eigenvalues of a step against J, a body ceases to exist at -1."""
    inverse = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(phi.reshape(-1, 10))))
    change = pseudo_inertia(step.reshape(-1, 10))
    return np.asarray(np.linalg.eigvalsh(inverse @ change @ inverse.transpose(0, 2, 1)))


def _pull(prior: Array) -> Array:
    """Return tr(J0⁻¹ M_k) (10 joints,)."""
    return np.asarray(np.einsum("iab,kba->ik", np.linalg.inv(prior), _PSEUDO).ravel())


def _barrier(phi: Array, pull: Array) -> tuple[Array, Array]:
    """Return the gradient tr(J0⁻¹ M_k) - tr(J⁻¹ M_k), and the inverse of the Hessian.

    The Hessian is tr(J⁻¹ M_k J⁻¹ M_l): with J = T Tᵀ that of J = 1, seen through T.
    """
    inverse, gradient = np.zeros((phi.size, phi.size)), pull.copy()
    for i, own in enumerate(pseudo_inertia(phi.reshape(-1, 10))):
        triangle, block = np.linalg.cholesky(own), slice(10 * i, 10 * i + 10)
        gradient[block] -= np.einsum("ab,kba->k", np.linalg.inv(own), _PSEUDO)
        through = _standard(triangle @ _PSEUDO @ triangle.T).reshape(10, 10).T
        inverse[block, block] = through @ _AT_ONE @ through.T
    return gradient, inverse


def _standard(inertia: Array) -> Array:
    """Return the standard parameters (10 joints,) of pseudo-inertias (joints, 4, 4)."""
    rows = _PSEUDO.reshape(10, 16)
    found = np.linalg.lstsq(rows.T, inertia.reshape(-1, 16).T, rcond=None)[0]
    return np.asarray(found.T.ravel())

"""Decide whether bodies that could exist explain the estimates; find links that do.

A rigid body's ten parameters are those of some distribution of mass exactly if its pseudo-inertia
is positive semidefinite (Wensing, Kim & Slotine 2018, Theorem 1):

    J = [ Σ  h ]      Σ = ∫ r rᵀ dm,  h = ∫ r dm,  m = ∫ dm
        [ hᵀ m ]

Consistent is an estimate for which bodies exist whose β lies within its covariance (Sousa &
Cortesão 2014):

    minimise  ½ (β̂ - L φ)ᵀ C⁻¹ (β̂ - L φ)    over φ with every J_i(φ_i) ⪰ 0

A barrier method solves it (Boyd & Vandenberghe 2004, section 11.3). Its barrier is the divergence
ε Σ_i tr(J0_i⁻¹ J_i) - log det J_i from bodies J0, which no choice of frames or units changes (Lee &
Park 2018). Of all links that have this β those nearest to the described ones in it are taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.altered import chain_of
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.chain import STANDARD
from pipelines.dynamics.kinematics import SerialChain
from pipelines.estimation.config import UncertaintyConfig
from pipelines.estimation.estimate import Estimate
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription, inconsistency_of_link

_CONFIG = UncertaintyConfig()
_STEPS = 400  # numerics: of Newton's method at most; fifty are usual
_SHRINK = 30.0  # numerics: of ε between two centres
_CENTRED = 0.05  # numerics: squared Newton decrement
_CLOSE, _WAY = 0.3, 0.6  # numerics: size of a step back, and share of the way ahead
_STUCK = 3e-4  # numerics: of the way; where less of it is left at each step there is no more
_SETTLED = 1e-9  # numerics: squared Newton decrement, where the search ends


@dataclass(frozen=True)
class Consistent:
    """Test whether links that could exist have the estimated parameters."""

    consistent: bool
    distance: float  # [standard deviations] to the nearest parameters that could
    violating: tuple[str, ...]  # links without whose condition they would


@dataclass(frozen=True, eq=False)
class Consistency:
    """How far an estimate is from what bodies can do."""

    consistent: bool
    distance: float  # standard deviations between the estimate and the nearest possible one
    nearest: Array  # (k,) the nearest possible β
    parameters: Array  # (bodies, 10) one set of bodies that has it; many do
    inner: Array  # (bodies, 10) bodies a tenth farther off, inside of what exists
    violating: tuple[int, ...]  # bodies without whose condition the estimate would be consistent


def consistency(found: Estimate, body: RigidBody) -> Consistent | None:
    """Return whether links could have these parameters.

    None where a parameter is not determined: nothing can be said of links then.
    """
    own = len(found.columns.kept)
    if not found.trusted[:own].all():
        return None
    covariance, combine = (
        found.robust.covariance[:own, :own],
        body.combine[list(found.columns.kept)],
    )
    answer = physical_consistency(found.beta[:own], covariance, combine)
    names = tuple(body.robot.joints[i].name for i in answer.violating)
    return Consistent(answer.consistent, answer.distance, names)


def _pseudo_map() -> Array:
    """(10, 4, 4): J = Σ_k map[k] φ_k for φ = m, mx, my, mz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz.

    About the origin, products positive: Σ_xx = (Iyy + Izz - Ixx)/2, Σ_xy = Ixy.
    """
    out = np.zeros((10, 4, 4))
    out[0, 3, 3] = 1.0
    for a in range(3):
        out[1 + a, a, 3] = out[1 + a, 3, a] = 1.0
        out[4:7, a, a] = 0.5
        out[4 + a, a, a] = -0.5
    for k, (a, b) in enumerate(((0, 1), (0, 2), (1, 2))):
        out[7 + k, a, b] = out[7 + k, b, a] = 1.0
    return out


PSEUDO = _pseudo_map()
_AT_ONE = np.linalg.inv(np.einsum("kab,lba->kl", PSEUDO, PSEUDO))  # inverse Hessian at J = 1
_BALL = np.diag([0.5, 0.5, 0.5, 1.0])


def pseudo_inertia(parameters: Array) -> Array:
    """Return J (bodies, 4, 4) of standard parameters (bodies, 10)."""
    return np.asarray((parameters @ PSEUDO.reshape(10, 16)).reshape(-1, 4, 4))


def standard(inertia: Array) -> Array:
    """Return the standard parameters (10 bodies,) of pseudo-inertias (bodies, 4, 4)."""
    flat = inertia.reshape(-1, 16) @ np.linalg.pinv(PSEUDO.reshape(10, 16))
    return np.asarray(flat.ravel())


def physical_consistency(
    beta: Array, covariance: Array, combine: Array, prior: Array | None = None
) -> Consistency:
    """Return whether bodies exist that reproduce `beta` within `covariance`.

    Args:
        beta: (k,) estimates.
        covariance: (k, k); an estimate with an infinite variance says nothing.
        combine: L (k, 10 · bodies), β = L φ.
        prior: J0 (bodies, 4, 4).
    """
    known = np.isfinite(np.diag(covariance))
    whiten = _whitener(covariance[np.ix_(known, known)])
    a, b = whiten @ combine[known], whiten @ beta[known]
    count = combine.shape[1] // 10
    prior = np.tile(_BALL, (count, 1, 1)) if prior is None else prior

    def away(phi: Array) -> float:
        return float(np.linalg.norm(a @ phi - b))

    path = _central_path(a, b, prior)
    phi, distance = path[-1], away(path[-1])
    inner = next(one for one in path if away(one) <= _CONFIG.inside * distance)
    violating: tuple[int, ...] = ()
    if distance > _CONFIG.limit:
        without = (away(_central_path(a, b, prior, free=i)[-1]) for i in range(count))
        enough = max(_CONFIG.limit, 0.5 * distance)
        violating = tuple(i for i, far in enumerate(without) if far <= enough)
        violating = violating or tuple(range(count))
    return Consistency(
        distance <= _CONFIG.limit,
        distance,
        combine @ phi,
        phi.reshape(count, 10),
        inner.reshape(count, 10),
        violating,
    )


def _whitener(covariance: Array) -> Array:
    """Return W with WᵀW = C⁻¹, found with unit variances."""
    std = np.sqrt(np.diag(covariance))
    std = np.where(std > 0.0, std, 1e-12)
    values, vectors = np.linalg.eigh(covariance / std / std[:, None])
    return np.asarray((vectors / np.sqrt(np.maximum(values, 1e-12))).T / std)


def _central_path(a: Array, b: Array, prior: Array, free: int | None = None) -> list[Array]:
    """Return φ at the minimum of ½ ‖a φ - b‖² + ε barrier for falling ε; 5 · bodies ε is left.

    Args:
        prior: J0 (bodies, 4, 4), from where the path starts.
        free: a body that need not exist.
    """
    phi, path = standard(prior), list[Array]()
    slack = max(float(np.sum(np.square(a @ phi - b))), 1e-3)
    for _ in range(_STEPS):
        off = b - a @ phi
        value, gradient, blocks = barrier(phi, prior, free)
        step = _newton(a, off, gradient, blocks, slack)
        decrement = float((a.T @ off / slack - gradient) @ step)
        if decrement < _CENTRED:
            path.append(phi)
            if 5.0 * len(prior) * slack < _CONFIG.gap * max(1.0, 0.5 * float(off @ off)):
                return path
            slack /= _SHRINK
            continue
        # halve the step until it gains a quarter of what its slope promises
        start = 0.5 * float(off @ off) / slack + value
        for length in np.power(0.5, np.arange(40)):
            rest = off - length * (a @ step)
            there = barrier(phi + length * step, prior, free)[0]
            if 0.5 * float(rest @ rest) / slack + there <= start - 0.25 * length * decrement:
                phi = phi + length * step
                break
        else:  # rounding leaves no step
            break
    return path or [phi]


def closest(a: Array, b: Array, prior: Array) -> Array | None:
    """Return φ with a φ = b at the least divergence from J0, or None without a solution.

    Where there are such φ, there are some on all of the line from a φ0 to b. Newton's method goes
    along it: most of the way to where a body ceases to exist, then back to the least divergence at
    that place.
    """
    phi = described = standard(prior)
    before = 0.0
    for _ in range(_STEPS):
        _, gradient, blocks = barrier(phi, prior)
        sideways = _newton(a, np.zeros(len(a)), gradient, blocks)
        ahead = _newton(a, b - a @ phi, np.zeros(len(phi)), blocks)
        far = float(np.linalg.norm(_changes(phi, sideways)))
        room = 1.0 / max(-float(_changes(phi, ahead).min()), _SETTLED)
        step = sideways / (1.0 + far)
        if far < _CLOSE:
            if room < before and room < _STUCK:  # the way ends at the boundary
                return None
            before, step = room, sideways + min(1.0, _WAY * room) * ahead
        if not _changes(described, phi + step).min() > _SETTLED:
            return None  # so close to the boundary rounding leaves no step
        phi = phi + step
        if _WAY * room >= 1.0 and far**2 < _SETTLED:
            return phi
    return None


def _changes(phi: Array, step: Array) -> Array:
    """Return the eigenvalues of a step against J; a body ceases to exist at -1."""
    inverse = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(phi.reshape(-1, 10))))
    change = pseudo_inertia(step.reshape(-1, 10))
    return np.asarray(np.linalg.eigvalsh(inverse @ change @ inverse.transpose(0, 2, 1)))


def _newton(a: Array, off: Array, gradient: Array, blocks: Array, slack: float = 0.0) -> Array:
    """Return the step of Newton's method towards a step = `off`; met exactly without slack.

    From H Δ + g = aᵀ ν and a Δ + ε ν = off: (a H⁻¹ aᵀ + ε) ν = off + a H⁻¹ g.
    """
    down = np.einsum("iab,ib->ia", blocks, gradient.reshape(-1, 10)).ravel()
    across = np.einsum("kia,iab->kib", a.reshape(len(a), -1, 10), blocks).reshape(len(a), -1)
    schur = across @ a.T + slack * np.eye(len(a))
    size = np.sqrt(np.diag(schur))
    schur = schur / size / size[:, None]
    step = across.T @ (np.linalg.solve(schur, (off + a @ down) / size) / size) - down
    if slack == 0.0:  # what rounding has left
        step += across.T @ (np.linalg.solve(schur, (off - a @ step) / size) / size)
    return np.asarray(step)


def barrier(phi: Array, prior: Array, free: int | None = None) -> tuple[float, Array, Array]:
    """Return the barrier, its gradient and the blocks (bodies, 10, 10) of its inverse Hessian.

    The gradient is tr(J0⁻¹ M_k) - tr(J⁻¹ M_k), the Hessian tr(J⁻¹ M_k J⁻¹ M_l): with J = T Tᵀ that
    of J = 1, seen through T. Of a free body it is the parabola that the barrier is at J0. Infinite
    where a body cannot exist.
    """
    table = phi.reshape(-1, 10)
    inertia = pseudo_inertia(table)
    if free is not None:
        inertia[free] = prior[free]
    sizes = np.linalg.eigvalsh(inertia)
    if not sizes.min() > 0.0:
        return np.inf, phi, prior
    triangle = np.linalg.cholesky(inertia)[:, None]
    through = standard(triangle @ PSEUDO @ triangle.swapaxes(2, 3)).reshape(-1, 10, 10)
    blocks = through.swapaxes(1, 2) @ _AT_ONE @ through
    pull = np.einsum("iab,kba->ik", np.linalg.inv(prior), PSEUDO)
    gradient = pull - np.einsum("iab,kba->ik", np.linalg.inv(inertia), PSEUDO)
    value = (pull * table).sum(axis=1) - np.log(sizes).sum(axis=1)
    if free is not None:
        away = table[free] - standard(prior[free])
        gradient[free] = np.linalg.solve(blocks[free], away)
        value[free] = 0.5 * away @ gradient[free]
    return float(value.sum()), gradient.ravel(), blocks


__all__ = ["Links", "carried", "consistent_links", "prior_links"]

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

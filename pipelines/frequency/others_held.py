"""Take the motion of the other joints out of a response: what the joint would answer were they held.

    τ_j = Σ_k Z_jk(s) e^(sδ) a_k,    Z_jk(s) = D_jk - Σ_m b_jm b_km s² / (s² + 2 ζ_m ω_m s + ω_m²)

a_k are accelerations and D is the mass matrix; friction and gravity of the joint add to Z_jj. The modes m are those of the arm
with all joints locked: the arm on its base, and each link on the spring that its motor turns it with. They are the poles of all
Z_jk alike, and their residues are of rank one (Ewins 2000, Modal Testing, §2.4; Craig, Bampton 1968, AIAA J. 6, p. 1313). The
other joints are held by their controllers, and above the band of those they swing freely: the inertia at joint j then falls from
D_jj towards 1 / (D⁻¹)_jj, which looks like a heavily damped mode. Their motion is in the log, as noisy as it is read: the least
squares of τ_j - Σ Z_jk a_k are weighted by its own variance, renewed with Z, and the noise of a_k is taken out at the end
(Pintelon, Schoukens 2012, System Identification, §9.11).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.fit.bounded import least_squares
from pipelines.frequency.controller import Complex
from pipelines.frequency.frequency_response import FrequencyResponse, Responses, closed_loop
from pipelines.io.log import Array

__all__ = ["Held", "HeldConfig", "others_held"]


@dataclass(frozen=True)
class HeldConfig:
    """How Z is found.

    Attributes:
        modes: at most: a base and a spring in two joints.
        dampings: tried for each mode; the last is the largest.
        delay: [s] the largest.
        floor: of the torque, what the model leaves out.
        alike: share of the frequency over which that is the same: its bins count as one.
        weighings: times that the variance of the rest is renewed.
        draws: of the response within what is known of the coupling.
        fewest: bins.
        moves: mean square of the motion of a joint over that of its noise, beyond which most of it is motion: of what is noise
            alone, D_jk would be any number.
    """

    modes: int = 3
    dampings: tuple[float, ...] = (0.01, 0.02, 0.05, 0.1, 0.2)
    delay: float = 0.02
    floor: float = 0.01
    alike: float = 0.15
    weighings: int = 4
    draws: int = 24
    fewest: int = 20
    moves: float = 2.0


@dataclass(frozen=True, eq=False)
class Held:
    """A response with the other joints held, and draws of it within what is known of their inertia."""

    response: FrequencyResponse
    draws: Complex  # (draws, bins)

    def times(self, factor: Complex) -> Held:
        """Both times a known `factor` (bins,)."""
        return Held(self.response.times(factor), self.draws * factor)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Equations of one fit, at every frequency."""

    torque: Complex  # (bins,)
    acceleration: Complex  # a_j, then those of the others (bins, joints)
    covariance: Complex  # of torque and accelerations (bins, 1 + joints, 1 + joints)
    floor: Array  # std that the torque has at least (bins,)
    s: Complex  # jω (bins,)
    independent: float  # bins that count


@dataclass(frozen=True, eq=False)
class _Modes:
    """What is known of b_jm b_km: of a base and of a spring less has to be found.

    A base turns as the joint does, b_k / b_j = D_jk / D_jj. The link on the spring of joint j is all
    that couples to the others, b_j b_k = D_jk: above its mode the motor feels none of them. It is
    the only mode then: beside a base none is that of the link alone.
    """

    kinds: tuple[str, ...]  # of each mode: "base", "spring" or "free"
    turned: Array  # D_jk / D_jj (others,)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Z with some modes."""

    shape: Array  # δ [s], then log ω [rad/s] and log ζ of each mode (1 + 2 modes,)
    gains: Array  # D_jk, b_jm b_km of each mode (b_jm² alone unless free), friction and gravity of j
    rest: Array  # real and imaginary parts over their std (2 bins,)
    spread: Array  # that std (bins,)
    modes: _Modes
    inside: bool = True  # every frequency and damping lies within its bounds: at one, it is not found

    @property
    def cost(self) -> float:
        return max(float(self.rest @ self.rest), 1e-300)

    def passive(self, most: Array) -> bool:
        """Whether every mode is found and masses could be so: b_jm² is positive, no b_km² is more than D_kk, `most` (others,).

        D is positive definite: D_jk² is less than D_jj D_kk. A column that is mostly noise would have it grow
        until the noise of τ_j - Σ Z_jk a_k covers what the modes leave.
        """
        joints, place = len(most) + 1, len(most) + 1
        if (self.gains[1:joints] ** 2 > most * self.gains[0]).any():
            return False
        for kind in self.modes.kinds:
            size, at = (joints, place) if kind == "free" else (1, 0)
            own, others = self.gains[place], self.gains[at + 1:at + joints]
            if own <= 0.0 or (kind != "base" and (others**2 > most * own).any()):
                return False
            place += size
        return self.inside

    def description(self, independent: float) -> float:
        """-2 log-likelihood + p log n (Rissanen 1978, Automatica 14).

        The errors are those of the measured torque and accelerations, whose variance no fit changes:
        that of the rest weighs, but no logarithm of it counts (Pintelon, Schoukens 2012, §9.11).
        """
        share = 2.0 * independent / len(self.rest)
        return share * self.cost + (len(self.shape) + len(self.gains)) * float(np.log(2.0 * independent))


def others_held(responses: Responses, rigid: Complex, torque: int, position: int, others: tuple[int, ...],
                most: Array | None = None, config: HeldConfig | None = None) -> Held | None:
    """Return the response from torque to position with the other joints held; None where their motion does not matter.

    It matters where Z with columns for the others has the shorter description. Where the others hardly move, their columns are
    nearly those of Z_jj times the same a_j, and taking them out adds more than it takes away.

    Args:
        responses: from v to torque and all positions, in the excited band.
        rigid: position over acceleration (bins,), complex: the double integrator as it was sampled.
        torque, position, others: places among the outputs.
        most: D_kk of the others at most (others,) [kg m^2], where it is known.
    """
    config = config or HeldConfig()
    bound = np.full(len(others), np.inf) if most is None else most
    if len(responses.frequency) < config.fewest:
        return None
    noise = np.diagonal(responses.covariance, axis1=1, axis2=2).real
    power = (np.abs(responses.response) ** 2 / np.maximum(noise, 1e-300)).mean(axis=0)
    moves = power[list(others)] > config.moves
    others, bound = tuple(k for k, does in zip(others, moves, strict=True) if does), bound[moves]
    if not others:
        return None
    kept = [torque, position, *others]
    scale = np.stack([np.ones_like(rigid), *(1.0 / rigid for _ in kept[1:])], axis=1)
    values = responses.response[:, kept] * scale
    covariance = responses.covariance[:, kept][:, :, kept] * scale[:, :, None] * np.conj(scale[:, None, :])
    f = responses.frequency
    alike = np.maximum(config.alike * f / (responses.correlated * float(np.median(np.diff(f)))), 1.0)
    rows = _Rows(values[:, 0], values[:, 1:], covariance, config.floor * np.sqrt(alike) * np.abs(values[:, 0]),
                 np.asarray(2j * np.pi * responses.frequency), len(responses.frequency) / responses.correlated)
    single = replace(rows, acceleration=rows.acceleration[:, :1], covariance=rows.covariance[:, :2, :2])
    alone = _with_modes(single, bound[:0], config)
    fit = _with_modes(rows, bound, config, alone.shape)
    if not fit.passive(bound) or alone.description(rows.independent) <= fit.description(rows.independent):
        return None
    fit = _unattenuated(rows, fit)
    held = closed_loop(_less(responses, kept, _impedance(rows, fit)[:, 1:] / rigid[:, None]))
    couplings = np.stack([one[:, 1:] for one in _drawn(rows, fit, config.draws)]) / rigid[:, None]
    rest = responses.response[:, torque] - np.einsum("dbk,bk->db", couplings, responses.response[:, list(others)])
    return Held(held, np.asarray(responses.response[:, position] / rest))


def _less(responses: Responses, kept: list[int], coupling: Complex) -> Responses:
    """Of the torque less `coupling` (bins, others) times the positions of the others, and of the position."""
    to = np.zeros((len(coupling), 2, len(kept)), dtype=np.complex128)
    to[:, 0, 0], to[:, 1, 1] = 1.0, 1.0
    to[:, 0, 2:] = -coupling
    return replace(responses, response=(to @ responses.response[:, kept, None])[..., 0],
                   covariance=to @ responses.covariance[:, kept][:, :, kept] @ np.conj(np.swapaxes(to, 1, 2)),
                   coherence=responses.coherence[:, kept[:2]])


def _with_modes(rows: _Rows, most: Array, config: HeldConfig, known_shape: Array | None = None) -> _Fit:
    """Add modes as long as they shorten the description; of bodies that could exist, where there are such.

    `known_shape` of a fit with fewer joints is a further start: that fit is one of these, with no coupling.
    """
    plain = np.sqrt(0.5 * (rows.covariance[:, 0, 0].real + rows.floor**2))
    delays = np.arange(-config.delay, config.delay, np.pi / 4.0 / abs(rows.s[-1]))
    none = _Modes((), np.zeros(rows.acceleration.shape[1] - 1))
    rigid = [_linear(rows, np.array([delay]), plain, none) for delay in (0.0, *delays)]
    begun = [_refined(rows, min(rigid, key=lambda one: one.cost), config)]
    if known_shape is not None:
        count = len(known_shape) // 2
        free = _linear(rows, known_shape, plain, _Modes(("free",) * count, none.turned))
        ways = [("base",) * count, ("spring",)][:1 + (count == 1)]
        tried = [free, *(_linear(rows, known_shape, plain, _Modes(way, _turned(free))) for way in ways)]
        begun += [_refined(rows, start, config) for start in tried]
    known = begun[0]
    best = min((one for one in begun if one.passive(most)), key=lambda one: one.description(rows.independent), default=known)
    low, high = np.log(np.abs(rows.s[[0, -1]]))  # a mode is 2 ζ ω wide: as close as that frequencies are tried
    shapes = np.array([(w, np.log(z)) for z in config.dampings for w in np.arange(low + z, high, 2.0 * z)]).reshape(-1, 2)
    for _ in range(config.modes):
        starts = []
        kinds, turned = known.modes.kinds, _turned(known)
        for kind in ("base", "spring", "free") if len(turned) else ("free",):
            if kind == "spring" and kinds:
                continue
            now = _Modes((*kinds, kind), turned)
            for delay, spread in ((0.0, plain), (known.shape[0], _spread(rows, known))):
                before = np.concatenate([[delay], known.shape[1:]])
                cheapest = np.argsort(_costs(rows, before, shapes, spread, now), kind="stable")
                trials = (_linear(rows, np.concatenate([before, shapes[k]]), spread, now) for k in cheapest)
                starts.append(next((one for one in trials if one.passive(most)), None))
        found = [one for one in (_refined(rows, start, config) for start in starts if start is not None) if one.passive(most)]
        if not found:
            break
        best = min((best, *found), key=lambda one: one.description(rows.independent))
        found = [one for one in found if "spring" not in one.modes.kinds]
        if not found:
            break
        known = min(found, key=lambda one: one.description(rows.independent))
    return best


def _refined(rows: _Rows, start: _Fit, config: HeldConfig) -> _Fit:
    """Refine delay, frequencies and dampings by variable projection (Golub, Pereyra 1973, SIAM J. Numer. Anal. 10, p. 413).

    The variance of the rest is that of the impedance found before.
    """
    modes = len(start.shape) // 2
    low = np.array([-config.delay, *np.tile(np.log([abs(rows.s[0]), 1e-3]), modes)])
    high = np.array([config.delay, *np.tile(np.log([abs(rows.s[-1]), 1.01 * config.dampings[-1]]), modes)])
    fit, mask = start, np.zeros(len(low), dtype=bool)
    for _ in range(config.weighings):
        spread, known = _spread(rows, fit), replace(fit.modes, turned=_turned(fit))

        def rest(x: Array, spread: Array = spread, known: _Modes = known) -> Array:
            return _linear(rows, x, spread, known).rest

        try:
            found = least_squares(rest, np.clip(fit.shape, low + 1e-9, high - 1e-9), low, high,
                                  np.array([1e-4, *np.full(2 * modes, 0.1)]), 10)
        except np.linalg.LinAlgError:  # the start as it is, which the description then judges
            break
        fit, mask = _linear(rows, found.x, spread, known), found.at_bound
    return replace(fit, inside=not mask[1:].any())


def _turned(fit: _Fit) -> Array:
    """D_jk / D_jj (others,)."""
    return np.asarray(fit.gains[1:1 + len(fit.modes.turned)] / fit.gains[0])


def _spread(rows: _Rows, fit: _Fit) -> Array:
    """Std of a part of τ_j - Σ Z_jk a_k (bins,)."""
    to = np.concatenate([np.ones((len(rows.s), 1)), -_impedance(rows, fit)], axis=1)
    variance = np.einsum("ba,bac,bc->b", to, rows.covariance, np.conj(to)).real
    return np.asarray(np.sqrt(0.5 * (variance + rows.floor**2)))


def _linear(rows: _Rows, shape: Array, spread: Array, modes: _Modes) -> _Fit:
    """Least squares of the gains, `spread` (bins,) given."""
    stacked, size = _scaled(_columns(rows, shape, modes) / spread)
    right = _parts(rows.torque / spread)
    gains = np.linalg.pinv(stacked @ stacked.T, rcond=1e-10, hermitian=True) @ (stacked @ right)
    return _Fit(shape, gains / size, right - gains @ stacked, spread, modes)


def _costs(rows: _Rows, before: Array, shapes: Array, spread: Array, modes: _Modes) -> Array:
    """The cost (trials,) of `_linear` with delay and modes `before` and one more of each of the `shapes` (trials, 2)."""
    known, _ = _scaled(_columns(rows, before, replace(modes, kinds=modes.kinds[:-1])) / spread)
    kind = "free" if modes.kinds[-1] == "spring" else modes.kinds[-1]
    moved = _directions(modes, kind) @ (rows.acceleration.T * np.exp(before[0] * rows.s) / spread)
    new, _ = _scaled(np.stack([_mode(rows.s, w, z) * moved for w, z in shapes]))  # (trials, columns of a mode, 2 bins)
    right, count = _parts(rows.torque / spread), len(known)
    normal = np.empty((len(shapes), count + len(moved), count + len(moved)))
    normal[:, :count, :count] = known @ known.T
    normal[:, count:, :count] = new @ known.T
    normal[:, :count, count:] = normal[:, count:, :count].swapaxes(1, 2)
    normal[:, count:, count:] = new @ new.swapaxes(1, 2)
    target = np.concatenate([np.tile(known @ right, (len(shapes), 1)), new @ right], axis=1)[:, :, None]
    taken = target.swapaxes(1, 2) @ np.linalg.pinv(normal, rcond=1e-10, hermitian=True) @ target
    return np.asarray(right @ right - taken[:, 0, 0])


def _parts(values: Complex) -> Array:
    """Real parts, then imaginary parts, along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)


def _scaled(columns: Complex) -> tuple[Array, Array]:
    """Parts of columns (…, bins) of unit length (…, 2 bins), and their lengths (…)."""
    parts = _parts(columns)
    size = np.maximum(np.sqrt((parts**2).sum(axis=-1)), 1e-300)
    return parts / size[..., None], size


def _unattenuated(rows: _Rows, fit: _Fit) -> _Fit:
    """The gains without what noise of the accelerations takes off them; as they are where that is more than the half.

    Expected normal equations hold the covariance of the noise; it is known, and taken out (Söderström 2007, Automatica 43, §5.1).
    """
    shapes, w = _shapes(rows, fit.shape, fit.modes), 0.5 / fit.spread**2
    columns = np.einsum("gbk,bk->gb", shapes, rows.acceleration)
    normal = ((columns * w) @ np.conj(columns.T)).real
    noise = np.einsum("gbk,bkl,hbl,b->gh", shapes, rows.covariance[:, 1:, 1:], np.conj(shapes), w, optimize=True).real
    if not np.linalg.eigvals(_inverse(normal) @ noise).real.max() < 0.5:
        return fit
    cross = np.einsum("gbk,bk,b->g", shapes, rows.covariance[:, 1:, 0], w, optimize=True).real
    gains = np.linalg.solve(normal - noise, ((columns * w) @ np.conj(rows.torque)).real - cross)
    return replace(fit, gains=gains)


def _drawn(rows: _Rows, fit: _Fit, draws: int) -> list[Complex]:
    """Impedances (bins, joints) each, within what is known of shape and gains."""
    step, count = 1e-5, len(fit.shape)
    steps = step * np.array([1e-3, *np.ones(count - 1)])
    found = _impedance(rows, fit)
    moved = [(_impedance(rows, replace(fit, shape=fit.shape + one)) - found) / one.sum() for one in np.diag(steps)]
    every = (*moved, *_shapes(rows, fit.shape, fit.modes))
    columns = (np.stack(every) * rows.acceleration).sum(axis=2) / fit.spread
    covariance = _inverse((columns @ np.conj(columns.T)).real)
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    about = np.random.default_rng(0).multivariate_normal(np.zeros(len(size)), covariance / np.outer(size, size), draws) * size
    return [_impedance(rows, replace(fit, shape=fit.shape + one[:count], gains=fit.gains + one[count:])) for one in about]


def _inverse(normal: Array) -> Array:
    """Of a symmetric matrix whose rows have different units."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    return np.asarray(np.linalg.pinv(normal / np.outer(size, size), rcond=1e-12, hermitian=True) / np.outer(size, size))


def _impedance(rows: _Rows, fit: _Fit) -> Complex:
    """Z_jk e^(sδ) (bins, joints)."""
    factors, directions = _factors(rows, fit.shape, fit.modes)
    return np.asarray((fit.gains[:, None] * factors).T @ directions)


def _columns(rows: _Rows, shape: Array, modes: _Modes) -> Complex:
    """The torque of each gain (gains, bins)."""
    factors, directions = _factors(rows, shape, modes)
    return np.asarray(factors * (directions @ rows.acceleration.T))


def _shapes(rows: _Rows, shape: Array, modes: _Modes) -> Complex:
    """What each gain multiplies in Z e^(sδ) (gains, bins, joints)."""
    factors, directions = _factors(rows, shape, modes)
    return np.asarray(factors[:, :, None] * directions[:, None, :])


def _factors(rows: _Rows, shape: Array, modes: _Modes) -> tuple[Complex, Array]:
    """The same as a factor (gains, bins) and a direction (gains, joints) each."""
    s, unit = rows.s, np.eye(rows.acceleration.shape[1])
    factors, directions, coupled = [np.ones_like(s)], [unit[0]], np.ones_like(s)
    for (w, z), kind in zip(shape[1:].reshape(-1, 2), modes.kinds, strict=True):
        own = _mode(s, w, z)
        if kind == "spring":
            coupled = coupled + own
        along = _directions(modes, kind)
        factors += [own] * len(along)
        directions += [*along]
    factors[1:1], directions[1:1] = [coupled] * (len(unit) - 1), [*unit[1:]]
    return np.stack([*factors, 1.0 / s, 1.0 / s**2]) * np.exp(shape[0] * s), np.stack([*directions, unit[0], unit[0]])


def _directions(modes: _Modes, kind: str) -> Array:
    """b_k / b_j of a mode (columns, joints): each joint by itself where it is free.

    Of a spring that of joint j alone: the others are in the column of D_jk.
    """
    if kind == "free":
        return np.eye(1 + len(modes.turned))
    return np.concatenate([[1.0], modes.turned if kind == "base" else 0.0 * modes.turned])[None]


def _mode(s: Complex, w: float, z: float) -> Complex:
    """What b_jm b_km multiplies in Z for log ω = `w`, log ζ = `z` (bins,)."""
    return np.asarray(-(s**2) / (s**2 + 2.0 * np.exp(z + w) * s + np.exp(2.0 * w)))

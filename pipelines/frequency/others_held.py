"""Take the motion of the other joints out of a response: what the joint answers were they held.

    τ_j = Σ_k Z_jk(s) e^(sδ) a_k,    Z_jk(s) = D_jk - Σ_m b_jm b_km s² / (s² + 2 ζ_m ω_m s + ω_m²)

a_k are accelerations and D is the mass matrix; friction and gravity of the joint add to Z_jj. The
modes m are those of the arm with all joints locked: the arm on its base, and each link on the
spring that its motor turns it with. They are the poles of all Z_jk, and their residues are of
rank one (Ewins 2000, Modal Testing, §2.4; Craig, Bampton 1968, AIAA J. 6, p. 1313). The others
are held by their controllers, and above the band of those they swing freely: the inertia at joint j
then falls from D_jj towards 1 / (D⁻¹)_jj, which looks like a heavily damped mode. Their motion is
in the log, as noisy as it is read: the least squares of τ_j - Σ Z_jk a_k are weighted by its own
variance, renewed with Z, and the noise of a_k is taken out at the end (Pintelon, Schoukens 2012,
System Identification, §9.11).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.estimation.bounded import least_squares
from pipelines.frequency.config import HeldConfig
from pipelines.frequency.rational import inverse
from pipelines.frequency.spectra import Array, Complex, FrequencyResponse, Responses, closed_loop

__all__ = ["Held", "others_held"]

_CONFIG = HeldConfig()


@dataclass(frozen=True, eq=False)
class Held:
    """A response with the other joints held, and draws of it within what is known of D_jk."""

    response: FrequencyResponse
    draws: Complex  # (draws, bins)

    def times(self, factor: Complex) -> Held:
        """Return both times a known `factor` (bins,)."""
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
class _Fit:
    """Z with some modes, each "base", "spring" or "free".

    Of a base and of a spring less of b_jm b_km has to be found. A base turns as the joint does,
    b_k / b_j = D_jk / D_jj. The link on the spring of joint j is all that couples to the others,
    b_j b_k = D_jk: above its mode the motor feels none of them. It is the only mode then: beside a
    base none is that of the link alone.
    """

    shape: Array  # δ [s], then log ω [rad/s] and log ζ of each mode (1 + 2 modes,)
    kinds: tuple[str, ...]  # of the modes
    turned: Array  # D_jk / D_jj of a base (others,)
    gains: Array  # D_jk, b_jm b_km of each mode (b_jm² alone unless free), friction and gravity
    rest: Array  # real and imaginary parts over their std (2 bins,)
    spread: Array  # that std (bins,)
    inside: bool = True  # no frequency and damping lies at its bound: at one, it is not found

    @property
    def cost(self) -> float:
        """Weighted sum of squares."""
        return max(float(self.rest @ self.rest), 1e-300)

    @property
    def couples(self) -> Array:
        """D_jk / D_jj that was found (others,)."""
        return np.asarray(self.gains[1 : 1 + len(self.turned)] / self.gains[0])

    def passive(self, most: Array) -> bool:
        """Return whether every mode is found, and masses could be so.

        b_jm² is positive, no b_km² is more than D_kk, `most` (others,). D is positive definite:
        D_jk² is less than D_jj D_kk. A column that is mostly noise would have it grow until the
        noise of τ_j - Σ Z_jk a_k covers what the modes leave.
        """
        joints = place = len(most) + 1
        if (self.gains[1:joints] ** 2 > most * self.gains[0]).any():
            return False
        for kind in self.kinds:
            size, at = (joints, place) if kind == "free" else (1, 0)
            own, others = self.gains[place], self.gains[at + 1 : at + joints]
            if own <= 0.0 or (kind != "base" and (others**2 > most * own).any()):
                return False
            place += size
        return self.inside

    def description(self, independent: float) -> float:
        """-2 log-likelihood + p log n (Rissanen 1978, Automatica 14).

        The errors are those of the measured torque and accelerations, whose variance no fit
        changes: that of the rest weighs, but no logarithm of it counts (Pintelon, Schoukens 2012,
        §9.11).
        """
        numbers = len(self.shape) + len(self.gains)
        share = 2.0 * independent / len(self.rest)
        return share * self.cost + numbers * float(np.log(2.0 * independent))


def others_held(
    responses: Responses,
    rigid: Complex,
    torque: int,
    position: int,
    others: tuple[int, ...],
    most: Array,
) -> Held | None:
    """Return the response with the other joints held; None where their motion does not matter.

    It matters where Z with columns for the others has the shorter description. Where the others
    hardly move, their columns are nearly those of Z_jj times the same a_j, and taking them out adds
    more than it takes away.

    Args:
        responses: from v to torque and all positions, in the excited band.
        rigid: position over acceleration (bins,): the double integrator as it was sampled.
        torque, position, others: places among the outputs.
        most: D_kk of the others at most (others,) [kg m^2]; inf where it is not known.
    """
    f = responses.frequency
    if len(f) < _CONFIG.fewest:
        return None
    power = np.abs(responses.response) ** 2 / np.maximum(responses.variance, 1e-300)
    moves = power.mean(axis=0)[list(others)] > _CONFIG.moves
    others, most = tuple(np.array(others)[moves].tolist()), most[moves]
    if not others:
        return None
    kept = [torque, position, *others]
    values = responses.response[:, kept]
    covariance = responses.covariance[:, kept][:, :, kept]
    rows = _rows(responses, values, covariance, rigid)
    own = rows.acceleration[:, :1]
    alone = _with_modes(
        replace(rows, acceleration=own, covariance=rows.covariance[:, :2, :2]), most[:0]
    )
    fit = _with_modes(rows, most, alone.shape)
    longer = alone.description(rows.independent) <= fit.description(rows.independent)
    if longer or not fit.passive(most):
        return None
    fit = _unattenuated(rows, fit)
    less = -_impedance(rows, fit)[:, 1:] / rigid[:, None]
    # of the torque less what couples to the others, and of the position
    to = np.zeros((len(f), 2, len(kept)), dtype=np.complex128)
    to[:, 0, 0] = to[:, 1, 1] = 1.0
    to[:, 0, 2:] = less
    held = replace(
        responses,
        response=(to @ values[..., None])[..., 0],
        covariance=to @ covariance @ np.conj(np.swapaxes(to, 1, 2)),
        coherence=responses.coherence[:, kept[:2]],
    )
    couplings = np.stack([one[:, 1:] for one in _drawn(rows, fit)]) / rigid[:, None]
    rest = values[:, 0] - np.einsum("dbk,bk->db", couplings, values[:, 2:])
    return Held(closed_loop(held), np.asarray(values[:, 1] / rest))


def _rows(responses: Responses, values: Complex, covariance: Complex, rigid: Complex) -> _Rows:
    """Equations of `values` (bins, channels), torque and positions, and of their covariance."""
    f = responses.frequency
    scale = np.repeat(1.0 / rigid[:, None], values.shape[1], axis=1)
    scale[:, 0] = 1.0
    alike = _CONFIG.alike * f / (responses.correlated * float(np.median(np.diff(f))))
    return _Rows(
        values[:, 0],
        (values * scale)[:, 1:],
        covariance * scale[:, :, None] * np.conj(scale[:, None, :]),
        _CONFIG.floor * np.sqrt(np.maximum(alike, 1.0)) * np.abs(values[:, 0]),
        np.asarray(2j * np.pi * f),
        len(f) / responses.correlated,
    )


def _with_modes(rows: _Rows, most: Array, known_shape: Array | None = None) -> _Fit:
    """Add modes as long as they shorten the description; of bodies that could exist, if any.

    `known_shape` of a fit with fewer joints is a further start: that fit is one of these, with no
    coupling.
    """

    def length(one: _Fit) -> float:
        return one.description(rows.independent)

    plain = np.sqrt(0.5 * (rows.covariance[:, 0, 0].real + rows.floor**2))
    delays = np.arange(-_CONFIG.delay, _CONFIG.delay, np.pi / 4.0 / abs(rows.s[-1]))
    none = np.zeros(len(most))
    rigid = [_linear(rows, np.array([delay]), plain, (), none) for delay in (0.0, *delays)]
    begun = [_refined(rows, min(rigid, key=lambda one: one.cost))]
    if known_shape is not None:
        count = len(known_shape) // 2
        free = _linear(rows, known_shape, plain, ("free",) * count, none)
        ways = [("base",) * count, *([("spring",)] if count == 1 else [])]
        tried = [free, *(_linear(rows, known_shape, plain, way, free.couples) for way in ways)]
        begun += [_refined(rows, start) for start in tried]
    known = begun[0]
    best = min((one for one in begun if one.passive(most)), key=length, default=known)
    # a mode is 2 ζ ω wide: as close as that frequencies are tried
    low, high = np.log(np.abs(rows.s[[0, -1]]))
    shapes = np.array(
        [(w, np.log(z)) for z in _CONFIG.dampings for w in np.arange(low + z, high, 2.0 * z)]
    ).reshape(-1, 2)
    for _ in range(_CONFIG.modes):
        starts = []
        for kind in ("base", "spring", "free") if len(most) else ("free",):
            if kind == "spring" and known.kinds:
                continue
            for delay, spread in ((0.0, plain), (known.shape[0], _spread(rows, known))):
                before = np.concatenate([[delay], known.shape[1:]])
                costs = _costs(rows, before, shapes, spread, known, kind)
                trials = (
                    _linear(
                        rows,
                        np.concatenate([before, shapes[k]]),
                        spread,
                        (*known.kinds, kind),
                        known.couples,
                    )
                    for k in np.argsort(costs, kind="stable")
                )
                starts.append(next((one for one in trials if one.passive(most)), None))
        refined = [_refined(rows, start) for start in starts if start is not None]
        found = [one for one in refined if one.passive(most)]
        best = min((best, *found), key=length)
        found = [one for one in found if "spring" not in one.kinds]
        if not found:
            break
        known = min(found, key=length)
    return best


def _refined(rows: _Rows, start: _Fit) -> _Fit:
    """Refine delay, frequencies and dampings by variable projection.

    Golub, Pereyra 1973, SIAM J. Numer. Anal. 10, p. 413. The variance of the rest is that of the
    impedance found before.
    """
    modes, delay = len(start.kinds), _CONFIG.delay
    slowest, fastest = np.log(np.abs(rows.s[[0, -1]]))
    dampest = np.log(1.01 * _CONFIG.dampings[-1])
    low = np.array([-delay, *np.tile([slowest, np.log(_CONFIG.lightest)], modes)])
    high = np.array([delay, *np.tile([fastest, dampest], modes)])
    scale = np.array([1e-4, *np.full(2 * modes, 0.1)])
    fit, mask = start, np.zeros(len(low), dtype=bool)
    for _ in range(_CONFIG.weighings):
        spread, couples = _spread(rows, fit), fit.couples

        def rest(x: Array, spread: Array = spread, couples: Array = couples) -> Array:
            return _linear(rows, x, spread, start.kinds, couples).rest

        begin = np.clip(fit.shape, low + 1e-9, high - 1e-9)
        try:
            found = least_squares(rest, begin, low, high, scale, _CONFIG.evaluations)
        except np.linalg.LinAlgError:  # the start as it is, which the description then judges
            break
        fit, mask = _linear(rows, found.x, spread, start.kinds, couples), found.at_bound
    return replace(fit, inside=not mask[1:].any())


def _spread(rows: _Rows, fit: _Fit) -> Array:
    """Std of a part of τ_j - Σ Z_jk a_k (bins,)."""
    to = np.concatenate([np.ones((len(rows.s), 1)), -_impedance(rows, fit)], axis=1)
    variance = np.einsum("ba,bac,bc->b", to, rows.covariance, np.conj(to)).real
    return np.asarray(np.sqrt(0.5 * (variance + rows.floor**2)))


def _linear(
    rows: _Rows, shape: Array, spread: Array, kinds: tuple[str, ...], turned: Array
) -> _Fit:
    """Least squares of the gains, `spread` (bins,) given."""
    factors, directions = _factors(rows, shape, kinds, turned)
    stacked, size = _scaled(factors * (directions @ rows.acceleration.T) / spread)
    right = _parts(rows.torque / spread)
    solved = np.linalg.pinv(stacked @ stacked.T, rcond=1e-10, hermitian=True)
    gains = solved @ (stacked @ right)
    return _Fit(shape, kinds, turned, gains / size, right - gains @ stacked, spread)


def _costs(
    rows: _Rows, before: Array, shapes: Array, spread: Array, known: _Fit, kind: str
) -> Array:
    """Return the cost (trials,) of `_linear` with one mode more, of each of the `shapes`.

    `before` has the delay and the shapes of the known modes; `shapes` (trials, 2).
    """
    factors, directions = _factors(rows, before, known.kinds, known.couples)
    own, _ = _scaled(factors * (directions @ rows.acceleration.T) / spread)
    along = _directions("free" if kind == "spring" else kind, known.couples)
    moved = along @ (rows.acceleration.T * np.exp(before[0] * rows.s) / spread)
    # (trials, columns of a mode, 2 bins)
    new, _ = _scaled(np.stack([_mode(rows.s, w, z) * moved for w, z in shapes]))
    right, count = _parts(rows.torque / spread), len(own)
    normal = np.empty((len(shapes), count + len(moved), count + len(moved)))
    normal[:, :count, :count] = own @ own.T
    normal[:, count:, :count] = new @ own.T
    normal[:, :count, count:] = normal[:, count:, :count].swapaxes(1, 2)
    normal[:, count:, count:] = new @ new.swapaxes(1, 2)
    target = np.concatenate([np.tile(own @ right, (len(shapes), 1)), new @ right], axis=1)
    solved = np.linalg.pinv(normal, rcond=1e-10, hermitian=True)
    taken = target[:, None, :] @ solved @ target[:, :, None]
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
    """Return the gains without what noise of the accelerations takes off, if below half.

    Expected normal equations hold the covariance of the noise; it is known, and taken out
    (Söderström 2007, Automatica 43, §5.1).
    """
    shapes, w = _shapes(rows, fit), 0.5 / fit.spread**2
    columns = np.einsum("gbk,bk->gb", shapes, rows.acceleration)
    normal = ((columns * w) @ np.conj(columns.T)).real
    inner, cross = rows.covariance[:, 1:, 1:], rows.covariance[:, 1:, 0]
    several = (shapes, inner, np.conj(shapes), w)
    noise = np.einsum("gbk,bkl,hbl,b->gh", *several, optimize=True).real
    if not np.linalg.eigvals(inverse(normal, _CONFIG.rank) @ noise).real.max() < _CONFIG.attenuated:
        return fit
    right = ((columns * w) @ np.conj(rows.torque)).real
    right -= np.einsum("gbk,bk,b->g", shapes, cross, w, optimize=True).real
    return replace(fit, gains=np.linalg.solve(normal - noise, right))


def _drawn(rows: _Rows, fit: _Fit) -> list[Complex]:
    """Impedances (bins, joints) each, within what is known of shape and gains."""
    count = len(fit.shape)
    steps = 1e-5 * np.array([1e-3, *np.ones(count - 1)])
    found = _impedance(rows, fit)
    moved = [
        (_impedance(rows, replace(fit, shape=fit.shape + one)) - found) / one.sum()
        for one in np.diag(steps)
    ]
    every = np.stack((*moved, *_shapes(rows, fit)))
    columns = (every * rows.acceleration).sum(axis=2) / fit.spread
    covariance = inverse((columns @ np.conj(columns.T)).real, _CONFIG.rank)
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation, mean = covariance / np.outer(size, size), np.zeros(len(size))
    rng = np.random.default_rng(0)
    about = rng.multivariate_normal(mean, correlation, _CONFIG.draws) * size
    return [
        _impedance(rows, replace(fit, shape=fit.shape + one[:count], gains=fit.gains + one[count:]))
        for one in about
    ]


def _impedance(rows: _Rows, fit: _Fit) -> Complex:
    """Z_jk e^(sδ) (bins, joints)."""
    factors, directions = _factors(rows, fit.shape, fit.kinds, fit.turned)
    return np.asarray((fit.gains[:, None] * factors).T @ directions)


def _shapes(rows: _Rows, fit: _Fit) -> Complex:
    """Factor of each gain in Z e^(sδ) (gains, bins, joints)."""
    factors, directions = _factors(rows, fit.shape, fit.kinds, fit.turned)
    return np.asarray(factors[:, :, None] * directions[:, None, :])


def _factors(
    rows: _Rows, shape: Array, kinds: tuple[str, ...], turned: Array
) -> tuple[Complex, Array]:
    """Return the same as a factor (gains, bins) and a direction (gains, joints) each."""
    s, unit = rows.s, np.eye(1 + len(turned))
    factors, directions, coupled = [], [], np.ones_like(s)
    for (w, z), kind in zip(shape[1:].reshape(-1, 2), kinds, strict=True):
        own = _mode(s, w, z)
        if kind == "spring":
            coupled = coupled + own
        along = _directions(kind, turned)
        factors += [own] * len(along)
        directions += [*along]
    every = [np.ones_like(s), *[coupled] * len(turned), *factors, 1.0 / s, 1.0 / s**2]
    return np.stack(every) * np.exp(shape[0] * s), np.stack([*unit, *directions, unit[0], unit[0]])


def _directions(kind: str, turned: Array) -> Array:
    """b_k / b_j of a mode (columns, joints): each joint by itself where it is free.

    Of a spring that of joint j alone: the others are in the column of D_jk.
    """
    if kind == "free":
        return np.eye(1 + len(turned))
    return np.concatenate([[1.0], turned if kind == "base" else 0.0 * turned])[None]


def _mode(s: Complex, w: float, z: float) -> Complex:
    """Factor of b_jm b_km in Z for log ω = `w`, log ζ = `z` (bins,)."""
    return np.asarray(-(s**2) / (s**2 + 2.0 * np.exp(z + w) * s + np.exp(2.0 * w)))

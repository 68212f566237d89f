"""Fit a rational function to a frequency response: modes, level and delay with deviations.

    H(s) = g e^(-s delay) · Π (1 + b s + a s²) [zeros] / Π (1 + b s + a s²) [poles]

    found = fit_rational(frequency, response, variance)
    found.modes()                  resonances and antiresonances inside the band, by frequency

Products of sections, with s in units of the middle of the band, keep the fit well conditioned at
any order, and every section is a mode: ω = 1/√a, ζ = b / (2√a). g, a and b are positive: poles are
stable and every damping is positive, as of a passive structure that is moved and measured at one
place (all zeros of such a response are minimum phase, too). Maximum likelihood: the sum of
|Ĝ - H|² / variance is smallest (Pintelon, Schoukens 2012, System Identification, §9.11); the number
of sections is that of the shortest description (ibid. §11.3; Rissanen 1978, Automatica 14).

From a bare gain and delay on, every step tries one more pair of poles at many frequencies and
dampings, with the best numerator for each, which is linear in its coefficients, as in vector
fitting (Gustavsen, Semlyen 1999, IEEE Trans. Power Delivery 14, p. 1052); the best few are refined
by Gauss-Newton steps on all parameters (Levenberg 1944, Marquardt 1963).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipelines.errors import InputRejected
from pipelines.frequency.config import RationalConfig
from pipelines.frequency.spectra import Array, Complex

__all__ = ["FEWEST", "Known", "Mode", "Rational", "fit_rational"]

_CONFIG = RationalConfig()
FEWEST = _CONFIG.fewest  # numerics: bins of a fit at least


@dataclass(frozen=True)
class Known:
    """A value and its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True)
class Mode:
    """One lightly or heavily damped pair of poles or zeros."""

    kind: Literal["resonance", "antiresonance"]
    frequency: Known  # undamped [Hz]
    damping: Known  # ratio [1]


@dataclass(frozen=True, eq=False)
class Rational:
    """A fitted function.

    `parameters`: log g, delay · unit, log b, log a of each zero section, then of each pole section.
    """

    parameters: Array  # (2 + 2 zeros + 2 poles,), s in `unit`
    covariance: Array  # of them; zero rows for what was held
    zeros: int  # sections
    poles: int
    unit: float  # [rad/s] of s
    band: tuple[float, float]  # [Hz] of the fit
    misfit: float = np.inf  # mean |Ĝ - H|² / variance: 1 where model and variance are right
    description: float = np.inf  # length of the description, of the same data

    @property
    def delay(self) -> float:
        """[s]."""
        return float(self.parameters[1] / self.unit)

    def response(self, frequency: Array) -> Complex:
        """H at these frequencies [Hz]."""
        s = np.asarray(2j * np.pi / self.unit * frequency, dtype=np.complex128)
        return _product(self.parameters, s, self.zeros)[0]

    def modes(self) -> tuple[Mode, ...]:
        """Complex pairs in the band, by frequency.

        An antiresonance and a resonance that are equal within their deviations take each other
        away: they are no modes.
        """
        found = [self._mode(k) for k in range(self.zeros + self.poles)]
        low, high = self.band
        modes = [m for m in found if m is not None and low <= m.frequency.value <= high]
        near = sorted(
            (_apart(zero, pole), i, k)
            for i, zero in enumerate(modes)
            for k, pole in enumerate(modes)
            if (zero.kind, pole.kind) == ("antiresonance", "resonance")
        )
        gone: set[int] = set()
        for apart, i, k in near:
            if apart <= _CONFIG.cancels and not gone & {i, k}:
                gone |= {i, k}
        distinct = [m for i, m in enumerate(modes) if i not in gone]
        return tuple(sorted(distinct, key=lambda m: m.frequency.value))

    def _mode(self, section: int) -> Mode | None:
        """δω/ω = -δ(log a)/2, δζ/ζ = δ(log b) - δ(log a)/2. None for two real roots."""
        at = slice(2 + 2 * section, 4 + 2 * section)
        log_b, log_a = self.parameters[at]
        c, damping = self.covariance[at, at], float(0.5 * np.exp(log_b - 0.5 * log_a))
        if damping >= 1.0:
            return None
        hertz = float(self.unit * np.exp(-0.5 * log_a) / (2.0 * np.pi))
        gradient = damping * np.array([1.0, -0.5])
        frequency = Known(hertz, hertz * 0.5 * float(np.sqrt(c[1, 1])))
        own = Known(damping, float(np.sqrt(gradient @ c @ gradient)))
        return Mode("antiresonance" if section < self.zeros else "resonance", frequency, own)


def _apart(m: Mode, other: Mode) -> float:
    """Return the larger difference of frequency and damping, in standard deviations of it."""
    pairs = ((m.frequency, other.frequency), (m.damping, other.damping))
    return max(
        abs(x.value - y.value) / max(float(np.hypot(x.std, y.std)), 1e-300) for x, y in pairs
    )


def _product(parameters: Array, s: Complex, zeros: int) -> tuple[Complex, Complex]:
    """H at s in units of the fit (bins,), and each 1 + b s + a s² (sections, bins)."""
    b, a = np.exp(parameters[2::2, None]), np.exp(parameters[3::2, None])
    sections = 1.0 + b * s + a * s**2
    value = np.exp(parameters[0] - s * parameters[1]) * np.prod(sections[:zeros], axis=0)
    return np.asarray(value / np.prod(sections[zeros:], axis=0)), np.asarray(sections)


@dataclass(frozen=True, eq=False)
class _Data:
    """The response to fit, the same for every order."""

    s: Complex  # in `unit` (bins,)
    target: Complex  # response (bins,)
    weight: Array  # 1 / std of one of its two parts (bins,)
    unit: float  # [rad/s]
    band: tuple[float, float]  # [Hz]
    with_delay: bool
    correlated: float  # neighbouring bins that carry one independent estimate
    freedom: float  # of the variance; infinite where it is known


def fit_rational(
    frequency: Array,
    response: Complex,
    variance: Array,
    *,
    with_delay: bool = True,
    correlated: float = 1.0,
    freedom: float = np.inf,
) -> Rational:
    """Return the rational function of the shortest description.

    Args:
        frequency: [Hz] (bins,), above 0.
        response: (bins,).
        variance: of it, E|Ĝ - G|² (bins,); bins without a finite one or response are left out.
        with_delay: find one, positive or negative; else it is 0.
        correlated: neighbouring bins that carry one independent estimate.
        freedom: degrees of freedom of the variance; infinite where it is known.

    Raises:
        InputRejected: T08, fewer than 18 bins; D09, not one bin with a finite variance.
    """
    good = np.isfinite(response) & np.isfinite(variance) & (frequency > 0.0) & (response != 0.0)
    if not good.any():
        remedy = "excite the frequencies that are asked for"
        raise InputRejected("D09", "no frequency at which the response is known", remedy=remedy)
    f, target = frequency[good], response[good]
    if len(f) < FEWEST:
        remedy = "record longer, or excite a wider band"
        raise InputRejected("T08", f"{len(f)} frequencies are too few for a mode", remedy=remedy)
    spread = variance[good] + (_CONFIG.floor**2 + _CONFIG.exact) * np.abs(target) ** 2
    unit = float(2.0 * np.pi * np.sqrt(f[0] * f[-1]))
    s = np.asarray(2j * np.pi / unit * f, dtype=np.complex128)
    band, weight = (float(f[0]), float(f[-1])), np.sqrt(2.0 / spread)
    data = _Data(s, target, weight, unit, band, with_delay, correlated, freedom)
    current = best = _rigid(data)
    waited = 0
    for order in range(1, _CONFIG.most + 1):
        if 2 + 4 * order > len(f) / correlated or waited >= _CONFIG.patience:
            break
        current, fewer = _grow(data, current, True), _grow(data, current, False)
        better = min(current, fewer, best, key=lambda one: one.description)
        waited = 0 if better is not best else waited + 1
        best = better
    return best


def _rigid(data: _Data) -> Rational:
    """Gain and delay alone, from no delay and from the one that brings most phases to zero."""
    gain = float(np.median(np.log(np.abs(data.target))))
    delays = [0.0]
    if data.with_delay:
        omega, turned = data.s.imag, data.target / np.abs(data.target)
        grid = np.arange(-_CONFIG.delays, _CONFIG.delays + 1) * (0.25 * np.pi / omega[-1])
        delays.append(float(grid[np.argmax((np.exp(1j * np.outer(grid, omega)) @ turned).real)]))
    starts = [
        Rational(np.array([gain, delay]), np.zeros((2, 2)), 0, 0, data.unit, data.band)
        for delay in delays
    ]
    found = [*(_refine(data, one) for one in starts), *(_judged(data, one) for one in starts)]
    # where modes tower over everything, the most likely gain alone is none: no place to go on from
    near = [one for one in found if abs(one.parameters[0] - gain) < _CONFIG.leap]
    return min(near, key=lambda one: one.description)


def _residual(data: _Data, p: Array, zeros: int) -> tuple[Complex, Complex]:
    """Residual (bins,) and Jacobian (parameters, bins), weighted.

    ∂H/∂log b = ± H b s / section, ∂H/∂log a = ± H a s² / section.
    """
    value, sections = _product(p, data.s, zeros)
    sign = np.where(np.arange(len(sections)) < zeros, 1.0, -1.0)[:, None]
    slope = np.empty((len(p), len(data.s)), dtype=np.complex128)
    slope[0], slope[1] = value, -data.s * value if data.with_delay else 0.0
    shared = sign * value * data.s / sections
    slope[2::2] = shared * np.exp(p[2::2, None])
    slope[3::2] = shared * np.exp(p[3::2, None]) * data.s
    return np.asarray((value - data.target) * data.weight), slope * data.weight


def _cost(rest: Complex, freedom: float) -> tuple[float, Array]:
    """-2 log-likelihood, and the weights (bins,) with which least squares lowers it.

    Where the variance is itself an estimate with ν degrees of freedom, u = |Ĝ - H|² / variance is
    F-distributed, and the sum is Σ 2 (ν + 1) log(1 + u / ν), weights (ν + 1) / (ν + u); with ν = ∞
    it is Σ 2 u, weights 1.
    """
    u = 0.5 * (rest.real**2 + rest.imag**2)
    if not np.isfinite(freedom):
        return float(2.0 * u.sum()), np.ones(len(rest))
    cost = float(2.0 * (freedom + 1.0) * np.log1p(u / freedom).sum())
    return cost, np.asarray((freedom + 1.0) / (freedom + u))


def _refine(data: _Data, start: Rational) -> Rational:
    """Find the most likely parameters: by least squares, then with the variance's freedom."""
    found = _descend(data, start, np.inf, *_CONFIG.fine)
    if np.isfinite(data.freedom):
        found = _descend(data, found, data.freedom, *_CONFIG.fine)
    return _judged(data, found)


def _descend(data: _Data, start: Rational, freedom: float, steps: int, stop: float) -> Rational:
    """Gauss-Newton steps, shortened until the cost decreases."""
    p, damping = start.parameters, 1e-3
    with np.errstate(all="ignore"):
        rest, slope = _residual(data, p, start.zeros)
        cost, w = _cost(rest, freedom)
        for _ in range(steps):
            normal, gradient = _normal(slope, w), (np.conj(slope) @ (w * rest)).real
            scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
            matrix, before = normal / np.outer(scale, scale), cost
            while damping < _CONFIG.stiffest:
                step = np.linalg.solve(matrix + damping * np.eye(len(p)), gradient / scale) / scale
                tried, its_slope = _residual(data, p - step, start.zeros)
                its_cost, its_w = _cost(tried, freedom)
                if its_cost < cost and np.abs(np.delete(step, 1)).max() < _CONFIG.leap:
                    p, rest, slope, cost, w = p - step, tried, its_slope, its_cost, its_w
                    damping = max(damping / 10.0, 1e-12)
                    break
                damping *= 4.0
            if not before - cost > stop * before:
                break
    return replace(start, parameters=p)


def _normal(slope: Complex, w: Array) -> Array:
    """Re J W Jᴴ, of real and imaginary part side by side."""
    both = slope.view(np.float64)
    return np.asarray((both * np.repeat(w, 2)) @ both.T)


def _judged(data: _Data, model: Rational) -> Rational:
    """Covariance and length of the description, -2 log-likelihood + k log n.

    The information of a bin whose variance has ν degrees of freedom is ν / (ν + 2) of what its
    weight says. The covariance is wider where bins are correlated, or the model does not fit.
    """
    rest, slope = _residual(data, model.parameters, model.zeros)
    cost, w = _cost(rest, data.freedom)
    free = np.ones(len(model.parameters), dtype=bool)
    free[1] = data.with_delay
    count = float(free.sum())
    misfit = float((w * np.abs(rest) ** 2).sum()) / max(2.0 * len(data.s) - count, 1.0)
    normal = _normal(slope[free], w)
    if not np.isfinite(normal).all():
        return model  # poles on a measured frequency, or beyond all numbers: no shorter description
    wider = data.correlated * max(misfit, 1.0) * (1.0 + 2.0 / data.freedom)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    both = np.outer(scale, scale)
    inverse = np.linalg.pinv(normal / both, rcond=_CONFIG.rank, hermitian=True) / both
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free, free)] = inverse * wider
    information = count * float(np.log(2.0 * len(data.s) / data.correlated))
    description = cost / data.correlated + information
    return replace(model, covariance=covariance, misfit=misfit, description=description)


def _grow(data: _Data, model: Rational, with_zeros: bool) -> Rational:
    """One more pair of poles, and one of zeros or none: the best of the trials, refined."""
    value, _ = _product(model.parameters, data.s, model.zeros)
    weight, ratio = (data.weight * np.abs(value)) ** 2, data.target / value
    frequencies = np.abs(data.s[:: max(1, len(data.s) // _CONFIG.frequencies)])
    a = np.repeat(1.0 / frequencies**2, len(_CONFIG.dampings))
    b = (2.0 * np.array(_CONFIG.dampings) / frequencies[:, None]).ravel()
    numerator, gained = _numerators(np.abs(data.s), weight, ratio, (a, b), with_zeros)
    zeros, poles, between = model.zeros + int(with_zeros), model.poles + 1, 2 + 2 * model.zeros
    found = []
    for k in _separate(gained, len(_CONFIG.dampings)):
        pole, (gain, *zero) = np.array([b[k], a[k]]), numerator[k]
        # a best numerator may be none that is passive
        own = np.log(np.maximum(np.array(zero) / gain, _CONFIG.smallest * pole[: len(zero)]))
        base = model.parameters[:2] + np.array([np.log(gain), 0.0])
        before, after = model.parameters[2:between], model.parameters[between:]
        p = np.concatenate([base, before, own, after, np.log(pole)])
        started = replace(model, parameters=p, zeros=zeros, poles=poles)
        found.append(_judged(data, _descend(data, started, np.inf, *_CONFIG.rough)))
    return _refine(data, min(found, key=lambda one: one.description))


def _numerators(
    omega: Array, weight: Array, ratio: Complex, poles: tuple[Array, Array], with_zeros: bool
) -> tuple[Array, Array]:
    """min Σ weight |ratio - (c + d s + e s²) / (1 + b s + a s²)|² for every a, b; real c, d, e.

    At s = jω the normal equations of d are apart from those of c and e. Gives c, d, e (trials, 3),
    without zeros c alone, and what the sum loses; c is 1 and that is -1 where c is not positive.
    """
    a, b = poles
    below = 1.0 / ((1.0 - a[:, None] * omega**2) + 1j * (b[:, None] * omega))  # (trials, bins)
    powers = weight[:, None] * np.stack([omega**0, omega**2, omega**4], axis=1)
    power = (below.real**2 + below.imag**2) @ powers
    seen = below * (weight * np.conj(ratio))
    right = np.stack([seen.real.sum(axis=1), -seen.imag @ omega, -seen.real @ omega**2], axis=1)
    if not with_zeros:
        right, found = right[:, :1], right[:, :1] / power[:, :1]
        gained = np.where(found[:, 0] > 0.0, (found * right).sum(axis=1), -1.0)
        return np.where(found > 0.0, found, 1.0), gained
    determinant = power[:, 0] * power[:, 2] - power[:, 1] ** 2
    c = (power[:, 2] * right[:, 0] + power[:, 1] * right[:, 2]) / determinant
    e = (power[:, 0] * right[:, 2] + power[:, 1] * right[:, 0]) / determinant
    found = np.stack([c, right[:, 1] / power[:, 1], e], axis=1)
    gained = np.where(c > 0.0, (found * right).sum(axis=1), -1.0)
    found[c <= 0.0, 0] = 1.0
    return found, gained


def _separate(gained: Array, dampings: int) -> list[int]:
    """Return the best trial, and the best of those that do not neighbour it."""
    best = gained.reshape(-1, dampings)
    order = np.argsort(-best.max(axis=1))
    chosen: list[int] = []
    for k in order.tolist():
        far = all(abs(k - j) > max(3, len(order) // 30) for j in chosen)
        if len(chosen) < _CONFIG.refined and far:
            chosen.append(k)
    return [k * dampings + int(best[k].argmax()) for k in chosen]

"""Fit a rational function to a frequency response: sections are added where they tell most, as long as they pay.

    found = fit_rational(frequency, response, variance, integrators=2, hold=1e-3)

From a bare gain and delay on, every step tries one more pair of poles at many frequencies and dampings, with the best numerator
for each, which is linear in its coefficients, as in vector fitting (Gustavsen, Semlyen 1999, IEEE Trans. Power Delivery 14,
p. 1052); the best few are refined by Gauss-Newton steps on all parameters (Levenberg 1944, Marquardt 1963).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.frequency.rational import Array, Complex, Rational, known_part, product

__all__ = ["FEWEST", "fit_rational", "scattered"]

_DAMPINGS = (0.003, 0.01, 0.03, 0.1, 0.3)  # tried for a new pair of poles
_FREQUENCIES = 150  # tried for it
_REFINED = 3  # of the trials
_DELAYS = 100  # tried, in eighths of a period of the highest frequency, early and late
_LEAP = 3.0  # of the logarithm of gain, b or a at once
_SMALLEST = 1e-4  # of b and a of the poles: where those of a numerator start that would be negative
_ROUGH = (12, 1e-3)  # steps and relative decrease of a trial
_STEPS = 60  # of Gauss and Newton at most
_STOP = 1e-7  # relative decrease of the sum of squares below which they end
_PATIENCE = 2  # sections more that do not pay before the search ends
FEWEST = 18  # bins
_EXACT = 1e-12  # of the square of the response: a variance below this is rounding


@dataclass(frozen=True, eq=False)
class _Data:
    """What is fitted, and what is the same for every order."""

    s: Complex  # in `unit` (bins,)
    target: Complex  # response over the known part s⁻ⁱ hold(s) (bins,)
    weight: Array  # 1 / std of one of its two parts (bins,)
    unit: float  # [rad/s]
    with_delay: bool
    correlated: float  # neighbouring bins that carry one independent estimate
    freedom: float  # of the variance; infinite where it is known

    @property
    def independent(self) -> float:
        """Bins that count."""
        return len(self.s) / self.correlated


def fit_rational(frequency: Array, response: Complex, variance: Array, *, integrators: int = 0, hold: float = 0.0,
                 most: int = 6, with_delay: bool = True, correlated: float = 1.0, freedom: float = np.inf,
                 floor: float = 1e-3) -> Rational:
    """The rational function of the shortest description.

    Args:
        frequency: [Hz] (bins,), above 0.
        response: (bins,).
        variance: of it, E|Ĝ - G|² (bins,); bins with none, or without a finite response, are left out.
        integrators: i, poles at s = 0 that are known to be there.
        hold: [s] time that the input is held between samples, see `known_part`; 0 for a response in continuous time.
        most: sections of the denominator.
        with_delay: find one, positive or negative; else it is 0.
        correlated: neighbouring bins that carry one independent estimate.
        freedom: degrees of freedom of the variance, as of a `Responses`; infinite where it is known.
        floor: relative deviation that every bin has at least, for what the model leaves out.

    Raises:
        InputRejected: T08, fewer than 18 bins, too few for gain, delay and one mode; D09, not one bin with a finite variance.
    """
    frequency, data = _prepare(frequency, response, variance, integrators, hold, with_delay, correlated, freedom, floor)
    shell = Rational(np.zeros(2), np.zeros((2, 2)), 0, 0, integrators, hold, data.unit,
                     (float(frequency[0]), float(frequency[-1])), np.inf, np.inf)
    current = _rigid(data, shell)
    best, waited = current, 0
    for order in range(1, most + 1):
        if 2 + 4 * order > data.independent:
            break
        square, fewer = _grow(data, current, True), _grow(data, current, False)
        current = square
        better = min((square, fewer, best), key=lambda one: one.description)
        waited = 0 if better is not best else waited + 1
        best = better
        if waited >= _PATIENCE:
            break
    return best


def scattered(model: Rational, frequency: Array, responses: Complex, variance: Array, floor: float = 1e-3) -> Rational:
    """The same function, its covariance that of the parameters from one of `responses` (parts, bins) to the next.

    Each moves them by one Gauss-Newton step from those of the fit; `variance` (bins,) weighs the bins, as it did there.
    """
    _, data = _prepare(frequency, model.response(frequency), variance, model.integrators, model.hold, True, 1.0, np.inf, floor)
    good = np.isfinite(variance) & (frequency > 0.0)
    _, slope = _residual(data, model.parameters, model.zeros)
    free = np.diag(model.covariance) > 0.0
    normal = _normal(np.ascontiguousarray(slope[free]), np.ones(len(data.s)))
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal / scale / scale[:, None], rcond=1e-14, hermitian=True) / scale / scale[:, None]
    rest = (responses[:, good] / known_part(np.asarray(2j * np.pi * frequency[good]), model.integrators, model.hold)
            - data.target) * data.weight
    steps = (np.conj(slope[free]) @ rest.T).real.T @ inverse
    covariance = np.zeros_like(model.covariance)
    covariance[np.ix_(free, free)] = np.cov(steps.T)
    return replace(model, covariance=covariance)


def _prepare(frequency: Array, response: Complex, variance: Array, integrators: int, hold: float, with_delay: bool,
             correlated: float, freedom: float, floor: float) -> tuple[Array, _Data]:
    good = np.isfinite(response) & np.isfinite(variance) & (frequency > 0.0) & (response != 0.0)
    if not good.any():
        raise InputRejected("D09", "no frequency at which the response is known",
                            remedy="excite the frequencies that are asked for")
    frequency = frequency[good]
    s = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
    if len(frequency) < FEWEST:
        raise InputRejected("T08", f"{len(frequency)} frequencies are too few for a mode",
                            remedy="record longer, or ask for a finer resolution or a wider band")
    known = known_part(s, integrators, hold)
    target = response[good] / known
    spread = variance[good] / np.abs(known) ** 2 + (floor**2 + _EXACT) * np.abs(target) ** 2
    unit = float(2.0 * np.pi * np.sqrt(frequency[0] * frequency[-1]))
    return frequency, _Data(s / unit, target, np.sqrt(2.0 / spread), unit, with_delay, correlated, freedom)


def _rigid(data: _Data, shell: Rational) -> Rational:
    """Gain and delay alone, from no delay and from the one that brings most phases to zero: 2π is soon gone round."""
    gain = float(np.median(np.log(np.abs(data.target))))
    delays = [0.0]
    if data.with_delay:
        omega, turned = data.s.imag, data.target / np.abs(data.target)
        grid = np.arange(-_DELAYS, _DELAYS + 1) * (0.25 * np.pi / omega[-1])
        delays.append(float(grid[np.argmax((np.exp(1j * np.outer(grid, omega)) @ turned).real)]))
    starts = [replace(shell, parameters=np.array([gain, delay])) for delay in delays]
    found = [*(_refine(data, one) for one in starts), *(_judged(data, one) for one in starts)]
    # where modes tower over everything, the most likely gain alone is none at all: no place to go on from
    return min((one for one in found if abs(one.parameters[0] - gain) < _LEAP), key=lambda one: one.description)


def _residual(data: _Data, parameters: Array, zeros: int) -> tuple[Complex, Complex]:
    """Residual (bins,) and Jacobian (parameters, bins), weighted. ∂H/∂log b = ± H b s / section, ∂H/∂log a = ± H a s² / section."""
    value, sections = product(parameters, data.s, zeros)
    sign = np.where(np.arange(len(sections)) < zeros, 1.0, -1.0)[:, None]
    slope = np.empty((len(parameters), len(data.s)), dtype=np.complex128)
    slope[0], slope[1] = value, -data.s * value if data.with_delay else 0.0
    shared = sign * value * data.s / sections
    slope[2::2] = shared * np.exp(parameters[2::2, None])
    slope[3::2] = shared * np.exp(parameters[3::2, None]) * data.s
    return np.asarray((value - data.target) * data.weight), slope * data.weight


def _cost(rest: Complex, freedom: float) -> tuple[float, Array]:
    """-2 log-likelihood, and the weights (bins,) with which least squares lowers it.

    Where the variance is itself an estimate with ν degrees of freedom, |Ĝ - H|² / variance = u is F-distributed, and the sum is
    Σ 2 (ν + 1) log(1 + u / ν), weights (ν + 1) / (ν + u); with ν = ∞ it is Σ 2 u, weights 1.
    """
    twice = rest.real**2 + rest.imag**2
    if not np.isfinite(freedom):
        return float(twice.sum()), np.ones(len(rest))
    u = 0.5 * twice
    return float(2.0 * (freedom + 1.0) * np.log1p(u / freedom).sum()), np.asarray((freedom + 1.0) / (freedom + u))


def _refine(data: _Data, start: Rational) -> Rational:
    """The nearest most likely parameters: by least squares first, then with what is known of the variance."""
    p = _descend(data, start, np.inf)
    return _judged(data, replace(start, parameters=p if data.freedom == np.inf else
                                 _descend(data, replace(start, parameters=p), data.freedom)))


def _descend(data: _Data, start: Rational, freedom: float, steps: int = _STEPS, stop: float = _STOP) -> Array:
    """Gauss-Newton steps, shortened until the cost decreases."""
    p, damping = start.parameters, 1e-3
    with np.errstate(all="ignore"):
        rest, slope = _residual(data, p, start.zeros)
        cost, w = _cost(rest, freedom)
        for _ in range(steps):
            normal, gradient = _normal(slope, w), (np.conj(slope) @ (w * rest)).real
            scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
            matrix = normal / scale / scale[:, None]
            before = cost
            while damping < 1e8:
                step = np.linalg.solve(matrix + damping * np.eye(len(p)), gradient / scale) / scale
                tried, its_slope = _residual(data, p - step, start.zeros)
                its_cost, its_w = _cost(tried, freedom)
                if its_cost < cost and np.abs(np.delete(step, 1)).max() < _LEAP:
                    p, rest, slope, cost, w, damping = p - step, tried, its_slope, its_cost, its_w, max(damping / 10.0, 1e-12)
                    break
                damping *= 4.0
            if not before - cost > stop * before:
                break
    return p


def _normal(slope: Complex, w: Array) -> Array:
    """Re J W Jᴴ, of real and imaginary part side by side."""
    both = slope.view(np.float64)
    return np.asarray((both * np.repeat(w, 2)) @ both.T)


def _judged(data: _Data, model: Rational) -> Rational:
    """Covariance and length of the description, -2 log-likelihood + k log n.

    The information of a bin whose variance has ν degrees of freedom is ν / (ν + 2) of what its weight says. The covariance is wider
    where bins are correlated, or where the model does not fit.
    """
    rest, slope = _residual(data, model.parameters, model.zeros)
    cost, w = _cost(rest, data.freedom)
    free = np.ones(len(model.parameters), dtype=bool)
    free[1] = data.with_delay
    misfit = float((w * np.abs(rest) ** 2).sum()) / max(2.0 * len(data.s) - float(free.sum()), 1.0)
    normal = _normal(slope[free], w)
    if not np.isfinite(normal).all():
        return model  # poles on a measured frequency, or beyond all numbers: no description is longer
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal / scale / scale[:, None], rcond=1e-14, hermitian=True) / scale / scale[:, None]
    wider = data.correlated * max(misfit, 1.0) * (1.0 if data.freedom == np.inf else 1.0 + 2.0 / data.freedom)
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free, free)] = inverse * wider
    description = cost / data.correlated + float(free.sum()) * np.log(2.0 * data.independent)
    return replace(model, covariance=covariance, misfit=misfit, description=float(description))


def _grow(data: _Data, model: Rational, with_zeros: bool) -> Rational:
    """One more pair of poles, and one of zeros or none: the best of the trials, refined."""
    value, _ = product(model.parameters, data.s, model.zeros)
    weight, ratio = (data.weight * np.abs(value)) ** 2, data.target / value
    frequencies = np.abs(data.s[::max(1, len(data.s) // _FREQUENCIES)])
    a = np.repeat(1.0 / frequencies**2, len(_DAMPINGS))
    b = (2.0 * np.array(_DAMPINGS) / frequencies[:, None]).ravel()
    gain, zero, gained = _numerators(np.abs(data.s), weight, ratio, a, b, with_zeros)
    found = []
    for k in _separate(gained, len(_DAMPINGS)):
        base = model.parameters[:2] + np.array([np.log(gain[k]), 0.0])
        between, pole = 2 + 2 * model.zeros, np.array([b[k], a[k]])
        own = np.log(np.maximum(zero[k], _SMALLEST * pole[:len(zero[k])]))  # a best numerator may be none that is passive
        p = np.concatenate([base, model.parameters[2:between], own, model.parameters[between:], np.log(pole)])
        started = replace(model, parameters=p, zeros=model.zeros + int(with_zeros), poles=model.poles + 1)
        found.append(_judged(data, replace(started, parameters=_descend(data, started, np.inf, *_ROUGH))))
    return _refine(data, min(found, key=lambda one: one.description))


def _numerators(omega: Array, weight: Array, ratio: Complex, a: Array, b: Array, with_zeros: bool) -> tuple[Array, Array, Array]:
    """min Σ weight |ratio - (c + d s + e s²) / (1 + b s + a s²)|² for every a, b, real c, d, e; without zeros c alone.

    At s = jω the normal equations of d stand apart from those of c and e. Gives c, (d, e) / c, and what the sum loses; that
    is -1 where c is not positive.
    """
    below = 1.0 / ((1.0 - a[:, None] * omega**2) + 1j * (b[:, None] * omega))  # (trials, bins)
    power = (below.real**2 + below.imag**2) @ (weight[:, None] * np.stack([omega**0, omega**2, omega**4], axis=1))
    seen = below * (weight * np.conj(ratio))
    right = np.stack([seen.real.sum(axis=1), -seen.imag @ omega, -seen.real @ omega**2], axis=1)
    if not with_zeros:
        c = right[:, 0] / power[:, 0]
        return np.where(c > 0.0, c, 1.0), np.zeros((len(a), 0)), np.where(c > 0.0, c * right[:, 0], -1.0)
    determinant = power[:, 0] * power[:, 2] - power[:, 1] ** 2
    c = (power[:, 2] * right[:, 0] + power[:, 1] * right[:, 2]) / determinant
    e = (power[:, 0] * right[:, 2] + power[:, 1] * right[:, 0]) / determinant
    d = right[:, 1] / power[:, 1]
    gained, positive = c * right[:, 0] + d * right[:, 1] + e * right[:, 2], c > 0.0
    safe = np.where(positive, c, 1.0)
    return safe, np.stack([d, e], axis=1) / safe[:, None], np.where(positive, gained, -1.0)


def _separate(gained: Array, dampings: int) -> list[int]:
    """The best trial, and the best of those that do not neighbour it."""
    best = gained.reshape(-1, dampings)
    order = np.argsort(-best.max(axis=1))
    chosen: list[int] = []
    for k in order:
        if len(chosen) < _REFINED and all(abs(int(k) - j) > max(3, len(order) // 30) for j in chosen):
            chosen.append(int(k))
    return [k * dampings + int(best[k].argmax()) for k in chosen]

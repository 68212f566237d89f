"""What a log can show of the parameters, and what it cannot.

    condition_number(statistics)         of Φ itself: no weights, no scaling
    unresolved(solution, names)          which parameters cannot be separated, in words
    not_separated(solution, std, names)  groups of parameters that are determined only together
    hard_to_see(solution, names)         the weakest directions, strongest columns first
    visible(value, std, typical)         parameters worth printing as a number

Directions are those of columns scaled to unit length: what one of them weighs is its torque, not its unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.fit.equations import Array
from pipelines.fit.least_squares import Solution
from pipelines.fit.statistics import Statistics

__all__ = ["Direction", "Separation", "Unresolved", "condition_number", "hard_to_see", "not_separated", "typical_size",
           "unresolved", "visible"]

_WHOLE = 3.0  # a direction is lost if three standard deviations of it are as large as all that was measured
_SURE = 3.0  # standard deviations that a value must stand from zero
_SMALL = 0.05  # of the typical size: a value that is zero to within this is known to be nearly nothing
_NAMED = 0.15  # share of a direction below which a column is not worth naming
_INVOLVED = 1e-3  # share of an unresolved direction above which a parameter is not determined


@dataclass(frozen=True)
class Separation:
    """When parameters count as not separated (Belsley, Kuh & Welsch 1980, Regression Diagnostics, sec. 3.2)."""

    index: float = 10.0  # condition index from which on a dependency of columns does harm; 30 is a strong one
    share: float = 0.5  # of a parameter's variance that comes from such dependencies
    linked: float = 0.3  # of its variance, with which a parameter belongs to a dependency that competes with others
    torque: float = 0.5  # std of its torque over the residual: its interval of 2 std is then as wide as the residual


@dataclass(frozen=True)
class Direction:
    """A combination of parameters, by the share that each column has in its torque."""

    singular_value: float  # of columns of unit length; 1 is a column on its own
    weights: tuple[tuple[str, float], ...]  # the largest first; squares of all shares sum to one

    def __str__(self) -> str:
        words = " ".join(f"{'-' if w < 0 else '+'} {abs(w):.2f} {name}" for name, w in self.weights)
        return words.removeprefix("+ ")


@dataclass(frozen=True)
class Unresolved:
    """Parameters of which the log shows too little."""

    never_moved: tuple[str, ...]  # their columns are zero
    confused: tuple[tuple[str, ...], ...]  # groups that cannot be separated
    parameters: tuple[str, ...]  # all parameters without a trustworthy value, in order

    def __bool__(self) -> bool:
        return bool(self.parameters)

    def __str__(self) -> str:
        return self.told({})

    def told(self, called: Mapping[str, str]) -> str:
        """In a sentence, each parameter as it is `called` there; by its name where nothing is said of it."""
        def words(names: Sequence[str]) -> list[str]:
            return [called.get(name, name) for name in names]

        said = [f"no sample shows {', '.join(words(self.never_moved))}"] if self.never_moved else []
        for group in map(words, self.confused):
            said.append(f"{', '.join(group[:-1])} and {group[-1]} cannot be separated" if len(group) > 1 else
                        f"{group[0]} is lost in the noise")
        return "; ".join(said)


def condition_number(statistics: Statistics, columns: Sequence[int] | None = None) -> float:
    """Largest over smallest singular value of Φ in SI units. Kostić et al. 2004, eq. (13)."""
    a = statistics.root(np.ones(len(statistics.power)))[:, :-1]
    s = np.linalg.svd(a if columns is None else a[:, list(columns)], compute_uv=False)
    return float(s[0] / s[-1]) if s[-1] > statistics.floor * s[0] else float("inf")


def _resolved(solution: Solution, inflation: float) -> npt.NDArray[np.bool_]:
    """A direction is resolved if its standard deviation is below a third of the whole signal.

    With columns of unit length a direction's coordinate has the unit of √(Σ w y²), and a standard deviation 1/s of a
    residual of unit variance: a direction in which even a third of all that was measured could hide is not seen.
    `inflation` is how much the residual's memory adds.
    """
    e = solution.errors
    signal = np.sqrt(np.sum(solution.weights * np.square(e.signal_rms) * e.counts))
    unit = np.sqrt(np.mean(solution.weights * np.square(solution.sigma)))
    ok: npt.NDArray[np.bool_] = solution.singular_values * signal > _WHOLE * unit * inflation
    return ok & (np.arange(len(ok)) < solution.rank)


def unresolved(solution: Solution, names: Sequence[str], inflation: float = 1.0) -> Unresolved:
    """Name what cannot be seen: columns that are zero, and groups of columns that only show together."""
    lost = solution.directions[~_resolved(solution, inflation)]
    involved = [int(k) for k in np.flatnonzero(np.any(np.abs(lost) > _INVOLVED, axis=0))]
    alone, groups = [], []
    for vector in _sparse(lost):
        group = np.flatnonzero(np.abs(vector) > _NAMED * np.abs(vector).max())
        if len(group) == 1 and not solution.acting[group[0]]:
            alone.append(int(group[0]))
        else:
            groups.append(tuple(int(k) for k in group))
    return Unresolved(tuple(names[k] for k in sorted(alone)), tuple(tuple(names[k] for k in g) for g in sorted(groups)),
                      tuple(names[k] for k in involved))


def _sparse(space: Array) -> Array:
    """A basis of the same rows with as many zeros as rows: reduced row echelon form with the largest pivots."""
    rows = space.copy()
    for k in range(len(rows)):
        i, j = np.unravel_index(int(np.argmax(np.abs(rows[k:]))), rows[k:].shape)
        rows[[k, k + int(i)]] = rows[[k + int(i), k]]
        rows[k] /= rows[k, j]
        others = np.arange(len(rows)) != k
        rows[others] -= rows[others, j, None] * rows[k]
    return rows


def not_separated(solution: Solution, std: Array, names: Sequence[str],
                  config: Separation | None = None) -> tuple[tuple[str, ...], ...]:
    """Return groups of parameters of which these equations determine the sum of torques better than each.

    Variance decomposition: with singular values μ_j and directions v_j of columns of unit length, var β_k is proportional to
    Σ_j (v_kj / μ_j)²; the share of j is what that dependency adds. A group is what shares dependencies of a high condition
    index μ_max / μ_j, and whose torques, each by itself, are uncertain beside the residual.

    Args:
        std: of the parameters (k,), with the memory of the residual allowed for.
    """
    config = config or Separation()
    values = solution.singular_values
    floor = np.where(values > 0.0, values, np.finfo(float).eps * values[0])
    shares = (solution.directions / floor[:, None]) ** 2
    shares = shares / np.maximum(shares.sum(axis=0), 1e-300)
    weak = shares[values[0] / floor >= config.index]
    power = np.square(solution.scale * np.where(np.isfinite(std), std, np.inf))  # of its torque, in units of the residual's
    uncertain = power >= config.torque**2 * solution.errors.samples
    members = np.flatnonzero((weak.sum(axis=0) >= config.share) & uncertain & solution.acting)
    groups: list[tuple[set[int], set[int]]] = []  # parameters, dependencies
    for k in members.tolist():
        own, dependencies = {int(k)}, set(np.flatnonzero(weak[:, k] >= config.linked).tolist())
        for group in [g for g in groups if g[1] & dependencies]:
            groups.remove(group)
            own, dependencies = own | group[0], dependencies | group[1]
        groups.append((own, dependencies))
    return tuple(tuple(names[k] for k in sorted(own)) for own, _ in groups if len(own) > 1)


def hard_to_see(solution: Solution, names: Sequence[str], count: int = 3) -> tuple[Direction, ...]:
    """The `count` weakest directions, the weakest first."""
    found = []
    for s, v in list(zip(solution.singular_values, solution.directions, strict=True))[::-1][:count]:
        order: list[int] = [int(k) for k in np.argsort(-np.abs(v), kind="stable")]
        sign = np.sign(v[order[0]])
        found.append(Direction(float(s), tuple((names[k], float(sign * v[k])) for k in order if abs(v[k]) >= _NAMED)))
    return tuple(found)


def typical_size(value: Array, std: Array, groups: Sequence[str]) -> Array:
    """For each parameter the root mean square of those of its group (its unit, say) that stand out of their noise."""
    typical = np.zeros(len(value))
    sure = np.isfinite(std) & (np.abs(value) > _SURE * std)
    for group in set(groups):
        members = np.array([other == group for other in groups])
        known = value[members & sure]
        typical[members] = np.sqrt(np.mean(np.square(known))) if len(known) else 0.0
    return typical


def visible(value: Array, std: Array, typical: Array | None = None) -> npt.NDArray[np.bool_]:
    """Return whether each parameter is visible: its value is known to a third, or known to be small.

    |value| > 3 std, or std ≤ 5 % of `typical`, the size of its like: a parameter that is truly zero never stands out of
    its noise, and is yet well known where that noise is small.
    """
    known = np.isfinite(std) & (np.abs(value) > _SURE * std)
    if typical is not None:
        known |= (typical > 0.0) & (std <= _SMALL * typical)
    return known

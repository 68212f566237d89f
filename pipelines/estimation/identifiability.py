"""Decide which parameters logs determine, and which they cannot separate.

    condition_number(statistics)         of Φ itself: no weights, no scaling
    unresolved(solution, names)          which parameters cannot be separated, in words
    not_separated(solution, std, names)  groups of parameters that are determined only together
    visible(value, std, typical)         parameters worth printing as a number

Directions are those of columns scaled to unit length: what one of them weighs is its torque, not
its unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.estimation.config import UncertaintyConfig
from pipelines.estimation.least_squares import Flags, Solution, Statistics
from pipelines.io.log import Array

_CONFIG = UncertaintyConfig()


@dataclass(frozen=True)
class Unresolved:
    """Parameters of which the log shows too little."""

    never_moved: tuple[str, ...]  # their columns are zero
    confused: tuple[tuple[str, ...], ...]  # groups that cannot be separated
    parameters: tuple[str, ...]  # all parameters without a trustworthy value, in order

    def told(self, called: Mapping[str, str]) -> str:
        """Return a sentence, each parameter by its name in `called`, or by its own."""
        said = []
        if self.never_moved:
            never = ", ".join(called.get(name, name) for name in self.never_moved)
            said.append(f"no sample shows {never}")
        for names in self.confused:
            *group, last = (called.get(name, name) for name in names)
            together = f"{', '.join(group)} and {last} cannot be separated"
            said.append(together if group else f"{last} is lost in the noise")
        return "; ".join(said)


def condition_number(statistics: Statistics, columns: Sequence[int] | None = None) -> float:
    """Return largest over smallest singular value of Φ in SI. Kostić et al. 2004, eq. (13)."""
    a = statistics.root(np.ones(len(statistics.power)))[:, :-1]
    s = np.linalg.svd(a if columns is None else a[:, list(columns)], compute_uv=False)
    return float(s[0] / s[-1]) if s[-1] > statistics.floor * s[0] else float("inf")


def _resolved(solution: Solution, inflation: float) -> Flags:
    """Return which directions have a standard deviation below a third of the whole signal.

    With columns of unit length a direction's coordinate has the unit of √(Σ w y²), and a standard
    deviation 1/s of a residual of unit variance: a direction in which even a third of all that was
    measured could hide is not seen. `inflation` is how much the residual's memory adds.
    """
    e, w = solution.errors, solution.weights
    signal = np.sqrt(np.sum(w * np.square(e.signal_rms) * e.counts))
    unit = np.sqrt(np.mean(w * np.square(solution.sigma)))
    ok: Flags = solution.singular_values * signal > _CONFIG.whole * unit * inflation
    return ok & (np.arange(len(ok)) < solution.rank)


def unresolved(solution: Solution, names: Sequence[str], inflation: float = 1.0) -> Unresolved:
    """Return what cannot be seen: zero columns, and groups of columns that only show together."""
    lost = solution.directions[~_resolved(solution, inflation)]
    involved = np.flatnonzero(np.any(np.abs(lost) > _CONFIG.involved, axis=0)).tolist()
    groups = []
    for vector in _sparse(lost):
        weights = np.abs(vector)
        groups.append(np.flatnonzero(weights > _CONFIG.named * weights.max()).tolist())
    alone = [g[0] for g in groups if len(g) == 1 and not solution.acting[g[0]]]
    confused = sorted(group for group in groups if len(group) > 1 or group[0] not in alone)
    return Unresolved(
        tuple(names[k] for k in sorted(alone)),
        tuple(tuple(names[k] for k in group) for group in confused),
        tuple(names[k] for k in involved),
    )


def _sparse(space: Array) -> Array:
    """Return a basis of the same rows with as many zeros as rows: reduced, with largest pivots."""
    rows = space.copy()
    for k in range(len(rows)):
        i, j = np.unravel_index(int(np.argmax(np.abs(rows[k:]))), rows[k:].shape)
        rows[[k, k + int(i)]] = rows[[k + int(i), k]]
        rows[k] /= rows[k, j]
        others = np.arange(len(rows)) != k
        rows[others] -= rows[others, j, None] * rows[k]
    return rows


def not_separated(
    solution: Solution, std: Array, names: Sequence[str]
) -> tuple[tuple[str, ...], ...]:
    """Return groups of parameters whose sum of torques is determined better than each.

    Variance decomposition (Belsley, Kuh & Welsch 1980, Regression Diagnostics, sec. 3.2): with
    singular values μ_j and directions v_j of columns of unit length, var β_k is proportional to
    Σ_j (v_kj / μ_j)²; the share of j is what that dependency adds. A group is what shares
    dependencies of a high condition index μ_max / μ_j, and whose torques, each by itself, are
    uncertain compared with the residual.

    Args:
        std: of the parameters (k,), with the memory of the residual allowed for.
    """
    values = solution.singular_values
    floor = np.where(values > 0.0, values, np.finfo(float).eps * values[0])
    shares = (solution.directions / floor[:, None]) ** 2
    shares = shares / np.maximum(shares.sum(axis=0), 1e-300)
    weak = shares[values[0] / floor >= _CONFIG.index]
    # of its torque, in units of the residual's
    power = np.square(solution.scale * np.where(np.isfinite(std), std, np.inf))
    uncertain = power >= _CONFIG.torque**2 * solution.errors.samples
    members = np.flatnonzero((weak.sum(axis=0) >= _CONFIG.share) & uncertain & solution.acting)
    groups: list[tuple[set[int], set[int]]] = []  # parameters, dependencies
    for k in members.tolist():
        own, links = {k}, set(np.flatnonzero(weak[:, k] >= _CONFIG.linked).tolist())
        for group in [g for g in groups if g[1] & links]:
            groups.remove(group)
            own, links = own | group[0], links | group[1]
        groups.append((own, links))
    return tuple(tuple(names[k] for k in sorted(own)) for own, _ in groups if len(own) > 1)


def typical_size(value: Array, std: Array, groups: Sequence[str]) -> Array:
    """Return for each parameter the rms of those of its group that stand out of their noise."""
    typical = np.zeros(len(value))
    sure = visible(value, std)
    for group in set(groups):
        members = np.array([other == group for other in groups])
        known = value[members & sure]
        typical[members] = np.sqrt(np.mean(np.square(known))) if len(known) else 0.0
    return typical


def visible(value: Array, std: Array, typical: Array | float = 0.0) -> Flags:
    """Return whether each parameter's value is known to a third, or known to be small.

    |value| > 3 std, or std ≤ 5 % of `typical`, the size of its like: a parameter that is truly zero
    never stands out of its noise, and is yet well known where that noise is small.
    """
    known: Flags = np.isfinite(std) & (np.abs(value) > _CONFIG.sure * std)
    return known | ((np.asarray(typical) > 0.0) & (std <= _CONFIG.small * np.asarray(typical)))

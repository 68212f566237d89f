"""Estimate variance components of standing numbers, and the noise of each session.

    found = components(table, y, groups, n_nominal, config)
    dataset, columns = settle(dataset, dictionary, config)

Standing numbers s_g ~ N(0, τ_g), with τ_g by empirical Bayes: expectation maximisation, each group
shrunk to its family (Dempster, Laird & Rubin 1977; Efron & Morris 1973). The noise Σ of each
session is an autoregressive process for each joint: what the nominal model and every candidate
together leave, fitted to rows alone by generalised least squares (Cochrane & Orcutt 1949).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.diagnosis.candidates import Dictionary, Group
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset, Rows
from pipelines.diagnosis.events import windows_of
from pipelines.diagnosis.screening import Screened, best_of, screen
from pipelines.dynamics.arm import Arm
from pipelines.estimation.joint_table import Array, Arrow, Indices, Structure, Table

__all__ = ["Components", "components", "settle"]

Through = Callable[[Table], Table]

_FLAT = 1e-10  # numerics: of a column's information
_START = 1e-2  # numerics: variance at which the expectation maximisation begins
_AT_ONCE = 100  # numerics: groups of columns that are whitened together
_EM_ROUNDS = 8  # numerics: rounds of it; more change the variances by less than a tenth


@dataclass(frozen=True, eq=False)
class Components:
    """Standing numbers and their variances."""

    flat: Array  # (nominal,) precision
    mean_square: Array  # (standing,) of each column
    variance: Array  # (standing,) τ_g of a row, in units of the noise
    mean: Array  # (nominal + standing,) of the numbers

    @property
    def precision(self) -> Array:
        """(nominal + standing,)"""
        return np.asarray(np.r_[self.flat, self.mean_square / self.variance])


def components(
    gram: Array,
    moment: Array,
    structure: Structure,
    rows: int,
    of: Sequence[Group],
    config: DiagnosisConfig,
    power: float | None = None,
) -> Components:
    """Return the numbers and variances of the standing columns.

    Args:
        gram: B Bᵀ (k, k), B the nominal columns and, behind them, the standing ones.
        moment: B y (k,).
        structure: of the columns.
        of: group of each standing column.
        power: yᵀ y, where the variance of the noise is not 1 and has to be found.
    """
    n_nominal = len(gram) - len(of)
    own, family = _numbered([(g.key, g.shape) for g in of]), _numbered([_family(g) for g in of])
    mean_square = np.maximum(np.diag(gram)[n_nominal:] / rows, 1e-30)
    largest = np.zeros(int(own.max()) + 1)
    np.maximum.at(largest, own, mean_square)
    alike = np.array([g.kind == "unnamed" for g in of])  # columns that share a variance [(N m)²]
    mean_square = np.where(alike, largest[own], mean_square)
    square = np.diag(gram)[:n_nominal]
    flat = _FLAT * np.where(square > 0.0, square, 1.0)
    tau, mean, noise = np.full(len(own), _START), np.zeros(len(gram)), 1.0
    per_group, per_family = np.bincount(own), np.bincount(family)
    for _ in range(_EM_ROUNDS):
        precision = np.r_[flat, mean_square / tau]
        info = Arrow.of(gram / noise + np.diag(precision), structure)
        mean, spread = info.solve(moment / noise), info.inverse_diagonal
        energy = (mean[n_nominal:] ** 2 + spread[n_nominal:]) * mean_square
        of_family = np.bincount(family, energy) / per_family
        pooled = np.bincount(own, energy)[own] + config.variance_prior * of_family[family]
        tau = np.maximum(pooled / (per_group[own] + config.variance_prior), 1e-12)
        if power is not None:
            rss = power - 2.0 * float(mean @ moment) + float(mean @ gram @ mean)
            noise = rss / (rows - len(gram) + float(spread @ precision))
    return Components(flat, mean_square, tau, mean)


def _numbered(names: Sequence[Hashable]) -> Indices:
    """Return the number of each name, in order of appearance."""
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return np.array([number[name] for name in names], dtype=np.intp)


def _family(group: Group) -> tuple[str, int | None]:
    """Return the key that shares a variance: of a ripple its joint, of any order."""
    return (group.family, group.key[1])


def settle(
    dataset: Dataset,
    dictionary: Dictionary,
    config: DiagnosisConfig,
    cause: Array | None = None,
    fit: Array | None = None,
    reference: tuple[Rows, Table] | None = None,
) -> tuple[Dataset, Callable[[], Dictionary]]:
    """Return the rows of each session whitened, in units of its own noise, and their columns.

    Sessions that are compared use the same columns, the first shapes, so that their residuals are
    comparable. Rows alone use the best shape of each cause, and the best window of each log, or a
    fault of another shape would be noise. The columns, which take most memory, are made when they
    are asked for.

    Args:
        cause: (rows,) [N m] torque of causes found before, which is no noise of the later rows.
        fit: (rows,) [N m] torque of the whole fitted model; the residual of the rows is the noise.
        reference: rows and columns of the reference that were whitened before.
    """
    alone = dataset.reference is None
    first = tuple(group for group in dictionary.groups if group.shape == 0)

    def noise_of(rows: Rows, table: Table, white: Rows, through: Through) -> list[Array]:
        every = dictionary.groups
        groups = _best_shapes(white, table, through, every) if alone else first
        own = table.take(np.concatenate([g.columns for g in groups]))
        numbers = _imitated(white, through(own), groups, config)
        torque = Table.stacked([rows.nominal, own]).times(numbers)
        noise = [y - t for y, t in zip(rows.y, torque, strict=True)]
        return _less_events(rows, dictionary, dataset.arm, noise) if alone else noise

    rows, table, bins = dataset.later.less(fit), dictionary.later, config.noise_bins
    noise = noise_of(rows, table, rows, _as_they_are)
    if alone:  # what fits best depends on the noise
        noise = noise_of(rows, table, *rows.whitened(noise, bins))
    cleared, to_later = dataset.later.less(cause).whitened(noise, bins)
    now = replace(dataset, later=cleared.less(None), cleared=cleared)
    before, own = dataset.reference, dictionary.reference
    if reference is None and before is not None and own is not None:
        white, through = before.whitened(noise_of(before, own, before, _as_they_are), bins)
        reference = white, through(own)
    if reference is not None:
        white, columns = reference
        now, dictionary = replace(now, reference=white), replace(dictionary, reference=columns)
    return now, lambda: replace(dictionary, later=to_later(table))


def _as_they_are(table: Table) -> Table:
    return table


def _best_shapes(
    rows: Rows, table: Table, through: Through, groups: Sequence[Group]
) -> tuple[Group, ...]:
    """Return each cause's shape at each joint that explains most beside the nominal columns.

    Args:
        table: all candidates.
        through: brings columns of it to the rows; it is asked for some at a time.
    """
    nominal = rows.nominal.scaled(1.0 / rows.nominal.lengths)
    known = Arrow.of(nominal.gram(nominal) + _FLAT * np.eye(nominal.width), Structure.of(nominal))
    left = known.solve(nominal.moments(rows.y))
    found: list[Screened] = []
    for first in range(0, len(groups), _AT_ONCE):
        some, start = groups[first : first + _AT_ONCE], groups[first].first
        own = through(table.take(np.arange(start, some[-1].span.stop)))
        near = [replace(group, first=group.first - start) for group in some]
        cross = nominal.gram(own)
        moments = own.moments(rows.y) - cross.T @ left
        each = screen(near, known, cross, own.squares([g.span for g in near]), moments)
        found += [replace(one, group=group) for one, group in zip(each, some, strict=True)]
    return tuple(one.group for one in best_of(found).values())


def _less_events(rows: Rows, dictionary: Dictionary, arm: Arm, y: Sequence[Array]) -> list[Array]:
    """Return a residual (rows of each joint) less the push that explains most of each log."""
    out = [r.copy() for r in y]
    for log in range(len(rows.data.logs)):
        windows = windows_of(rows, dictionary, arm, y, log)
        if not windows:
            continue
        best = max(windows, key=lambda window: window.gain)
        for own, push in zip(out, best.push, strict=True):
            own[best.rows] -= push
    return out


def _imitated(
    rows: Rows, columns: Table, groups: Sequence[Group], config: DiagnosisConfig
) -> Array:
    """Return the numbers (nominal + columns,) that fit the rows best; the columns are of groups."""
    unit = 1.0 / rows.nominal.lengths
    nominal = rows.nominal.scaled(unit)
    of = [g for g in groups for _ in range(g.width)]
    table = Table.stacked([nominal, columns])
    power = sum(float(y @ y) for y in rows.y)
    gram, moment, structure = table.gram(table), table.moments(rows.y), Structure.of(table)
    found = components(gram, moment, structure, rows.count, of, config, power)
    return np.asarray(np.r_[found.mean[: nominal.width] * unit, found.mean[nominal.width :]])

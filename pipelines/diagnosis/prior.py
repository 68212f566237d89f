"""Prior of a healthy machine: variance components, and the posterior of the reference.

    prior = reference_prior(dataset, dictionary, config)
    prior.of(parts)                        information of the numbers of later logs

Nominal numbers b have a flat prior in the reference. Standing numbers s_g ~ N(0, τ_g), with τ_g by
empirical Bayes: expectation maximisation, each group shrunk to its family (Efron & Morris 1973).
The prior of later logs is the posterior N(m, V) of the reference, plus what may drift between sessions
without a fault: friction, by a relative standard deviation; rigid-body numbers not at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.diagnosis.candidates import FORM, Dictionary, Group
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset
from pipelines.diagnosis.table import Array, Indices, Table

__all__ = ["Prior", "reference_prior"]

_FLAT = 1e-10  # numerics: of a column's information
_LEAST_VARIANCE = 2e-5  # numerics: of a row, in units of its noise; less cannot be seen in 1e5 rows


@dataclass(frozen=True, eq=False)
class Prior:
    """Gaussian knowledge of nominal and standing numbers; columns are scaled to unit noise."""

    scale: Array  # (nominal,) length of each nominal column in the reference
    noise: float  # variance of a row that neither model explains
    standing: Indices  # columns of the dictionary
    precision: Array  # (k, k) of the numbers before any log
    drift: Array  # (k,) variance between sessions
    parts: tuple[
        tuple[np.ndarray, ...], ...
    ]  # masks (rows,) of each joint, for each part of the reference
    grams: tuple[Array, ...]  # (k, k) of each part
    moments: tuple[Array, ...]

    @property
    def n_nominal(self) -> int:
        return len(self.scale)

    def table(self, nominal: Table, dictionary: Table) -> Table:
        """Return B = [N D] in units of the noise, of the reference or of the later rows."""
        columns = Table.stacked([nominal.scaled(1.0 / self.scale), dictionary.take(self.standing)])
        return columns.scaled(np.full(columns.width, self.noise**-0.5))

    def of(self, parts: range | tuple[int, ...]) -> tuple[Array, Array]:
        """Return information A and A m of later numbers, after some parts of the reference.

        (V + U Q Uᵀ)⁻¹ = A - A U (Q⁻¹ + Uᵀ A U)⁻¹ Uᵀ A (Woodbury).
        """
        info = self.precision + sum(self.grams[k] for k in parts)
        moment = sum(self.moments[k] for k in parts)
        free = np.flatnonzero(self.drift)
        side = info[:, free]
        inner = np.diag(1.0 / self.drift[free]) + side[free]
        new = info - side @ np.linalg.solve(inner, side.T)
        new = 0.5 * (new + new.T)
        return new, new @ np.linalg.solve(info, moment)


def reference_prior(dataset: Dataset, dictionary: Dictionary, config: DiagnosisConfig) -> Prior:
    """Return the posterior of the reference with its variance components."""
    rows = dataset.reference
    groups = [group for group in dictionary.groups if group.standing]
    scale = rows.nominal.norms
    columns = dictionary.standing()
    table = Table.stacked([rows.nominal.scaled(1.0 / scale), dictionary.reference.take(columns)])
    parts = _halves(dataset)
    grams = np.array([table.gram(table, part) for part in parts])
    moments = np.array([table.moments(rows.y, part) for part in parts])
    power = sum(float(y @ y) for y in rows.y)
    tau, noise = _components(
        grams.sum(axis=0), moments.sum(axis=0), power, rows.count, groups, len(scale), config
    )
    n_nominal = len(scale)
    keep = np.flatnonzero(np.r_[np.ones(n_nominal, bool), tau.variance > _LEAST_VARIANCE])
    precision = np.diag(np.r_[tau.flat, tau.mean_square / tau.variance][keep])
    at = np.ix_(keep, keep)
    return Prior(
        scale,
        noise,
        columns[keep[n_nominal:] - n_nominal],
        precision,
        _drift(dataset, scale, tau, groups, config)[keep],
        parts,
        tuple(gram[at] / noise for gram in grams),
        tuple(m[keep] / noise for m in moments),
    )


@dataclass(frozen=True, eq=False)
class _Components:
    flat: Array  # (nominal,) precision
    mean_square: Array  # (standing,) of each column
    variance: Array  # (standing,) τ_g of a row


def _components(
    gram: Array,
    moment: Array,
    power: float,
    rows: int,
    groups: list[Group],
    n_nominal: int,
    config: DiagnosisConfig,
) -> tuple[_Components, float]:
    """Return the variance of each standing column, and that of the noise, by EM."""
    own = np.concatenate([np.full(g.width, k) for k, g in enumerate(groups)])
    names = list(dict.fromkeys(_family(g) for g in groups))
    family = np.concatenate([np.full(g.width, names.index(_family(g))) for g in groups])
    mean_square = np.maximum(np.diag(gram)[n_nominal:] / rows, 1e-30)
    for k, group in enumerate(groups):
        if group.kind == "unnamed":  # its columns are alike, and share a variance [(N m)²]
            mean_square[own == k] = mean_square[own == k].max()
    flat = _FLAT * np.diag(gram)[:n_nominal]
    noise, tau = 1.0, np.full(len(own), 1e-2)  # where EM begins
    per_group, per_family = np.bincount(own), np.bincount(family)
    for _ in range(config.em_rounds):
        precision = np.r_[flat, mean_square / tau]
        covariance = np.linalg.inv(gram / noise + np.diag(precision))
        mean = covariance @ (moment / noise)
        spread = np.diag(covariance)
        energy = (mean[n_nominal:] ** 2 + spread[n_nominal:]) * mean_square
        of_family = np.bincount(family, energy) / per_family
        pooled = np.bincount(own, energy)[own] + config.variance_prior * of_family[family]
        tau = np.maximum(pooled / (per_group[own] + config.variance_prior), 1e-12)
        rss = power - 2.0 * float(mean @ moment) + float(mean @ gram @ mean)
        noise = rss / (rows - len(gram) + float(spread @ precision))
    return _Components(flat, mean_square, tau), noise


def _family(group: Group) -> tuple[str, int | None]:
    """Return the key that shares a variance: of a ripple its joint, of any order."""
    return (group.key[0].split()[0], group.key[1])


def _drift(
    dataset: Dataset,
    scale: Array,
    tau: _Components,
    groups: list[Group],
    config: DiagnosisConfig,
) -> Array:
    """Return the variance between sessions of each scaled number: friction drifts."""
    beta, rigid = dataset.model.beta, len(dataset.model.columns.kept)
    usual = np.r_[beta[rigid:] * scale[rigid : len(beta)], scale[len(beta) :]] ** 2
    form = np.concatenate([np.full(g.width, float(g.key[0] == FORM)) for g in groups])
    every = np.r_[np.zeros(rigid), usual, form * tau.variance / tau.mean_square]
    return np.asarray(config.friction_drift**2 * every)


def _halves(dataset: Dataset) -> tuple[tuple[np.ndarray, ...], ...]:
    """Return the first and the second half of each reference log, as masks of each joint's rows."""
    data = dataset.reference.data
    out = []
    for k in range(len(data.logs)):
        own = data.log_of == k
        late = data.t > np.median(data.t[own])
        out += [
            tuple((own & (late == half))[data.joint == j] for j in range(data.n_joints))
            for half in (False, True)
        ]
    return tuple(out)

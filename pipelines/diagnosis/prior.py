"""Compute the prior of a healthy machine from its reference logs, or from its other joints.

    prior = prior_of(dataset, dictionary, config)
    prior.start                 information and mean of the numbers before the later logs
    prior.of(parts)             the same after some parts of the known logs
    belief = Belief(info, mean, base, gram, structure, block)    the prior beside the later rows
    belief.cost(theta, residual)          ‖r‖² + (θ - m)ᵀ A (θ - m)
    belief.beside(effects)                factor of the information of all numbers, with effects
    belief.losses(effects, residual)      squared error of each block, predicted from all others

With reference logs, the prior of later logs is their posterior N(m, V), plus what may drift between
sessions without a fault: friction, by a relative standard deviation; rigid-body numbers not at all.
Without them nominal numbers have a flat prior, and standing ones are as large as is typical of
their family over the joints of this machine: a fault exceeds its family.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipelines.diagnosis.candidates import Dictionary, Group
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset
from pipelines.diagnosis.score import Blocks
from pipelines.diagnosis.unnamed import FORM
from pipelines.diagnosis.variance import Components, components
from pipelines.effects import find_effect
from pipelines.effects.base import FrictionLaw
from pipelines.estimation.joint_table import Array, Arrow, Indices, Structure, Table

__all__ = ["RIDGE", "Belief", "Prior", "of_any_size", "prior_of", "rubs"]

RIDGE = 1e-9  # numerics: of unit columns of an effect, which may be dependent
_FREE = 1e-6  # numerics: of the information along a direction that is freed, or not held


@dataclass(frozen=True, eq=False)
class Belief:
    """θ ~ N(m, A⁻¹), and the rows y = θ B + e that will tell more of it."""

    info: Array  # A (k, k)
    mean: Array  # m (k,)
    base: Table  # B
    gram: Array  # B Bᵀ
    structure: Structure
    block: tuple[Indices, ...]  # of each joint's rows

    @cached_property
    def after(self) -> Arrow:
        """The factor of P = A + B Bᵀ."""
        return Arrow.of(self.info + self.gram, self.structure)

    def cost(self, theta: Array, residual: Sequence[Array]) -> float:
        """Return ‖r‖² + (θ - m)ᵀ A (θ - m)."""
        away = theta - self.mean
        return float(sum(r @ r for r in residual) + away @ self.info @ away)

    def slope(self, theta: Array, residual: Sequence[Array]) -> Array:
        """Return the slope (k,) of -cost / 2 by θ."""
        return np.asarray(self.info @ (self.mean - theta) + self.base.moments(residual))

    def beside(self, effects: Table, damping: float = RIDGE) -> Arrow:
        """Return the factor of [P, B Eᵀ; E Bᵀ, E Eᵀ + damping I], E the columns of effects."""
        own = effects.gram(effects) + damping * np.eye(effects.width)
        return self.after.widened(self.base.gram(effects), own)

    def losses(self, effects: Table, residual: Sequence[Array]) -> Array:
        """Return the squared error (blocks,) of each block of rows, predicted from all others."""
        if not effects.width:
            return self._blocks.losses(residual)
        across = self.base.gram(effects)
        half = self.after.half(across)
        own = effects.gram(effects) + RIDGE * np.eye(effects.width) - half.T @ half
        into = np.linalg.inv(np.linalg.cholesky(own))
        both = Table.stacked([self.base, effects])
        every = np.concatenate([-self.after.solve(across), np.eye(effects.width)]) @ into.T
        return self._blocks.losses(residual, both.times(every))

    @cached_property
    def _blocks(self) -> Blocks:
        return Blocks.of(self.base, self.after, self.block)

    def exactly(self, nominal: Table) -> Belief:
        """Return the same of rows that follow other nominal columns, which are the first ones."""
        first = np.arange(nominal.width)
        rest = self.base.take(np.arange(nominal.width, self.base.width))
        base, gram = Table.stacked([nominal, rest]), self.gram.copy()
        gram[first] = nominal.gram(base)
        gram[:, first] = gram[first].T
        return replace(self, base=base, gram=gram)

    def information(self, effects: Table) -> Array:
        """Return the information of all numbers, whose factor `beside` gives."""
        across, own = self.base.gram(effects), effects.gram(effects) + RIDGE * np.eye(effects.width)
        return np.block([[self.info + self.gram, across], [across.T, own]])

    def freed(self, along: Array) -> Belief:
        """Return the belief that knows nothing along directions (k, d) of unit length."""
        side = self.info @ along
        inner = along.T @ side
        inner = inner + _FREE * np.trace(inner) * np.eye(len(inner))
        free = self.info - side @ np.linalg.solve(inner, side.T)
        free = 0.5 * (free + free.T)
        return replace(self, info=free)

    def held(self, at: Indices) -> Belief:
        """Return the belief with some of the numbers fixed at their mean."""
        info = self.info.copy()
        info[at, at] += np.diag(self.gram)[at] / _FREE
        return replace(self, info=info)


_LEAST_VARIANCE = 2e-5  # numerics: of a row, in units of its noise; less cannot be seen in 1e5 rows
_ROUNDING = 1e-13  # numerics: of each number's information: more than the differences round off
_PARTS = 8  # numerics: of the known logs at most, of which splits are made


@dataclass(frozen=True, eq=False)
class Prior:
    """Gaussian knowledge of nominal and standing numbers; columns are scaled to unit noise."""

    scale: Array  # (nominal,) length of each nominal column in the known logs
    standing: Indices  # columns of the dictionary
    groups: tuple[Group, ...]  # of each of them
    precision: Array  # (k, k) of the numbers before any log, as the known logs have their variances
    drift: Array  # (k,) variance between sessions
    parts: tuple[tuple[np.ndarray, ...], ...]  # masks (rows,) of each joint, of parts of known logs
    grams: tuple[Array, ...]  # (k, k) of each part
    moments: tuple[Array, ...]
    start: tuple[Array, Array]  # information A and mean m before the later logs
    structure: Structure  # of the numbers

    @property
    def n_nominal(self) -> int:
        return len(self.scale)

    def table(self, nominal: Table, dictionary: Table) -> Table:
        """Return B = [N D], of the known or of the later rows."""
        return Table.stacked([nominal.scaled(1.0 / self.scale), dictionary.take(self.standing)])

    def nominal(self, info: Array, mean: Array) -> Prior:
        """Return a prior of the nominal numbers alone, by information (n, n) and mean (n,)."""
        structure = Structure.all_shared(self.n_nominal, len(self.structure.own))
        none = np.zeros(0, dtype=np.intp)
        return replace(self, standing=none, groups=(), start=(info, mean), structure=structure)

    def of(self, parts: range | tuple[int, ...]) -> tuple[Array, Array]:
        """Return information A and mean of numbers of a later session, after some parts.

        (V + U Q Uᵀ)⁻¹ = A - A U (Q⁻¹ + Uᵀ A U)⁻¹ Uᵀ A (Woodbury).
        """
        info = self.precision + np.sum([self.grams[k] for k in parts], axis=0)
        moment = np.sum([self.moments[k] for k in parts], axis=0)
        free = np.flatnonzero(self.drift)
        side = info[:, free]
        inner = np.diag(1.0 / self.drift[free]) + side[free]
        new = info - side @ np.linalg.solve(inner, side.T)
        new = 0.5 * (new + new.T) + _ROUNDING * np.diag(np.diag(info))
        return new, Arrow.of(info, self.structure).solve(moment)


def prior_of(dataset: Dataset, dictionary: Dictionary, config: DiagnosisConfig) -> Prior:
    """Return what is known before the later logs are looked at."""
    rows = dataset.known
    groups = [group for group in dictionary.groups if group.standing]
    of = [group for group in groups for _ in range(group.width)]
    scale = rows.nominal.lengths
    columns, first = dictionary.standing(), len(scale)
    table = Table.stacked([rows.nominal.scaled(1.0 / scale), dictionary.known.take(columns)])
    parts = _parts(dataset)
    grams = np.array([table.gram(table, part) for part in parts])
    moments = np.array([table.moments(rows.y, part) for part in parts])
    structure = Structure.of(table)
    found = components(grams.sum(axis=0), moments.sum(axis=0), structure, rows.count, of, config)
    now = Table.stacked([dataset.later.nominal, dictionary.later.take(columns)])
    later = now.norms[first:] ** 2 / dataset.later.count
    visible = found.variance * np.maximum(1.0, later / found.mean_square)
    keep = np.flatnonzero(np.r_[np.ones(first, bool), visible > _LEAST_VARIANCE])
    at = np.ix_(keep, keep)
    kept = tuple(of[k - first] for k in keep[first:])
    drift = _drift(dataset, scale, found, of, config)[keep]
    standing = columns[keep[first:] - first], kept, np.diag(found.precision[keep]), drift
    sums = tuple(g[at] for g in grams), tuple(m[keep] for m in moments)
    start, structure = (
        (np.zeros((0, 0)), np.zeros(0)),
        Structure.of(table.take(keep), now.take(keep)),
    )
    out = Prior(scale, *standing, parts, *sums, start, structure)
    if dataset.reference is not None:
        return replace(out, start=out.of(range(len(parts))))
    gram, moment = np.sum(out.grams, axis=0), np.sum(out.moments, axis=0)
    found = components(gram, moment, out.structure, rows.count, kept, config)
    usual = _typical(found, kept, dataset, config)
    return replace(out, start=(np.diag(usual.precision), np.zeros(len(keep))))


def _typical(
    found: Components, of: Sequence[Group], dataset: Dataset, config: DiagnosisConfig
) -> Components:
    """Return the variances as far as they are those of the family over all joints.

    What a family has in common is in units of the noise of the joints on which it acts; of a family
    of one place it is that of the other families. What healthy machines have in small is no more
    than the part of a joint's torque that is a fault where no cause explains it, and than the
    tolerance that a cause states.
    """
    torque = np.array([float(np.mean(y**2)) for y in dataset.later.y])
    each = zip(of, found.mean_square, strict=True)
    small = [_most(group, square, torque, config) for group, square in each]
    largest: dict[str, dict[int, float]] = {}  # of each family and joint
    for group, value in zip(of, found.variance, strict=True):
        at = largest.setdefault(group.family, {})
        at[group.key[1] or 0] = max(value, at.get(group.key[1] or 0, 0.0))
    median = {word: _lower_median(at.values()) for word, at in largest.items()}
    several = [value for word, value in median.items() if len(largest[word]) > 1]
    other = _lower_median(several or median.values())
    usual = [median[w] if len(largest[w]) > 1 else other for w in (g.family for g in of)]
    return replace(found, variance=np.minimum(found.variance, np.minimum(usual, small)))


def _most(group: Group, square: float, torque: Array, config: DiagnosisConfig) -> float:
    """Return the largest variance that a standing number of a healthy machine has, of a row.

    Of what effects state a tolerance for that, else a part of the torque (joints,) of its joint, or
    of the joint that has most.
    """
    if of_any_size(group):
        return np.inf
    unnamed = group.kind == "unnamed"
    healthy = None if unnamed else find_effect(group.key[0]).parameters.healthy
    own = float(torque.max() if group.key[1] is None else torque[group.key[1] - 1])
    small = config.misfit**2 * own
    return min(small, healthy**2 * square) if healthy else small


def of_any_size(group: Group) -> bool:
    """Return whether healthy machines have a standing number of any size: the form of friction."""
    if group.kind == "unnamed":
        return group.key[0] == FORM
    return find_effect(group.key[0]).parameters.healthy == np.inf


def _lower_median(values: Iterable[float]) -> float:
    ordered = sorted(values)
    return ordered[(len(ordered) - 1) // 2]


def _drift(
    dataset: Dataset, scale: Array, found: Components, of: Sequence[Group], config: DiagnosisConfig
) -> Array:
    """Return the variance between sessions of each scaled number.

    Friction drifts: the nominal laws, their form, and what changes sign with them.
    """
    beta, rigid = dataset.model.beta, len(dataset.model.columns.kept)
    usual = (beta[rigid:] * scale[rigid:]) ** 2
    own = np.array([rubs(g) for g in of], float)
    every = np.r_[np.zeros(rigid), usual, own * found.variance / found.mean_square]
    return np.asarray(config.friction_drift**2 * every)


def rubs(group: Group) -> bool:
    """Return whether a group is a form or law of friction, or changes sign with that."""
    if group.kind != "named":
        return group.key[0] == FORM
    effect = find_effect(group.key[0])
    return issubclass(effect, FrictionLaw) or any(q.shared for q in effect.parameters)


def _parts(dataset: Dataset) -> tuple[tuple[np.ndarray, ...], ...]:
    """Return masks of each joint's rows, of parts of the known logs.

    The first and the second half of each log, dealt to as many parts as are compared at most.
    """
    data = dataset.known.data
    half = np.zeros(data.rows, dtype=np.intp)
    for k in range(len(data.logs)):
        own = data.log_of == k
        half[own] = 2 * k + (data.t[own] > np.median(data.t[own]))
    count = min(2 * len(data.logs), _PARTS)
    return tuple(
        tuple((half % count == part)[data.joint == j] for j in range(data.n_joints))
        for part in range(count)
    )

"""Thresholds of causes that act on several joints, whose gain with other weights is no multiple of what it was.

    wide = Wide.of_twin(fit, residuals, families, usual, rest, arm)
    gain, own = wide.at(weight)

A cause that acts on its joint alone gains with the square of that joint's weight. One of the whole arm acts on several, and so does
an error of an angle, with which the loads of all joints change; how much of it the model imitates hangs on which joint counts. But
all of it follows from sums over the rows of each joint, which are few numbers:
with B an orthonormal basis of the model's columns at the reference weights, c a cause's columns, r a replica's residual and ρ_j the
weight of joint j over its reference,

    BᵀB → Σ ρ_j² (BᵀB)_j,    cᵀB → Σ ρ_j² (cᵀB)_j,    cᵀc → Σ ρ_j² (cᵀc)_j,    cᵀr → Σ ρ_j² (cᵀr)_j

so that thresholds can be stored, and neither replicas nor logs are needed to ask for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.nominal import Fit
from pipelines.model.diagnosis.screened.candidates import Family, lay_family, place_of
from pipelines.model.diagnosis.screened.screen import Products

__all__ = ["ONCE", "TIMES", "USELESS", "Wide", "WideCause", "median"]

Indices = npt.NDArray[np.intp]

TIMES = 3.0
# Times as much of an event, which no other log bears out: chance gives the largest of many moments, with longer tails than noise
# where friction reverses. Of nine true ones the weakest gained 4 times what was asked before, a false one 1.2 times.
ONCE = 2.0
USELESS = 0.01  # of the squared weighted residual of a joint of the twin
_EVENTS = 3  # replicas that an event is looked for in
_FAR = 100.0  # times the reference's square, of the weights for which an event's shapes are kept


@dataclass(frozen=True, eq=False)
class WideCause:
    """Sums over the rows of each joint, columns and residuals weighted by the reference."""

    event: bool
    columns: Array  # (joints, shapes, k, k) cᵀc
    model: Array  # (joints, shapes, k, rank) cᵀB
    left: Array  # (joints, shapes, k, replicas) cᵀr; of an event only the replica that a shape was found in
    place: str = ""  # "cause:joint"; empty of one of the whole arm
    joint: int | None = None


@dataclass(frozen=True, eq=False)
class Wide:
    """What thresholds of causes that act on several joints follow from, with any weights."""

    weight: Array  # (joints,) the reference
    model: Array  # (joints, rank, rank) BᵀB
    left: Array  # (joints, rank, replicas) Bᵀr
    usual: Array  # (joints,) what half the causes of a joint get
    rest: Array  # (joints,) squared weighted residual of the replicas
    causes: tuple[WideCause, ...]  # those of the whole arm first
    longer: float = 1.0  # times as many rows, which give chance more to gain

    @classmethod
    def of_twin(cls, fit: Fit, residuals: Array, families: Sequence[Family], usual: Array, rest: Array, arm: Arm) -> Wide:
        """`families`: those that act on several joints, of the whole arm first; `residuals` (replicas, rows) weighted, that `fit`
        leaves."""
        rows = [np.flatnonzero(fit.data.joint == j) for j in range(len(fit.weight))]
        basis = fit.basis
        model = np.array([basis[:, own] @ basis[:, own].T for own in rows])
        left = np.array([basis[:, own] @ residuals[:, own].T for own in rows])
        causes = (_event(one, fit, residuals, arm, rows, model, left) if one.event else _cause(one, fit, residuals, arm, rows)
                  for one in families)
        return cls(fit.weight, model, left, usual, rest, tuple(causes))

    def at(self, weight: Array) -> tuple[Array, Array]:
        """Gains (causes,) to exceed with joints weighted by `weight`, and the most that any replica gives."""
        ratio = np.square(weight / self.weight)
        usual, rest = ratio * self.usual, ratio * self.rest
        own = np.array([_gains(one, self.model, self.left, ratio).max(initial=0.0) for one in self.causes])
        events = np.array([one.event for one in self.causes], dtype=bool)
        whole = np.array([one.joint is None for one in self.causes], dtype=bool)
        place = np.array([(one.joint or 1) - 1 for one in self.causes])
        common = max(median(own[whole & ~events]), float(np.median(usual)))
        others = np.where(whole, np.where(events, 0.0, common), usual[place])
        useless = USELESS * np.where(whole, rest.mean(), rest[place])
        return self.longer * TIMES * np.max([np.where(events, ONCE, 1.0) * own, others, useless], axis=0), self.longer * own


def median(values: Array) -> float:
    return float(np.median(values)) if len(values) else 0.0


def _cause(family: Family, fit: Fit, residuals: Array, arm: Arm, rows: Sequence[Indices]) -> WideCause:
    parts = []
    for laid in lay_family(fit.data, family, arm):
        table = np.zeros((*laid.table.shape[:2], fit.data.rows))
        table[:, :, laid.rows] = laid.table
        parts.append(table)
    columns, model, left = _sums(np.concatenate(parts), fit, residuals, rows)
    place = "" if family.joint is None else place_of(family.cause, family.joint)
    return WideCause(False, columns, model, left, place, family.joint)


def _event(family: Family, fit: Fit, residuals: Array, arm: Arm, rows: Sequence[Indices], model: Array, left: Array) -> WideCause:
    """In each replica and log the shapes that its residual speaks for; kept are those that gain most with some weights or other."""
    parts = []
    for replica, residual in enumerate(residuals[:_EVENTS]):
        only = np.arange(len(residuals)) == replica
        for place, (one, x) in enumerate(zip(fit.data.logs, fit.data.split(residual / fit.weights), strict=True)):
            full = np.stack([np.interp(one.motion.t, one.t, row) for row in x], axis=1)
            shapes = tuple(family.shapes[0].promising(one.motion, arm, full))
            start = int(np.argmax(fit.data.log_of == place))
            if not shapes:
                continue
            for laid in lay_family(replace(fit.data, logs=(one,), known=None), replace(family, shapes=shapes), arm):
                table = np.zeros((*laid.table.shape[:2], fit.data.rows))
                table[:, :, start + laid.rows] = laid.table
                columns, seen, own = _sums(table, fit, residuals, rows)
                best = _best(WideCause(True, columns, seen, own * only), model, left)
                parts += [best] if best.columns.shape[1] else []  # none where the tip moves with no joint: an axis goes through it
    if not parts:
        columns, seen, own = (np.zeros((len(rows), 1, 1, size)) for size in (1, model.shape[1], len(residuals)))
        return WideCause(True, columns, seen, own)
    columns, seen, own = (np.concatenate([getattr(one, name) for one in parts], axis=1) for name in ("columns", "model", "left"))
    return _best(WideCause(True, columns, seen, own), model, left)


def _best(one: WideCause, model: Array, left: Array) -> WideCause:
    """Of its shapes only those that gain most in a replica, with the reference weights, or one joint weighted far more or less."""
    kept = set()
    for ratio in (np.ones(len(model)), *(1.0 + (far - 1.0) * np.eye(len(model))[j] for j in range(len(model))
                                         for far in (_FAR, 1.0 / _FAR))):
        gains = _gains(one, model, left, ratio)
        kept |= {int(k) for k in np.argmax(gains, axis=0)[gains.max(axis=0, initial=0.0) > 0.0]}
    some = sorted(kept)
    return replace(one, columns=one.columns[:, some], model=one.model[:, some], left=one.left[:, some])


def _sums(table: Array, fit: Fit, residuals: Array, rows: Sequence[Indices]) -> tuple[Array, Array, Array]:
    """Of `table` (shapes, k, rows): cᵀc, cᵀB, cᵀr of the rows of each joint."""
    c = [(table * fit.weights)[..., own] for own in rows]
    return (np.array([x @ x.transpose(0, 2, 1) for x in c]),
            np.array([x @ fit.basis[:, own].T for x, own in zip(c, rows, strict=True)]),
            np.array([x @ residuals[:, own].T for x, own in zip(c, rows, strict=True)]))


def _gains(one: WideCause, model: Array, left: Array, ratio: Array) -> Array:
    """(shapes, replicas)"""
    gram = np.einsum("j,jab->ab", ratio, model)
    moved = np.linalg.solve(gram, np.einsum("j,jam->am", ratio, left))  # of the model, for it is fitted anew
    seen = np.einsum("j,jska->ska", ratio, one.model)
    columns = np.einsum("j,jskl->skl", ratio, one.columns)
    hidden = np.linalg.solve(gram, seen.reshape(-1, len(gram)).T).T.reshape(seen.shape)
    moment = np.einsum("j,jskm->skm", ratio, one.left) - seen @ moved
    return Products(columns, columns - seen @ hidden.transpose(0, 2, 1), moment).gains()[0]

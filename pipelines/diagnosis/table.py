"""Columns over the rows of logs, stored joint by joint, only where they act.

table = Table.of(columns, joint, n_joints)
table.gram(other), table.moments(y), table.times(coefficients)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Array", "Indices", "Parts", "Table", "by_joint"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Parts = Sequence[npt.NDArray[np.bool_]]


def by_joint(x: npt.NDArray[Any], joint: Indices, n_joints: int) -> tuple[npt.NDArray[Any], ...]:
    """Return a signal (…, rows) split into an array (…, rows of the joint) for each joint."""
    return tuple(np.ascontiguousarray(x[..., joint == j]) for j in range(n_joints))


@dataclass(frozen=True, eq=False)
class Table:
    """Columns over rows."""

    width: int  # number of columns
    index: tuple[Indices, ...]  # of each joint, which columns act on it
    values: tuple[npt.NDArray[np.floating], ...]  # of each joint (columns there, rows there)

    @classmethod
    def of(cls, columns: npt.NDArray[Any], joint: Indices, n_joints: int) -> Table:
        """Return the table of dense columns (k, rows); `joint` (rows,) counts from 0."""
        index, values = [], []
        for part in by_joint(columns, joint, n_joints):
            acting = np.flatnonzero(part.any(axis=1))
            index.append(acting)
            values.append(part[acting])
        return cls(len(columns), tuple(index), tuple(values))

    @classmethod
    def stacked(cls, tables: Sequence[Table]) -> Table:
        """Return the columns of several tables over the same rows, one behind the other."""
        first = np.cumsum([0, *(table.width for table in tables)])
        joints = range(len(tables[0].index))
        return cls(
            int(first[-1]),
            tuple(
                np.concatenate([t.index[j] + f for t, f in zip(tables, first, strict=False)])
                for j in joints
            ),
            tuple(np.concatenate([t.values[j] for t in tables]) for j in joints),
        )

    def take(self, columns: Indices) -> Table:
        """Return some of the columns, in the order given."""
        place = np.full(self.width, -1, dtype=np.intp)
        place[columns] = np.arange(len(columns))
        kept = [np.flatnonzero(place[index] >= 0) for index in self.index]
        order = [k[np.argsort(place[index[k]])] for k, index in zip(kept, self.index, strict=True)]
        return Table(
            len(columns),
            tuple(place[i[k]] for i, k in zip(self.index, order, strict=True)),
            tuple(v[k] for v, k in zip(self.values, order, strict=True)),
        )

    def scaled(self, scale: Array) -> Table:
        """Return every column multiplied by its `scale` (k,)."""
        return Table(
            self.width,
            self.index,
            tuple(v * scale[i, None] for v, i in zip(self.values, self.index, strict=True)),
        )

    def compact(self) -> Table:
        """Return the columns in single precision: of candidates there are many."""
        return Table(self.width, self.index, tuple(v.astype(np.float32) for v in self.values))

    @cached_property
    def norms(self) -> Array:
        """(k,) Euclidean length of each column."""
        total = np.zeros(self.width)
        for index, values in zip(self.index, self.values, strict=True):
            total[index] += np.einsum("ij,ij->i", values, values, dtype=np.float64)
        return np.asarray(np.sqrt(total))

    def gram(self, other: Table, part: Parts | None = None) -> Array:
        """Return A Bᵀ (k, l), over the rows of `part` (a mask for each joint) where it is given."""
        out = np.zeros((self.width, other.width))
        for j, (a, b) in enumerate(zip(self.values, other.values, strict=True)):
            if len(self.index[j]) and len(other.index[j]):
                mine, theirs = (a, b) if part is None else (a[:, part[j]], b[:, part[j]])
                mine = mine.astype(np.float64, copy=False)
                out[np.ix_(self.index[j], other.index[j])] += mine @ theirs.T
        return out

    def moments(self, y: Sequence[Array], part: Parts | None = None) -> Array:
        """Return A y (k,)."""
        out = np.zeros(self.width)
        for j, (index, values) in enumerate(zip(self.index, self.values, strict=True)):
            own = slice(None) if part is None else part[j]
            out[index] += values[:, own] @ y[j][own]
        return out

    def times(self, coefficients: Array) -> tuple[Array, ...]:
        """Return cᵀ A of coefficients (k,) or (k, m), an array (…, rows) for each joint."""
        return tuple(coefficients[i].T @ v for i, v in zip(self.index, self.values, strict=True))

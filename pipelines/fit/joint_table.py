"""Store columns over the rows of logs joint by joint; factor their information matrices.

    table = Table.of(columns, joint, n_joints)
    table.gram(other), table.moments(y), table.times(coefficients)
    factor = Arrow.of(matrix, Structure.of(table))     the Cholesky factor
    factor.solve(b), factor.inverse_diagonal, factor.whitened(columns, joint)

With the own numbers of each joint first and the shared ones last, an information matrix has the
shape of an arrow, and its Cholesky factor has no more entries: L = [L_1 0; … ; W_1 … L_s] (George &
Liu 1981). The cost grows with the number of joints, not with its cube.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Array", "Arrow", "Indices", "Parts", "Structure", "Table", "by_joint", "gains", "in_rows"]

_ROUNDING = 1e-13  # numerics: of each number's information: more than sums of 1e5 rows round off
_DEPENDENT = 1e-6  # numerics: squared length, of columns of unit length, that others leave

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Parts = Sequence[npt.NDArray[np.bool_]]


def by_joint(x: npt.NDArray[Any], joint: Indices, n_joints: int) -> tuple[npt.NDArray[Any], ...]:
    """Return a signal (…, rows) split into an array (…, rows of the joint) for each joint."""
    return tuple(np.ascontiguousarray(x[..., joint == j]) for j in range(n_joints))


def in_rows(each: Sequence[Array], joint: Indices) -> Array:
    """Return the signal (rows,) that `by_joint` has split."""
    out = np.empty(len(joint))
    for j, own in enumerate(each):
        out[joint == j] = own
    return out


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


@dataclass(frozen=True, eq=False)
class Structure:
    """The partition of k numbers: those of one joint alone, and the shared ones."""

    own: tuple[Indices, ...]  # of each joint
    shared: Indices

    @classmethod
    def of(cls, *tables: Table) -> Structure:
        """Return the structure of columns over the rows of one or several sessions."""
        width, index = tables[0].width, zip(*(table.index for table in tables), strict=True)
        acting = [np.unique(np.concatenate(every)) for every in index]
        joints = np.bincount(np.concatenate(acting), minlength=width)
        own = tuple(here[joints[here] == 1] for here in acting)
        return cls(own, np.flatnonzero(joints != 1))

    @classmethod
    def all_shared(cls, width: int, joints: int) -> Structure:
        """Return the structure of numbers of which none belongs to one joint alone."""
        return cls((np.zeros(0, dtype=np.intp),) * joints, np.arange(width))

    def wider(self, more: int) -> Structure:
        """Return the structure with `more` shared numbers behind all others."""
        k = len(self.shared) + sum(len(own) for own in self.own)
        return Structure(self.own, np.r_[self.shared, np.arange(k, k + more)])

    def among(self, matrix: Array) -> Structure:
        """Return the structure; all numbers are shared where the matrix couples joints."""
        for j, one in enumerate(self.own):
            for other in self.own[:j]:
                if matrix[np.ix_(one, other)].any():
                    return self.all_shared(len(matrix), len(self.own))
        return self


@dataclass(frozen=True, eq=False)
class Arrow:
    """The Cholesky factor of a matrix with a structure."""

    structure: Structure
    blocks: tuple[Array, ...]  # L_j of each joint
    across: tuple[Array, ...]  # W_j (own, shared)
    corner: Array  # L_s

    @classmethod
    def of(cls, matrix: Array, structure: Structure) -> Arrow:
        """Return the factor of a positive definite matrix (k, k).

        Raises:
            numpy.linalg.LinAlgError: it is not positive definite.
        """
        structure = structure.among(matrix)
        shared, blocks, across = structure.shared, list[Array](), list[Array]()
        corner = matrix[np.ix_(shared, shared)]
        for own in structure.own:
            blocks.append(_root(matrix[np.ix_(own, own)]))
            across.append(_forward(blocks[-1], matrix[np.ix_(own, shared)]))
            corner = corner - across[-1].T @ across[-1]
        return cls(structure, tuple(blocks), tuple(across), _root(corner))

    def widened(self, across: Array, own: Array) -> Arrow:
        """Return the factor of [A, across; acrossᵀ, own]: of m further numbers, which are shared.

        Args:
            across: (k, m).
            own: (m, m).
        """
        half, shared = self.half(across), self.structure.shared
        wider = tuple(
            np.concatenate([w, half[at]], axis=1)
            for w, at in zip(self.across, self.structure.own, strict=True)
        )
        upper = np.zeros((len(shared), len(own)))
        last = _root(own - half.T @ half)
        corner = np.block([[self.corner, upper], [half[shared].T, last]])
        return Arrow(self.structure.wider(len(own)), self.blocks, wider, corner)

    def half(self, b: Array) -> Array:
        """Return L⁻¹ b, in the order of `b` (k,) or (k, m): |L⁻¹ b|² is bᵀ A⁻¹ b."""
        out, shared = np.empty(b.shape), self.structure.shared
        left = b[shared]
        for own, block, w in zip(self.structure.own, self.blocks, self.across, strict=True):
            out[own] = _forward(block, b[own])
            left = left - w.T @ out[own]
        out[shared] = _forward(self.corner, left)
        return out

    def solve(self, b: Array) -> Array:
        """Return A⁻¹ b of b (k,) or (k, m)."""
        out, shared = self.half(b), self.structure.shared
        out[shared] = _backward(self.corner, out[shared])
        for own, block, w in zip(self.structure.own, self.blocks, self.across, strict=True):
            out[own] = _backward(block, out[own] - w @ out[shared])
        return out

    @property
    def inverse_diagonal(self) -> Array:
        """(k,)"""
        shared = self.structure.shared
        out = np.empty(len(shared) + sum(len(own) for own in self.structure.own))
        corner = _forward(self.corner, np.eye(len(shared)))
        out[shared] = np.sum(corner**2, axis=0)
        for own, block, w in zip(self.structure.own, self.blocks, self.across, strict=True):
            inverse = _forward(block, np.eye(len(own)))
            side = (corner @ w.T) @ inverse
            out[own] = np.sum(inverse**2, axis=0) + np.sum(side**2, axis=0)
        return out

    def whitened(self, table: Table, joint: int) -> tuple[Array, Array]:
        """Return L⁻¹ of columns over the rows of a joint: its own part and the shared one.

        Args:
            table: columns, in the order of the matrix.
        """
        structure, block, w = self.structure, self.blocks[joint], self.across[joint]
        place = np.full(table.width, -1, dtype=np.intp)
        place[table.index[joint]] = np.arange(len(table.index[joint]))
        values = np.asarray(table.values[joint], dtype=np.float64)
        own = _forward(block, values[place[structure.own[joint]]])
        there = place[structure.shared] >= 0
        shared = np.zeros((len(structure.shared), values.shape[1]))
        shared[there] = values[place[structure.shared[there]]]
        return own, _forward(self.corner, shared - w.T @ own)


def _root(matrix: Array) -> Array:
    """Return the Cholesky factor of a matrix whose diagonal is larger by what its sums round off."""
    more = _ROUNDING * np.diag(np.diag(matrix))
    return np.asarray(np.linalg.cholesky(matrix + more), dtype=np.float64)


def _forward(factor: Array, b: Array) -> Array:
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, b, lower=True, check_finite=False))


def _backward(factor: Array, b: Array) -> Array:
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, b, lower=True, trans="T", check_finite=False))


def gains(columns: Table, others: Table, known: Arrow, signals: Sequence[Sequence[Array]]) -> Array:
    """Return what columns C explain of each signal r beside others B: gᵀ H⁻¹ g (signals,).

    g = C r - C Bᵀ P⁻¹ B r and H = C Cᵀ - C Bᵀ P⁻¹ B Cᵀ (Frisch & Waugh 1933, with a prior).

    Args:
        columns: of unit length; directions that others explain gain nothing.
        known: P, the information of the numbers of B.
    """
    cross = others.gram(columns)
    into = known.solve(cross)
    values, vectors = np.linalg.eigh(columns.gram(columns) - cross.T @ into)
    seen = values > _DEPENDENT
    moments = np.array([columns.moments(r) - others.moments(r) @ into for r in signals])
    return np.asarray(((moments @ vectors[:, seen]) ** 2 / values[seen]).sum(axis=1))

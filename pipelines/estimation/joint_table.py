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

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = [
    "Array",
    "Arrow",
    "Indices",
    "Parts",
    "Structure",
    "Table",
    "by_joint",
    "gains",
    "in_rows",
]

_NOTHING = 1e-12  # numerics: of the longest column
_ROUNDING = 1e-11  # numerics: of a diagonal, by which products of columns may be wrong
_ROOM, _AT_ONCE = 4_000_000, 64  # numerics: values in double precision, columns
_DEPENDENT = 1e-6  # numerics: squared length, of columns of unit length, that others leave

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Parts = Sequence[npt.NDArray[np.bool_]]
Piece = tuple[Indices, npt.NDArray[Any]]  # columns (k,), and their values (k, rows)
Pieces = tuple[tuple[Piece, ...], ...]


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
    """Columns over rows; tables behind one another are not copied."""

    width: int  # number of columns
    pieces: tuple[tuple[Piece, ...], ...]  # of each joint; every column acts there in one at most

    @classmethod
    def of(cls, columns: npt.NDArray[Any], joint: Indices, n_joints: int) -> Table:
        """Return the table of dense columns (k, rows); `joint` (rows,) counts from 0."""
        pieces = []
        for part in by_joint(columns, joint, n_joints):
            acting = np.flatnonzero(part.any(axis=1))
            pieces.append(((acting, part[acting]),))
        return cls(len(columns), tuple(pieces))

    @classmethod
    def stacked(cls, tables: Sequence[Table]) -> Table:
        """Return the columns of several tables over the same rows, one behind the other."""
        first = np.cumsum([0, *(table.width for table in tables)])
        pieces = [
            tuple((i + f, v) for t, f in zip(tables, first, strict=False) for i, v in t.pieces[j])
            for j in range(len(tables[0].pieces))
        ]
        return cls(int(first[-1]), tuple(pieces))

    @property
    def index(self) -> tuple[Indices, ...]:
        """Of each joint, which columns act on it."""
        return tuple(np.concatenate([i for i, _ in own]) for own in self.pieces)

    def take(self, columns: Indices) -> Table:
        """Return some of the columns, in the order given; neighbours are not copied."""
        place = np.full(self.width, -1, dtype=np.intp)
        place[columns] = np.arange(len(columns))

        def taken(index: Indices, values: npt.NDArray[Any]) -> Piece:
            kept = np.flatnonzero(place[index] >= 0)
            run = len(kept) and kept[-1] - kept[0] == len(kept) - 1
            own = values[kept[0] : kept[-1] + 1] if run else values[kept]
            return place[index[kept]], own

        return Table(len(columns), self._each(taken))

    def replaced(self, columns: Indices, by: Table) -> Table:
        """Return a table of one piece a joint with some of its columns replaced."""
        kept = np.ones(self.width, bool)
        kept[columns] = False
        pieces = []
        for old, new in zip(self.pieces, by.pieces, strict=True):
            ((index, values),) = old
            at, rest = columns[np.concatenate([i for i, _ in new])], kept[index]
            if not len(at) and rest.all():
                pieces.append(old)
                continue
            every = np.union1d(index[rest], at)
            out = np.empty((len(every), values.shape[1]), values.dtype)
            out[np.searchsorted(every, index[rest])] = values[rest]
            for i, v in new:
                out[np.searchsorted(every, columns[i])] = v
            pieces.append(((every, out),))
        return Table(self.width, tuple(pieces))

    def scaled(self, scale: Array) -> Table:
        """Return every column multiplied by its `scale` (k,)."""
        return Table(self.width, self._each(lambda i, v: (i, v * scale[i, None])))

    def over(self, rows: Indices) -> Table:
        """Return the table with `rows` rows at each joint, also where no column acts."""
        none = [(np.zeros(0, dtype=np.intp), np.zeros((0, n))) for n in rows]
        pairs = zip(none, self.pieces, strict=True)
        return Table(self.width, tuple((n, *(p for p in own if len(p[0]))) for n, own in pairs))

    def mapped(self, change: Callable[[npt.NDArray[Any], int], npt.NDArray[Any]]) -> Table:
        """Apply `change(columns, joint)` to the columns of each joint, some at a time."""
        pieces = []
        for j, own in enumerate(self.pieces):
            new = tuple((i, np.empty_like(v)) for i, v in own)
            for (_, before), (_, after) in zip(own, new, strict=True):
                for at in range(0, len(before), _AT_ONCE):
                    after[at : at + _AT_ONCE] = change(before[at : at + _AT_ONCE], j)
            pieces.append(new)
        return Table(self.width, tuple(pieces))

    def compact(self) -> Table:
        """Return the columns in order and single precision, in one piece."""
        return Table(self.width, tuple((_joined(own),) for own in self.pieces))

    def _each(self, change: Callable[[Indices, npt.NDArray[Any]], Piece]) -> Pieces:
        return tuple(tuple(change(i, v) for i, v in own) for own in self.pieces)

    @property
    def power(self) -> Array:
        """(k, joints) sum of squares of each column over the rows of each joint."""
        out = np.zeros((self.width, len(self.pieces)))
        for j, own in enumerate(self.pieces):
            for index, values in own:
                out[index, j] = np.einsum("ij,ij->i", values, values, dtype=np.float64)
        return out

    @cached_property
    def norms(self) -> Array:
        """(k,) Euclidean length of each column."""
        return np.asarray(np.sqrt(self.power.sum(axis=1)))

    @property
    def lengths(self) -> Array:
        """(k,) `norms` to divide by: 1 of columns that are zero but for rounding."""
        least = _NOTHING * self.norms.max(initial=0.0)
        return np.where(self.norms > least, self.norms, 1.0)

    def gram(self, other: Table, part: Parts | None = None) -> Array:
        """Return A Bᵀ (k, l), over the rows of `part` (a mask for each joint) where it is given."""
        out = np.zeros((self.width, other.width))
        for j, (mine, theirs) in enumerate(zip(self.pieces, other.pieces, strict=True)):
            count = len(part[j]) if part else _rows(mine)
            for rows in _runs(count, self.width + other.width):
                chosen = rows if part is None else rows.start + np.flatnonzero(part[j][rows])
                right = [
                    (k, np.asarray(b[:, chosen].T, dtype=np.float64)) for k, b in theirs if len(k)
                ]
                for i, a in (own for own in mine if len(own[0])):
                    left = np.asarray(a[:, chosen], dtype=np.float64)
                    for k, b in right:
                        out[np.ix_(i, k)] += left @ b
        return out

    def squares(self, groups: Sequence[slice], part: Parts | None = None) -> tuple[Array, ...]:
        """Return A Aᵀ of each group of neighbouring columns, in single precision."""
        out = tuple(np.zeros((g.stop - g.start, g.stop - g.start)) for g in groups)
        for j, ((index, values),) in enumerate(self.compact().pieces):
            rows = slice(None) if part is None else part[j]
            for g, total in zip(groups, out, strict=True):
                first, last = np.searchsorted(index, [g.start, g.stop])
                if first < last:
                    own, at = (
                        values[first:last, rows].astype(np.float64),
                        index[first:last] - g.start,
                    )
                    total[np.ix_(at, at)] += own @ own.T
        return out

    def moments(self, y: Sequence[Array], part: Parts | None = None) -> Array:
        """Return A y (k,)."""
        out = np.zeros(self.width)
        for j, own in enumerate(self.pieces):
            masked = y[j] if part is None else np.where(part[j], y[j], 0.0)
            for index, values in own:
                for rows in _runs(len(masked), len(index)):
                    out[index] += values[:, rows] @ masked[rows]
        return out

    def times(self, coefficients: Array) -> tuple[Array, ...]:
        """Return cᵀ A of coefficients (k,) or (k, m), an array (…, rows) for each joint."""
        out = []
        for own in self.pieces:
            total = np.zeros((*coefficients.shape[1:], _rows(own)))
            for index, values in own:
                for rows in _runs(values.shape[1], len(index)):
                    total[..., rows] += coefficients[index].T @ values[:, rows]
            out.append(total)
        return tuple(out)

    def dense(self, joint: int) -> Array:
        """Return all columns (k, rows) over the rows of a joint."""
        out = np.zeros((self.width, _rows(self.pieces[joint])))
        for index, values in self.pieces[joint]:
            out[index] = values
        return out


def _rows(pieces: Sequence[Piece]) -> int:
    return int(pieces[0][1].shape[1])


def _runs(rows: int, columns: int) -> list[slice]:
    """Return the rows in runs, which take little memory in double precision."""
    run = max(1, _ROOM // max(columns, 1))
    return [slice(k, min(k + run, rows)) for k in range(0, rows, run)]


def _joined(pieces: Sequence[Piece]) -> Piece:
    every = np.concatenate([i for i, _ in pieces])
    order, first = np.argsort(every), 0
    if len(pieces) == 1 and pieces[0][1].dtype == np.float32 and np.all(np.diff(every) > 0):
        return pieces[0]
    values, place = np.empty((len(every), _rows(pieces)), np.float32), np.argsort(order)
    for index, own in pieces:
        values[place[first : first + len(index)]] = own
        first += len(index)
    return every[order], values


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
        block, w, dense = self.blocks[joint], self.across[joint], table.dense(joint)
        own = _forward(block, dense[self.structure.own[joint]])
        return own, _forward(self.corner, dense[self.structure.shared] - w.T @ own)


def _root(matrix: Array) -> Array:
    """Return the Cholesky factor of a matrix with a diagonal larger by its rounding."""
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

"""Factor information matrices whose joints are coupled by shared numbers alone.

    structure = Structure.of(table)   which numbers are a joint's own
    factor = Arrow.of(matrix, structure)   the Cholesky factor
    factor.solve(b), factor.inverse_diagonal, factor.whitened(columns, joint)

With the own numbers of each joint first and the shared ones last such a matrix has the shape of an
arrow, and its Cholesky factor has no more entries: L = [L_1 0; … ; W_1 … L_s] (George & Liu 1981).
The cost grows with the number of joints, not with its cube.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.diagnosis.table import Array, Indices, Table

__all__ = ["Arrow", "Structure"]


@dataclass(frozen=True, eq=False)
class Structure:
    """Which of k numbers belong to one joint alone."""

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
    return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)


def _forward(factor: Array, b: Array) -> Array:
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, b, lower=True, check_finite=False))


def _backward(factor: Array, b: Array) -> Array:
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, b, lower=True, trans="T", check_finite=False))

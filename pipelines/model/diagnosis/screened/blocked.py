"""What a cause gains on blocks of time that chose neither its numbers nor its shape, to first order.

    blocked = Blocked.of(now, 20)           a model fitted exactly, and what it leaves, by blocks of time
    blocked.gains(family, arm)              (blocks,) taken off the weighted squares of each

With J the slopes of the model and c the columns of a shape, all weighted, the rest of the time asks for a = G⁻¹ c⊥ r⊥ and moves the
model's numbers by β = A (J r - Cᵀ a), A = (J Jᵀ)⁻¹, C = c Jᵀ. Sums over blocks are all that is needed: each block is left out by
subtracting its own (Stone 1974).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.rows.data import Indices
from pipelines.model.diagnosis.screened.candidates import Family, lay_family
from pipelines.model.diagnosis.screened.screen import INVISIBLE

__all__ = ["Blocked"]

_RIDGE = 1e-9  # of unit columns
_SPREAD = 1e-4  # of the largest: directions of c⊥ that are left alone


@dataclass(frozen=True, eq=False)
class Blocked:
    """A model's slopes J, weighted, of unit length, and what it leaves r, by blocks of time."""

    now: Refined
    unit: Array  # (numbers, rows)
    place: Indices  # (rows,) block
    gram: Array  # (blocks, numbers, numbers) J Jᵀ
    moment: Array  # (blocks, numbers) J r
    inverse: Array  # (blocks, numbers, numbers) A without the block

    @classmethod
    def of(cls, now: Refined, count: int) -> Blocked:
        """In about `count` blocks; numbers of what happened once stay as they are."""
        once = {k for where, one in enumerate(now.model.effects) if one.log is not None for k in now.of_effect(where)}
        table = np.delete(now.slopes, sorted(once), axis=0) * now.weights
        residual, place = now.residual, now.data.blocks(count)
        size = np.linalg.norm(table, axis=1)
        unit = table[size > 0.0] / size[size > 0.0, None]
        parts = [(unit[:, place == b], residual[place == b]) for b in range(int(place.max()) + 1)]
        gram = np.stack([u @ u.T for u, _ in parts])
        inverse = np.linalg.inv(gram.sum(axis=0) - gram + _RIDGE * np.eye(len(unit)))
        return cls(now, unit, place, gram, np.stack([u @ r for u, r in parts]), inverse)

    def gains(self, family: Family, arm: Arm) -> Array:
        """(blocks,) each with the shape and the amplitudes that the others ask for."""
        best, gains = np.full(len(self.gram), -np.inf), np.zeros(len(self.gram))
        for sums in self._sums(family, arm):
            for block in range(len(gains)):
                inside, amplitudes, numbers = sums.asked(self, block)
                shape = int(np.argmax(inside))
                if inside[shape] > best[block]:
                    best[block] = inside[shape]
                    gains[block] = sums.held(self, block, shape, amplitudes[shape], numbers[shape])
        return gains

    def alone(self, block: int) -> Array:
        """(numbers,) what the other blocks ask for without the cause."""
        return np.asarray(self.inverse[block] @ (self.moment.sum(axis=0) - self.moment[block]))

    def _sums(self, family: Family, arm: Arm) -> Iterator[_Sums]:
        now, blocks = self.now, len(self.gram)
        residual = now.residual
        for laid in lay_family(now.data, family, arm):
            table, place = laid.table * now.weights[laid.rows], self.place[laid.rows]
            parts = [(table[:, :, own], laid.rows[own]) for own in (place == block for block in range(blocks))]
            yield _Sums(np.stack([c @ c.transpose(0, 2, 1) for c, _ in parts]),
                        np.stack([c @ self.unit[:, rows].T for c, rows in parts]),
                        np.stack([c @ residual[rows] for c, rows in parts]))


@dataclass(frozen=True, eq=False)
class _Sums:
    """Of the columns c of some shapes, weighted, by blocks."""

    whole: Array  # (blocks, shapes, k, k) c cᵀ
    seen: Array  # (blocks, shapes, k, numbers) C
    moment: Array  # (blocks, shapes, k) c r

    def asked(self, blocked: Blocked, block: int) -> tuple[Array, Array, Array]:
        """What the other blocks ask for: (shapes,) taken off their squares, (shapes, k) a and (shapes, numbers) β."""
        whole, seen, moment = (x.sum(axis=0) - x[block] for x in (self.whole, self.seen, self.moment))
        alone, share = blocked.alone(block), seen @ blocked.inverse[block]
        scale = np.sqrt(np.maximum(np.einsum("skk->sk", whole), 1e-300))
        values, vectors = np.linalg.eigh((whole - share @ seen.transpose(0, 2, 1)) / scale[:, :, None] / scale[:, None, :])
        sure = values > np.maximum(INVISIBLE**2, _SPREAD**2 * values[:, -1:])
        turned = np.einsum("skl,sk->sl", vectors, (moment - seen @ alone) / scale)
        solved = np.where(sure, turned / np.where(sure, values, 1.0), 0.0)
        a = np.einsum("skl,sl->sk", vectors, solved) / scale
        return np.einsum("sl,sl->s", turned, solved), a, alone - np.einsum("skn,sk->sn", share, a)

    def held(self, blocked: Blocked, block: int, shape: int, a: Array, numbers: Array) -> float:
        """What these numbers take off the squares of the block itself, more than those without the cause."""
        gram, moment, alone = blocked.gram[block], blocked.moment[block], blocked.alone(block)
        before = alone @ gram @ alone - 2.0 * alone @ moment
        after = (numbers @ gram @ numbers - 2.0 * numbers @ moment + a @ self.whole[block, shape] @ a
                 - 2.0 * a @ self.moment[block, shape] + 2.0 * a @ self.seen[block, shape] @ numbers)
        return float(before - after)

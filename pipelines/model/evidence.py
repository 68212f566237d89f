"""The torque rows of one log, worked out once for every question of plausibility."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, RigidBody
from pipelines.model.row_fit import Row, Sampled, relative_residual, row_fits
from pipelines.quality.subject import Subject

__all__ = ["Evidence"]

_HELD = 0.1  # of the travel of the joint that moves most, a metre taken for a radian


@dataclass(frozen=True, eq=False)
class Evidence:
    """The rows of one log, worked out once for all questions."""

    subject: Subject
    body: RigidBody
    motion: Sampled

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        return row_fits(self.body, self.motion)

    @cached_property
    def table(self) -> Array:
        """(rows, torques) relative residual of every torque on every joint's row."""
        return relative_residual(self.rows, self.motion.tau)

    @property
    def residual(self) -> Array:
        return np.diag(self.table)

    @cached_property
    def telling(self) -> npt.NDArray[np.int_]:
        """The joints (from 0) whose row can tell anything: those that move.

        A joint that is held sways within its dry friction, of which no row knows, while the moving joints' motion stands in
        every row: another joint's row may explain its torque better than its own.
        """
        travel = self.subject.travel
        return np.flatnonzero(travel >= _HELD * travel.max())

    @property
    def n_joints(self) -> int:
        return int(self.motion.q.shape[1])

    def thinned(self) -> Evidence:
        """Fewer moments, for questions that need a new factorisation each."""
        motion = self.motion
        step = max(1, len(motion.t) // (5 * max(row.basis.shape[1] for row in self.rows)))
        few = {name: getattr(motion, name)[::step] for name in ("t", "q", "dq", "ddq", "coulomb", "at")}
        return replace(self, motion=replace(motion, **few))

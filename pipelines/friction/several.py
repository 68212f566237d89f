"""Fit friction of joints that were never driven alone, together with the base parameters.

Of the equations τ_j = Y_j p + friction_j of one joint, Y_j p is linear and friction is linear but
for a few numbers: variable projection solves for those with p as it pleases that row. It is done
joint by joint, for p ties the rows together and the few numbers do not; then one fit of all rows,
with every law's shape given, finds p and the amplitudes of all joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.estimation.estimate import Fitted, Recipe, equations_of, fit_logs, with_cutoff
from pipelines.estimation.filters import centre_samples, zero_phase
from pipelines.estimation.motion import Motions
from pipelines.estimation.nominal import nominal_columns
from pipelines.estimation.regression import Columns as RigidColumns
from pipelines.estimation.regression import LogEquations
from pipelines.friction.fit import Columns, Equations
from pipelines.friction.laws import LADDER, Law, OneJoint
from pipelines.friction.model_selection import Ladder, climb

__all__ = ["RowEquations", "SeveralFit", "fit_several"]


@dataclass(frozen=True, eq=False)
class _Run:
    """One joint's motion along a run, and which of its conditioned samples make rows."""

    motion: Motion  # (samples, 1)
    held: bool
    cutoff_hz: float | None
    rate: float
    rows: npt.NDArray[np.intp]  # samples of the run, after centring

    def conditioned(self, columns: Array) -> Array:
        x = centre_samples(columns) if self.held else columns
        if self.cutoff_hz is not None:
            x = zero_phase(x, self.cutoff_hz, self.rate)
        return x[self.rows]


def _runs_of(log: LogEquations, j: int) -> list[_Run]:
    """Return the runs of `log`, their rows found by the times that its equations have."""
    motion, runs = log.found.motion, []
    times = motion.t[log.moments()]
    for run in log.runs:
        rows = log.found.good.kept[run]
        t = motion.t[rows]
        known = np.isfinite(motion.q[rows, j] + motion.dq[rows, j] + motion.ddq[rows, j])
        at = np.arange(len(t))
        states = (np.interp(at, at[known], x[rows, j][known])[:, None]
                  for x in (motion.q, motion.dq, motion.ddq))
        own = times[(times >= t[0]) & (times <= t[-1])]
        runs.append(_Run(Motion(t, *states), log.held, log.conditioning.cutoff_hz, log.rate,
                         np.searchsorted(t, own) - int(log.held)))
    return runs


@dataclass(frozen=True, eq=False, kw_only=True)
class RowEquations(Equations):
    """One joint's rows of several logs, conditioned as the rigid body's columns are."""

    runs: tuple[_Run, ...]

    @classmethod
    def of(cls, logs: Sequence[LogEquations], j: int) -> RowEquations:
        """Return the rows of joint `j`, from 0; other joints load it without a bound."""
        blocks = [(np.array(block.y[j]), np.array(block.values[j].T))
                  for log in logs for block in log]
        y, fixed = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        motion = max(logs, key=lambda log: len(log.found.motion.t)).found.motion
        alone = Motion(motion.t, motion.q[:, [j]], motion.dq[:, [j]], motion.ddq[:, [j]])
        return cls(y=y, fixed=fixed, parts=(np.arange(len(y)),), nodes=alone, largest=float("inf"),
                   joint=OneJoint.of(logs[0].columns.body.robot, j + 1),
                   runs=tuple(run for log in logs for run in _runs_of(log, j)))

    def thinned(self, rows: int) -> Self:
        """Return about `rows` of all rows, as views."""
        every = max(1, len(self.y) // rows)
        return replace(self, every=every, y=self.y[::every], fixed=self.fixed[::every])

    def arms(self, beta: Array | None = None) -> tuple[OneJoint, ...]:
        del beta  # laws that ask for the load are not tried here
        return (self.joint,)

    def means(self, columns: Columns, arms: Sequence[OneJoint], pointwise: bool = True) -> Array:
        del pointwise  # the low-pass needs all samples
        parts = [run.conditioned(columns(run.motion, arms[0])) for run in self.runs]
        return np.vstack(parts)[self.rows]


@dataclass(frozen=True, eq=False)
class SeveralFit:
    """Laws joint by joint, and the fit of everything."""

    ladders: tuple[Ladder, ...]
    fitted: Fitted


def fit_several(identify: Motions, validate: Motions, recipe: Recipe,
                law: Law | None = None) -> SeveralFit:
    """Choose a law for every joint, or take `law`, and fit amplitudes with the base parameters.

    Laws with memory or load are not tried: a row of a moving arm does not show what its joint
    carries before all is fitted.
    """
    robot = identify[0][0].robot
    columns = nominal_columns(robot, friction=False, offset=False)
    recipe = with_cutoff(recipe, identify)
    rows = equations_of(identify, recipe, columns)
    others = equations_of(validate, recipe, columns) if validate else None
    laws = (law,) if law is not None else tuple(one for one in LADDER
                                                if one.pointwise and not one.sees_load)
    own = [RowEquations.of(rows, j) for j in range(robot.n_joints)]
    ladders = tuple(climb(one, None if others is None else RowEquations.of(others, j), laws)
                    for j, one in enumerate(own))
    fits = [ladder.chosen.fit for ladder in ladders]
    shaped = [replace(effect, joint=j + 1) for j, fit in enumerate(fits)
              for effect in fit.law.shaped(fit.theta)]
    whole = RigidColumns(columns.body, columns.kept, (*shaped, *columns.laws), columns.arm)
    return SeveralFit(ladders, fit_logs(identify, whole, recipe))

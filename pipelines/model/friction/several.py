"""Friction of joints that were never driven alone: from excitation logs, law by law, together with the base parameters.

Of the equations τ_j = Y_j p + friction_j of one joint, Y_j p is linear and friction is linear but for a few numbers: variable
projection solves for those with p as it pleases that row. It is done joint by joint, for p ties the rows together and the few
numbers do not; then one fit of all rows, with every law's shape given, finds p and the amplitudes of all joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.fit.varpro import Separable
from pipelines.model.estimation.logs import Fitted, Motions, Recipe, equations_of, fit_logs, with_cutoff
from pipelines.model.estimation.nominal import nominal_columns
from pipelines.model.estimation.regression import Columns, LogEquations
from pipelines.model.friction.equations import Columned, Predicted
from pipelines.model.friction.ladder import Judge, Ladder, climb
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import LADDER, Law
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.friction.ripple import Ripple, ripple_of
from pipelines.model.rigid.body import Array, Motion
from pipelines.signal.filters import LowPass, centre_samples, zero_phase

__all__ = ["RowEquations", "SeveralFit", "fit_several"]


def _alone(motion: Motion, j: int) -> Motion:
    return Motion(motion.t, motion.q[:, [j]], motion.dq[:, [j]], motion.ddq[:, [j]])


@dataclass(frozen=True, eq=False)
class _Run:
    """One joint's motion along a run, and which of its conditioned samples make rows."""

    motion: Motion  # (samples, 1)
    held: bool
    low_pass: LowPass | None
    rows: npt.NDArray[np.intp]  # samples of the run, after centring
    scale: float

    def conditioned(self, columns: Array) -> Array:
        x = centre_samples(columns) if self.held else columns
        return self.scale * (x if self.low_pass is None else zero_phase(x, self.low_pass))[self.rows]


def _runs_of(log: LogEquations, j: int) -> list[_Run]:
    """The runs of `log`, its rows found by the times that its equations have."""
    times, found = log.times(), []
    motion, good = log.found.motion, log.found.good
    for run in log.runs:
        rows = good.kept[run]
        t = motion.t[rows]
        known = np.isfinite(motion.q[rows, j] + motion.dq[rows, j] + motion.ddq[rows, j])
        at = np.arange(len(t))
        q, dq, ddq = (np.interp(at, at[known], x[rows, j][known])[:, None] for x in (motion.q, motion.dq, motion.ddq))
        own = times[(times >= t[0]) & (times <= t[-1])]
        found.append(_Run(Motion(t, q, dq, ddq), log.held, log.conditioning.low_pass,
                          np.searchsorted(t, own) - int(log.held), float(np.sqrt(log.repeats))))
    return found


@dataclass(frozen=True, eq=False)
class _Row:
    """What is made once of one joint's rows, however many of them are looked at."""

    logs: tuple[LogEquations, ...]  # with the rigid body's columns
    joint: int  # from 0

    @cached_property
    def blocks(self) -> tuple[Array, Array]:
        """Columns of the rigid body that act on this row, and torque."""
        fixed, y = [], []
        for log in self.logs:
            for block in log:
                fixed.append(np.array(block.values[self.joint].T))
                y.append(np.array(block.y[self.joint]))
        return np.vstack(fixed), np.concatenate(y)

    @cached_property
    def runs(self) -> tuple[_Run, ...]:
        return tuple(run for log in self.logs for run in _runs_of(log, self.joint))


@dataclass(frozen=True, eq=False)
class RowEquations:
    """One joint's rows of several logs."""

    row: _Row
    every: int = 1

    @property
    def y(self) -> Array:
        return self.row.blocks[1][::self.every]

    @property
    def largest(self) -> float:
        """Nothing bounds it: the other joints load this one as well [N m]."""
        return float("inf")

    @property
    def fixed(self) -> Array:
        return self.row.blocks[0][::self.every]

    @property
    def width(self) -> int:
        return int(self.row.blocks[0].shape[1])

    @property
    def postures(self) -> tuple[tuple[float, ...], ...]:
        return ((),)

    @cached_property
    def nodes(self) -> Motion:
        longest = max(self.row.logs, key=lambda log: len(log.found.motion.t))
        return _alone(longest.found.motion, self.row.joint)

    def arms(self, beta: Array | None = None) -> tuple[OneJoint, ...]:
        del beta  # laws that ask for the load are not tried here
        return (OneJoint.of(self.row.logs[0].columns.body.robot, self.row.joint + 1),)

    def build(self, law: Columned, arms: Sequence[OneJoint], theta: Array) -> Array:
        """The law's columns (rows, amplitudes), centred, filtered and thinned out as the body's were."""
        return np.vstack([run.conditioned(law.columns(run.motion, arms[0], theta)) for run in self.row.runs])[::self.every]

    def problem(self, law: Law, arms: Sequence[OneJoint]) -> Separable:
        lower, upper = law.bounds
        return Separable(self.y, self.fixed, lambda theta: self.build(law, arms, theta), lower, upper)

    def thinned(self, rows: int) -> RowEquations:
        return replace(self, every=max(1, len(self.y) // rows))

    @property
    def rows(self) -> npt.NDArray[np.intp]:
        """Which of all rows these are."""
        return np.arange(0, len(self.row.blocks[1]), self.every)

    def predicted(self, fit: LawFit) -> Predicted:
        law = self.build(fit.law, self.arms(), fit.theta) @ fit.amplitudes
        return Predicted(self.y, self.fixed @ fit.found.beta[:self.width] + law)


@dataclass(frozen=True, eq=False)
class SeveralFit:
    """Laws joint by joint, and the fit of everything."""

    ladders: tuple[Ladder, ...]
    fitted: Fitted
    ripples: tuple[Ripple | None, ...]
    beside_ripples: Fitted | None  # the same fit with every ripple known; None where there is none


def fit_several(identify: Motions, validate: Motions, recipe: Recipe, law: Law | None = None) -> SeveralFit:
    """Choose a law for every joint, or take `law`, and fit its amplitudes together with the base parameters.

    Laws with memory or load are not tried: a row of a moving arm does not show what its joint carries before all is fitted.
    """
    robot = identify[0][0].robot
    columns = nominal_columns(robot, friction=False, offset=False)
    recipe = with_cutoff(recipe, identify)
    rows, others = (tuple(equations_of(part, recipe, columns)) if part else () for part in (identify, validate))
    laws = (law,) if law is not None else tuple(one for one in LADDER if one.pointwise and not one.sees_load)
    own = [RowEquations(_Row(rows, j)) for j in range(robot.n_joints)]
    ladders = tuple(climb(Judge(one, RowEquations(_Row(others, j)) if others else None), laws) for j, one in enumerate(own))
    placed = [replace(effect, joint=j + 1) for j, ladder in enumerate(ladders)
              for effect in ladder.chosen.fit.law.shaped(ladder.chosen.fit.theta)]
    everything = Columns(columns.body, columns.kept, (*placed, *columns.laws), columns.arm)
    ripples = tuple(ripple_of(one, ladder.chosen.fit) for one, ladder in zip(own, ladders, strict=True))
    waves = tuple(wave for j, ripple in enumerate(ripples) if ripple is not None for wave in ripple.waves.alone(j + 1))
    beside = fit_logs(identify, replace(everything, laws=(*everything.laws, *waves)), recipe) if waves else None
    return SeveralFit(ladders, fit_logs(identify, everything, recipe), ripples, beside)

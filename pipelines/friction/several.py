"""Fit friction of joints that were never driven alone, together with the base parameters.

Of the equations τ_j = Y_j p + friction_j of one joint, Y_j p is linear and friction is linear but
for a few numbers: variable projection solves for those with p as it pleases that row. It is done
joint by joint, for p ties the rows together and the few numbers do not; then one fit of all rows,
with every law's shape given, finds p and the amplitudes of all joints.

    arm = fitted_in_folder(logs)      the model that a folder gives, where a stage needs one
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.parameter import Parameter
from pipelines.estimation.estimate import (
    Fitted,
    Recipe,
    equations_of,
    fit_logs,
    motions_of,
    with_cutoff,
)
from pipelines.estimation.filters import centre_samples, zero_phase
from pipelines.estimation.motion import Motions, Reconstruction, reconstruct
from pipelines.estimation.nominal import fitted_arm, nominal_columns
from pipelines.estimation.periods import averaged
from pipelines.estimation.regression import Columns, LogEquations
from pipelines.friction.config import FRICTION
from pipelines.friction.fit import Equations
from pipelines.friction.joint import JointLogs, fit_joint, friction_of
from pipelines.friction.laws import LADDER, Law, OneJoint, law_named
from pipelines.friction.model_selection import Ladder, climb
from pipelines.io.log import ExperimentLog

__all__ = ["SeveralFit", "fit_several", "fitted_in_folder"]


@dataclass(frozen=True, eq=False)
class _Run:
    """One joint's rows of a run, conditioned as the rigid body's columns are."""

    nodes: Motion  # (samples, 1)
    torque: Array  # (rows,) [N m]
    rigid: Array  # (rows, parameters)
    mean: Callable[[Array], Array]  # of columns (samples, k) in each row
    largest = float("inf")  # other joints load it without a bound

    def sampler(self, every: int, pointwise: bool) -> tuple[Motion, Callable[[Array], Array]]:
        del pointwise  # the low-pass needs all samples
        return self.nodes, lambda columns: self.mean(columns)[::every]


def _runs_of(log: LogEquations, j: int) -> list[_Run]:
    """Return the runs of `log`, their rows found by the times that its equations have."""
    motion, held, cutoff, runs = log.found.motion, log.held, log.conditioning.cutoff_hz, []
    times = motion.t[log.moments()]
    blocks = [(np.array(block.y[j]), np.array(block.values[j].T)) for block in log]
    y, fixed = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    for run in log.runs:
        rows = log.found.good.kept[run]
        t = motion.t[rows]
        known = np.isfinite(motion.q[rows, j] + motion.dq[rows, j] + motion.ddq[rows, j])
        at = np.arange(len(t))
        states = (
            np.interp(at, at[known], x[rows, j][known])[:, None]
            for x in (motion.q, motion.dq, motion.ddq)
        )
        own = (times >= t[0]) & (times <= t[-1])
        places = np.searchsorted(t, times[own]) - int(held)

        def mean(columns: Array, places: Array = places) -> Array:
            x = centre_samples(columns) if held else columns
            x = x if cutoff is None else zero_phase(x, cutoff, log.rate)
            return np.asarray(x[places])

        runs.append(_Run(Motion(t, *states), y[own], fixed[own], mean))
    return runs


@dataclass(frozen=True, eq=False)
class SeveralFit:
    """Laws joint by joint, and the fit of everything."""

    ladders: tuple[Ladder, ...]
    fitted: Fitted


def fit_several(
    identify: Motions, validate: Motions, recipe: Recipe, law: Law | None = None
) -> SeveralFit:
    """Choose a law for every joint, or take `law`, and fit amplitudes with the base parameters.

    Laws with memory or load are not tried: a row of a moving arm does not show what its joint
    carries before all is fitted.
    """
    robot = identify[0][0].robot
    columns = nominal_columns(robot, friction=False, offset=False)
    recipe = with_cutoff(recipe, identify)
    rows = equations_of(identify, recipe, columns)
    others = equations_of(validate, recipe, columns) if validate else ()
    laws = [one for one in LADDER[:-1] if one.pointwise and not one.sees_load]

    def own(logs: Sequence[LogEquations], j: int) -> Equations:
        runs = [run for log in logs for run in _runs_of(log, j)]
        return Equations(runs, OneJoint.of(robot, j + 1))

    ladders = tuple(
        climb(own(rows, j), own(others, j) if others else None, laws if law is None else (law,))
        for j in range(robot.n_joints)
    )
    fits = [ladder.chosen.fit for ladder in ladders]
    shaped = [
        replace(effect, joint=j + 1)
        for j, fit in enumerate(fits)
        for effect in fit.law.shaped(fit.theta)
    ]
    whole = Columns(columns.body, columns.kept, (*shaped, *columns.laws), columns.arm)
    return SeveralFit(ladders, fit_logs(identify, whole, recipe))


def fitted_in_folder(logs: Iterable[ExperimentLog]) -> Arm | None:
    """Return the arm with the covariance of its numbers; None without a log that moves all joints.

    Where every joint was driven alone, friction is what fit-friction finds. Else it is fitted
    along: Coulomb and viscous as estimate-bps does, or three sigmoids, Kostić et al. 2004, eq.
    (10), where these explain the same logs better: on a writing task the arm reverses often and
    goes slowly in places, and there a Stribeck curve counts.

    Raises:
        RrridError: the stages' reasons why these logs cannot be fitted.
    """
    known = [log for log in logs if log.origin != "planned" and log.role == "identify"]
    identify = [log for log in known if log.experiment in ("excitation", "free")]
    if not identify:
        return None
    how = Reconstruction()
    motions, friction = motions_of(identify, how), _driven_alone(known, how)
    robot, recipe = identify[0].robot, Recipe(how)
    columns = nominal_columns(robot, friction=not friction)
    if friction:
        unknown = tuple(
            Parameter(p.name, 0.0, None, p.unit, origin="assumed") for p in columns.body.parameters
        )
        rubs = Arm(robot.name, columns.body, unknown, friction).friction_torque
        recipe = Recipe(how, known=rubs)
    recipe = with_cutoff(recipe, motions)
    means, _ = averaged(motions, recipe.cutoff_hz)
    fitted = fit_logs(means, columns, recipe)
    if not friction:
        flexible = fit_several(motions, (), Recipe(how), law_named("three_sigmoid"))
        fitted = min(fitted, flexible.fitted, key=_error)
    return fitted_arm(fitted.estimate, identify[0].robot_name, friction)


def _error(fitted: Fitted) -> float:
    """Return the relative torque error; a more flexible law must be worth its numbers."""
    numbers = len(fitted.estimate.columns.names)
    return fitted.errors.relative_error * (1.0 + FRICTION.dear * numbers)


def _driven_alone(logs: Sequence[ExperimentLog], how: Reconstruction) -> tuple[Acting, ...]:
    """Return the laws of all joints, where every one was driven alone; none otherwise."""
    alone = [log for log in logs if log.experiment == "friction" and log.joint is not None]
    joints = range(1, logs[0].n_joints + 1)
    if {log.joint for log in alone} != set(joints):
        return ()
    moved = [(log, reconstruct(log, how)) for log in alone]
    parts = (tuple(pair for pair in moved if pair[0].joint == j) for j in joints)
    fits = [fit_joint(JointLogs(j, own), FRICTION.window) for j, own in enumerate(parts, start=1)]
    return friction_of(fits, logs[0].robot)[0]

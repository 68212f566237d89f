"""Two checks of an estimate that the fit itself does not make: links that could exist, and the balance of power."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.fit.consistency import physical_consistency
from pipelines.fit.equations import Block
from pipelines.fit.least_squares import solve
from pipelines.fit.statistics import gather
from pipelines.log.order_statistics import median
from pipelines.model.estimation.estimate import Estimate
from pipelines.model.estimation.logs import Fitted
from pipelines.model.motion import Reconstructed
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Motion, RigidBody
from pipelines.model.rigid.energy import energy, work
from pipelines.model.rigid.rrr import RRR
from pipelines.model.rigid.rrr_consistency import rrr_combine, rrr_inequalities

__all__ = ["Balance", "Consistent", "Inequal", "consistency", "power_balance"]

_WINDOW = 0.05  # [s] between two balances: long against the noise of a sample, short against the motion
_APART = 3.0  # standard deviations


@dataclass(frozen=True)
class Inequal:
    """A condition that positive mass puts on the parameters."""

    condition: str
    value: float
    std: float
    holds: bool  # or cannot be said to be broken


@dataclass(frozen=True)
class Consistent:
    """Whether links that could exist have the estimated parameters."""

    consistent: bool
    distance: float  # [standard deviations] to the nearest parameters that could
    violating: tuple[str, ...]  # links without whose condition they would
    inequalities: tuple[Inequal, ...]  # of the RRR arm


@dataclass(frozen=True)
class Balance:
    """Parameters by the balance of power, which needs no acceleration, beside those of the torques."""

    names: tuple[str, ...]
    value: tuple[float, ...]
    std: tuple[float, ...]
    apart: tuple[float, ...]  # difference in standard deviations of both
    agree: bool


def consistency(found: Estimate, body: RigidBody) -> Consistent | None:
    """Pseudo-inertias that are positive definite (Wensing et al. 2018), and for the RRR arm what (A4) demands.

    None where a parameter is not determined: nothing can be said of links then.
    """
    if not found.trusted[list(found.columns.rigid)].all():
        return None
    count, kept = len(body.parameters), list(found.columns.kept)
    beta, covariance = np.zeros(count), np.zeros((count, count))
    beta[kept] = found.beta[:len(kept)]
    covariance[np.ix_(kept, kept)] = found.robust.covariance[:len(kept), :len(kept)]
    combine = rrr_combine(body) if isinstance(body, RRR) else body.base.combine if isinstance(body, BaseArm) else None
    if combine is None:
        raise TypeError(f"no links are known behind a {type(body).__name__}")
    rest = np.array(kept)
    answer = physical_consistency(beta[rest], covariance[np.ix_(rest, rest)], combine[rest])
    names = tuple(body.robot.joints[i].name for i in answer.violating)
    rules = rrr_inequalities(beta, covariance) if isinstance(body, RRR) else ()
    return Consistent(answer.consistent, answer.distance, names,
                      tuple(Inequal(rule.name, rule.value, rule.std, rule.satisfied) for rule in rules))


def power_balance(fitted: Fitted) -> Balance | None:
    """The same parameters from E(t_b) - E(t_a) = work of the drives - work of friction, over short windows.

    Linear in the same parameters and free of accelerations (Gautier & Khalil 1988), so that an error of the
    reconstructed acceleration shows as a difference. None where the balance does not determine them.
    """
    found = fitted.estimate
    blocks = [block for log, motion in fitted.motions for run in motion.good.runs
              if (block := _balances(fitted, motion, run, log.torque != "measured"))]
    if not blocks:
        return None
    solution = solve(gather(blocks))
    rigid = [k for k in found.columns.rigid if solution.determined[k] and found.trusted[k]]
    if not rigid:
        return None
    std, names = solution.std, [column.name for column in found.columns.names]
    apart = np.abs(solution.beta - found.beta)[rigid] / np.hypot(std, found.std)[rigid]
    return Balance(tuple(names[k] for k in rigid), tuple(map(float, solution.beta[rigid])), tuple(map(float, std[rigid])),
                   tuple(map(float, apart)), bool(np.all(apart < _APART)))


def _balances(fitted: Fitted, found: Reconstructed, run: slice, held: bool) -> Block | None:
    """One equation a window: energy gained and work of friction by parameter, against work of the drives."""
    columns, rows, motion = fitted.estimate.columns, found.good.kept[run], found.motion
    whole = Motion(motion.t[rows], motion.q[rows], motion.dq[rows], motion.ddq[rows])
    q, tau = whole.q, found.good.log.tau[run]
    if held:  # τ_k acts from t_k to t_{k+1}
        tau = np.vstack([tau[:1], 0.5 * (tau[1:] + tau[:-1])])
    if fitted.recipe.known is not None:
        tau = tau - fitted.recipe.known(whole)
    size = max(2, round(_WINDOW / float(median(np.diff(whole.t)))))
    ends = np.arange(size, len(rows) - size, size)
    if len(ends) < 3 * len(columns.names) or not (np.isfinite(tau).all() and np.isfinite(q + whole.dq).all()):
        return None
    gained = np.diff(energy(columns.body, q[ends], whole.dq[ends])[:, list(columns.kept)], axis=0)
    tables = [law.columns(whole, columns.arm) for law in columns.laws]
    lost = [work(q, table[..., k]) for table in tables for k in range(table.shape[2])]
    table = np.hstack([gained, *(np.diff(x[ends])[:, None] for x in lost)])
    return Block.of(table[:, None, :], np.diff(work(q, tau)[ends])[:, None])

"""Check an estimate by the balance of power: energy gained is the work of the drives less that of friction.

    e(q, q̇)|_a^b p + Σ φ ∫ f(q̇) dq - d ∫ τ̇ᵀ dq = ∫ τᵀ dq           over short windows a … b

Gautier & Khalil 1988. Linear in the same parameters and free of accelerations, so that whatever spoils these makes the two
estimates differ. One more unknown, d, is the time by which torque comes late behind position, to first order: both
estimates feel it alike, and only by name it shows. A recorded command is held from its sample to the next: its work is then
exact, Σ τ_k (q_{k+1} - q_k).

Both estimates are as wrong as motion is wrong in itself: a lagging observer's speed is not the slope of its position. Hence
a second question that needs no measured torque, whether the modelled torque does the work that the modelled energy gains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import chain
from operator import add

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Motion, RigidBody
from pipelines.dynamics.energy import energy, work
from pipelines.fit.equations import Array, Block, Indices, split
from pipelines.fit.least_squares import solve
from pipelines.fit.statistics import Gram, gather_growing
from pipelines.model.estimation.estimate import Estimate
from pipelines.model.estimation.regression import LogEquations

__all__ = ["ALONE", "CLOSED", "TOGETHER", "Balance", "power_balance"]

_WINDOW = 0.02  # [s] between two balances: long against the noise of a sample, short against the motion
_GROUPS = 40  # at least, left out in turn
_PIECE = 32768  # samples worked on at once
_PER_PARAMETER, _FEWEST = 3, 1.5  # groups a parameter: aimed at, and enough to tell chance by
CLOSED = 2e-3  # of the energy: a smoother leaves 1e-5, central differences of a fine encoder 1e-4, a lagging observer 1e-2
ALONE = 4.0  # standard deviations of one difference that chance does not make among twenty
TOGETHER = 3.0  # normal deviate of all differences together: once in 700


@dataclass(frozen=True)
class Balance:
    """Parameters by the balance of power beside those of the torques."""

    names: tuple[str, ...]
    value: tuple[float, ...]
    std: tuple[float, ...]
    apart: tuple[float, ...]  # difference in standard deviations of both
    delay: float  # [s] of torque behind position
    delay_std: float
    chi_square: float  # of all differences and the delay together, their covariances allowed for
    freedom: int  # how many differences chi_square is made of
    deviate: float  # what that is in standard deviations of a normal distribution
    closure: float  # share of the energy gained that the reconstructed motion's own acceleration does not account for
    windows: int
    agree: bool


def power_balance(found: Estimate) -> Balance | None:
    """The parameters once more, from the samples that the fit took; None where the balance does not determine them.

    Args:
        found: whose equations are those of logs.
    """
    logs = [one for one in found.equations.logs if isinstance(one, LogEquations)]
    parameters = len(found.columns.names) + 1
    groups = _groups(logs, max(_GROUPS, _PER_PARAMETER * parameters))
    if len(groups) < _FEWEST * parameters:
        return None
    gram = reduce(add, groups)
    solution = solve(gram)
    rigid = [k for k in found.columns.rigid if solution.determined[k] and found.trusted[k]]
    if not rigid:
        return None
    beside = [*rigid, len(solution.beta) - 1]  # the delay, which the torques take for zero
    covariance = _jackknife(groups, solution.beta)[np.ix_(beside, beside)]
    both, difference = covariance.copy(), solution.beta[beside]
    both[:-1, :-1] += found.robust.covariance[np.ix_(rigid, rigid)]
    difference[:-1] -= found.beta[rigid]
    apart, std = np.abs(difference) / np.sqrt(np.diag(both)), np.sqrt(np.diag(covariance))
    chi_square, rank = _distance(difference, both)
    free = len(groups) - rank
    closure = _closure(logs, found.beta)
    deviate = _deviate(chi_square * free / (len(groups) - 1), rank, free)
    return Balance(tuple(found.columns.names[k].name for k in rigid), tuple(map(float, solution.beta[rigid])),
                   tuple(map(float, std[:-1])), tuple(map(float, apart[:-1])), float(solution.beta[-1]), float(std[-1]),
                   chi_square, rank, deviate, closure, int(gram.counts.sum()),
                   bool(apart.max() < ALONE and deviate < TOGETHER and closure < CLOSED))


def _jackknife(groups: list[Gram], beta: Array) -> Array:
    """(G - 1)/G Σ_g (β_(g) - β)(β_(g) - β)ᵀ, β_(g) without group g: true to noise that depends on motion and on its past.

    The error of an energy is that of speed times momentum, and two windows share it. MacKinnon, Nielsen & Webb 2023, CV3.
    """
    total = sum(group.gram[0] for group in groups)
    scale = np.sqrt(np.diag(total)[:-1])
    scale = np.where(scale > 0.0, scale, 1.0)
    rest = total - np.stack([group.gram[0] for group in groups])
    table = rest[:, :-1, :-1] / scale / scale[:, None] + 1e-12 * np.eye(len(scale))
    apart = np.linalg.solve(table, (rest[:, :-1, -1] / scale)[..., None])[..., 0] / scale - beta
    return np.asarray((len(groups) - 1) / len(groups) * apart.T @ apart)


def _distance(difference: Array, covariance: Array) -> tuple[float, int]:
    """dᵀ V⁻¹ d over the directions that V knows, and how many they are."""
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / scale / scale[:, None])
    keep = values > 1e-10 * values[-1]
    return float(np.sum(np.square(vectors[:, keep].T @ (difference / scale)) / values[keep])), int(keep.sum())


def _deviate(chi_square: float, freedom: int, rest: int) -> float:
    """The normal deviate as rare as `chi_square` of so many degrees, the variance known from `rest` others.

    χ²/k follows F(k, n) then; Paulson 1942: ((1 - 2/9n) F^⅓ - (1 - 2/9k)) / √(2/9n F^⅔ + 2/9k).
    """
    n, k, root = 2.0 / (9.0 * rest), 2.0 / (9.0 * freedom), np.cbrt(chi_square / freedom)
    return float(((1.0 - n) * root - (1.0 - k)) / np.sqrt(n * root**2 + k))


def _groups(logs: Sequence[LogEquations], least: int) -> list[Gram]:
    """The statistics of consecutive stretches: `least` of them or up to twice as many, where there are as many windows."""
    windows = sum((run.stop - run.start) / _size(one) for one in logs for run in one.counted)
    balances = chain.from_iterable(_balances(one) for one in logs)
    parts = gather_growing(split(balances, max(1, int(windows / least))), least)
    return [part for part in parts if part.counts.any()]


def _closure(logs: Sequence[LogEquations], beta: Array) -> float:
    """‖Δe p - ∫ (Y p)ᵀ dq‖ / ‖Δe p‖ over all windows: whether acceleration is the slope of speed, and speed that of position.

    The torque of the rigid body does the work that its energy gains, whatever its parameters; no measured torque is needed.
    """
    apart = power = 0.0
    columns = logs[0].columns
    p = np.zeros(len(columns.body.parameters))
    p[list(columns.kept)] = beta[columns.rigid]
    for one in logs:
        for part in _parts(one):
            torque = columns.body.torque(part.motion.q, part.motion.dq, part.motion.ddq, p)
            gained = np.diff(part.energy(columns.body) @ p)[part.used]
            apart += float(np.sum(np.square(gained - np.diff(work(part.motion.q, torque)[part.ends])[part.used])))
            power += float(np.sum(np.square(gained)))
    return float(np.sqrt(apart / power)) if power > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class _Part:
    """Windows side by side on one unbroken stretch."""

    motion: Motion
    tau: Array  # [N m] (samples, joints)
    ends: Indices  # (windows + 1,) samples
    used: npt.NDArray[np.bool_]  # (windows,) none of its samples is left out of the fit

    def energy(self, body: RigidBody) -> Array:
        """(windows + 1, parameters) by parameter, at the ends [J]."""
        return energy(body, self.motion.q[self.ends], self.motion.dq[self.ends])


def _size(one: LogEquations) -> int:
    """Samples of a window."""
    return max(2, round(_WINDOW / one.found.good.log.sample_time))


def _parts(one: LogEquations) -> Iterator[_Part]:
    good, motion = one.found.good, one.found.motion
    bad = one.rows.out | one.rows.slow.any(axis=1)
    size = _size(one)
    length = max(1, _PIECE // size) * size
    for run in one.counted:
        for first in range(run.start, run.stop - size, length):
            samples = min(length, (run.stop - 1 - first) // size * size) + 1
            place, ends = slice(first, first + samples), np.arange(0, samples, size)
            rows = good.kept[place]
            q, dq, ddq = (np.nan_to_num(x[rows]) for x in (motion.q, motion.dq, motion.ddq))
            count = np.append(0, np.cumsum(bad[place]))
            used = count[ends[1:] + 1] == count[ends[:-1]]
            yield _Part(Motion(motion.t[rows], q, dq, ddq), np.nan_to_num(good.log.tau[place]), ends, used)


def _balances(one: LogEquations) -> Iterator[Block]:
    """One equation a window; windows that touch a sample which the fit leaves out are left out as well."""
    columns, step = one.columns, one.found.good.log.sample_time
    for part in _parts(one):
        q, tau = part.motion.q, part.tau
        done = np.append(0.0, np.cumsum(np.sum(tau[:-1] * np.diff(q, axis=0), axis=1))) if one.held else work(q, tau)
        if one.known is not None:
            done = done - work(q, one.known(part.motion))
        tables = [law.columns(part.motion, columns.arm) for law in columns.laws]
        lost = [*(work(q, table[..., k]) for table in tables for k in range(table.shape[2])),
                -work(q, np.gradient(tau, step, axis=0))]
        states = part.energy(columns.body)[:, list(columns.kept)]
        table = np.diff(np.hstack([states, *(x[part.ends, None] for x in lost)]), axis=0)
        block = Block.of(np.where(part.used[:, None], table, 0.0)[:, None, :],
                         np.where(part.used, np.diff(done[part.ends]), 0.0)[:, None])
        yield block if part.used.all() else replace(block, used=(part.used,))

"""Check an estimate by the balance of power: energy gained is the work of drives less friction's.

    e(q, q̇)|_a^b p + Σ φ ∫ f(q̇) dq - d ∫ τ̇ᵀ dq = ∫ τᵀ dq           over short windows a … b

Gautier & Khalil 1988. Linear in the same parameters and free of accelerations, so that whatever
spoils these makes the two estimates differ. One more unknown, d, is the time by which torque comes
late behind position, to first order: both estimates feel it alike, and only by name it shows. A
recorded command is held from its sample to the next: its work is then exact, Σ τ_k (q_{k+1} - q_k).

Both estimates are as wrong as motion is wrong in itself: a lagging observer's speed is not the
slope of its position. Hence a second question that needs no measured torque, whether the modelled
torque does the work that the modelled energy gains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import chain
from operator import add

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.dynamics.energy import energy, work
from pipelines.estimation.config import BalanceConfig
from pipelines.estimation.estimate import Estimate
from pipelines.estimation.least_squares import (
    Block,
    Flags,
    Indices,
    Statistics,
    gather_growing,
    solve,
    split,
)
from pipelines.estimation.regression import LogEquations
from pipelines.io.log import Array

_CONFIG = BalanceConfig()
_PIECE = 32768  # numerics: samples worked on at once


@dataclass(frozen=True)
class Balance:
    """Parameters by the balance of power, with those of the torques."""

    names: tuple[str, ...]
    value: tuple[float, ...]
    std: tuple[float, ...]
    apart: tuple[float, ...]  # difference in standard deviations of both
    delay: float  # [s] of torque behind position
    delay_std: float
    chi_square: float  # of all differences and the delay together, their covariances allowed for
    freedom: int  # how many differences chi_square is made of
    deviate: float  # what that is in standard deviations of a normal distribution
    closure: float  # share of the energy gained that the motion's acceleration does not account for
    windows: int
    agree: bool


def power_balance(found: Estimate) -> Balance | None:
    """Return the parameters once more, from the samples of the fit; None where it cannot tell.

    Args:
        found: whose equations are those of logs.
    """
    logs = [one for one in found.equations.logs if isinstance(one, LogEquations)]
    columns, parameters = found.columns, len(found.columns.names) + 1
    least = max(_CONFIG.groups, _CONFIG.per_parameter * parameters)
    # consecutive stretches: `least` of them or up to twice as many, of as many windows
    windows = sum((run.stop - run.start) / _size(one) for one in logs for run in one.counted)
    balances = chain.from_iterable(_balances(one) for one in logs)
    parts = gather_growing(split(balances, max(1, int(windows / least))), least)
    groups = [part for part in parts if part.counts.any()]
    if len(groups) < _CONFIG.fewest * parameters:
        return None
    gram = reduce(add, groups)
    solution = solve(gram)
    rigid = [k for k in columns.rigid if solution.determined[k] and found.trusted[k]]
    if not rigid:
        return None
    tested = [*rigid, len(solution.beta) - 1]  # the delay, which the torques take for zero
    covariance = _jackknife(groups, solution.beta)[np.ix_(tested, tested)]
    both, difference = covariance.copy(), solution.beta[tested]
    both[:-1, :-1] += found.robust.covariance[np.ix_(rigid, rigid)]
    difference[:-1] -= found.beta[rigid]
    apart, std = np.abs(difference) / np.sqrt(np.diag(both)), np.sqrt(np.diag(covariance))
    # dᵀ V⁻¹ d over the directions that V knows
    scale = np.sqrt(np.diag(both))
    values, vectors = np.linalg.eigh(both / scale / scale[:, None])
    keep = values > 1e-10 * values[-1]
    turned = vectors[:, keep].T @ (difference / scale)
    chi_square, rank = float(np.sum(np.square(turned) / values[keep])), int(keep.sum())
    # the normal deviate as rare: χ²/k follows F(k, n), V known from n others; Paulson 1942,
    # ((1 - 2/9n) F^⅓ - (1 - 2/9k)) / √(2/9n F^⅔ + 2/9k)
    free = len(groups) - rank
    n, k = 2.0 / (9.0 * free), 2.0 / (9.0 * rank)
    root = np.cbrt(chi_square * free / (len(groups) - 1) / rank)
    deviate = float(((1.0 - n) * root - (1.0 - k)) / np.sqrt(n * root**2 + k))
    closure = _closure(logs, found.beta)
    agree = apart.max() < _CONFIG.alone and deviate < _CONFIG.together
    return Balance(
        names=tuple(columns.names[k].name for k in rigid),
        value=tuple(solution.beta[rigid].tolist()),
        std=tuple(std[:-1].tolist()),
        apart=tuple(apart[:-1].tolist()),
        delay=float(solution.beta[-1]),
        delay_std=float(std[-1]),
        chi_square=chi_square,
        freedom=rank,
        deviate=deviate,
        closure=closure,
        windows=int(gram.counts.sum()),
        agree=bool(agree and closure < _CONFIG.closed),
    )


def _jackknife(groups: list[Statistics], beta: Array) -> Array:
    """(G - 1)/G Σ_g (β_(g) - β)(β_(g) - β)ᵀ, β_(g) without group g.

    True to noise that depends on motion and on its past: the error of an energy is that of speed
    times momentum, and two windows share it. MacKinnon, Nielsen & Webb 2023, CV3.
    """
    each = np.stack([group.gram[0] for group in groups])
    rest = each.sum(axis=0) - each
    scale = np.sqrt(np.diag(each.sum(axis=0))[:-1])
    scale = np.where(scale > 0.0, scale, 1.0)
    table = rest[:, :-1, :-1] / scale / scale[:, None] + 1e-12 * np.eye(len(scale))
    solved = np.linalg.solve(table, (rest[:, :-1, -1] / scale)[..., None])[..., 0] / scale
    return np.asarray((len(groups) - 1) / len(groups) * (solved - beta).T @ (solved - beta))


def _closure(logs: Sequence[LogEquations], beta: Array) -> float:
    """Return ‖Δe p - ∫ (Y p)ᵀ dq‖ / ‖Δe p‖ over all windows.

    Whether acceleration is the slope of speed, and speed that of position: the torque of the rigid
    body does the work that its energy gains, whatever its parameters.
    """
    columns = logs[0].columns
    p = np.zeros(len(columns.body.parameters))
    p[list(columns.kept)] = beta[columns.rigid]
    off = power = 0.0
    for one in logs:
        for part in _parts(one):
            m, ends = part.motion, part.ends
            torque = columns.body.torque(m.q, m.dq, m.ddq, p)
            gained = np.diff(energy(columns.body, m.q[ends], m.dq[ends]) @ p)[part.used]
            done = np.diff(work(m.q, torque)[ends])[part.used]
            off += float(np.sum(np.square(gained - done)))
            power += float(np.sum(np.square(gained)))
    return float(np.sqrt(off / power)) if power > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class _Part:
    """Consecutive windows on one unbroken stretch."""

    motion: Motion
    tau: Array  # [N m] (samples, joints)
    ends: Indices  # (windows + 1,) samples
    used: Flags  # (windows,) none of its samples is left out of the fit


def _size(one: LogEquations) -> int:
    """Return the samples of a window."""
    return max(2, round(_CONFIG.window / one.found.good.log.sample_time))


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
            tau = np.nan_to_num(good.log.tau[place])
            yield _Part(Motion(motion.t[rows], q, dq, ddq), tau, ends, used)


def _balances(one: LogEquations) -> Iterator[Block]:
    """Yield an equation for each window; those that touch a sample left out of the fit are zero."""
    columns, step = one.columns, one.found.good.log.sample_time
    for part in _parts(one):
        q, tau, ends = part.motion.q, part.tau, part.ends
        done = work(q, tau)
        if one.held:
            done = np.append(0.0, np.cumsum(np.sum(tau[:-1] * np.diff(q, axis=0), axis=1)))
        if one.known is not None:
            done = done - work(q, one.known(part.motion))
        tables = [law.columns(part.motion, columns.arm) for law in columns.laws]
        lost = [work(q, table[..., k]) for table in tables for k in range(table.shape[2])]
        lost.append(-work(q, np.gradient(tau, step, axis=0)))
        states = energy(columns.body, q[ends], part.motion.dq[ends])[:, list(columns.kept)]
        table = np.diff(np.hstack([states, *(x[ends, None] for x in lost)]), axis=0)
        values = np.where(part.used[:, None], table, 0.0)[:, None, :]
        block = Block.of(values, np.where(part.used, np.diff(done[ends]), 0.0)[:, None])
        yield block if part.used.all() else replace(block, used=(part.used,))

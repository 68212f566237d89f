"""Find the order of the columns that a log's motion and torque fit.

Every order is scored by the likelihood of the whole arm under its described gravity, on a few moments. Orders of positions and
torques together come from columns that are named otherwise than the joints; orders of either alone from a column map.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from pipelines.estimation.checks.torque_rows import Array, GenericArm, Order
from pipelines.model.rigid.chain import regressor
from pipelines.model.row_fit import Sampled

__all__ = ["ColumnOrder", "search_orders"]

_ALL_UP_TO = {"q and tau": 6, "q": 4, "tau": 4}  # joints: 720 orders take a second; of more, orders are reached by swaps
_SIGNALS = ("q and tau", "tau", "q")
_AGAIN = 40  # orders that are compared once more, on more moments
_BEAM = 12  # orders that are kept at each swap
_AT_ONCE = 40  # orders whose regressors are formed together: 30 MB
_RIDGE = 1e-8
_ROUNDS = 3


@dataclass(frozen=True)
class ColumnOrder:
    """Joint j takes column order[j] of the log, of the signals named."""

    signal: str  # "q and tau", "q" or "tau"
    order: Order
    score: float  # log likelihood, of independent moments


class _Scorer:
    """Scores of orders, each formed once."""

    def __init__(self, arm: GenericArm, motion: Sampled, gravity: Array, model_error: float) -> None:
        self.arm, self.motion, self.model_error = arm, motion, model_error
        self.gravity = gravity
        tau = motion.tau / np.maximum(np.std(motion.tau, axis=0), 1e-12)
        self.basis, self.tau = [], []
        for k in range(tau.shape[1]):
            speed, sign = motion.dq[:, k], motion.coulomb[:, k]
            own = np.stack([motion.ddq[:, k], sign, speed, speed * np.abs(speed), sign * np.abs(tau[:, k]), np.ones(len(tau))],
                           axis=-1)
            q, _ = np.linalg.qr(own / np.maximum(np.linalg.norm(own, axis=0), 1e-300))
            self.basis.append(q)
            self.tau.append(tau - q @ (q.T @ tau))
        self.known: dict[Order, tuple[Array, Array, Array]] = {}

    def prepare(self, orders: Iterable[Order]) -> None:
        """Form the normal equations of `orders` of the positions."""
        new = [order for order in dict.fromkeys(orders) if order not in self.known]
        chain = replace(self.arm.chain, gravity=self.gravity)
        moments, n = self.motion.q.shape
        for first in range(0, len(new), _AT_ONCE):
            part = new[first:first + _AT_ONCE]
            q, dq, ddq = (np.concatenate([x[:, list(order)] for order in part])
                          for x in (self.motion.q, self.motion.dq, self.motion.ddq))
            y = regressor(chain, q, dq, ddq, self.arm.columns).reshape(len(part), moments, n, -1)
            for order, columns in zip(part, y, strict=True):
                self.known[order] = self._normal(order, columns)

    def _normal(self, order: Order, columns: Array) -> tuple[Array, Array, Array]:
        """Per joint: Gram matrix (n, p, p), products with every torque (n, p, n), power of every torque (n, n)."""
        moments, n, p = columns.shape
        gram, cross, power = np.empty((n, p, p)), np.empty((n, p, n)), np.empty((n, n))
        for j, k in enumerate(order):
            own = np.ascontiguousarray(columns[:, j])
            own -= self.basis[k] @ (self.basis[k].T @ own)
            gram[j], cross[j] = own.T @ own / moments, own.T @ self.tau[k] / moments
            power[j] = np.mean(self.tau[k] ** 2, axis=0)
        return gram, cross, power

    def score(self, q_order: Order, tau_order: Order) -> float:
        """Log likelihood a moment of an order of the positions, of those prepared, and one of the torques."""
        gram, cross, power = self.known[q_order]
        n = len(q_order)
        right = cross[np.arange(n), :, list(tau_order)]
        total = power[np.arange(n), list(tau_order)]
        scale = np.sqrt(np.maximum(np.einsum("jpp->p", gram), 1e-300))
        scale[scale < 1e-10 * scale.max()] = np.inf
        gram, right = gram / np.outer(scale, scale), right / scale
        variance = np.ones(n)
        for _ in range(_ROUNDS):
            normal = np.einsum("jpq,j->pq", gram, 1.0 / variance)
            ridge = _RIDGE * np.trace(normal) / len(normal) * np.eye(len(normal))
            phi = np.linalg.solve(normal + ridge, right.T @ (1.0 / variance))
            left = total - 2.0 * right @ phi + np.einsum("p,jpq,q->j", phi, gram, phi)
            variance = np.maximum(left, 0.0) + self.model_error**2
        return -0.5 * float(np.sum(np.log(variance)))


def search_orders(arm: GenericArm, motion: Sampled, gravity: Array, moving: Sequence[int], model_error: float,
                  config: tuple[int, int, bool]) -> tuple[ColumnOrder, ...]:
    """Return the best orders that score better than the logged one, best first.

    Exchanges of two columns come first; only where one of them fits better than the log, or `every` is asked for, all others.

    Args:
        motion: some hundred moments.
        gravity: (3,) [m/s^2] under which orders are compared.
        moving: joints that move; the others keep their place.
        config: how many are returned at most; moments that all orders of many joints are compared with; whether to try every order.
    """
    keep, few, every = config
    same: Order = tuple(range(motion.q.shape[1]))
    exchanged = [_swapped(same, a, b) for a, b in combinations(moving, 2)]
    scorer = _Scorer(arm, motion, gravity, model_error)
    first = {(signal, order): score for signal in _SIGNALS for order, score in _scores(scorer, signal, [same, *exchanged]).items()}
    logged = first["q and tau", same]
    if not every and max(first.values()) <= logged:
        return ()
    coarse = scorer
    if len(moving) > _ALL_UP_TO["q"]:
        step = max(1, len(motion.t) // few)
        thin = replace(motion, **{name: getattr(motion, name)[::step] for name in ("t", "q", "dq", "ddq", "coulomb", "at")})
        coarse = _Scorer(arm, thin, gravity, model_error)
    found = {(signal, order): score for signal in _SIGNALS for order, score in _all_of(coarse, signal, same, moving).items()}
    if coarse is not scorer:  # the best of them once more, on all moments
        best = sorted(found, key=lambda key: -found[key])[:_AGAIN]
        found = {(signal, order): _scores(scorer, signal, [order])[order] for signal, order in best}
    better = {key: score for key, score in found.items() if score > logged and key[1] != same}
    ranked = sorted(better.items(), key=lambda item: -item[1])[:keep]
    return tuple(ColumnOrder(signal, order, score) for (signal, order), score in ranked)


def _scores(scorer: _Scorer, signal: str, orders: Sequence[Order]) -> dict[Order, float]:
    same: Order = tuple(range(len(orders[0])))
    scorer.prepare(orders if "q" in signal else [same])
    return {order: scorer.score(order if "q" in signal else same, order if "tau" in signal else same) for order in orders}


def _all_of(scorer: _Scorer, signal: str, same: Order, moving: Sequence[int]) -> dict[Order, float]:
    """Scores of every order of one kind; of many joints, of those that exchanges of two columns reach."""
    if len(moving) <= _ALL_UP_TO[signal]:
        return _scores(scorer, signal, _placed(same, moving))
    known, beam = _scores(scorer, signal, [same]), [same]
    for _ in range(len(moving) - 1):
        near = {_swapped(order, a, b) for order in beam for a, b in combinations(moving, 2)} - set(known)
        known |= _scores(scorer, signal, sorted(near)) if near else {}
        best = sorted(known, key=lambda order: -known[order])[:_BEAM]
        if best == beam:
            break
        beam = best
    return known


def _placed(same: Order, moving: Sequence[int]) -> list[Order]:
    """Every order of the joints that move."""
    orders = []
    for moved in permutations(moving):
        whole = list(same)
        for place, joint in zip(moving, moved, strict=True):
            whole[place] = joint
        orders.append(tuple(whole))
    return orders


def _swapped(order: Order, a: int, b: int) -> Order:
    out = list(order)
    out[a], out[b] = out[b], out[a]
    return tuple(out)

"""Find the order of the columns that a log's motion and torque fit.

Every order is scored by the likelihood of the whole arm under its described gravity. Orders of
positions and torques together come from columns that are named otherwise than the joints; orders of
either alone from a column map.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from pipelines.dynamics.chain import regressor
from pipelines.estimation.checks.joint_rows import Sampled
from pipelines.estimation.checks.torque_rows import (
    Array,
    GenericArm,
    Order,
    RowFilter,
    own_columns,
    thinned,
)

__all__ = ["SIGNALS", "ColumnOrder", "search_orders"]

SIGNALS = ("q and tau", "tau", "q")
_ALL_UP_TO = {"q and tau": 7, "q": 4, "tau": 4}  # joints; of more, orders are reached by exchanges
_ROUGHLY = 100  # numerics: moments that rank orders by one solution
_REFINED = 50  # numerics: orders that are compared in full, of those that are ranked
_BEAM = 8  # numerics: orders that are kept at each exchange
_RIDGE = 1e-9  # numerics: of equilibrated columns
_ROUNDS = 4  # numerics: of reweighting, from what each joint by itself leaves


@dataclass(frozen=True)
class ColumnOrder:
    """Joint j takes column order[j] of the log, of the signals named."""

    signal: str  # "q and tau", "q" or "tau"
    order: Order

    @property
    def q(self) -> Order | None:
        """The order of the positions; None as logged."""
        return self.order if "q" in self.signal else None

    @property
    def tau(self) -> Order | None:
        """The order of the torques; None as logged."""
        return self.order if "tau" in self.signal else None


def search_orders(
    arm: GenericArm,
    motions: Sequence[Sampled],
    gravity: Array,
    moving: Sequence[int],
    model_error: float,
    size: tuple[int, int],
    every: bool | None = None,
    least: float = -np.inf,
    signals: Sequence[str] = SIGNALS,
) -> tuple[ColumnOrder, ...]:
    """Return the best orders other than the logged one, best first.

    Args:
        gravity: (3,) [m/s^2] under which orders are compared.
        moving: joints that move; the others keep their place.
        size: moments that orders are compared with; how many orders are returned at most.
        every: whether to try every order, or exchanges of two columns only; None: every order
            where an exchange fits better than the log, or of few joints.
        least: log likelihood a moment, below which an order is not returned.
        signals: whose columns are exchanged.
    """
    moments, most = size
    scorer = _Scorer(arm, thinned(motions, moments), gravity, model_error)
    same: Order = tuple(range(len(arm.chain.revolute)))
    logged = scorer("q and tau", same)
    swaps = [_exchanged(same, a, b) for a, b in combinations(moving, 2)]
    scores: dict[tuple[str, Order], float] = {}
    for signal in signals:
        scores |= {(signal, order): scorer(signal, order) for order in swaps}
    if every is None:
        few = len(moving) <= min(_ALL_UP_TO.values())
        every = few or max(scores.values(), default=logged) > logged
    for signal in signals if every else ():
        if len(moving) <= _ALL_UP_TO[signal]:
            rough = _Scorer(arm, thinned(motions, _ROUGHLY), gravity, model_error)
            orders = _best_ranked(rough, signal, same, moving)
            scores |= {(signal, order): scorer(signal, order) for order in orders}
        else:
            own = {order: scores[signal, order] for order in swaps} | {same: logged}
            reached = _by_exchanges(scorer, signal, own, moving)
            scores |= {(signal, order): x for order, x in reached.items() if order != same}
    ranked = sorted(scores.items(), key=lambda item: -item[1])[:most]
    return tuple(ColumnOrder(*key) for key, score in ranked if score > least)


def _best_ranked(
    rough: _Scorer, signal: str, same: Order, moving: Sequence[int]
) -> Collection[Order]:
    """Return all orders but the logged one, of many those that a rough comparison ranks first."""
    orders = {_placed(same, moving, moved) for moved in permutations(moving)} - {same}
    if len(orders) <= _REFINED:
        return orders
    return sorted(orders, key=lambda order: -rough.rank(signal, order))[:_REFINED]


def _by_exchanges(
    scorer: _Scorer, signal: str, known: Mapping[Order, float], moving: Sequence[int]
) -> dict[Order, float]:
    """Return the scores of orders that exchanges of two columns reach from the best ones known."""
    own, beam = dict(known), list[Order]()
    for _ in range(len(moving) - 1):
        best = sorted(own, key=lambda order: -own[order])[:_BEAM]
        if best == beam:
            break
        beam = best
        near = {_exchanged(order, a, b) for order in beam for a, b in combinations(moving, 2)}
        own |= {order: scorer(signal, order) for order in near - own.keys()}
    return own


class _Scorer:
    """Log likelihoods a moment of orders, each position's rows formed once."""

    def __init__(
        self, arm: GenericArm, motions: Sequence[Sampled], gravity: Array, model_error: float
    ) -> None:
        self.columns, self.chain = arm.columns, replace(arm.chain, gravity=gravity)
        self.model_error = model_error
        self.filter = RowFilter(motions)
        self.q, self.dq, self.ddq, coulomb, tau = (
            np.concatenate([getattr(motion, name) for motion in motions])
            for name in ("q", "dq", "ddq", "coulomb", "tau")
        )
        own = self.filter(own_columns(self.dq, self.ddq, coulomb))
        torque = self.filter(tau.T[:, :, None])[:, :, 0].T
        self.size = np.maximum(np.std(torque, axis=0), 1e-12)
        self.basis, self.tau = [], []  # of each column of the positions
        for columns in own:
            basis = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
            self.basis.append(basis)
            self.tau.append(torque - basis @ (basis.T @ torque))
        self.same: Order = tuple(range(len(arm.chain.revolute)))
        self.logged = self._normal(self.same)

    def _normal(self, order: Order) -> tuple[Array, Array, Array]:
        """Per joint: Gram matrix (n, p, p), products with every torque (n, p, n), power of every
        torque (n, n).
        """
        at = list(order)
        y = regressor(self.chain, self.q[:, at], self.dq[:, at], self.ddq[:, at], self.columns)
        own = self.filter(y.transpose(1, 0, 2))
        basis, tau = np.stack([self.basis[k] for k in at]), np.stack([self.tau[k] for k in at])
        own = own - basis @ (basis.transpose(0, 2, 1) @ own)
        moments, turned = own.shape[1], own.transpose(0, 2, 1)
        return turned @ own / moments, turned @ tau / moments, np.mean(tau**2, axis=1)

    def _scaled(self, signal: str, order: Order) -> tuple[Array, Array, Array]:
        """Return the same of an order of the signals named, in units of each joint's torque."""
        q_order, tau_order = (order if name in signal else self.same for name in ("q", "tau"))
        gram, cross, power = self.logged if q_order == self.same else self._normal(q_order)
        joints, torques = np.arange(len(order)), list(tau_order)
        size = self.size[torques]
        gram = gram / size[:, None, None] ** 2
        right = cross[joints, :, torques] / size[:, None] ** 2
        scale = np.sqrt(np.maximum(np.einsum("jpp->p", gram), 1e-300))
        scale[scale < 1e-10 * scale.max()] = np.inf
        return gram / np.outer(scale, scale), right / scale, power[joints, torques] / size**2

    def _left(self, gram: Array, right: Array, total: Array, variance: Array) -> Array:
        """Return the variance of each joint's residual (n,) if joints weigh by 1 / `variance`."""
        normal = np.einsum("jpq,j->pq", gram, 1.0 / variance)
        ridge = _RIDGE * np.trace(normal) / len(normal) * np.eye(len(normal))
        phi = np.linalg.solve(normal + ridge, right.T @ (1.0 / variance))
        rest = total - 2.0 * right @ phi + np.einsum("p,jpq,q->j", phi, gram, phi)
        return np.asarray(np.maximum(rest, 0.0) + self.model_error**2)

    def rank(self, signal: str, order: Order) -> float:
        """Return the log likelihood a moment with all joints weighed alike."""
        gram, right, total = self._scaled(signal, order)
        return -0.5 * float(np.sum(np.log(self._left(gram, right, total, np.ones(len(order))))))

    def __call__(self, signal: str, order: Order) -> float:
        """Return the log likelihood a moment of an order of the signals named."""
        gram, right, total = self._scaled(signal, order)
        size = gram.shape[1]
        ridge = 1e-6 * np.eye(size) * np.einsum("jpp->j", gram)[:, None, None] / size
        alone = np.linalg.solve(gram + ridge, right[:, :, None])[:, :, 0]  # each joint by itself
        variance = np.maximum(total - np.sum(right * alone, axis=1), 0.0) + self.model_error**2
        for _ in range(_ROUNDS):
            variance = self._left(gram, right, total, variance)
        return -0.5 * float(np.sum(np.log(variance)))


def _placed(same: Order, moving: Sequence[int], moved: Sequence[int]) -> Order:
    order = list(same)
    for place, joint in zip(moving, moved, strict=True):
        order[place] = joint
    return tuple(order)


def _exchanged(order: Order, a: int, b: int) -> Order:
    return _placed(order, (a, b), (order[b], order[a]))

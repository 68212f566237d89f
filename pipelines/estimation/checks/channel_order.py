"""Find the order of the columns that a log's motion and torque fit.

Every order is scored by the likelihood of the whole arm under its described gravity. Orders of
positions and torques together come from columns that are named otherwise than the joints; orders of
either alone from a column map.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pipelines.dynamics.chain import regressor
from pipelines.estimation.checks.config import BoundaryConfig
from pipelines.estimation.checks.gravity_fit import GravityFit
from pipelines.estimation.checks.joint_rows import Sampled
from pipelines.estimation.checks.torque_rows import Array, GenericArm, RowFilter, own_columns

Order = tuple[int, ...]
_SIGNALS = ("q and tau", "tau", "q")
_BEAM = 8  # numerics: orders that are kept at each exchange
_RIDGE = 1e-9  # numerics: of equilibrated columns
_ROUNDS = 4  # numerics: of reweighting, from what each joint by itself leaves


@dataclass(frozen=True)
class ColumnOrder:
    """Joint j takes column order[j] of the log, of the signals named."""

    signal: str  # "q and tau", "q" or "tau"
    order: Order

    @property
    def q(self) -> Order:
        """The order of the positions."""
        return self.order if "q" in self.signal else tuple(range(len(self.order)))

    @property
    def tau(self) -> Order:
        """The order of the torques."""
        return self.order if "tau" in self.signal else tuple(range(len(self.order)))

    @property
    def listed(self) -> str:
        return ",".join(str(k + 1) for k in self.order)


def search_orders(
    arm: GenericArm,
    motion: Sampled,
    gravity: Array,
    moving: Sequence[int],
    logged: GravityFit,
    config: BoundaryConfig,
) -> tuple[ColumnOrder, ...]:
    """Return the best orders other than the logged one, best first.

    Orders are reached by exchanges of two columns, from the best ones at each exchange.

    Args:
        gravity: (3,) [m/s^2] under which orders are compared.
        moving: joints that move; the others keep their place.
        logged: the best fit of the columns as they are.
    """
    explained = logged.residual.max() < config.suspect
    # go on where no exchange fits better than the log
    every = logged.rms > config.lost or (len(moving) <= config.few and not explained)
    least = -0.5 * float(np.sum(np.log(logged.variance))) - len(logged.variance)  # hopeless below
    score = _scorer(arm, motion.every(max(1, len(motion.t) // config.order_rows)), gravity, config)
    same: Order = tuple(range(len(arm.chain.revolute)))
    scores: dict[ColumnOrder, float] = {}
    for signal in _SIGNALS[:1] if explained else _SIGNALS:
        own = {same: score(ColumnOrder(signal, same))}
        beam: list[Order] = []
        for _ in range(len(moving) - 1):
            best = sorted(own, key=lambda order: -own[order])[:_BEAM]
            if best == beam or (beam and best[0] == same and not every):
                break
            beam = best
            near = {_exchanged(order, a, b) for order in beam for a, b in combinations(moving, 2)}
            own |= {order: score(ColumnOrder(signal, order)) for order in near - own.keys()}
        scores |= {ColumnOrder(signal, order): x for order, x in own.items() if order != same}
    ranked = sorted(scores.items(), key=lambda item: -item[1])[: config.orders]
    return tuple(order for order, x in ranked if x > least)


def _exchanged(order: Order, a: int, b: int) -> Order:
    swapped = list(order)
    swapped[a], swapped[b] = order[b], order[a]
    return tuple(swapped)


def _scorer(
    arm: GenericArm, motion: Sampled, gravity: Array, config: BoundaryConfig
) -> Callable[[ColumnOrder], float]:
    """Return the log likelihood a moment of an order."""
    chain, smooth = replace(arm.chain, gravity=gravity), RowFilter([motion])
    error = config.model_error**2
    own = smooth(own_columns(motion.dq, motion.ddq, motion.coulomb))
    torque = smooth(motion.tau.T[:, :, None])[:, :, 0].T
    sizes = np.maximum(np.std(torque, axis=0), 1e-12)
    own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-300)
    basis = np.linalg.qr(own)[0]  # of each column of the positions
    # torque (n, N, n) less what each column's own explains
    tau = torque - basis @ (basis.transpose(0, 2, 1) @ torque)
    rows: dict[Order, tuple[Array, Array]] = {}

    def rows_of(order: Order) -> tuple[Array, Array]:
        """Return Gram matrices (n, p, p) and products with every torque (n, p, n) of positions."""
        if order not in rows:
            at = list(order)
            y = regressor(chain, motion.q[:, at], motion.dq[:, at], motion.ddq[:, at], arm.columns)
            columns = smooth(y.transpose(1, 0, 2))
            columns = columns - basis[at] @ (basis[at].transpose(0, 2, 1) @ columns)
            turned = columns.transpose(0, 2, 1) / columns.shape[1]
            rows[order] = turned @ columns, turned @ tau[at]
        return rows[order]

    def score(one: ColumnOrder) -> float:
        gram, cross = rows_of(one.q)
        joints, torques = np.arange(len(one.order)), list(one.tau)
        size = sizes[torques]
        total = np.mean(tau[list(one.q), :, torques] ** 2, axis=1) / size**2
        gram = gram / size[:, None, None] ** 2
        right = cross[joints, :, torques] / size[:, None] ** 2
        scale = np.sqrt(np.maximum(np.einsum("jpp->p", gram), 1e-300))
        scale[scale < 1e-10 * scale.max()] = np.inf
        gram, right = gram / np.outer(scale, scale), right / scale
        count = gram.shape[1]
        ridge = 1e-6 * np.eye(count) * np.einsum("jpp->j", gram)[:, None, None] / count
        alone = np.linalg.solve(gram + ridge, right[:, :, None])[:, :, 0]  # each joint by itself
        variance = np.maximum(total - np.sum(right * alone, axis=1), 0.0) + error
        for _ in range(_ROUNDS):
            normal = np.tensordot(1.0 / variance, gram, 1)
            normal += _RIDGE * np.trace(normal) / count * np.eye(count)
            phi = np.linalg.solve(normal, right.T @ (1.0 / variance))
            rest = total - 2.0 * right @ phi + gram @ phi @ phi
            variance = np.maximum(rest, 0.0) + error
        return -0.5 * float(np.sum(np.log(variance)))

    return score

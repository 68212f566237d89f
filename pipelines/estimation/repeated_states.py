"""Tell noise from model error by pairs of rows of one state.

    common, differing = Repeated.of(data).parts(left)      what is noise, and what is not
    facts(left, known, prepared, nominal_estimate(prepared))    whether a residual can be judged

Noise is what differs between two rows of one state. With a residual r = f(q, dq, ddq) + e of a
model error f and noise e, independent in both rows,

    E ¼ (r₁ - r₂)² = ½ σ²        E ¼ (r₁ + r₂)² = ½ σ² + f²

(Rice 1984, difference-based variance). Rows of periods that come again are such pairs, declared or
not, within a log or between two. Where states differ a little, σ² is too large, not too small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from pipelines.estimation.config import FitConfig
from pipelines.estimation.estimate import Estimate, estimate
from pipelines.estimation.judgements import Facts, one_way, predicted_std, unresolved
from pipelines.estimation.least_squares import Flags, Indices
from pipelines.estimation.nominal import with_offsets
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.preparation import Prepared
from pipelines.estimation.regression import Columns, LogEquations
from pipelines.estimation.rows import Data
from pipelines.io.log import Array

_CONFIG = FitConfig()
_NEIGHBOURS = 32  # numerics: that are looked at; slow motion has many next to it in time
_OTHER_LOG = 1e9  # numerics: [s] between the clocks of two logs
_FEWEST = 100  # numerics: pairs of a joint; fewer say little


@dataclass(frozen=True, eq=False)
class Repeated:
    """Pairs of rows of one state; no row is in two of them."""

    data: Data
    first: Indices  # (pairs,) among the rows of all logs, one joint
    second: Indices

    @classmethod
    def of(cls, data: Data) -> Repeated:
        """Return the pairs, nearest first."""
        logs = []
        for one in data.logs:
            m, still = one.motion, _CONFIG.alike
            scaled = zip((m.q, m.dq, m.ddq), still, strict=True)
            logs.append(np.hstack([one.at_rows(x) / least for x, least in scaled]))
        log = np.repeat(np.arange(len(logs)), [len(own) for own in logs])
        time = np.concatenate([one.t for one in data.logs]) + _OTHER_LOG * log
        return cls(data, *nearest_pairs(np.vstack(logs), time, _CONFIG.near, _CONFIG.apart))

    @property
    def count(self) -> Array:
        """(joints,) pairs that count."""
        return np.asarray(self._counts.sum(axis=1), dtype=np.float64)

    def parts(self, left: Array) -> tuple[Array, Array]:
        """Return the mean squares of what pairs of a residual (rows,) share, and of the rest."""
        laid = np.concatenate(list(self.data.split(left)), axis=1)  # (joints, rows of one)
        one, other = laid[:, self.first], laid[:, self.second]
        counts, number = self._counts, np.where(self.count < _FEWEST, np.nan, self.count)
        common, differing = (
            np.square(0.5 * x).sum(axis=1, where=counts) / number
            for x in (one + other, one - other)
        )
        return common, differing

    def noise(self, left: Array) -> Array:
        """Return the variance (joints,) of a residual's noise; NaN of too few pairs."""
        return 2.0 * self.parts(left)[1]

    @property
    def _counts(self) -> Flags:
        """(joints, pairs)"""
        weighed = np.concatenate([one.weighed for one in self.data.logs], axis=1)
        return np.asarray(weighed[:, self.first] & weighed[:, self.second])


def nearest_pairs(state: Array, time: Array, near: float, apart: float) -> tuple[Indices, Indices]:
    """Return pairs of rows of one state, the nearest first; no row is in two of them.

    Args:
        state: (rows, coordinates), each in units of what is no motion of it.
        time: (rows,) [s]
        near: of the standard deviation of each coordinate, by which two rows may differ, or by a
            unit.
        apart: [s] between them, at least.
    """
    from scipy.spatial import cKDTree

    if len(state) < 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    scaled, count = state / np.maximum(state.std(axis=0), 1.0 / near), len(state)
    tree, most = cKDTree(scaled), min(_NEIGHBOURS, count)
    distance, other = tree.query(scaled, most, p=np.inf, distance_upper_bound=near)
    own, place = np.nonzero(np.isfinite(distance))
    partner, away = other[own, place], distance[own, place]
    kept = np.abs(time[own] - time[partner]) >= apart
    own, partner, away = own[kept], partner[kept], away[kept]
    free, chosen = np.ones(count, dtype=bool), []
    for k in np.argsort(away, kind="stable"):
        if free[own[k]] and free[partner[k]]:
            free[[own[k], partner[k]]] = False
            chosen.append(k)
    return own[chosen], partner[chosen]


def nominal_estimate(prepared: Prepared) -> Estimate:
    """Return the nominal model as `estimate-bps` fits it, on prepared rows."""
    return estimate(_equations(prepared.data, prepared.columns), prepared.columns)


def facts(left: Array, known: bool, prepared: Prepared, estimated: Estimate) -> Facts:
    """Return the errors of the nominal model on held-out motion, and the state of its floor.

    Args:
        left: (joints,) [N m] rms residual on held-out motion.
        known: the floor, by reference logs.
    """
    data, columns = prepared.data, prepared.columns
    judge = data if prepared.judge is None else prepared.judge
    spread = predicted_std(estimated, chain.from_iterable(_equations(judge, columns)))
    floor, confused = np.full(len(left), known), unresolved(estimated)
    if not known:
        # noise of the residual by rows of one state; 0 without any
        _, fit = fit_nominal(data, columns)
        noise = np.sqrt(np.nan_to_num(Repeated.of(data).noise(fit.left)))
        # what is predicted is off by the noise and by the deviations of the model
        floor = left <= _CONFIG.above * np.hypot(noise, spread)
        if not confused:
            offset = with_offsets(columns)
            confused = one_way(estimate(_equations(data, offset), offset))
    return Facts(left, judge.rms(judge.y), spread, confused, floor)


def _equations(data: Data, columns: Columns) -> list[LogEquations]:
    """Return the equations of each log in `columns`; rows may hold more terms of a friction law."""
    return [replace(log.equations, columns=columns) for log in data.logs]

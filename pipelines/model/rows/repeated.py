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
import numpy.typing as npt

from pipelines.estimation.estimate import Estimate, estimate
from pipelines.estimation.judgements import Facts, one_way, predicted_std, unresolved
from pipelines.estimation.nominal import with_offsets
from pipelines.estimation.regression import Columns, LogEquations
from pipelines.io.log import Array
from pipelines.model.rows.data import Data
from pipelines.model.rows.nominal import fit_nominal
from pipelines.model.rows.prepare import Prepared

__all__ = ["Repeated", "facts", "nearest_pairs", "nominal_estimate"]

Indices = npt.NDArray[np.intp]
_NEIGHBOURS = 32  # numerics: that are looked at; slow motion has many next to it in time
_STILL = (1e-3, 1e-2, 0.1)  # [rad, rad/s, rad/s²; m, m/s, m/s²] less motion is noise
_NEAR = 0.1  # of the standard deviation of each coordinate: rows of one state
_APART = 1.0  # [s] in a log, at least: after less, what wanders is still where it was
_OTHER_LOG = 1e9  # numerics: [s] between the clocks of two logs
_ABOVE = 1.6  # times the noise between rows of one state: a smaller residual is noise
_FEWEST = 100  # numerics: pairs of a joint; fewer say little


@dataclass(frozen=True, eq=False)
class Repeated:
    """Pairs of rows of one state; no row is in two of them."""

    data: Data
    first: npt.NDArray[np.intp]  # (pairs,) among the rows of all logs, one joint
    second: npt.NDArray[np.intp]

    @classmethod
    def of(cls, data: Data) -> Repeated:
        """Return the pairs, nearest first."""
        logs = []
        for one in data.logs:
            scaled = zip((one.motion.q, one.motion.dq, one.motion.ddq), _STILL, strict=True)
            logs.append(np.hstack([one.at_rows(x) / least for x, least in scaled]))
        log = np.repeat(np.arange(len(logs)), [len(own) for own in logs])
        time = np.concatenate([one.t for one in data.logs]) + _OTHER_LOG * log
        return cls(data, *nearest_pairs(np.vstack(logs), time, _NEAR, _APART))

    @property
    def count(self) -> Array:
        """(joints,) pairs that count."""
        return np.asarray(self._counts.sum(axis=1), dtype=np.float64)

    def parts(self, left: Array) -> tuple[Array, Array]:
        """Return the mean squares of what pairs of a residual (rows,) share, and of the rest."""
        one, other = (self._laid(left)[:, at] for at in (self.first, self.second))
        counts, number = self._counts, np.where(self.count < _FEWEST, np.nan, self.count)
        both = (one + other, one - other)
        return tuple(np.square(0.5 * x).sum(axis=1, where=counts) / number for x in both)

    def noise(self, left: Array) -> Array:
        """Return the variance (joints,) of a residual's noise; NaN of too few pairs."""
        return 2.0 * self.parts(left)[1]

    @property
    def _counts(self) -> npt.NDArray[np.bool_]:
        """(joints, pairs)"""
        weighed = np.concatenate([one.weighed for one in self.data.logs], axis=1)
        return np.asarray(weighed[:, self.first] & weighed[:, self.second])

    def _laid(self, x: Array) -> Array:
        """(rows,) -> (joints, rows of one joint)"""
        return np.concatenate(list(self.data.split(x)), axis=1)


def nominal_estimate(prepared: Prepared) -> Estimate:
    """Return the nominal model as `estimate-bps` fits it, on prepared rows."""
    return _estimated(prepared, prepared.columns)


def _estimated(prepared: Prepared, columns: Columns) -> Estimate:
    return estimate(_equations(prepared.data, columns), columns)


def facts(left: Array, known: bool, prepared: Prepared, estimated: Estimate) -> Facts:
    """Return the errors of the nominal model on held-out motion, and the state of its floor.

    Args:
        left: (joints,) [N m] rms residual on held-out motion.
        known: the floor, by reference logs.
    """
    judge = prepared.data if prepared.judge is None else prepared.judge
    spread = predicted_std(estimated, chain.from_iterable(_equations(judge, prepared.columns)))
    told = np.full(len(left), known)
    if not known:  # what is predicted is off by the noise and by the deviations of the model
        told = left <= _ABOVE * np.hypot(_noise(prepared), spread)
    confused = unresolved(estimated) or ("" if known else one_way(_estimated(prepared, with_offsets(prepared.columns))))
    return Facts(left, judge.rms(judge.y), spread, confused, told)


def _noise(prepared: Prepared) -> Array:
    """Return the noise (joints,) [N m] of the residual by rows of one state; 0 without any."""
    _, fit = fit_nominal(prepared.data, prepared.columns)
    return np.asarray(np.sqrt(np.nan_to_num(Repeated.of(prepared.data).noise(fit.left))))


def _equations(data: Data, columns: Columns) -> list[LogEquations]:
    """Return the equations of each log in `columns`; rows may hold more terms of a friction law."""
    return [replace(log.equations, columns=columns) for log in data.logs]


def nearest_pairs(state: Array, time: Array, near: float, apart: float) -> tuple[Indices, Indices]:
    """Return pairs of rows of one state, the nearest first; no row is in two of them.

    Args:
        state: (rows, coordinates), each in units of what is no motion of it.
        time: (rows,) [s]
        near: of the standard deviation of each coordinate, by which two rows may differ, or by a unit.
        apart: [s] between them, at least.
    """
    from scipy.spatial import cKDTree

    if len(state) < 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    scaled = state / np.maximum(state.std(axis=0), 1.0 / near)
    distance, other = cKDTree(scaled).query(
        scaled, min(_NEIGHBOURS, len(scaled)), p=np.inf, distance_upper_bound=near
    )
    here, place = np.nonzero(np.isfinite(distance))
    there = other[here, place]
    kept = np.abs(time[here] - time[there]) >= apart
    here, there, distance = here[kept], there[kept], distance[here, place][kept]
    free, chosen = np.ones(len(scaled), dtype=bool), []
    for k in np.argsort(distance, kind="stable"):
        if free[here[k]] and free[there[k]]:
            free[[here[k], there[k]]] = False
            chosen.append(k)
    return here[chosen], there[chosen]

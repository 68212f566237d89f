"""What surrounds the stationary stretches of a filter: the start, the gaps, and the return to the stationary gain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.signal import blocks
from pipelines.signal.chain import input_covariance, transition

if TYPE_CHECKING:
    from pipelines.signal.observer import Observer, Start

__all__ = ["Gap", "Opening", "Part", "Piece", "Prior", "Run", "after", "begin", "deviations", "diffuse", "gap_covariance",
           "offsets", "opening", "parts", "predict_gap", "spread"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

# Diffuse start: 1e5 times the noise in position, and as much a sample in every derivative.
_DIFFUSE = 1e5


@dataclass(frozen=True)
class Piece:
    """Standard deviations of the states over one stretch of samples, in physical units."""

    first: int
    joints: Indices
    std: Array  # (order, samples, joints)


@dataclass(frozen=True)
class Part:
    """Channels that miss the same samples, with the first value taken off: the chain does not feel a constant."""

    joints: Indices
    samples: int
    runs: tuple[tuple[int, int], ...]  # stretches without a missing sample
    values: Array  # (samples, joints), as measured
    offset: Array  # (joints,)

    def run(self, first: int, last: int) -> Run:
        return Run(self.values[first:last], self.offset)


@dataclass(frozen=True)
class Run:
    """An unbroken stretch of measurements."""

    values: Array  # (samples, joints)
    offset: Array  # (joints,)

    @property
    def samples(self) -> int:
        return len(self.values)

    def take(self, first: int, last: int) -> Array:
        """(joints, last - first), the offset taken off."""
        return np.subtract(self.values[first:last].T, self.offset[:, None], order="C")


@dataclass(frozen=True)
class Prior:
    """Prediction of the states of the next sample and the excess of its covariance over the stationary one, scaled."""

    mean: Array  # (joints, order)
    excess: Array | None  # D (joints, order, order); None is the start that knows nothing, whose opening is kept


def parts(y: Array) -> list[Part]:
    """The channels of `y` (samples, joints) grouped by the samples they miss (NaN)."""
    with np.errstate(all="ignore"):
        if np.isfinite(y.sum()):  # half the time of asking every sample
            return [Part(np.arange(y.shape[1]), len(y), ((0, len(y)),), y, y[0])]
    valid = np.isfinite(y)
    if np.isinf(y).any():
        raise InputRejected("D03", "infinite values among the measurements", remedy="mark what is missing as NaN")
    if not valid.any(axis=0).all():
        raise InputRejected("D02", f"channel {int(np.argmin(valid.any(axis=0))) + 1} has no sample at all",
                            remedy="leave the channel out, or record it again")
    groups: dict[bytes, list[int]] = {}
    for j in range(y.shape[1]):
        groups.setdefault(np.packbits(valid[:, j]).tobytes(), []).append(j)
    out = []
    for joints in groups.values():
        mask = valid[:, joints[0]]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.view(np.int8), [0]])))
        runs = tuple(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
        out.append(Part(np.array(joints), len(y), runs, y[:, joints], y[runs[0][0], joints]))
    return out


def diffuse(observer: Observer) -> Array:
    """The excess D of a start that knows nothing, scaled."""
    f = observer.filter
    wide = (_DIFFUSE / f.step[:, None] ** np.arange(f.order)) ** 2
    return np.asarray(wide[:, :, None] * np.eye(f.order) - f.prior)


def begin(observer: Observer, part: Part, start: Start | None) -> Prior:
    """The prediction of the first sample: what `start` says, or nothing."""
    if start is None:
        return Prior(np.zeros((len(part.joints), observer.order)), None)
    mean = start.mean[part.joints].astype(np.float64)
    mean[:, 0] -= part.offset
    unit = observer.unit
    covariance = start.covariance[part.joints] / (unit[:, :, None] * unit[:, None, :])
    # means stay in the unit of position: the filter is linear in them, and the noise need not be divided out
    return Prior(mean / observer.rate, covariance - observer.filter.prior)


@dataclass(frozen=True)
class Gap:
    """States and covariances predicted over missing samples, scaled."""

    states: Array  # (joints, missing, order)
    covariance: Array  # (joints, missing, order, order)
    prior: Prior  # for the first sample after the gap


def gap_covariance(observer: Observer, count: int) -> tuple[Array, Array]:
    """E^i and Q_i for i = 0 .. count: (joints, count + 1, order, order) each."""
    f = observer.filter
    away = transition(f.order, np.multiply.outer(f.step, np.arange(count + 1)))
    return away, input_covariance(f.order, f.step, count, f.tracking_index / f.step**f.order)


def predict_gap(observer: Observer, prior: Prior, count: int) -> Gap:
    """x_i = E^i x, P_i = E^i P E^iT + Q_i over `count` missing samples."""
    away, noise = gap_covariance(observer, count)
    states = (away @ prior.mean[:, None, :, None])[..., 0]
    excess = diffuse(observer) if prior.excess is None else prior.excess
    covariance = away @ (observer.filter.prior + excess)[:, None] @ away.swapaxes(2, 3) + noise
    return Gap(states[:, :-1], covariance[:, :-1], Prior(states[:, -1], covariance[:, -1] - observer.filter.prior))


@dataclass(frozen=True)
class Opening:
    """How the filter returns to its stationary gain from an excess D of its first covariance: nothing here needs the data."""

    power: Array  # A^k (joints, count + 1, order, order)
    spread: Array  # covariance of δ after k samples, (I + D G_k)^-1 D, (joints, count, order, order)
    felt: Array  # (I - k c) A^k: from δ to the reconstructed states

    def covariance(self, observer: Observer) -> Array:
        """Posterior covariances of the states, (joints, count, order, order)."""
        return np.asarray(observer.filter.posterior[:, None] + self.felt @ self.spread @ self.felt.swapaxes(2, 3))


def opening(observer: Observer, excess: Array, count: int) -> Opening:
    """The return to the stationary gain over `count` samples (Lainiotis 1976)."""
    power = blocks.powers(observer.filter.predictor, count)
    row = power[:, :count, 0]  # c A^k
    known = np.cumsum(row[..., :, None] * (row * observer.filter.remainder[:, None, None])[..., None, :], axis=1)
    return Opening(power, spread(excess, known), observer.filter.updater[:, None] @ power[:, :count])


def offsets(observer: Observer, opening: Opening, prior: Prior, y: Run, head: Array) -> Array:
    """δ_k = (I + D G_k)^-1 D g_k from the innovations of the stationary filter whose states are `head`: (joints, count, order)."""
    count = min(y.samples, opening.spread.shape[1])
    surprise = y.take(0, count)
    surprise[:, 0] -= prior.mean[:, 0]
    surprise[:, 1:] -= ((observer.filter.transition[:, 0] / observer.rate)[:, None] @ head[:, :, :-1])[:, 0]
    drive = opening.power[:, :count, 0] * (surprise * observer.filter.remainder[:, None])[..., None]
    return np.asarray((opening.spread[:, :count] @ np.cumsum(drive, axis=1)[..., None])[..., 0])


def after(opening: Opening, offset: Array, mean: Array, samples: int) -> Prior:
    """The prediction of the sample after a stretch whose last δ is `offset` and whose stationary prediction is `mean`."""
    if samples >= opening.power.shape[1]:
        return Prior(mean, np.zeros_like(opening.spread[:, 0]))
    last = opening.power[:, samples]
    excess = last @ opening.spread[:, samples - 1] @ last.swapaxes(1, 2)
    return Prior(mean + (last @ offset[..., None])[..., 0], excess)


def spread(excess: Array, known: Array) -> Array:
    """(I + D G)^-1 D for `known` G (joints, ..., n, n), after D is scaled to a unit diagonal: it may hold 1e20 and 1e-3."""
    n = excess.shape[-1]
    scale = np.sqrt(np.maximum(np.abs(np.einsum("njj->nj", excess)), 1e-300))
    across = (scale[:, :, None] * scale[:, None, :])[(slice(None),) + (None,) * (known.ndim - 3)]
    d = excess[(slice(None),) + (None,) * (known.ndim - 3)] / across
    return np.asarray(np.linalg.solve(np.eye(n) + d @ (known * across), np.broadcast_to(d, known.shape)) * across)


def deviations(observer: Observer, covariance: Array) -> Array:
    """(order, samples, joints) in physical units from scaled covariances (joints, samples, order, order)."""
    return np.asarray(np.sqrt(np.maximum(np.einsum("nkjj->jkn", covariance), 0.0)) * observer.unit.T[:, None])

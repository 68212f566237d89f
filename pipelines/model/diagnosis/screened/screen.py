"""Screen every cause: how much of the residual its columns would take away, after the model was refitted beside them.

    found = screen(data, fit, families, arm, residuals)
    found[i].gain                 (residuals,) what the best shape takes off the squared weighted residual

With c⊥ = c - Q Qᵀ c the part of the columns that the nominal model Q cannot imitate, the gain is gᵀ G⁻¹ g, G = c⊥ᵀc⊥,
g = c⊥ᵀ r. Several residuals at once: those of a log and of the twin's replicas, which must not be confused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.nominal import Fit
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.rows.kept import together
from pipelines.model.diagnosis.screened.candidates import Arms, Family, Laid, lay_family
from pipelines.model.diagnosis.screened.through import passed_through
from pipelines.model.effects.base import Effect
from pipelines.model.rigid.body import Motion

__all__ = ["INVISIBLE", "Screened", "for_each", "gains_of", "products_apart", "products_of", "screen", "screen_event",
           "screen_family"]

A = TypeVar("A")

Mask = npt.NDArray[np.bool_]

INVISIBLE = 1e-3  # η below which a column is what the nominal model makes of rounding and interpolation
_USUAL = 0.25  # of the shapes reach less
_EVENTS = 3  # residuals that an event is looked for in
_MOMENTS, _AGAIN = 2, 1.0 / 3.0  # that an event may have; of its gain, that any further moment gains at most
# Rows times shapes that are laid already, up to which a second process costs more than it takes off: to copy this one, and every
# page that either writes.
_LITTLE = 15_000_000
_SPREAD = 1e-4  # of the largest: directions of c⊥ that are left alone


@dataclass(frozen=True, eq=False)
class Screened:
    """One cause at one place. Arrays (residuals,)."""

    family: Family
    gain: Array  # of the best shape
    shape: tuple[Effect, ...]  # the best one for each residual
    visibility: Array  # η of it
    best_visibility: float  # the largest η of any shape
    reach: float  # what the first of its columns, one unit of it, adds to the residual: √ of the gain, in most shapes or more
    width: int  # columns of one shape
    logs: tuple[int | None, ...] = ()  # of an event: number of the log it happened in
    again: float = 0.0  # of an event: what the third best moment gains of the first residual, as a share of the best
    amplitude: float | None = None  # of the first residual, where the whole model was fitted through the effect

    @property
    def lean(self) -> Screened:
        """Without its family, which has hundreds of shapes: what another process need not send."""
        return replace(self, family=Family(self.family.cause, self.family.joint, ()))

    @property
    def stands_out(self) -> bool:
        """Of an event, whether it happened once or twice: what a law does not have to the last comes again at every reversal."""
        return not self.family.event or self.again <= _AGAIN

    @property
    def cause(self) -> str:
        return self.family.cause

    @property
    def joint(self) -> int | None:
        return self.family.joint


def screen(data: Data, fit: Fit, candidates: Sequence[Family], arm: Arm | Arms, residuals: Array | None = None) -> list[Screened]:
    """Every family; `residuals` (m, rows), weighted and orthogonal to the fit, that of the fit where left out."""
    arms = arm if isinstance(arm, Arms) else Arms(arm, arm)

    def one(family: Family) -> Screened:
        return (screen_event if family.event else screen_family)(data, fit, family, arms.of(family), residuals).lean

    found = for_each(data, one, candidates, (fit,), *arms.every)
    return [replace(seen, family=family) for seen, family in zip(found, candidates, strict=True)]


def for_each(data: Data, work: Callable[[Family], A], candidates: Sequence[Family], fits: Iterable[Fit], *arms: Arm,
             laid: bool = False) -> list[A]:
    """What `work` makes of each family, by two processes; `fits` and `arms` are what it needs.

    Args:
        laid: most of the columns have been asked for before: what is little is done here, then.
    """
    for fit in fits:
        _ = fit.basis, fit.residual  # once, before there are two
    for log in data.logs:
        for arm in arms:
            log.kept.number(arm)
    if laid and data.rows * sum(len(family.shapes) for family in candidates) < _LITTLE:
        return [work(family) for family in candidates]
    return together([log.kept for log in data.logs], work, candidates)


def screen_event(data: Data, fit: Fit, family: Family, arm: Arm, residuals: Array | None = None) -> Screened:
    """What happens once: looked for in each log apart, where the residual is largest."""
    wanted = fit.residual[None] if residuals is None else residuals[:_EVENTS]
    reach, width = [0.0], 0
    moments: list[tuple[float, float, float]] = []  # gain, start and end [s], of the first residual
    best: list[tuple[float, Effect, float, int | None]] = [(0.0, family.shapes[0], 1.0, None)] * len(wanted)
    for k, residual in enumerate(wanted):
        left = list(data.split(residual / fit.weights))
        for place, one in enumerate(data.logs):
            if not left[place].any():
                continue
            full = np.stack([np.interp(one.motion.t, one.t, row) for row in left[place]], axis=1)
            shapes = tuple(family.shapes[0].promising(one.motion, arm, full))
            if not shapes:
                continue
            alone, start = replace(data, logs=(one,)), int(np.argmax(data.log_of == place))
            for laid in lay_family(alone, replace(family, shapes=shapes), arm):
                gains, seen, size = gains_of(replace(laid, rows=start + laid.rows), fit, residual[None])
                reach.append(float(np.median(size)))
                width = laid.table.shape[1]
                if k == 0:
                    moments += [(float(gain), *_when(shapes[laid.first + i], one.motion)) for i, gain in enumerate(gains[:, 0])]
                top = int(np.argmax(gains[:, 0]))
                if gains[top, 0] > best[k][0]:
                    best[k] = (float(gains[top, 0]), shapes[laid.first + top], float(seen[top]), data.first + place)
    eta = [one[2] for one in best]
    return Screened(family, np.array([one[0] for one in best]), tuple(one[1] for one in best), np.array(eta), max(eta),
                    float(np.median(reach)), width, tuple(one[3] for one in best), _again(moments))


def _when(effect: Effect, motion: Motion) -> tuple[float, float]:
    """When it acts [s], from the start of its log."""
    acting = effect.acting(motion)
    t = motion.t if acting is None else motion.t[acting]
    return (float(t[0] - motion.t[0]), float(t[-1] - motion.t[0])) if len(t) else (0.0, 0.0)


def _again(moments: Sequence[tuple[float, float, float]]) -> float:
    """What the third best moment gains, as a share of the best; the same time in several logs is one moment."""
    apart: list[tuple[float, float, float]] = []
    for gain, start, end in sorted(moments, reverse=True):
        if all(end <= first or start >= last for _, first, last in apart):
            apart.append((gain, start, end))
    return apart[_MOMENTS][0] / max(apart[0][0], 1e-300) if len(apart) > _MOMENTS else 0.0


def screen_family(data: Data, fit: Fit, family: Family, arm: Arm, residuals: Array | None = None) -> Screened:
    wanted = fit.residual[None] if residuals is None else residuals
    gains, visible, reach, width = [], [], [], 0
    for laid in lay_family(data, family, arm):
        gain, eta, size = gains_of(laid, fit, wanted)
        gains.append(gain)
        width = laid.table.shape[1]
        visible.append(eta)
        reach.append(size)
    gain, eta = np.concatenate(gains), np.concatenate(visible)
    best = np.argmax(gain, axis=0)
    found = Screened(family, gain[best, np.arange(gain.shape[1])], tuple(family.shapes[int(k)] for k in best), eta[best],
                     float(eta.max()), float(np.quantile(np.concatenate(reach), _USUAL)), width)
    whole = passed_through(data, fit, family.shapes[0], wanted)
    if whole is None:
        return found
    more, amplitude = whole
    return replace(found, gain=np.maximum(found.gain, more), amplitude=float(amplitude[0]) if more[0] > found.gain[0] else None)


def gains_of(laid: Laid, fit: Fit, residuals: Array) -> tuple[Array, Array, Array]:
    """(shapes, residuals) gains; (shapes,) visibility, and size of the first column."""
    return products_of(laid, fit, residuals).gains()


@dataclass(frozen=True, eq=False)
class Products:
    """Of the columns of some shapes with each other and with residuals."""

    whole: Array  # (shapes, k, k) cᵀc
    gram: Array  # (shapes, k, k) c⊥ᵀc⊥
    moment: Array  # (shapes, k, residuals) c⊥ᵀr

    def first(self, k: int) -> Products:
        """Of the first `k` columns alone."""
        return Products(self.whole[:, :k, :k], self.gram[:, :k, :k], self.moment[:, :k])

    def gains(self) -> tuple[Array, Array, Array]:
        """(shapes, residuals) gains; (shapes,) visibility, and size of the first column."""
        k = self.whole.shape[1]
        scale = np.sqrt(np.maximum(np.einsum("skk->sk", self.whole), 1e-300))
        unit = self.gram / scale[:, :, None] / scale[:, None, :]
        values, vectors = np.linalg.eigh(unit)
        turned = np.square(np.einsum("skl,skm->slm", vectors, self.moment / scale[:, :, None]))
        lowest = np.maximum(INVISIBLE**2, _SPREAD**2 * values[:, -1:])
        sure = values > lowest
        gain = np.sum(np.where(sure[:, :, None], turned / np.where(sure, values, 1.0)[:, :, None], 0.0), axis=1)
        share = np.sqrt(np.clip(np.einsum("skk->s", unit) / k, 0.0, None))
        return gain, np.asarray(np.minimum(share, 1.0)), np.sqrt(np.maximum(self.gram[:, 0, 0], 0.0))


def products_of(laid: Laid, fit: Fit, residuals: Array) -> Products:
    return _sums(laid, fit, residuals, np.ones(len(laid.rows), dtype=bool))[1].products()


def products_apart(laid: Laid, fit: Fit, residuals: Array, part: Mask) -> Products:
    """The same of twice the columns: as they are, and zero beyond some of their rows, `part` (rows here,)."""
    rest, own = _sums(laid, fit, residuals, part)
    every = _Sums(own.whole + rest.whole, own.seen + rest.seen, own.moment + rest.moment)
    whole = np.block([[every.whole, own.whole], [own.whole, own.whole]])
    seen, moment = (np.concatenate(pair, axis=1) for pair in ((every.seen, own.seen), (every.moment, own.moment)))
    return _Sums(whole, seen, moment).products()


@dataclass(frozen=True, eq=False)
class _Sums:
    """Over some rows, weighted."""

    whole: Array  # (shapes, k, k) cᵀc
    seen: Array  # (shapes, k, rank) cᵀQ
    moment: Array  # (shapes, k, residuals) cᵀr

    def products(self) -> Products:
        return Products(self.whole, self.whole - self.seen @ self.seen.transpose(0, 2, 1), self.moment)


def _sums(laid: Laid, fit: Fit, residuals: Array, part: Mask) -> tuple[_Sums, _Sums]:
    """Over the rows out of `part`, and in it; rows in a row are taken as they lie, without a copy."""
    shapes, k, count = laid.table.shape
    c = laid.table * fit.weights[laid.rows]
    flat = c.reshape(shapes * k, count)
    sums = tuple(_Sums(np.zeros((shapes, k, k)), np.zeros((shapes, k, len(fit.basis))), np.zeros((shapes, k, len(residuals))))
                 for _ in range(2))
    ends = np.flatnonzero((np.diff(laid.rows) != 1) | (part[1:] != part[:-1])) + 1
    for here in (slice(first, last) for first, last in pairwise([0, *ends.tolist(), count]) if first < last):
        there, into = slice(int(laid.rows[here.start]), int(laid.rows[here.stop - 1]) + 1), sums[int(part[here.start])]
        into.whole[...] += c[:, :, here] @ c[:, :, here].transpose(0, 2, 1)
        into.seen[...] += (flat[:, here] @ fit.basis[:, there].T).reshape(shapes, k, -1)
        into.moment[...] += (flat[:, here] @ residuals[:, there].T).reshape(shapes, k, -1)
    return sums[0], sums[1]

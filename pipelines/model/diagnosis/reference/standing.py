"""With reference logs: what has changed since, and what was there from the first day.

    standing = standing_set(reference)              columns that explain what the reference logs leave, at most ten
    change = Change(...)                            screens every cause by a column that acts after the reference only

The rows of reference and later logs stand in one system: each with its own nominal model, the standing columns with common
coefficients, a cause as a common column and one that is zero in the reference: only what the second gains has changed. Amplitudes
fitted apart and subtracted do not answer that. What a cause gains where nothing changed, the second half of the reference logs
against the first, or some of them against the others, is what it has to exceed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.fit.bootstrap import apart as apart_by_chance
from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns, orthonormal
from pipelines.model.diagnosis.floor.calibration import CauseBound
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.floor.wide import ONCE, TIMES
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Family, lay_family, lay_shape
from pipelines.model.diagnosis.screened.screen import Screened, for_each, products_apart, screen, screen_event
from pipelines.model.effects.base import Effect

__all__ = ["Chance", "Chosen", "apart", "bounds", "changes", "fit_changed", "joined", "standing_set"]

Mask = npt.NDArray[np.bool_]

_MOST = 10
_WORTH = 0.02  # of the squared residual of a joint, that a standing column takes away at least
_NEAR = 0.6  # of an amplitude that physics gives
_BLOCKS, _SEED = 10, 20040509  # of held-out time; of the draws
_LEAST = 0.02  # of the squared residual of a joint


@dataclass(frozen=True, eq=False)
class Chosen:
    """One effect of the standing set."""

    effect: Effect
    gain: float  # share of the squared residual of its joint, or of all, that it took away there
    amplitudes: Array


def standing_set(data: Data, fit: Fit, families: Sequence[Family], arm: Arm) -> tuple[Chosen, ...]:
    """Effects that explain what the reference logs leave, one after the other, each in its best shape of one screening, as far as
    they pay on time that they were not fitted to. What cannot be, of the last chosen first, is barred before all are chosen anew.

    Pati, Rezaiifar & Krishnaprasad 1993: orthogonal matching pursuit. A scale of torque is none of them: at all joints
    together the torque would explain itself.
    """
    able = [family for family in families if not family.event and not family.shapes[0].needs]
    found = screen(data, fit, able, arm)
    tables = [fit.project(lay_shape(data, one.family, one.family.shapes.index(one.shape[0]), arm)) for one in found]
    barred = set[int]()
    while True:
        chosen = _greedily(fit, found, tables, barred)
        strange = [k for (k, _), one in zip(chosen, _sized(fit, found, tables, chosen), strict=True) if not _plausible(one)]
        if not strange:
            break
        barred.add(strange[-1])  # another may explain as much: a hump of friction is no law that bends, upside down
    while chosen:
        out = _sized(fit, found, tables, chosen)
        idle = next((place for place in reversed(range(len(out))) if not _plausible(out[place])
                     or not _pays(data, fit, [tables[k] for k, _ in chosen], place, out[place].effect.joint)), None)
        if idle is None:
            return tuple(out)
        del chosen[idle]
    return ()


def _sized(fit: Fit, found: Sequence[Screened], tables: Sequence[Array], chosen: Sequence[tuple[int, float]]) -> list[Chosen]:
    """Each that was chosen with its amplitudes beside the others."""
    solved = _amplitudes(fit, [tables[k] for k, _ in chosen]) if chosen else []
    return [Chosen(found[k].shape[0], gain, own) for (k, gain), own in zip(chosen, solved, strict=True)]


def _greedily(fit: Fit, found: Sequence[Screened], tables: Sequence[Array], barred: Collection[int]) -> list[tuple[int, float]]:
    """Places of those that take most of what is left, one after the other, with the share that each took of its own joint's, or of
    all. What it takes off other joints as well, only the choice counts."""
    data = fit.data
    residual, basis = fit.residual, np.zeros((0, data.rows))
    powers = np.bincount(data.joint, residual**2, minlength=data.n_joints)
    chosen: list[tuple[int, float]] = []
    while len(chosen) < _MOST:
        best, most, left = -1, 0.0, np.zeros((0, data.rows))
        for k, table in enumerate(tables):
            if k in barred or k in [place for place, _ in chosen]:
                continue
            own = orthonormal(table - (table @ basis.T) @ basis)
            gain = float(np.sum(np.square(own @ residual)))
            joint = found[k].joint
            gain /= max(float(powers.mean() if joint is None else powers[joint - 1]), 1e-300)
            if gain > most:
                best, most, left = k, gain, own
        if most < _WORTH:
            break
        after = residual - (left @ residual) @ left
        joint = found[best].joint
        here = np.ones(data.n_joints, dtype=bool) if joint is None else np.arange(data.n_joints) == joint - 1
        share = float(np.sum((residual**2 - after**2)[here[data.joint]])) / max(float(powers[here].sum()), 1e-300)
        chosen.append((best, max(share, 0.0)))
        basis, residual = np.concatenate([basis, left]), after
    return chosen


def _amplitudes(fit: Fit, tables: Sequence[Array], rows: Mask | slice = slice(None)) -> list[Array]:
    solved, *_ = np.linalg.lstsq(np.concatenate(tables)[:, rows].T, fit.residual[rows], rcond=1e-8)
    return list(np.split(solved, np.cumsum([len(table) for table in tables])[:-1]))


def _plausible(one: Chosen) -> bool:
    """Amplitudes that physics gives have to come out near what it gives; all numbers in their ranges."""
    given = one.effect.fixed_amplitudes
    near = given is None or bool((np.abs(one.amplitudes / np.array(given) - 1.0) < _NEAR).all())
    return near and one.effect.possible(one.effect.values(one.amplitudes))


def _pays(data: Data, fit: Fit, tables: Sequence[Array], place: int, joint: int | None) -> bool:
    """Whether it takes something off blocks of time that it was not fitted to, beyond what chance does."""
    others = [table for k, table in enumerate(tables) if k != place]
    blocks = data.blocks(_BLOCKS)
    sums = np.zeros((3, int(blocks.max()) + 1))
    own = data.counts if joint is None else data.counts & (data.joint == joint - 1)
    for block in range(sums.shape[1]):
        held, out = blocks != block, (blocks == block) & own
        for row, some in enumerate((others, tables)):
            left = fit.residual[out]
            if some:
                left = left - np.concatenate(_amplitudes(fit, some, held)) @ np.concatenate(some)[:, out]
            sums[row, block] = float(left @ left)
        sums[2, block] = float(out.sum())
    _, high = apart_by_chance(sums[0], sums[1], sums[2], np.random.default_rng(_SEED))
    return high < 0.0


def joined(reference: Data, later: Data) -> tuple[Data, Mask]:
    """The rows of both, and which of them are later ones."""
    parts = (reference, later)
    known = None if all(part.known is None for part in parts) else np.concatenate(
        [np.zeros(part.rows) if part.known is None else part.known for part in parts])
    data = Data((*reference.logs, *later.logs), known=known, rubbing=reference.rubbing | later.rubbing)
    return data, data.log_of >= len(reference.logs)


def apart(table: Array, later: Mask) -> Array:
    """Columns with coefficients of their own before and after: (2 k, rows)."""
    return np.concatenate([np.where(later, 0.0, table), np.where(later, table, 0.0)])


@dataclass(frozen=True, eq=False)
class Chance:
    """What causes gain where nothing changed, found once for each: parts of the reference logs are taken for later ones."""

    data: Data  # of the reference logs
    masks: tuple[Mask, ...]
    nominal: Array  # (k, rows)
    common: Array  # (m, rows)
    weight: Array  # (joints,) by what is left of them
    arm: Arm
    known: dict[Family, float]

    @classmethod
    def of(cls, data: Data, later: Mask, nominal: Array, common: Array, weight: Array, arm: Arm,
           known: Mapping[Family, float]) -> Chance:
        """As in `changes`.

        Args:
            known: of causes for which it was found earlier, with the same weights.
        """
        rows = ~later
        subtracted = None if data.known is None else data.known[rows]
        before = replace(data, logs=data.logs[:int(data.log_of[rows].max()) + 1], known=subtracted)
        masks = tuple(mask[rows] for mask in _nothing(data, rows))
        return cls(before, masks, nominal[:, rows], common[:, rows], weight, arm, dict(known))

    @cached_property
    def fits(self) -> tuple[Fit, ...]:
        """For each part the nominal model apart before and after."""
        return tuple(fit_columns(self.data, np.concatenate([apart(self.nominal, mask), self.common]), self.data.y, self.weight)
                     for mask in self.masks)

    def most(self, family: Family, weight: Array) -> float:
        """The most that any part gives it, with joints weighted by `weight`: a cause acts on its joint, or counts where most."""
        self.ask([family])
        ratio = np.square(weight / self.weight)
        return self.known[family] * float(ratio.max() if family.joint is None else ratio[family.joint - 1])

    def ask(self, families: Sequence[Family]) -> None:
        """Several at once."""
        new = [family for family in families if family not in self.known]
        if new:
            self.known.update(zip(new, for_each(self.data, self._gained, new, self.fits, self.arm, laid=True), strict=True))

    def moved(self, kept: int) -> float:
        """Share of the squared residual that the first `kept` columns of the nominal model, the rigid body's, take away by
        coefficients of their own in any part."""
        most = 0.0
        for mask, fit in zip(self.masks, self.fits, strict=True):
            beside = np.concatenate([apart(self.nominal[kept:], mask), self.common])
            one = fit_columns(self.data, np.concatenate([self.nominal[:kept], beside]), self.data.y, self.weight)
            most = max(most, float(one.residual @ one.residual) / max(float(fit.residual @ fit.residual), 1e-300) - 1.0)
        return most

    @property
    def bounds(self) -> tuple[CauseBound, ...]:
        """All that was found, as it is stored."""
        return tuple(CauseBound(family.cause, family.joint, np.nan, own) for family, own in self.known.items())

    def _gained(self, family: Family) -> float:
        if family.event:
            return float(screen_event(self.data, self.fits[0], family, self.arm).gain.max())
        most = 0.0
        for laid in lay_family(self.data, family, self.arm):
            width = laid.table.shape[1]
            for mask, fit in zip(self.masks, self.fits, strict=True):
                products = products_apart(laid, fit, fit.residual[None], mask[laid.rows])
                most = max(most, float((products.gains()[0] - products.first(width).gains()[0]).max()))
        return most


def changes(data: Data, later: Mask, nominal: Array, common: Array, more: Array, weight: Array, families: Sequence[Family],
            wanted: Sequence[bool], arm: Arm, chance: Chance) -> tuple[list[Screened], Thresholds]:
    """Every cause that is wanted by what its change gains, and what it has to exceed; the others gain nothing.

    Args:
        data: rows of the reference logs, then of the later ones; `later` says which.
        nominal: (k, rows) columns of the nominal model, with coefficients of their own before and after.
        common: (m, rows) columns of the standing set.
        more: (n, rows) slopes of the effects found so far, zero in the reference.
        weight: (joints,) before and after alike.
    """
    fit = fit_changed(data, later, nominal, common, more, weight)
    happened = np.where(later, fit.residual, 0.0)[None]  # to the later logs, or not at all

    def one(family: Family) -> Screened:
        return (screen_event(data, fit, family, arm, happened) if family.event else _screened(data, later, fit, family, arm)).lean

    asked = [family for family, is_asked in zip(families, wanted, strict=True) if is_asked]
    seen = dict(zip(asked, for_each(data, one, asked, (fit,), arm, laid=True), strict=True))
    found = [replace(seen[family], family=family) if family in seen else
             Screened(family, np.zeros(1), family.shapes[:1], np.ones(1), 1.0, 0.0, 1) for family in families]
    return found, bounds(families, wanted, fit, later, chance)


def fit_changed(data: Data, later: Mask, nominal: Array, common: Array, more: Array, weight: Array) -> Fit:
    """The model of reference and later logs together; as in `changes`."""
    return fit_columns(data, np.concatenate([apart(nominal, later), common, more]), weight=weight)


def _nothing(data: Data, reference: Mask) -> list[Mask]:
    """Parts of the reference that are taken for later, though nothing changed: second halves, and every other log."""
    middle = np.zeros(data.rows, dtype=bool)
    for log in np.unique(data.log_of[reference]).tolist():
        own = data.log_of == log
        middle[own] = data.t[own] > np.median(data.t[own])
    masks = [middle & reference]
    if len(np.unique(data.log_of[reference])) > 1:
        masks.append((data.log_of % 2 == 1) & reference)
    return masks


def _screened(data: Data, later: Mask, fit: Fit, family: Family, arm: Arm) -> Screened:
    gained, eta, width = [], [], 0
    for laid in lay_family(data, family, arm):
        width = laid.table.shape[1]
        products = products_apart(laid, fit, fit.residual[None], later[laid.rows])
        one, (two, seen, _) = products.first(width).gains()[0], products.gains()
        gained.append(two[:, 0] - one[:, 0])
        eta.append(seen)
    gain, visible = np.concatenate(gained), np.concatenate(eta)
    best = int(np.argmax(gain))
    return Screened(family, gain[best:best + 1], (family.shapes[best],), visible[best:best + 1], float(visible.max()), 0.0, width)


def bounds(families: Sequence[Family], wanted: Sequence[bool], fit: Fit, later: Mask, chance: Chance) -> Thresholds:
    """What a change has to exceed: of those wanted; infinite for the others."""
    chance.ask([family for family, asked in zip(families, wanted, strict=True) if asked])
    longer = max(1.0, float(later.sum()) / max(float((~later).sum()) / 2.0, 1.0))
    own = np.array([(1.0 if family.event else longer) * chance.most(family, fit.weight) if asked else np.inf
                    for family, asked in zip(families, wanted, strict=True)])
    joint = np.array([f.joint or 0 for f in families])
    left = np.bincount(fit.data.joint, fit.residual**2, minlength=fit.data.n_joints)
    least = _LEAST * np.append(left.mean(), left)
    once = np.array([f.event for f in families])
    there = [own[(joint == j) & np.isfinite(own) & ~once] for j in range(fit.data.n_joints + 1)]
    usual = np.array([np.median(some) if len(some) else 0.0 for some in there])
    gain = np.maximum(TIMES * np.where(once, ONCE * own, np.maximum(own, usual[joint])), least[joint])
    return Thresholds(gain, own, "reference logs", fit.weight, tuple(f.joint for f in families))

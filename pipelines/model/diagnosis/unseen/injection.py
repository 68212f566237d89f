"""The smallest strength of a cause that would have been found, by hiding it in the very logs that were diagnosed.

    probe = Probe.of(final, judge, arms)
    hidden = smallest(family, bound, probe)         amplitudes; None of what cannot be put in at a strength, an event say

The cause is added to what the final model leaves, with and against it, in several of its shapes; the model is fitted anew, which
takes part of it; and then it has to do what every cause has to do to be believed: its best shape, which need not be the hidden
one, takes more off the squared residual than its threshold, and what is held out becomes smaller by more than chance does. To first
order all of this is inner products: with r the residual and x⊥ what the fit leaves of one unit of the cause, a shape takes off
r + A x⊥

    g(r + A x⊥) = g(r) + 2 A b + A² g(x⊥),     b = ½ (g(r + x⊥) - g(r) - g(x⊥))

so that strengths need not be tried one by one. A cause that does more than add its columns, a delay say, is then put into the
torque exactly, and its strength raised until it passes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from pipelines.fit.bootstrap import apart_in, drawn
from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.nominal import Fit
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Arms, Family, Laid, lay_family, lay_one
from pipelines.model.diagnosis.screened.screen import INVISIBLE, Products, products_apart, products_of
from pipelines.model.effects.base import Effect

__all__ = ["Draw", "Hidden", "Probe", "held_out", "quadratics", "smallest"]

_SHAPES, _RANK = 8, 0.75  # of a family that are hidden; share of them for which less, or as much, suffices
_PHASES = 4  # of a sine and a cosine, each with both signs
_NUMBERS = 3  # amplitudes that are asked, until one shows
_HALF = 0.5  # of the held-out power, that chance does not take off
_NEAR = 0.97  # of the bound, that the torque of the exact cause takes off: it is not linear to the last
_RAISED, _TIMES = 1.25, 24  # a strength that did not pass, and how often
_BLOCKS, _SEED = 20, 20040509  # of held-out time; of the draws

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Hidden:
    """A strength that would have been found."""

    effect: Effect  # in the shape that was hidden
    amplitudes: Array  # (k,)
    found: bool  # False: at no strength


@dataclass(frozen=True, eq=False)
class Probe:
    """Into what causes are put, and what judges whether they are found."""

    final: Refined  # the final model
    data: Data  # that is screened: with reference logs theirs, then the later ones
    fit: Fit  # of it
    later: Mask | None  # (rows,) in which something may have changed; None: in all
    held: Refined  # the same model on what is held out
    arms: Arms  # by whose columns causes are screened

    @classmethod
    def of(cls, final: Refined, judge: Data | None, arms: Arms, stacked: tuple[Data, Fit, Mask] | None = None) -> Probe:
        """`judge`: held-out logs, if any; `stacked`: with reference logs both, the fit on both, and which rows are later."""
        data, fit, later = (final.data, final.fit, None) if stacked is None else stacked
        return cls(final, data, fit, later, final if judge is None else refine(final.model, judge, final.weight, steps=0), arms)

    @cached_property
    def draws(self) -> Array:
        """(draws, blocks) of held-out time."""
        return drawn(int(self.held.data.blocks(_BLOCKS).max()) + 1, np.random.default_rng(_SEED))

    @cached_property
    def absorbing(self) -> Array:
        """(numbers, rows): what it multiplies from the left, unweighted columns of the final model's rows, the fit takes in."""
        table = self.final.slopes * self.final.weights
        size = np.linalg.norm(table, axis=1)
        unit = table / np.where(size > 0.0, size, 1.0)[:, None]
        values, vectors = np.linalg.eigh(unit @ unit.T)
        keep = values > 1e-11 * values[-1]
        inverse = (vectors[:, keep] / values[keep]) @ vectors[:, keep].T
        return np.asarray((inverse @ unit) * self.final.weights / np.where(size > 0.0, size, 1.0)[:, None])

    @cached_property
    def _spanned(self) -> Array:
        """(rank, rows of the final model) of the fit's basis."""
        return self.fit.basis if self.later is None else self.fit.basis[:, self.later]

    def left_of(self, torque: Array) -> Array:
        """(…, rows) what the fit leaves, weighted, of `torque` (…, rows of the final model) [N m]."""
        own: Mask | slice = slice(None) if self.later is None else self.later
        weighted = torque * self.fit.weights[own]
        left = -(weighted @ self._spanned.T) @ self.fit.basis
        left[..., own] += weighted
        return np.asarray(left)

    def own(self, rows: npt.NDArray[np.intp], table: Array) -> Array:
        """(…, rows of the final model) of a `table` (…, those of `rows`) laid on the screened data."""
        whole = np.zeros((*table.shape[:-1], self.data.rows))
        whole[..., rows] = table
        return whole if self.later is None else whole[..., self.later]


@dataclass(frozen=True, eq=False)
class Draw:
    """One way in which the cause could be there."""

    effect: Effect
    columns: Array  # (k, rows of the final model) unweighted
    direction: Array  # (k,) amplitudes of one unit
    strength: float  # that passes; infinite where none does


def smallest(family: Family, bound: float, probe: Probe) -> Hidden | None:
    """The strength that passes, whatever sign and phase, in a shape for which less suffices in three of four shapes.

    Args:
        bound: the gain that the cause has to exceed.
    """
    if family.event or family.shapes[0].fixed_amplitudes is not None or not np.isfinite(bound):
        return None
    worst: dict[Effect, Draw] = {}
    numbers = (_draws(family, bound, probe, number) for number in range(_NUMBERS))
    for one in next((some for some in numbers if some), []):  # where the model takes in all of the first, an inertia say, the next
        possible = not np.isfinite(one.strength) or one.effect.possible(one.effect.values(one.strength * one.direction))
        if possible and (one.effect not in worst or worst[one.effect].strength < one.strength):
            worst[one.effect] = one
    if not worst:
        return None
    every = sorted(worst.values(), key=lambda one: one.strength)
    chosen = every[int(np.ceil(_RANK * len(every))) - 1]
    strength = chosen.strength
    against = [one for one in (chosen, replace(chosen, direction=-chosen.direction)) if not np.isfinite(strength)
               or one.effect.possible(one.effect.values(strength * one.direction))]
    for factor in (_exactly(chosen, family, bound, probe), *held_out(chosen, [one.direction for one in against], probe)):
        strength = _raised(factor, strength)
    found = bool(np.isfinite(strength))
    return Hidden(chosen.effect, (strength if found else 1.0) * chosen.direction, found)


def _raised(factor: Callable[[float], float], strength: float) -> float:
    """The strength for which the factor by which more is wanted is one."""
    for _ in range(_TIMES):
        if not np.isfinite(strength):
            break
        more = factor(strength)
        if more == 1.0:
            return strength
        strength *= more
    return np.inf


def _draws(family: Family, bound: float, probe: Probe, number: int = 0) -> list[Draw]:
    """Some shapes of the family by amplitude `number`, and from which strength on the best shape takes off more than `bound`."""
    arm, count = probe.arms.of(family), len(family.shapes)
    chosen = set(np.unique(np.linspace(0, count - 1, min(count, _SHAPES)).round().astype(int)).tolist())
    hidden: list[tuple[Effect, Array, Array]] = []
    rows, scales = [], []
    for laid in lay_family(probe.data, family, arm):
        for place in sorted(chosen & set(range(laid.first, laid.first + len(laid.table)))):
            effect, columns = family.shapes[place], probe.own(laid.rows, laid.table[place - laid.first])
            left, weighted = probe.left_of(columns), columns * probe.final.weights
            for direction in _directions(effect, len(columns), number):
                one = direction @ left
                size = float(np.linalg.norm(one))
                if size > INVISIBLE * float(np.linalg.norm(direction @ weighted)):
                    hidden.append((effect, columns, direction))
                    rows.append(one * np.sqrt(bound) / size)
                    scales.append(np.sqrt(bound) / size)
    if not hidden:
        return []
    from_which = np.full(len(hidden), np.inf)
    for a, b, c in quadratics(_laid(family, probe), probe, np.array(rows)):
        from_which = np.minimum(from_which, _last_root(a, b, c - bound).min(axis=0))
    return [Draw(*one, float(root * scale)) for one, root, scale in zip(hidden, from_which, scales, strict=True)]


def _laid(family: Family, probe: Probe) -> Iterator[Laid]:
    return lay_family(probe.data, family, probe.arms.of(family))


def quadratics(laid_shapes: Iterable[Laid], probe: Probe, units: Array) -> list[tuple[Array, Array, Array]]:
    """Of some shapes at a time g(x⊥), b and g(r), each (shapes, units)."""
    found = []
    residuals = np.concatenate([probe.fit.residual[None], units])
    for laid in laid_shapes:
        width = laid.table.shape[1]
        products = (products_of(laid, probe.fit, residuals) if probe.later is None else  # a common column, and one of the change
                    products_apart(laid, probe.fit, residuals, probe.later[laid.rows]))
        moment = np.concatenate([products.moment, products.moment[:, :, 1:] + products.moment[:, :, :1]], axis=2)
        every = Products(products.whole, products.gram, moment)
        gain = every.gains()[0]
        if probe.later is not None:
            gain = gain - every.first(width).gains()[0]
        count = len(units)
        alone, both = gain[:, 1:count + 1], gain[:, count + 1:]
        nothing = np.broadcast_to(gain[:, :1], alone.shape)
        found.append((alone, 0.5 * (both - alone - nothing), nothing))
    return found


def _last_root(a: Array, b: Array, c: Array) -> Array:
    """From which A ≥ 0 on a A² + 2 b A + c stays above zero."""
    inside = b * b - a * c
    with np.errstate(divide="ignore", invalid="ignore"):
        root = (-b + np.sqrt(np.maximum(inside, 0.0))) / a
    return np.where(a <= 0.0, np.inf, np.where(inside < 0.0, 0.0, np.maximum(root, 0.0)))


def _directions(effect: Effect, width: int, number: int) -> list[Array]:
    """Of amplitudes: one, with both signs; of a sine and a cosine, which give one number alike, several phases of the first."""
    if number >= width:
        return []
    first = np.eye(width)[number]
    if number == 0 and width > 1 and _alike(effect.values(first), effect.values(np.eye(width)[1])):
        turn = np.pi * np.arange(2 * _PHASES) / _PHASES
        return [np.cos(x) * first + np.sin(x) * np.eye(width)[1] for x in turn.tolist()]
    return [first, -first]


def _alike(one: dict[str, float], other: dict[str, float]) -> bool:
    """Whether two pairs of amplitudes are of one size, and differ in an angle alone."""
    sizes = [np.isclose(one[name], other[name]) for name in one if one[name] > 0.0 and other[name] > 0.0]
    return bool(sizes) and sum(not np.isclose(one[name], other[name]) for name in one) <= 1


def _exactly(one: Draw, family: Family, bound: float, probe: Probe) -> Callable[[float], float]:
    """How much more it takes to exceed the bound when the torque has all of what the cause does."""
    model, data = probe.final.model, probe.final.data

    def factor(strength: float) -> float:
        if one.effect.adds:
            return 1.0
        with np.errstate(all="ignore"):
            torque = model.with_effect(one.effect, strength * one.direction).torque(data) - (data.y - probe.final.left)
        if not np.isfinite(torque).all():
            return np.inf
        every = quadratics(_laid(family, probe), probe, probe.left_of(torque)[None])
        gain = max(float((a + 2.0 * b + c).max()) for a, b, c in every)
        return 1.0 if gain > _NEAR * bound else float(np.clip(np.sqrt(bound / max(gain, 1e-300)), 1.02, 3.0))

    return factor


def held_out(one: Draw, directions: Sequence[Array], probe: Probe) -> list[Callable[[float], float]]:
    """Of each direction how much more it takes until what is held out becomes smaller by more than chance does, when the cause is
    fitted."""
    final, held = probe.final, probe.held
    data = held.data
    there = one.columns if held is final else lay_one(data, one.effect, final.model.arm)
    seen = there - (one.columns @ probe.absorbing.T) @ held.slopes  # of each column, what the model fitted to the others leaves
    here = final.fit.project(one.columns)
    found = np.linalg.lstsq(here @ here.T, here @ final.residual, rcond=1e-8)[0]  # what it is taken for where it is not there
    after, place = held.left - found @ seen, data.blocks(_BLOCKS)
    joints = [joint for joint in range(data.n_joints) if seen[:, data.joint == joint].any()]

    weights = final.weight[data.joint]

    def factor(strength: float, direction: Array) -> float:
        before = held.left + strength * (direction @ seen)
        if np.linalg.norm(after * weights) >= np.linalg.norm(before * weights):
            return _RAISED
        for joint in joints:
            own = (data.joint == joint) & data.counts
            sums = [np.asarray(np.bincount(place[own], values, minlength=probe.draws.shape[1]), dtype=np.float64)
                    for values in (before[own]**2, after[own]**2, np.ones(int(own.sum())))]
            if sums[1].sum() < _HALF * sums[0].sum() or apart_in(probe.draws, *sums)[1] < 0.0:
                return 1.0
        return _RAISED

    return [partial(factor, direction=direction) for direction in directions]

"""Causes that the base parameters take in within one session: told by how these parameters moved since the reference logs.

    found = absorbed(case...)        a load at the tip, say, with its numbers

A load moves them. What else they can imitate they take in as well, and nothing of it is left in the residual: a constant torque at
a joint whose weight turns through a small angle is some more weight. But masses do not change by themselves: where one law, acting
after the reference only, leaves the base parameters where they were, it is the simpler story. The move is that of all columns of
the rigid body with coefficients of their own before and after; a cause explains it as far as the parameters no longer move beside
its columns, which are zero before (an analysis of covariance, Fisher 1932). Where it moves some of them by masses that they do not
tell, as a longer link does by those beyond it, these are numbers of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.fitted.linear import covariance
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns
from pipelines.model.diagnosis.reference.standing import Mask, apart
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Family, lay_family, lay_one, place_of
from pipelines.model.diagnosis.screened.screen import gains_of
from pipelines.model.diagnosis.worth.numbers import of_amplitudes
from pipelines.model.effects import all_effects
from pipelines.model.effects.base import Effect

__all__ = ["Absorbed", "Move", "Sessions", "Unexplained", "absorbed", "chosen"]

_EXPLAINS = 0.7  # of the move: a load, whose ten numbers move the parameters freely within what a body does
# The same, that it has a name for: true loads have been seen to explain all but a hundred-thousandth, a longer link .98.
_ALTOGETHER = 0.99
_ALONE = 0.9  # the same of a law, which has to put all of them back by its few numbers
_WORTH = 0.05  # of the squared residual, that separate parameters take away at least
_SURE = 5.0  # standard deviations of a number
_TELLS = 25.0  # of what is left of the move, in variances: five standard deviations between two stories
_NUMBER = 2.0  # variances, that each number more has to explain (Akaike 1974)
_PARSIMONY = 0.02  # of the move
_CHANCE = 3.0  # times what the parameters move between parts of the reference logs
# Of the squared residual that two sets of parameters leave. Of 8 arms in order, moved otherwise than before, none had over 0.8 %.
_UNEXPLAINED = 0.5


@dataclass(frozen=True, eq=False)
class Sessions:
    """Rows of reference and later logs, and the columns of a model of both."""

    data: Data
    later: Mask  # (rows,)
    rigid: Array  # (k, rows) of the rigid body
    others: Array  # (m, rows) of friction, with coefficients of their own before and after
    common: Array  # (n, rows) of the standing set, and of what was found in the later rows
    weight: Array  # (joints,)

    def fit(self, moved: bool, more: Array | None = None) -> Fit:
        """With base parameters of their own before and after, or one set for both, beside further columns."""
        rigid = apart(self.rigid, self.later) if moved else self.rigid
        beside = [apart(self.others, self.later), self.common, *(() if more is None else (more,))]
        return fit_columns(self.data, np.concatenate([rigid, *beside]), weight=self.weight)

    def acting(self, effect: Effect, arm: Arm) -> Array:
        """(k, rows) its columns, zero in the reference."""
        return np.where(self.later, lay_one(self.data, effect, arm), 0.0)

    def moving(self, directions: Array, arm: Arm) -> Array:
        """(k, rows) base parameters that move in these `directions` (base parameters, k) after the reference."""
        if not directions.shape[1]:
            return np.zeros((0, self.data.rows))
        laid = self.data.lay(lambda motion: arm.body.regressor(motion.q, motion.dq, motion.ddq) @ directions)
        return np.where(self.later, laid, 0.0)


@dataclass(frozen=True, eq=False)
class Absorbed:
    """A cause that the base parameters show."""

    acting: Acting
    numbers: int  # amplitudes that were fitted
    explained: float  # of the difference between one set of base parameters and two
    gain: float  # squared weighted residual that it takes away beside one set, in parts of that difference
    moves: Array | None = None  # (base parameters,) moved beside the cause's own torque, by what its values do not say
    unknowns: int = 0  # numbers behind `moves`
    rivals: tuple[Effect, ...] = ()  # elsewhere, or of other kind, that explain it as well: no name then
    times: float = 1.0  # what two sets of base parameters leave, one set for both leaves: the residual, not squared

    @property
    def effect(self) -> Effect:
        return self.acting.effect

    @property
    def far(self) -> bool:
        """Whether they have moved so far that something has changed, by whatever name."""
        return self.times**2 >= 1.0 + _UNEXPLAINED

    @property
    def taken(self) -> float:
        """Of the squared residual that one set of base parameters leaves: the share of how they moved, as far as it explains it."""
        return self.explained * self._share

    @property
    def least(self) -> float:
        """Of the same, what it has to take away to be named."""
        return (_ALTOGETHER if self.effect.evidence == "base parameters" else _ALONE) * self._share

    @property
    def _share(self) -> float:
        """What a second set of base parameters takes away of what one leaves."""
        return 1.0 - 1.0 / self.times**2

    @property
    def count(self) -> int:
        """Numbers that were fitted."""
        return self.numbers + len(self.effect.free) + self.unknowns

    @property
    def unsure(self) -> str:
        """Why it is not named; empty where nothing speaks against it."""
        places = [_place(one) for one in (self.effect, *self.rivals)]
        if not self.rivals and self.effect.evidence == "base parameters" and self.explained < _ALTOGETHER:
            return f"the base parameters have moved much as {places[0]} moves them, but not altogether"
        return f"the base parameters have moved as {' or '.join(places)} moves them" if self.rivals else ""


@dataclass(frozen=True)
class Unexplained:
    """Base parameters that have moved far, and no cause moves them so."""

    times: float  # what two sets of them leave, one set for both leaves: the residual, not squared


@dataclass(frozen=True)
class Move:
    """How the base parameters differ."""

    power: float  # squared weighted residual that two sets of them take off what one leaves
    whole: float  # what two leave
    variances: float  # the same move in units of its covariance: chi-squared where nothing moved


def absorbed(two: Sessions, arm: Arm, families: Sequence[Family] = (), usual: float = 0.0, without: Sequence[str] = (),
             ) -> Absorbed | Unexplained | None:
    """The cause that explains best how the base parameters moved; None where they did not, or not far enough to be sure of it;
    `Unexplained` where they moved far, and no cause that is known moves them so.

    Args:
        families: laws to be asked beside the causes that act on base parameters; none where the residual shows what is wrong.
        usual: share of the squared residual that parameters of their own take away where nothing changed.
    """
    one = two.fit(moved=False)
    move = _moved(two, one)
    if move is None:
        return None
    places = [kind_at.full() for kind in all_effects() if kind.evidence == "base parameters" and kind.name not in without
              for kind_at in kind.everywhere(arm.robot.revolute)]
    found = [*(_tried(effect, two, arm, move, _EXPLAINS, 1) for effect in places),
             *(_tried(effect, two, arm, move, _ALONE, None) for effect in _laws(two, one, families, arm, move))]
    best = chosen([one for one in found if one is not None], move)
    far = move.power >= _CHANCE * usual * move.whole
    more = move.power / max(move.whole, 1e-300)
    times = float(np.sqrt(1.0 + more))
    if best is None:
        return Unexplained(times) if far and more >= _UNEXPLAINED else None
    return replace(best, times=times) if far or best.effect.evidence == "base parameters" else None


def _moved(two: Sessions, one: Fit) -> Move | None:
    """None where it is not worth a cause."""
    apart_fit, k = two.fit(moved=True), len(two.rigid)
    if _power(one) - _power(apart_fit) < _WORTH * _power(apart_fit):
        return None
    whole = covariance(apart_fit.table * apart_fit.weights, apart_fit.residual)[:2 * k, :2 * k]
    difference = np.concatenate([-np.eye(k), np.eye(k)], axis=1)
    by, spread = difference @ apart_fit.beta[:2 * k], difference @ whole @ difference.T
    size = np.sqrt(np.maximum(np.diag(spread), 1e-300))
    unit = np.linalg.pinv(spread / size[:, None] / size, rcond=1e-9, hermitian=True)
    return Move(_power(one) - _power(apart_fit), _power(apart_fit), float((by / size) @ unit @ (by / size)))


def _power(fit: Fit) -> float:
    return float(fit.residual @ fit.residual)


def _laws(two: Sessions, one: Fit, families: Sequence[Family], arm: Arm, move: Move) -> Iterator[Effect]:
    """Each law in the shape that takes away most beside one set of base parameters, where that may be enough; in every shape where
    it moves some of them in ways that its columns do not show."""
    for family in families:
        if family.event:
            continue
        if family.shapes[0].moving(arm) is not None:
            yield from family.shapes
            continue
        best, most = family.shapes[0], 0.0
        for laid in lay_family(two.data, family, arm):
            after = replace(laid, table=np.where(two.later[laid.rows], laid.table, 0.0))
            gains = gains_of(after, one, one.residual[None])[0][:, 0]
            if (top := float(gains.max())) > most:
                best, most = family.shapes[laid.first + int(gains.argmax())], top
        if most > _ALONE * move.power:
            yield best


def _tried(effect: Effect, two: Sessions, arm: Arm, move: Move, least: float, numbers: int | None) -> Absorbed | None:
    """One cause; the first so many of its `numbers` have to be sure, or any of them."""
    columns, moving = two.acting(effect, arm), effect.moving(arm)
    own = len(columns)
    if moving is not None:
        columns = np.concatenate([columns, two.moving(moving, arm)])
    fit = two.fit(moved=False, more=columns)
    power, left = move.power + move.whole, _power(fit)
    share = 1.0 - (left - _power(two.fit(moved=True, more=columns))) / move.power
    every = fit.beta[-len(columns):]
    amplitudes = every[:own]
    spread = covariance(fit.table * fit.weights, fit.residual)[-len(columns):, -len(columns):][:own, :own]
    if share < least or not (np.abs(amplitudes) > _SURE * np.sqrt(np.maximum(np.diag(spread), 0.0)))[:numbers].any():
        return None
    if not effect.possible(effect.values(amplitudes)):
        return None
    gain = (power - left) / move.power
    moves = None if moving is None else moving @ every[own:]
    acting = of_amplitudes(effect, amplitudes, spread, arm.robot.revolute)
    return Absorbed(acting, own, share, gain, moves, unknowns=len(columns) - own)


def chosen(found: Sequence[Absorbed], move: Move) -> Absorbed | None:
    """Of those that explain nearly as much as the best, the one with fewest numbers; with rivals, where as good a one is elsewhere,
    or has as few.

    Masses that nobody knows let a longer link pass for much that is none, a load on a link say: it has to explain as much as the
    best, as far as five standard deviations tell, and what does so too is its rival, its own numbers counted (Akaike 1974).
    """
    if not found:
        return None
    best = max(one.gain for one in found)
    variance = 1.0 / max(move.variances, 1e-300)
    told = _TELLS * variance
    near = [one for one in found if one.gain >= best - (told if one.unknowns else max(_PARSIMONY, told))]
    near.sort(key=lambda one: (one.count, -one.gain))
    first = near[0]
    rivals = [one for one in near[1:] if _elsewhere(one.effect, first.effect) or one.count == first.count
              or (first.unknowns and one.gain >= best - told + _NUMBER * variance * (one.count - first.count))]
    return replace(first, rivals=tuple(one.effect for one in rivals))


def _elsewhere(one: Effect, other: Effect) -> bool:
    """At another joint, or of another link."""
    return one.joint != other.joint or (one.name == other.name and one != other)


def _place(effect: Effect) -> str:
    """"torque_gain:2", "link_length of link 2"."""
    numbers = [q.name for q in effect.parameters if q.shape and q.discrete] if effect.joint is None else []
    return place_of(effect.name, effect.joint) + "".join(f" of {name} {getattr(effect, name):g}" for name in numbers)

"""A friction law of several terms where logs do not tell these apart: as few of them as do as well.

    prepared = with_terms_told_apart(prepared, blocks)
    prepared.fewer                                        which laws gave way, to which, and why

Three sigmoids beside friction that has one are three numbers too many: two of them become as sharp as each other, with heights of
opposite signs that are whatever noise makes of them, or each stands for a piece of something else, a wave over the angle say, which
then nobody finds. So a law is chosen here as fit-friction chooses one: of those whose terms are told apart, the one with the fewest
that is not surely worse on what it was not fitted to, other logs or blocks of the same ones. What was recorded when all was in
order counts as much as what is diagnosed, for a fault blurs the terms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.gains import torque_gain_of
from pipelines.model.diagnosis.held_out import held_out_left
from pipelines.model.diagnosis.inputs import Prepared
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.refit import Refined, refine
from pipelines.model.diagnosis.result import FewerTerms
from pipelines.model.effects import find_effect
from pipelines.model.effects.base import Effect
from pipelines.model.estimation.regression import Columns

__all__ = ["unclear", "with_terms_told_apart"]

_SURE = 2.0  # standard deviations
_VAGUE = 1.0  # of the logarithm of a sharpness: it may as well be three times as large, or a third
_WORTH = 0.99  # of the squared error that a plainer law leaves: more is no gain, however sure


def with_terms_told_apart(prepared: Prepared, blocks: int) -> Prepared:
    """The same rows, for laws in the shape that they were fitted in, each with no more terms than these logs tell apart.

    Args:
        blocks: of time, held out in turn where no log judges.
    """
    given = prepared.columns
    if not any(law.plainer for law in given.laws):
        return prepared
    tried = [_Rungs.of(given, data, judge, blocks) for data, judge in _sets(prepared)]
    laws: list[Effect] = []
    fewer: list[FewerTerms] = []
    for law in given.laws:
        if not law.plainer:
            laws.append(law)
            continue
        ends = [rungs.chosen(law) for rungs in tried]
        rung = min(ends)
        laws += tried[ends.index(rung)].laws_for(law, rung)
        if rung:
            fewer.append(FewerTerms(law.joint, law.name, law.plainer[rung - 1], tried[0].why(law)))
    return replace(prepared, columns=replace(given, laws=tuple(laws)), fewer=tuple(fewer))


def _sets(prepared: Prepared) -> Iterator[tuple[Data, Data | None]]:
    """Those of the time before first: the laws are to be in the shapes that they had when all was in order."""
    if prepared.reference is not None:
        yield prepared.reference, None
    yield prepared.data, prepared.judge


@dataclass(frozen=True, eq=False)
class _Rungs:
    """Fits of all laws as they were given, then of each with fewer and fewer terms, to the same rows."""

    given: Columns
    fits: tuple[Refined, ...]
    judges: tuple[_Judge, ...]

    @classmethod
    def of(cls, given: Columns, data: Data, judge: Data | None, blocks: int) -> _Rungs:
        fits = []
        for rung in range(1 + max(len(law.plainer) for law in given.laws)):
            laws = [one for law in given.laws for one in _on(law, rung, given.laws)]
            columns, fit = fit_nominal(data, replace(given, laws=tuple(laws)))
            fits.append(refine(Exact.start(columns, fit), data, fit.weight))
        rows = (None,) if judge is None else (None, judge)
        return cls(given, tuple(fits), tuple(_Judge(data if one is None else one, tuple(held_out_left(fit, one, blocks)
                                                                                         for fit in fits)) for one in rows))

    def chosen(self, law: Effect) -> int:
        """The rung of `law` with fewest terms that is not surely worse than the best; the last stands whatever is known of it."""
        last, joint = len(law.plainer), (law.joint or 1) - 1
        able = [rung for rung in range(last) if not self._unclear(law, rung)] + [last]
        best = min(able, key=lambda rung: sum(judge.power(joint, rung) for judge in self.judges))
        return max(rung for rung in able if not any(judge.surely_less(joint, best, rung) for judge in self.judges))

    def why(self, law: Effect) -> str:
        """In words, what speaks against the law as it was given."""
        return self._unclear(law, 0) or "fewer terms leave as little of what was held out"

    def laws_for(self, law: Effect, rung: int) -> list[Effect]:
        """In their fitted shapes."""
        wanted = {(one.name, one.joint) for one in _on(law, rung, self.given.laws)}
        return [one for one in self.fits[rung].model.columns.laws if (one.name, one.joint) in wanted]

    def _unclear(self, law: Effect, rung: int) -> str:
        own = self.laws_for(law, rung)
        words = (unclear(self.fits[rung], place) for place, one in enumerate(self.fits[rung].model.columns.laws) if one in own)
        return next(filter(None, words), "")


@dataclass(frozen=True, eq=False)
class _Judge:
    """Rows that fits are judged by: those of other logs, or blocks of the same ones, held out in turn."""

    data: Data
    left: tuple[Array, ...]  # (rows,) [N m] of each fit

    def power(self, joint: int, rung: int) -> float:
        """Σ r² of a joint, from 0 [N² m²]."""
        own = (self.data.joint == joint) & self.data.counts
        return float(np.sum(np.square(self.left[rung][own])))

    def surely_less(self, joint: int, one: int, other: int) -> bool:
        """Whether rung `one` leaves less than `other`, beyond chance and by more than a hundredth."""
        high = torque_gain_of(self.data, self.left[other], self.left[one]).ci95[joint][1]
        return bool(high < 0.0 and self.power(joint, one) < _WORTH * self.power(joint, other))


def _on(law: Effect, rung: int, laws: Sequence[Effect]) -> list[Effect]:
    """`law` with so many rungs fewer terms, as far as it has; a part that stands beside it already is not laid twice."""
    if not rung or not law.plainer:
        return [law]
    names = law.plainer[min(rung, len(law.plainer)) - 1]
    there = {one.name for one in laws if one.joint == law.joint}
    return [find_effect(name)(joint=law.joint) for name in names if name not in there]


def unclear(done: Refined, place: int) -> str:
    """In words, why the terms of law number `place` of a fitted model are not told apart; empty where they are.

    Of each sharpness its logarithm has to be known, and two have to differ beyond their deviation √(C_aa + C_bb - 2 C_ab).
    """
    law, first = done.model.columns.laws[place], len(done.model.beta)
    own = [(first + k, name) for k, (kind, which, name) in enumerate(done.names) if kind == 0 and which == place]
    if not own or not law.plainer:
        return ""
    covariance, values = done.covariance(), {name: float(getattr(law, name)) for _, name in own}
    units = {q.name: q.unit for q in law.parameters}
    std = {name: float(np.sqrt(max(covariance[k, k], 0.0))) for k, name in own}
    known = {name: f"{name} = {values[name]:.3g} ± {std[name] * values[name]:.1g} {units[name]}" for name in values}
    if vague := [known[name] for name in values if not 0.0 < std[name] < _VAGUE]:
        return ", ".join(vague)
    for (i, one), (j, other) in pairwise(sorted(own, key=lambda pair: values[pair[1]])):
        apart = float(np.sqrt(max(covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j], 0.0)))
        if np.log(values[other] / values[one]) <= _SURE * apart:
            return f"{known[other]} and {known[one]} may be one"
    return ""

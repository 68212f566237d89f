"""Reduce a friction law to the terms that the logs distinguish.

    prepared = with_terms_told_apart(prepared, blocks)
    prepared.fewer                                        laws that have fewer terms, and why

Of a law and its plainer forms, that one is taken whose terms are distinguished, with the fewest of
them that is not clearly worse on blocks of time to which it was not fitted. Logs of role "validate"
have no part in it. Reference logs decide alone, as far as they drive a joint: a fault blurs the
terms, or is taken for one more of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from pipelines.effects import find_effect
from pipelines.effects.base import Effect, plainer
from pipelines.estimation.regression import Columns
from pipelines.io.log import Array
from pipelines.model.rows.data import Data
from pipelines.model.rows.exact import Exact
from pipelines.model.rows.fit import Refined, refine, torque_gain_of
from pipelines.model.rows.nominal import fit_nominal
from pipelines.model.rows.prepare import FewerTerms, Prepared

__all__ = ["unclear", "with_terms_told_apart"]

_SURE = 2.0  # standard deviations
_VAGUE = 1.0  # of the logarithm of a sharpness: it may as well be three times as large, or a third
_ROUGH = 0.3  # of the same, from which on what is as likely lies further up than down, and a factor says it
_WIDE = 10.0  # a factor that is no knowledge
_WORTH = 0.99  # of the squared error that a plainer law leaves: more is no gain, however sure
_MUCH = 0.85  # of the same; at 21 joints with one sigmoid, of two that were told apart none left less than .89
_ONE = 0.5  # of the half of a 95 % interval: a standard error
_LONG, _FAST = 0.25, 0.5  # times the equations and the speed of a joint in later logs, with which those before judge its friction
_AS_LITTLE = "fewer terms leave as little of what was held out"


def with_terms_told_apart(prepared: Prepared, blocks: int) -> Prepared:
    """The same rows, for laws in the shape that they were fitted in, each with no more terms than these logs tell apart.

    Args:
        blocks: of time, held out in turn.
    """
    given = prepared.columns
    if not any(plainer(law) for law in given.laws):
        return prepared
    now = _Rungs(given, prepared.data, blocks)
    before = now if prepared.reference is None else _Rungs(given, prepared.reference, blocks)
    laws: list[Effect] = []
    fewer: list[FewerTerms] = []
    for law in given.laws:
        if not plainer(law):
            laws.append(law)
            continue
        rungs = before if _judges(before.data, now.data, _row(law)) else now
        rung = rungs.chosen(law)
        laws += rungs.laws_for(law, rung)
        if rung:
            fewer.append(FewerTerms(law.joint, law.name, plainer(law)[rung - 1], rungs.why(law, rung)))
    return replace(prepared, columns=replace(given, laws=tuple(laws)), fewer=tuple(fewer))


def _judges(before: Data, now: Data, row: int) -> bool:
    """Whether the logs of the time before drive a joint, from 0, for long enough and as fast as to tell what friction it had."""
    (many, fast), (many_now, fast_now) = (_driven(data, row) for data in (before, now))
    return many > 0 and many >= _LONG * many_now and fast >= _FAST * fast_now


def _driven(data: Data, row: int) -> tuple[int, float]:
    """How many equations of a joint count, and its root mean square speed in them [rad/s]."""
    speed = np.concatenate([one.at_rows(one.motion.dq[:, row])[one.weighed[row]] for one in data.logs])
    return len(speed), float(np.sqrt(np.mean(np.square(speed)))) if len(speed) else 0.0


@dataclass(frozen=True, eq=False)
class _Rung:
    """One fit, and what it leaves of blocks of time that are held out in turn."""

    done: Refined
    blocks: int

    @cached_property
    def left(self) -> Array:
        """(rows,) [N m] of every block by the numbers that the others ask for, to first order."""
        table, residual = self.done.slopes * self.done.weights, self.done.residual
        size = np.linalg.norm(table, axis=1)
        unit = table / np.where(size > 0.0, size, 1.0)[:, None]
        left, gram, moment = np.empty_like(residual), unit @ unit.T, unit @ residual
        ridge, place = 1e-9 * np.eye(len(gram)), self.done.data.blocks(self.blocks)
        for block in range(int(place.max()) + 1):
            held = place == block
            own = unit[:, held]
            square, asked = gram - own @ own.T + ridge, moment - own @ residual[held]
            left[held] = residual[held] - np.linalg.solve(square, asked) @ own
        return left / self.done.weights

    def power(self, row: int) -> float:
        """Σ r² of a joint, from 0 [N² m²]."""
        return float(self.done.data.power(self.left)[0][row])

    def clearly_less(self, other: _Rung, row: int) -> bool:
        """Whether it leaves less than `other`: by more than a hundredth of the squares and beyond chance, or by a great part of
        them and a standard error.

        Beyond chance alone would leave a dip in the waves over the angle that it is added to: they make blocks differ far more than
        the law does.
        """
        less = self.power(row) / max(other.power(row), 1e-300)
        if less >= _WORTH:
            return False
        gain = torque_gain_of(self.done.data, other.left, self.left)
        by, high = float(gain.before[row] - gain.after[row]), float(gain.ci95[row][1])
        return high < 0.0 or (less < _MUCH and _ONE * (high + by) < by)


@dataclass(frozen=True, eq=False)
class _Rungs:
    """Fits of all laws as they were given, then of each with fewer and fewer terms, to the same rows: each once it is asked for."""

    given: Columns
    data: Data
    blocks: int
    _made: dict[int, _Rung] = field(default_factory=dict)

    def at(self, rung: int) -> _Rung:
        if rung not in self._made:
            laws = tuple(one for law in self.given.laws for one in _on(law, rung, self.given.laws))
            columns, fit = fit_nominal(self.data, replace(self.given, laws=laws))
            self._made[rung] = _Rung(refine(Exact.start(columns, fit), self.data, fit.weight), self.blocks)
        return self._made[rung]

    def chosen(self, law: Effect) -> int:
        """The rung of `law` with fewest terms that is not clearly worse than the best; the last stands whatever is known of it."""
        last, row = len(plainer(law)), _row(law)
        able = [rung for rung in range(last) if not self._unclear(law, rung)] + [last]
        best = self.at(min(able, key=lambda rung: self.at(rung).power(row)))
        return max(rung for rung in able if not best.clearly_less(self.at(rung), row))

    def why(self, law: Effect, chosen: int) -> str:
        """In words, what speaks against the law as it was given, and against each with fewer terms that was not taken either."""
        first, *more = (self._unclear(law, rung) or _AS_LITTLE for rung in range(chosen))
        passed = [f"of \"{_titles(names)}\": {why}" for names, why in zip(plainer(law), more, strict=False) if why != first]
        return "; ".join((first, *passed))

    def laws_for(self, law: Effect, rung: int) -> list[Effect]:
        """In their fitted shapes."""
        wanted = {(one.name, one.joint) for one in _on(law, rung, self.given.laws)}
        return [one for one in self.at(rung).done.model.columns.laws if (one.name, one.joint) in wanted]

    def _unclear(self, law: Effect, rung: int) -> str:
        own, done = self.laws_for(law, rung), self.at(rung).done
        words = (unclear(done, place) for place, one in enumerate(done.model.columns.laws) if one in own)
        return next(filter(None, words), "")


def _titles(names: Sequence[str]) -> str:
    return ", ".join(find_effect(name).words.title for name in names)


def _row(law: Effect) -> int:
    """Its joint, from 0."""
    return (law.joint or 1) - 1


def _on(law: Effect, rung: int, laws: Sequence[Effect]) -> list[Effect]:
    """`law` with so many rungs fewer terms, as far as it has; a part that stands beside it already is not laid twice."""
    if not rung or not plainer(law):
        return [law]
    names = plainer(law)[min(rung, len(plainer(law))) - 1]
    there = {one.name for one in laws if one.joint == law.joint}
    return [find_effect(name)(joint=law.joint) for name in names if name not in there]


def unclear(done: Refined, place: int) -> str:
    """In words, why the terms of law number `place` of a fitted model are not told apart; empty where they are.

    Of each sharpness its logarithm has to be known, and two have to differ beyond their deviation √(C_aa + C_bb - 2 C_ab).
    """
    law, first = done.model.columns.laws[place], len(done.model.beta)
    own = [(first + k, name) for k, (kind, which, name) in enumerate(done.names) if kind == 0 and which == place]
    if not own or not plainer(law):
        return ""
    covariance, values = done.covariance(), {name: float(getattr(law, name)) for _, name in own}
    turning = law.joint is None or done.model.columns.body.robot.revolute[law.joint - 1]
    units = {q.name: q.unit_at(turning) for q in law.parameters}
    std = {name: float(np.sqrt(max(covariance[k, k], 0.0))) for k, name in own}
    known = {name: _known(f"{name} = {values[name]:.3g}", units[name], values[name], std[name]) for name in values}
    if vague := [known[name] for name in values if not 0.0 < std[name] < _VAGUE]:
        return " and ".join(vague)
    for (i, one), (j, other) in pairwise(sorted(own, key=lambda pair: values[pair[1]])):
        apart = float(np.sqrt(max(covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j], 0.0)))
        if np.log(values[other] / values[one]) <= _SURE * apart:
            return f"{known[other]} and {known[one]} may be one"
    return ""


def _known(words: str, unit: str, value: float, std: float) -> str:
    """A number that is positive, and how well it is known; `std` of its logarithm."""
    if 0.0 < std < _ROUGH:
        return f"{words} ± {std * value:.1g} {unit}"
    if 0.0 < std < np.log(_WIDE):
        return f"{words} {unit} (known to a factor of {np.exp(std):.2g} only)"
    return f"{words} {unit} (not determined)"

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
from pipelines.estimation.config import TermsConfig
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.model_fit import Refined, refine, torque_gain_of
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.preparation import FewerTerms, Prepared
from pipelines.estimation.regression import Columns
from pipelines.estimation.rows import Data
from pipelines.io.log import Array

_CONFIG = TermsConfig()
_AS_LITTLE = "fewer terms leave as little of what was held out"


def with_terms_told_apart(prepared: Prepared, blocks: int) -> Prepared:
    """Return the same rows, for fitted laws with no more terms than these logs distinguish.

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
        # logs of the time before judge where they drive the joint as long and as fast
        (many, fast), (many_now, fast_now) = (_driven(x.data, _row(law)) for x in (before, now))
        long = many > 0 and many >= _CONFIG.long * many_now
        rungs = before if long and fast >= _CONFIG.fast * fast_now else now
        rung = rungs.chosen(law)
        laws += rungs.laws_for(law, rung)
        if rung:
            taken, why = plainer(law)[rung - 1], rungs.why(law, rung)
            fewer.append(FewerTerms(law.joint, law.name, taken, why))
    return replace(prepared, columns=replace(given, laws=tuple(laws)), fewer=tuple(fewer))


def _driven(data: Data, row: int) -> tuple[int, float]:
    """Return how many equations of a joint count, and its rms speed in them [rad/s]."""
    speeds = [one.at_rows(one.motion.dq[:, row])[one.weighed[row]] for one in data.logs]
    speed = np.concatenate(speeds)
    return len(speed), float(np.sqrt(np.mean(np.square(speed)))) if len(speed) else 0.0


@dataclass(frozen=True, eq=False)
class _Rung:
    """One fit, and what it leaves of blocks of time that are held out in turn."""

    done: Refined
    blocks: int

    @cached_property
    def left(self) -> Array:
        """(rows,) [N m] of every block by the numbers of the others, to first order."""
        table, residual = self.done.slopes * self.done.weights, self.done.residual
        size = np.linalg.norm(table, axis=1)
        unit = table / np.where(size > 0.0, size, 1.0)[:, None]
        left, gram, moment = np.empty_like(residual), unit @ unit.T, unit @ residual
        ridge, place = 1e-9 * np.eye(len(gram)), self.done.data.blocks(self.blocks)
        for block in range(int(place.max()) + 1):
            held = place == block
            own = unit[:, held]
            rest = moment - own @ residual[held]
            solved = np.linalg.solve(gram - own @ own.T + ridge, rest)
            left[held] = residual[held] - solved @ own
        return left / self.done.weights

    def power(self, row: int) -> float:
        """Return Σ r² of a joint, from 0 [N² m²]."""
        return float(self.done.data.power(self.left)[0][row])

    def clearly_less(self, other: _Rung, row: int) -> bool:
        """Return whether it leaves less than `other`: by a hundredth of the squares and beyond
        chance, or by a great part of them and a standard error.

        Beyond chance alone would leave a dip in the waves over the angle that it is added to: they
        make blocks differ far more than the law does.
        """
        less = self.power(row) / max(other.power(row), 1e-300)
        if less >= _CONFIG.worth:
            return False
        gain = torque_gain_of(self.done.data, other.left, self.left)
        by, high = float(gain.before[row] - gain.after[row]), float(gain.ci95[row][1])
        return high < 0.0 or (less < _CONFIG.much and 0.5 * (high + by) < by)


@dataclass(frozen=True, eq=False)
class _Rungs:
    """Fits of all laws as given, then of each with fewer and fewer terms: each once it is used."""

    given: Columns
    data: Data
    blocks: int
    _made: dict[int, _Rung] = field(default_factory=dict)

    def at(self, rung: int) -> _Rung:
        if rung not in self._made:
            given = self.given.laws
            laws = tuple(one for law in given for one in _on(law, rung, given))
            columns, fit = fit_nominal(self.data, replace(self.given, laws=laws))
            done = refine(Exact.start(columns, fit), self.data, fit.weight)
            self._made[rung] = _Rung(done, self.blocks)
        return self._made[rung]

    def chosen(self, law: Effect) -> int:
        """Return the rung of `law` with fewest terms that is not clearly worse than the best.

        The last is taken whatever is known of it.
        """
        last, row = len(plainer(law)), _row(law)
        able = [rung for rung in range(last) if not self._unclear(law, rung)] + [last]
        best = self.at(min(able, key=lambda rung: self.at(rung).power(row)))
        return max(rung for rung in able if not best.clearly_less(self.at(rung), row))

    def why(self, law: Effect, chosen: int) -> str:
        """Return what speaks against the law as given, and against others that were not taken."""
        first, *more = (self._unclear(law, rung) or _AS_LITTLE for rung in range(chosen))
        passed = [first]
        for names, why in zip(plainer(law), more, strict=False):
            if why != first:
                titles = ", ".join(find_effect(name).words.title for name in names)
                passed.append(f'of "{titles}": {why}')
        return "; ".join(passed)

    def laws_for(self, law: Effect, rung: int) -> list[Effect]:
        """Return the laws of a rung in their fitted shapes."""
        wanted = {(one.name, one.joint) for one in _on(law, rung, self.given.laws)}
        fitted = self.at(rung).done.model.columns.laws
        return [one for one in fitted if (one.name, one.joint) in wanted]

    def _unclear(self, law: Effect, rung: int) -> str:
        own, done = self.laws_for(law, rung), self.at(rung).done
        laws = enumerate(done.model.columns.laws)
        words = (unclear(done, place) for place, one in laws if one in own)
        return next(filter(None, words), "")


def _row(law: Effect) -> int:
    """Return its joint, from 0."""
    return (law.joint or 1) - 1


def _on(law: Effect, rung: int, laws: Sequence[Effect]) -> list[Effect]:
    """Return `law` with so many rungs fewer terms; a part that is there already is left out."""
    if not rung or not plainer(law):
        return [law]
    names = plainer(law)[min(rung, len(plainer(law))) - 1]
    there = {one.name for one in laws if one.joint == law.joint}
    return [find_effect(name)(joint=law.joint) for name in names if name not in there]


def unclear(done: Refined, place: int) -> str:
    """Return why the terms of law number `place` are not distinguished; empty where they are.

    Of each sharpness its logarithm has to be known, and two have to differ beyond their deviation
    √(C_aa + C_bb - 2 C_ab).
    """
    law = done.model.columns.laws[place]
    names = enumerate(done.names, len(done.model.beta))
    own = [(k, name) for k, (kind, which, name) in names if kind == 0 and which == place]
    if not own or not plainer(law):
        return ""
    covariance, values = done.covariance(), {name: float(getattr(law, name)) for _, name in own}
    turning = law.joint is None or done.model.columns.body.robot.revolute[law.joint - 1]
    units = {q.name: q.unit_at(turning) for q in law.parameters}
    std = {name: float(np.sqrt(max(covariance[k, k], 0.0))) for k, name in own}
    known = {name: _known(name, units[name], values[name], std[name]) for name in values}
    if vague := [known[name] for name in values if not 0.0 < std[name] < _CONFIG.vague]:
        return " and ".join(vague)
    for (i, one), (j, other) in pairwise(sorted(own, key=lambda pair: values[pair[1]])):
        variance = covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j]
        apart = float(np.sqrt(max(variance, 0.0)))
        if np.log(values[other] / values[one]) <= _CONFIG.sure * apart:
            return f"{known[other]} and {known[one]} may be one"
    return ""


def _known(name: str, unit: str, value: float, std: float) -> str:
    """Return a positive number, and how well it is known; `std` of its logarithm."""
    words = f"{name} = {value:.3g}"
    if 0.0 < std < _CONFIG.rough:
        return f"{words} ± {std * value:.1g} {unit}"
    if 0.0 < std < np.log(_CONFIG.wide):
        return f"{words} {unit} (known to a factor of {np.exp(std):.2g} only)"
    return f"{words} {unit} (not determined)"

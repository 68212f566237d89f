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
from itertools import pairwise

import numpy as np

from pipelines.effects import find_effect
from pipelines.effects.base import Effect, plainer
from pipelines.estimation.config import FitConfig
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.model_fit import Refined, refine, torque_gain_of
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.preparation import FewerTerms, Prepared
from pipelines.estimation.regression import Columns
from pipelines.estimation.rows import Data
from pipelines.io.log import Array

_CONFIG = FitConfig()
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
    before = None if prepared.reference is None else _Rungs(given, prepared.reference, blocks)
    laws, fewer = list[Effect](), list[FewerTerms]()
    for law in given.laws:
        if not plainer(law):
            laws.append(law)
            continue
        rungs = now if before is None or not _drives_as_much(before, now, law) else before
        rung = rungs.chosen(law)
        laws += rungs.laws_for(law, rung)
        if rung:
            why = rungs.unclear(law, 0) or _AS_LITTLE
            fewer.append(FewerTerms(law.joint, law.name, plainer(law)[rung - 1], why))
    return replace(prepared, columns=replace(given, laws=tuple(laws)), fewer=tuple(fewer))


def _drives_as_much(before: _Rungs, now: _Rungs, law: Effect) -> bool:
    """Return whether logs of the time before drive a joint about as long and as fast."""
    (many, fast), (many_now, fast_now) = (_driven(one.data, _row(law)) for one in (before, now))
    return 0 < many >= _CONFIG.long * many_now and fast >= _CONFIG.fast * fast_now


def _driven(data: Data, row: int) -> tuple[int, float]:
    """Return how many equations of a joint count, and its rms speed in them [rad/s]."""
    speeds = [one.at_rows(one.motion.dq[:, row])[one.weighed[row]] for one in data.logs]
    speed = np.concatenate(speeds)
    return len(speed), float(np.sqrt(np.mean(np.square(speed)))) if len(speed) else 0.0


@dataclass(frozen=True, eq=False)
class _Rungs:
    """Fits of all laws as given, then of each with fewer and fewer terms: each once it is used."""

    given: Columns
    data: Data
    blocks: int
    _made: dict[int, tuple[Refined, Array]] = field(default_factory=dict)

    def at(self, rung: int) -> tuple[Refined, Array]:
        """Return a fit, and the residual (rows,) [N m] of each block by the numbers of others."""
        if rung not in self._made:
            given = self.given.laws
            laws = tuple(one for law in given for one in _on(law, rung, given))
            columns, fit = fit_nominal(self.data, replace(self.given, laws=laws))
            done = refine(Exact.start(columns, fit), self.data, fit.weight)
            self._made[rung] = done, _left(done, self.blocks)
        return self._made[rung]

    def chosen(self, law: Effect) -> int:
        """Return the rung of `law` with fewest terms that is not clearly worse than the best.

        The last is taken whatever is known of it.
        """
        last, row = len(plainer(law)), _row(law)
        able = [rung for rung in range(last) if not self.unclear(law, rung)] + [last]
        best = min(able, key=lambda rung: self._power(rung, row))
        return max(rung for rung in able if not self._clearly_less(best, rung, row))

    def _power(self, rung: int, row: int) -> float:
        return float(self.data.power(self.at(rung)[1])[0][row])

    def _clearly_less(self, best: int, other: int, row: int) -> bool:
        """Return whether a rung leaves less than another: by a hundredth of the squares and beyond
        chance, or by a great part of them and a standard error.

        Beyond chance alone would leave a dip in the waves over the angle that it is added to: they
        make blocks differ far more than the law does.
        """
        less = self._power(best, row) / max(self._power(other, row), 1e-300)
        if less >= _CONFIG.worth:
            return False
        gain = torque_gain_of(self.data, self.at(other)[1], self.at(best)[1])
        by, high = float(gain.before[row] - gain.after[row]), float(gain.ci95[row][1])
        return high < 0.0 or (less < _CONFIG.much and 0.5 * (high + by) < by)

    def laws_for(self, law: Effect, rung: int) -> list[Effect]:
        """Return the laws of a rung in their fitted shapes."""
        wanted = {(one.name, one.joint) for one in _on(law, rung, self.given.laws)}
        fitted = self.at(rung)[0].model.columns.laws
        return [one for one in fitted if (one.name, one.joint) in wanted]

    def unclear(self, law: Effect, rung: int) -> str:
        """Return why terms of a law are not distinguished; empty where they are."""
        done, own = self.at(rung)[0], self.laws_for(law, rung)
        laws = enumerate(done.model.columns.laws)
        return next(filter(None, (unclear(done, k) for k, one in laws if one in own)), "")


def _left(done: Refined, blocks: int) -> Array:
    """Return the residual (rows,) [N m] of blocks of time, held out in turn, to first order."""
    table = done.slopes * done.weights
    size = np.linalg.norm(table, axis=1)
    unit = table / np.where(size > 0.0, size, 1.0)[:, None]
    left, gram, residual = np.empty(unit.shape[1]), unit @ unit.T, done.residual
    moment, ridge = unit @ residual, 1e-9 * np.eye(len(gram))
    place = done.data.blocks(blocks)
    for block in range(int(place.max()) + 1):
        held = place == block
        own = unit[:, held]
        rest = moment - own @ residual[held]
        left[held] = residual[held] - np.linalg.solve(gram - own @ own.T + ridge, rest) @ own
    return left / done.weights


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
    own = done.numbers_of(0, place)
    if not own or not plainer(law):
        return ""
    covariance, turning = done.covariance(), done.model.columns.body.robot.revolute
    turns = law.joint is None or turning[law.joint - 1]
    values, words, vague = {}, {}, []
    for k, name in own:
        value, std = float(getattr(law, name)), float(np.sqrt(max(covariance[k, k], 0.0)))
        unit = next(q.unit_at(turns) for q in law.parameters if q.name == name)
        values[name], words[name] = value, f"{name} = {value:.3g} {unit} (hardly determined)"
        if 0.0 < std < _CONFIG.rough:
            words[name] = f"{name} = {value:.3g} ± {std * value:.1g} {unit}"
        if not 0.0 < std < _CONFIG.vague:
            vague.append(words[name])
    if vague:
        return " and ".join(vague)
    for (i, one), (j, other) in pairwise(sorted(own, key=lambda pair: values[pair[1]])):
        variance = covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j]
        apart = float(np.sqrt(max(variance, 0.0)))
        if np.log(values[other] / values[one]) <= _CONFIG.sure * apart:
            return f"{words[other]} and {words[one]} may be one"
    return ""

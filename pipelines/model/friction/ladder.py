"""Choose among laws: each is fitted on some rows and judged on others; the simplest that is not measurably worse is taken.

The interval is that of the difference of two laws on the same rows: what is common to both, a cable that pulls or a noisy
minute, cancels. It is about the law, not about its numbers: labels may differ where curves agree, and
laws that these rows cannot tell apart are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.fit.varpro import held_out, linear_part
from pipelines.model.friction.equations import Equations
from pipelines.model.friction.fit_law import fit_law, takes_power
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import LADDER, Law, with_further
from pipelines.model.rigid.body import Array

__all__ = ["Judge", "Ladder", "LadderConfig", "Tried", "climb", "no_worse"]


@dataclass(frozen=True)
class LadderConfig:
    """Limits of a measurable difference between laws.

    Attributes:
        sure: standard errors of a difference, beyond which it is one: two-sided .05
        worth: of the mean square; a smaller difference does not count, however sure: half a per cent rms
        blocks: of the rows that judge, whose sums give a difference its deviation: 20 know it to a sixth
        folds: of the rows, each held out in turn (Kohavi 1995, IJCAI, p. 1137)
        further: causes beside the first
        more: of the residual (mean square), the least that each of these must explain
        hopeful: of them are fitted at a time, those that explain most to first order
    """

    sure: float = 2.0
    worth: float = 0.01
    blocks: int = 20
    folds: int = 10
    further: int = 2
    more: float = 0.1
    hopeful: int = 3


_CONFIG = LadderConfig()


@dataclass(frozen=True, eq=False)
class Tried:
    """One law, and how it did."""

    fit: LawFit
    identify_rms: float  # [N m] of mean torques
    validate_rms: float
    residual: Array  # (rows,) [N m] of the rows that judge
    reason: str = ""  # why it cannot be chosen; empty where it can

    @property
    def law(self) -> Law:
        return self.fit.law


@dataclass(frozen=True, eq=False)
class Ladder:
    """Every law that was tried, and the choice."""

    tried: tuple[Tried, ...]
    chosen: Tried
    best: Tried  # by the rows that judge
    by: str  # "logs" | "blocks"
    torque: float  # [N m] rms of what was measured in the rows that judge

    def alike(self, one: Tried) -> bool:
        """Not measurably worse than the best."""
        return not one.reason and no_worse(one.residual, self.best.residual)

    @property
    def alternatives(self) -> tuple[Tried, ...]:
        """Laws as simple as the chosen one, or nearly, that explain the fitted rows as well: nothing there speaks against them."""
        own = self.chosen.fit.found.residual
        return tuple(one for one in self.tried if one is not self.chosen and not one.reason
                     and no_worse(one.fit.found.residual, own) and one.law.size <= self.chosen.law.size + 1
                     and not set(self.chosen.law.members) <= set(one.law.members))


@dataclass(frozen=True, eq=False)
class Judge:
    """What laws are fitted to and judged by: other logs, or blocks of the same ones held out in turn."""

    identify: Equations
    validate: Equations | None

    @property
    def torque(self) -> float:
        """Root mean square of what was measured in the rows that judge [N m]."""
        return float(np.sqrt(np.mean(np.square((self.validate or self.identify).y))))

    def residual(self, fit: LawFit) -> Array:
        """What the law leaves (rows,) of rows that it was not fitted to [N m]."""
        return self.validate.predicted(fit).residual if self.validate is not None else _held_out(fit)

    def try_law(self, law: Law, start: Sequence[Array] | None = None, sharpness: float | None = None) -> Tried:
        fit = fit_law(self.identify, law, start, sharpness)
        residual = self.residual(fit)
        return Tried(fit, fit.found.rms, float(np.sqrt(np.mean(np.square(residual)))), residual,
                     _fault(fit, takes_power(self.identify, law, fit.joint, fit.found)))


def climb(judge: Judge, laws: Sequence[Law] = LADDER) -> Ladder:
    """Try `laws`, then further causes beside the best of them while they are measurably better."""
    tried: list[Tried] = []
    sharpness: float | None = None
    for law in laws:
        one = judge.try_law(law, None, sharpness if law.name != "coulomb+viscous" else None)
        tried.append(one)
        if law.name == "coulomb+viscous":
            sharpness = float(np.exp(one.fit.theta[0]))
    causes = [law.name for law in laws if len(law.members) > 2 and law.name in law.members]  # a law of several causes is none
    for _ in range(_CONFIG.further):
        best = _best(tried)
        if best.law.name in ("viscous", "coulomb", "coulomb+viscous"):
            break  # no single cause helps: two would be chance
        beside = [_beside(judge, best, cause) for cause in causes if cause not in best.law.members]
        gains = [_gain(judge, best, law, starts) for law, starts in beside]
        order = sorted(range(len(gains)), key=lambda k: -gains[k])
        hopeful = [k for k in order[:_CONFIG.hopeful] if gains[k] > 0.5 * _CONFIG.worth]
        more = [_worth(judge.try_law(*beside[k]), best) for k in hopeful]
        tried += more
        if not more or no_worse(best.residual, _best(tried).residual):
            break
    best = _best(tried)
    able = [one for one in tried if not one.reason and no_worse(one.residual, best.residual)]
    chosen = min(able or [best], key=lambda one: (one.law.size, one.validate_rms))
    return Ladder(tuple(tried), chosen, best, "logs" if judge.validate is not None else "blocks", judge.torque)


def _beside(judge: Judge, best: Tried, cause: str) -> tuple[Law, list[Array]]:
    """The law of `best` with one more cause, and where a search for it may begin: the new numbers on their grid."""
    law = with_further(best.law, cause)
    known = {place.name if place.name == "sharpness" else (place.effects, place.name): value
             for place, value in zip(best.law.places, best.fit.theta, strict=True)}
    starts: dict[bytes, Array] = {}
    for theta in law.starts(judge.identify.nodes, judge.identify.arms()[0], 1.0):
        begin = np.array([known.get(place.name if place.name == "sharpness" else (place.effects, place.name), value)
                          for place, value in zip(law.places, theta, strict=True)])
        starts[begin.tobytes()] = begin
    return law, list(starts.values())


def _worth(one: Tried, best: Tried) -> Tried:
    """A cause more has to explain a good part of what one cause leaves, or it is the model's own roughness that it explains."""
    if one.reason or one.validate_rms**2 < (1.0 - _CONFIG.more) * best.validate_rms**2:
        return one
    return replace(one, reason=f"explains too little beside {best.law.name}")


def _gain(judge: Judge, best: Tried, law: Law, starts: Sequence[Array]) -> float:
    """Share of what `best` leaves that the new columns of `law` explain: below `worth` it can never be told from `best`.

    To first order: what of each column lies outside everything that the fitted law can already do, ∂ŷ/∂(β, θ).
    """
    found = best.fit.found
    before = linear_part(found.jacobian, found.residual)
    arms = judge.identify.arms(found.beta)
    own = best.law.amplitudes
    gain = 0.0
    for theta in starts:
        more = judge.identify.build(law, arms, theta)[:, own:]
        after = linear_part(np.hstack([found.jacobian, more]), found.residual)
        gain = max(gain, before.rss - after.rss)
    return gain / before.rss if before.rss > 0.0 else 0.0


def _best(tried: Sequence[Tried]) -> Tried:
    able = [one for one in tried if not one.reason]
    return min(able or list(tried), key=lambda one: one.validate_rms)


def no_worse(one: Array, best: Array) -> bool:
    """Return whether residuals are not measurably larger than the best law's.

    Σ r² - Σ b² = Σ δ² + 2 Σ δ b with δ = r - b. Where the best law is right, b is noise, and the last sum is what chance
    does to the difference. Its deviation comes from sums over blocks, within which noise may remember itself.
    """
    apart = one - best
    chance = np.array([part.sum() for part in np.array_split(2.0 * apart * best, min(_CONFIG.blocks, len(best)))])
    difference = float(one @ one - best @ best)
    return difference <= max(_CONFIG.sure * float(np.sqrt(chance @ chance)), _CONFIG.worth * float(best @ best))


def _held_out(fit: LawFit) -> Array:
    """The residual of every block of rows as the other blocks would have it.

    By the first order of the law about the whole fit; a number on its bound does not move.
    """
    found = fit.found
    free = np.append(np.ones(len(found.beta), dtype=bool), ~np.array(found.at_bound, dtype=bool))
    part = linear_part(found.jacobian[:, free], found.residual)
    blocks = np.arange(len(found.residual)) * _CONFIG.folds // len(found.residual)
    return held_out(part.columns @ part.root, found.residual, blocks)


def _fault(fit: LawFit, takes: bool) -> str:
    """Why a law cannot be chosen: a number that its cause cannot have, or a curve that gives power back at some speed.

    Numbers that the rows hardly show are no fault: a law that has too many of them judges no better than a simpler one.
    """
    below = [number.name for number in fit.numbers if number.low >= 0.0 and number.value < number.low - _CONFIG.sure * number.std]
    if below:
        return f"{', '.join(below)} would be negative"
    for effect in fit.law.effects[2:]:  # what the law has beyond Coulomb and viscous friction
        own = {f"{effect.name}.{q.name}" for q in effect.parameters if not q.shape}
        numbers = [number for number in fit.numbers if number.name in own]
        if all(abs(number.value) <= _CONFIG.sure * number.std for number in numbers):
            return f"{', '.join(number.name for number in numbers)} may be zero"
    return "" if takes else "its curve would push at speeds that are not in these logs"

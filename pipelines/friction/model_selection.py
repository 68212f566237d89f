"""Choose among friction laws: the simplest that is not measurably worse than the best.

Each law is fitted on some rows and judged on others: other logs, or blocks of the same ones held
out in turn. The interval is that of the difference of two laws on the same rows: what is common to
both, a cable that pulls or a noisy minute, cancels. It is about the law, not about its numbers:
labels may differ where curves agree.

An alternative explains the rows that were fitted as well as the chosen law. It may be as good on
those held out, or measurably worse: then these are evidence for the chosen law, but they are the
same few rows, and another day may fall out otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.effects import find_effect
from pipelines.estimation.nominal import plain_number
from pipelines.estimation.varpro import held_out, linear_part
from pipelines.friction.config import LadderConfig
from pipelines.friction.fit import Equations, LawFit, fit_law, takes_power
from pipelines.friction.laws import LADDER, Law, with_further

__all__ = ["CandidateFit", "Ladder", "Missing", "climb", "no_worse", "undecided"]


_CONFIG = LadderConfig()


@dataclass(frozen=True, eq=False)
class CandidateFit:
    """One law, and how it did."""

    fit: LawFit
    residual: Array  # (rows,) [N m] of the rows that judge
    reason: str = ""  # why it cannot be chosen; empty where it can

    @property
    def law(self) -> Law:
        return self.fit.law

    @property
    def validate_rms(self) -> float:
        """Return the rms of `residual` [N m]."""
        return float(np.sqrt(np.mean(np.square(self.residual))))


@dataclass(frozen=True, eq=False)
class Ladder:
    """Every law that was tried, and the choice."""

    tried: tuple[CandidateFit, ...]
    chosen: CandidateFit
    best: CandidateFit  # by the rows that judge
    by: str  # "logs" | "blocks"
    torque: float  # [N m] rms of what was measured in the rows that judge

    def alike(self, candidate: CandidateFit) -> bool:
        """Return whether it is not measurably worse than the best."""
        return not candidate.reason and no_worse(candidate.residual, self.best.residual)

    @property
    def alternatives(self) -> tuple[CandidateFit, ...]:
        """Return other laws, nearly as simple as the chosen one, that fit as well."""
        own, members = self.chosen.fit.found.residual, set(self.chosen.law.members)
        return tuple(other for other in self.tried if other is not self.chosen and not other.reason
                     and no_worse(other.fit.found.residual, own)
                     and other.law.size <= self.chosen.law.size + 1
                     and not members <= set(other.law.members))


def climb(identify: Equations, validate: Equations | None,
          laws: Sequence[Law] = LADDER) -> Ladder:
    """Try `laws`, then further causes with the best of them while they are measurably better.

    Args:
        identify: rows that laws are fitted to.
        validate: rows that judge them; None: blocks of the same rows, held out in turn.
    """
    tried: list[CandidateFit] = []
    sharpness: float | None = None
    for law in laws:
        tried.append(_try(identify, validate, law, None, sharpness))
        if law.name == "coulomb+viscous":
            sharpness = float(np.exp(tried[-1].fit.theta[0]))
    # a law of several causes is no cause
    causes = [law.name for law in laws if law.members[2:] and law.name in law.members]
    for _ in range(_CONFIG.further):
        best = _best(tried)
        if best.law.name in ("viscous", "coulomb", "coulomb+viscous"):
            break  # no single cause helps: two would be chance
        wider = [_widened(identify, best, cause) for cause in causes
                 if cause not in best.law.members]
        gains = [_gain(identify, best, law, starts) for law, starts in wider]
        order = sorted(range(len(gains)), key=lambda k: -gains[k])
        hopeful = [k for k in order[:_CONFIG.hopeful] if gains[k] > 0.5 * _CONFIG.worth]
        more = [_try(identify, validate, *wider[k]) for k in hopeful]
        least = (1.0 - _CONFIG.more) * best.validate_rms**2
        tried += [one if one.reason or one.validate_rms**2 < least else
                  replace(one, reason=f"explains too little beside {best.law.name}")
                  for one in more]  # it may explain the roughness of the model itself
        if not more or no_worse(best.residual, _best(tried).residual):
            break
    best = _best(tried)
    able = [one for one in tried if not one.reason and no_worse(one.residual, best.residual)]
    chosen = min(able or [best], key=lambda one: (one.law.size, one.validate_rms))
    torque = float(np.sqrt(np.mean(np.square((validate or identify).y))))
    return Ladder(tuple(tried), chosen, best, "blocks" if validate is None else "logs", torque)


def _try(identify: Equations, validate: Equations | None, law: Law,
         starts: Sequence[Array] | None, sharpness: float | None = None) -> CandidateFit:
    fit = fit_law(identify, law, starts, sharpness)
    residual = _held_out(fit) if validate is None else validate.residual(fit)
    takes = takes_power(identify, law, fit.joint, fit.found)
    return CandidateFit(fit, residual, _fault(fit, takes))


def _best(tried: Sequence[CandidateFit]) -> CandidateFit:
    able = [one for one in tried if not one.reason]
    return min(able or tried, key=lambda one: one.validate_rms)


def _widened(identify: Equations, best: CandidateFit, cause: str) -> tuple[Law, list[Array]]:
    """Return the law of `best` with one more cause, and θ to start from: new numbers by grid."""
    law = with_further(best.law, cause)

    def keys(law: Law) -> list[object]:
        return [number.name if number.name == "sharpness" else (number.effects, number.name)
                for number in law.nonlinear]

    known = dict(zip(keys(best.law), best.fit.theta, strict=True))
    starts: dict[bytes, Array] = {}
    for theta in law.starts(identify.nodes, identify.arms()[0], 1.0):
        begin = np.array([known.get(key, value)
                          for key, value in zip(keys(law), theta, strict=True)])
        starts[begin.tobytes()] = begin
    return law, list(starts.values())


def _gain(identify: Equations, best: CandidateFit, law: Law, starts: Sequence[Array]) -> float:
    """Return the share of the residual of `best` that the new columns of `law` explain.

    To first order: what of each column lies outside everything that the fitted law can already do,
    ∂ŷ/∂(β, θ). Below `worth` the two laws are not distinguishable.
    """
    found = best.fit.found
    before = linear_part(found.jacobian, found.residual)
    arms, gain = identify.arms(found.beta), 0.0
    for theta in starts:
        more = identify.law_columns(law, arms, theta)[:, best.law.amplitudes:]
        after = linear_part(np.hstack([found.jacobian, more]), found.residual)
        gain = max(gain, before.rss - after.rss)
    return gain / before.rss if before.rss > 0.0 else 0.0


def no_worse(residual: Array, best: Array) -> bool:
    """Return whether residuals are not measurably larger than the best law's (rows,).

    Σ r² - Σ b² = Σ δ² + 2 Σ δ b with δ = r - b. Where the best law is right, b is noise, and the
    last sum is what chance does to the difference. Its deviation comes from sums over blocks,
    within which noise may remember itself.
    """
    blocks = min(_CONFIG.blocks, len(best))
    sums = np.array([part.sum() for part in np.array_split(2.0 * (residual - best) * best, blocks)])
    difference = float(residual @ residual - best @ best)
    chance = _CONFIG.sure * float(np.sqrt(sums @ sums))
    return difference <= max(chance, _CONFIG.worth * float(best @ best))


def _held_out(fit: LawFit) -> Array:
    """Return the residual of every block of rows as the other blocks predict it (rows,) [N m].

    By the first order of the law about the whole fit; a number on its bound does not move.
    """
    found = fit.found
    free = np.append(np.ones(len(found.beta), dtype=bool), ~np.array(found.at_bound, dtype=bool))
    part = linear_part(found.jacobian[:, free], found.residual)
    blocks = np.arange(len(found.residual)) * _CONFIG.folds // len(found.residual)
    return held_out(part.columns @ part.root, found.residual, blocks)


def _fault(fit: LawFit, takes: bool) -> str:
    """Return why a law cannot be chosen; empty where it can.

    A number that its cause cannot have, or a curve that gives power back at some speed. Numbers
    that the rows hardly show are no fault: a law with too many of them judges no better than a
    simpler one.
    """
    below = [number.name for number in fit.numbers
             if number.low >= 0.0 and number.value < number.low - _CONFIG.sure * number.std]
    if below:
        return f"{', '.join(below)} would be negative"
    for effect in fit.law.effects[2:]:  # what the law has beyond Coulomb and viscous friction
        own = {f"{effect.name}.{q.name}" for q in effect.parameters if not q.shape}
        numbers = [number for number in fit.numbers if number.name in own]
        if all(abs(number.value) <= _CONFIG.sure * number.std for number in numbers):
            return f"{', '.join(number.name for number in numbers)} may be zero"
    return "" if takes else "its curve would push at speeds that are not in these logs"


@dataclass(frozen=True)
class Missing:
    """Something these logs do not show, and what to record."""

    what: str
    record: str


def undecided(ladder: Ladder, slowest: float, fastest: float) -> tuple[Missing, ...]:
    """Return every alternative, how far its curve lies from the chosen one, and what to record.

    Args:
        slowest, fastest: speeds that were driven [rad/s].
    """
    side = np.geomspace(max(slowest, 1e-3 * fastest), fastest, _CONFIG.points)
    speed = np.concatenate([-side[::-1], side])
    chosen, found = ladder.chosen, []
    curve, (torque, unit, _) = chosen.fit.curve(speed), chosen.fit.joint.units
    for other in ladder.alternatives:
        apart = np.abs(curve - other.fit.curve(speed))
        most = int(np.argmax(apart))
        why = "nothing tells them apart, and the first has no more numbers"
        if not ladder.alike(other):
            why = "only the held-out rows speak against the second"
        elif chosen.law.size > other.law.size:
            why = "nothing tells them apart, and the first leaves a little less of held-out rows"
        found.append(Missing(
            f"{chosen.law.title} or {other.law.title}: {why}, {chosen.law.size} numbers against "
            f"{other.law.size}; the curves differ by at most {plain_number(float(apart[most]))} "
            f"{torque}, at {plain_number(abs(float(speed[most])))} {unit}",
            find_effect(other.law.members[-1]).words.experiment))
    return tuple(found)

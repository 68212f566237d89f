"""Choose among friction laws: the simplest that is not measurably worse than the best.

Each law is fitted on some rows and judged on others: other logs, or blocks of the same ones held
out in turn. The interval is that of the difference of two laws on the same rows: what is common to
both, a cable that pulls or a noisy minute, cancels. It is about the law, not about its numbers:
labels may differ where curves agree.

Seven to ten speeds over two decades in both directions show a friction curve; standing still shows
an offset apart from friction that is larger one way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.effects import find_effect
from pipelines.estimation.nominal import plain_number
from pipelines.estimation.varpro import held_out, linear_part
from pipelines.friction.config import FRICTION
from pipelines.friction.fit import Equations, LawFit, fit_law, takes_power
from pipelines.friction.laws import LADDER, Law
from pipelines.friction.weak_form import Mask, Stretch

__all__ = ["CandidateFit", "Coverage", "Ladder", "Missing", "climb", "coverage", "undecided"]
__all__ += ["unseen"]

_DRIVE = (
    "drive the joint alone at 7 to 10 constant speeds over two decades, in both directions, "
    "with ramps from rest"
)


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

    @property
    def torque_error(self) -> float | None:
        """Return the residual of the chosen law over the torque, in the rows that judge."""
        return self.chosen.validate_rms / self.torque if self.torque > 0.0 else None

    def alike(self, candidate: CandidateFit) -> bool:
        """Return whether it is not measurably worse than the best."""
        return not candidate.reason and _no_worse(candidate.residual, self.best.residual)

    @property
    def alternatives(self) -> tuple[CandidateFit, ...]:
        """Return other laws, nearly as simple as the chosen one, that fit the same rows as well."""
        chosen, found = self.chosen, []
        for other in self.tried:
            wider = set(chosen.law.members) <= set(other.law.members)
            plain = not wider and not other.reason and other.law.size <= chosen.law.size + 1
            if plain and _no_worse(other.fit.found.residual, chosen.fit.found.residual):
                found.append(other)
        return tuple(found)


def climb(
    identify: Equations,
    validate: Equations | None,
    laws: Sequence[Law] = LADDER,
    flexible: Array | None = None,
) -> Ladder:
    """Try `laws`; the last one of the ladder must explain a tenth more than the best before it.

    Args:
        identify: rows that laws are fitted to.
        validate: rows that judge them; None: blocks of the same rows, held out in turn.
        flexible: θ that the last law of the ladder starts from.
    """
    tried: list[CandidateFit] = []
    sharpness: float | None = None
    for law in laws:
        starts = [flexible] if law is LADDER[-1] and flexible is not None else None
        fit = fit_law(identify, law, starts, sharpness)
        residual = _held_out(fit) if validate is None else validate.residual(fit)
        reason = _fault(fit, takes_power(identify, law, fit.joint, fit.found))
        one = CandidateFit(fit, residual, reason)
        if law is LADDER[-1] and (able := [x for x in tried if not x.reason]):
            best = min(able, key=lambda x: x.validate_rms)
            if one.validate_rms**2 >= (1.0 - FRICTION.more) * best.validate_rms**2:
                one = replace(one, reason=f"explains too little beside {best.law.name}")
        tried.append(one)
        if law.name == "coulomb+viscous":
            sharpness = float(np.exp(fit.theta[0]))
    possible = [one for one in tried if not one.reason] or tried
    best = min(possible, key=lambda one: one.validate_rms)
    alike = [one for one in possible if _no_worse(one.residual, best.residual)]
    chosen = min(alike, key=lambda one: (one.law.size, one.validate_rms))
    torque = float(np.sqrt(np.mean(np.square((validate or identify).y))))
    return Ladder(tuple(tried), chosen, best, "blocks" if validate is None else "logs", torque)


def _no_worse(residual: Array, best: Array) -> bool:
    """Return whether residuals are not measurably larger than the best law's (rows,).

    Σ r² - Σ b² = Σ δ² + 2 Σ δ b with δ = r - b. Where the best law is right, b is noise, and the
    last sum is what chance does to the difference. Its deviation comes from sums over blocks,
    within which noise may remember itself.
    """
    parts = np.array_split(2.0 * (residual - best) * best, min(FRICTION.blocks, len(best)))
    difference = float(residual @ residual - best @ best)
    chance = FRICTION.sure * float(np.linalg.norm([part.sum() for part in parts]))
    return difference <= max(chance, FRICTION.worth * float(best @ best))


def _held_out(fit: LawFit) -> Array:
    """Return the residual of every block of rows as the other blocks predict it (rows,) [N m].

    By the first order of the law about the whole fit; a number on its bound does not move.
    """
    found = fit.found
    free = np.append(np.ones(len(found.beta), dtype=bool), ~np.array(found.at_bound, dtype=bool))
    part = linear_part(found.jacobian[:, free], found.residual)
    blocks = np.arange(len(found.residual)) * FRICTION.folds // len(found.residual)
    return held_out(part.columns @ part.root, found.residual, blocks)


def _fault(fit: LawFit, takes: bool) -> str:
    """Return why a law cannot be chosen; empty where it can.

    A number that its cause cannot have, or a curve that gives power back at some speed. Numbers
    that the rows hardly show are no fault: a law with too many of them judges no better than a
    simpler one.
    """
    below = [
        number.name
        for number in fit.numbers
        if number.low >= 0.0 and number.value < number.low - FRICTION.sure * number.std
    ]
    if below:
        return f"{', '.join(below)} would be negative"
    for effect in fit.law.effects[2:]:  # what the law has beyond Coulomb and viscous friction
        own = {f"{effect.name}.{q.name}" for q in effect.parameters if not q.shape}
        numbers = [number for number in fit.numbers if number.name in own]
        if all(abs(number.value) <= FRICTION.sure * number.std for number in numbers):
            return f"{', '.join(number.name for number in numbers)} may be zero"
    return "" if takes else "its curve would push at speeds that are not in these logs"


@dataclass(frozen=True)
class Missing:
    """Something these logs do not show, and what to record."""

    what: str
    record: str


@dataclass(frozen=True)
class Coverage:
    """Speeds that were driven."""

    fastest: float  # [rad/s]
    slowest: float  # [rad/s] of the classes that are filled
    forth: int  # classes of speed, five a decade, that were driven in the positive direction
    back: int


def coverage(stretches: Sequence[Stretch]) -> Coverage:
    """Return the speeds at which there are rows enough."""
    v = np.concatenate([stretch.middle[0] for stretch in stretches])
    fastest = max(float(np.abs(v).max()), 1e-12)
    size = np.maximum(np.abs(v), 1e-12 * fastest) / fastest
    level = np.floor(FRICTION.classes * np.log10(size) + 1e-9)

    def filled(side: Mask) -> Array:
        levels, count = np.unique(level[side], return_counts=True)
        return levels[(count >= FRICTION.filled) & (levels > -3 * FRICTION.classes)]

    forth, back = filled(v > 0.0), filled(v < 0.0)
    lowest = min((float(side[0]) for side in (forth, back) if side.size), default=0.0)
    slowest = fastest * 10.0 ** (lowest / FRICTION.classes)
    return Coverage(fastest, slowest, len(forth), len(back))


def unseen(covered: Coverage, ladder: Ladder) -> tuple[Missing, ...]:
    """Return gaps of the record, numbers hardly known, and laws that are not distinguishable."""
    gaps, decades = [], float(np.log10(covered.fastest / covered.slowest))
    if not (covered.forth and covered.back):
        way = "negative" if covered.forth else "positive"
        gaps.append(
            f"the joint never moves in the {way} direction: Coulomb friction is confounded with an "
            "offset"
        )
    elif min(covered.forth, covered.back) < FRICTION.speeds or decades < FRICTION.decades:
        gaps.append(
            f"speeds cover {decades:.1f} decades, {covered.forth} steps of five a decade forth and "
            f"{covered.back} back"
        )
    vague = []
    for number in ladder.chosen.fit.numbers:
        if not number.known or number.std > FRICTION.doubtful * abs(number.value):
            effect, _, quantity = number.name.partition(".")
            vague.append(f"{find_effect(effect).words.title}, {quantity.replace('_', ' ')}")
    if vague:
        gaps.append(f"hardly known: {'; '.join(vague)}")
    laws = undecided(ladder, covered.slowest, covered.fastest)
    return (*(Missing(gap, _DRIVE) for gap in gaps), *laws)


def undecided(ladder: Ladder, slowest: float, fastest: float) -> tuple[Missing, ...]:
    """Return every alternative, how far its curve lies from the chosen one, and what to record.

    An alternative explains the rows that were fitted as well as the chosen law. It may be as good
    on those held out, or measurably worse: then these are evidence for the chosen law, but they are
    the same few rows, and another day may fall out otherwise.

    Args:
        slowest, fastest: speeds that were driven [rad/s].
    """
    side = np.geomspace(max(slowest, 1e-3 * fastest), fastest, FRICTION.points)
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
        words = (
            f"{chosen.law.title} or {other.law.title}: {why}, {chosen.law.size} numbers against "
            f"{other.law.size}; the curves differ by at most {plain_number(float(apart[most]))} "
            f"{torque}, at {plain_number(abs(float(speed[most])))} {unit}"
        )
        found.append(Missing(words, find_effect(other.law.members[-1]).words.experiment))
    return tuple(found)

"""What the friction logs of a joint cover, what therefore cannot be seen, and what to record.

Seven to ten speeds over two decades in both directions show a friction curve; standing still shows an offset apart from
friction that is larger one way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.model.effects import find_effect
from pipelines.model.friction.ladder import Ladder
from pipelines.model.friction.undecided import undecided
from pipelines.model.friction.weak_form import Stretch

__all__ = ["Coverage", "Unseen", "coverage", "unseen"]

_CLASSES = 5  # of speed, a decade
_ENOUGH = 5  # rows in a class
_DECADES, _SPEEDS = 1.6, 7
_STILL = 2e-3  # of the fastest speed
_VAGUE = 0.5  # of a value, its standard deviation: hardly known
_WORDS = "drive the joint alone at 7 to 10 constant speeds over two decades, in both directions, with ramps from rest"


@dataclass(frozen=True)
class Coverage:
    """Speeds that were driven."""

    fastest: float  # [rad/s]
    slowest: float  # [rad/s] of the classes that are filled
    forth: int  # classes of speed, five a decade, that were driven in the positive direction
    back: int
    rest: float  # [s] of standing still

    @property
    def decades(self) -> float:
        return float(np.log10(self.fastest / self.slowest)) if self.slowest > 0.0 else 0.0


@dataclass(frozen=True)
class Unseen:
    """Something these logs do not show, and what would."""

    what: str
    record: str


def coverage(stretches: Sequence[Stretch]) -> Coverage:
    v = np.concatenate([stretch.middle[1] for stretch in stretches])
    seconds = float(np.mean([stretch.length.mean() for stretch in stretches]))
    fastest = max(float(np.abs(v).max()), 1e-12)
    level = np.floor(_CLASSES * np.log10(np.maximum(np.abs(v), 1e-12 * fastest) / fastest) + 1e-9)
    filled = {side: [int(k) for k in np.unique(level) if np.sum((level == k) & (side * v > 0.0)) >= _ENOUGH and k > -3 * _CLASSES]
              for side in (1, -1)}
    lowest = min((min(found) for found in filled.values() if found), default=0)
    rest = seconds * float(np.sum(np.abs(v) < _STILL * fastest))
    return Coverage(fastest, fastest * 10.0 ** (lowest / _CLASSES), len(filled[1]), len(filled[-1]), rest)


def unseen(covered: Coverage, ladder: Ladder) -> tuple[Unseen, ...]:
    """Gaps of the record, numbers that are hardly known, and laws that are not told apart."""
    found = []
    if not (covered.forth and covered.back):
        way = "negative" if covered.forth else "positive"
        found.append(Unseen(f"the joint never moves in the {way} direction: Coulomb friction is confounded with an offset", _WORDS))
    elif min(covered.forth, covered.back) < _SPEEDS or covered.decades < _DECADES:
        found.append(Unseen(f"speeds cover {covered.decades:.1f} decades, {covered.forth} steps of five a decade forth and "
                            f"{covered.back} back", _WORDS))
    vague = [_in_words(number.name) for number in ladder.chosen.fit.numbers
             if not number.known or number.std > _VAGUE * abs(number.value)]
    if vague:
        found.append(Unseen(f"hardly known: {'; '.join(vague)}", _WORDS))
    return (*found, *(Unseen(*words) for words in undecided(ladder, covered.slowest, covered.fastest, alone=True)))


def _in_words(number: str) -> str:
    """"Stribeck friction, amplitude" for "stribeck.amplitude"."""
    effect, _, quantity = number.partition(".")
    return f"{find_effect(effect).words.title}, {quantity.replace('_', ' ')}"

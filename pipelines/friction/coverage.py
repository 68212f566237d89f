"""Find what speeds the logs cover, and what they leave open.

Seven to ten speeds over two decades in both directions show a friction curve; standing still shows
an offset apart from friction that is larger one way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.effects import find_effect
from pipelines.friction.config import SpeedConfig
from pipelines.friction.model_selection import Ladder, Missing, undecided
from pipelines.friction.weak_form import Mask, Stretch

__all__ = ["Coverage", "coverage", "unseen"]

_DRIVE = ("drive the joint alone at 7 to 10 constant speeds over two decades, in both directions, "
          "with ramps from rest")


_CONFIG = SpeedConfig()


@dataclass(frozen=True)
class Coverage:
    """Speeds that were driven."""

    fastest: float  # [rad/s]
    slowest: float  # [rad/s] of the classes that are filled
    forth: int  # classes of speed, five a decade, that were driven in the positive direction
    back: int

    @property
    def decades(self) -> float:
        return float(np.log10(self.fastest / self.slowest)) if self.slowest > 0.0 else 0.0


def coverage(stretches: Sequence[Stretch]) -> Coverage:
    v = np.concatenate([stretch.middle[1] for stretch in stretches])
    fastest = max(float(np.abs(v).max()), 1e-12)
    size = np.maximum(np.abs(v), 1e-12 * fastest) / fastest
    level = np.floor(_CONFIG.classes * np.log10(size) + 1e-9)

    def filled(side: Mask) -> Array:
        levels, count = np.unique(level[side], return_counts=True)
        return levels[(count >= _CONFIG.enough) & (levels > -3 * _CONFIG.classes)]

    forth, back = filled(v > 0.0), filled(v < 0.0)
    lowest = min((float(side[0]) for side in (forth, back) if side.size), default=0.0)
    slowest = fastest * 10.0 ** (lowest / _CONFIG.classes)
    return Coverage(fastest, slowest, len(forth), len(back))


def unseen(covered: Coverage, ladder: Ladder) -> tuple[Missing, ...]:
    """Return gaps of the record, numbers hardly known, and laws that are not distinguishable."""
    gaps = []
    if not (covered.forth and covered.back):
        way = "negative" if covered.forth else "positive"
        gaps.append(f"the joint never moves in the {way} direction: Coulomb friction is "
                    "confounded with an offset")
    elif min(covered.forth, covered.back) < _CONFIG.speeds or covered.decades < _CONFIG.decades:
        gaps.append(f"speeds cover {covered.decades:.1f} decades, {covered.forth} steps of five a "
                    f"decade forth and {covered.back} back")
    vague = [number.name.partition(".") for number in ladder.chosen.fit.numbers
             if not number.known or number.std > _CONFIG.vague * abs(number.value)]
    if vague:
        words = [f"{find_effect(effect).words.title}, {quantity.replace('_', ' ')}"
                 for effect, _, quantity in vague]
        gaps.append(f"hardly known: {'; '.join(words)}")
    laws = undecided(ladder, covered.slowest, covered.fastest)
    return (*(Missing(gap, _DRIVE) for gap in gaps), *laws)

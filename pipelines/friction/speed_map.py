"""Show what speeds the logs cover, and friction at these without any law.

The friction map takes torque at equal position and opposite speed in pairs:

    ½ (τ(q, v) - τ(q, -v))     odd in speed: friction
    ½ (τ(q, v) + τ(q, -v))     even: gravity, offsets, all that does not turn with the motion

What acceleration takes, J ddq and the sway of held joints, is subtracted first. Nothing is assumed
of friction: the points are a test of the fitted curve that did not depend on it.

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
from pipelines.friction.fit import LawFit
from pipelines.friction.model_selection import Ladder, Missing, undecided
from pipelines.friction.weak_form import Mask, Stretch

__all__ = ["Coverage", "coverage", "speed_map", "unseen"]

_DRIVE = ("drive the joint alone at 7 to 10 constant speeds over two decades, in both directions, "
          "with ramps from rest")


_CONFIG = SpeedConfig()


def speed_map(stretches: Sequence[Stretch], fit: LawFit) -> Array:
    """Return a point for every class of speed that was driven both ways at one place (4, points).

    Speed [rad/s], mean of the pairs; odd part [N m], its standard deviation, and even part.
    """
    parts = []
    for stretch in stretches:
        arm, coupling = fit.at(stretch)
        rigid, (q, v, _) = stretch.rigid, stretch.middle
        torque = (stretch.torque - arm.inertia * rigid[:, 0]
                  - rigid[:, rigid.shape[1] - len(coupling):] @ coupling)
        parts.append((q, v, torque, np.full(len(q), fit.posture_of(stretch))))
    q, v, torque, posture = map(np.concatenate, zip(*parts, strict=True))
    fastest = float(np.abs(v).max(initial=0.0))
    moving = np.abs(v) > max(_CONFIG.slowest * fastest, 1e-12)
    q, v, torque, posture = q[moving], v[moving], torque[moving], posture[moving]
    turn = 2.0 * np.pi if fit.joint.revolute else max(float(np.ptp(q)) if q.size else 1.0, 1e-9)
    place = np.floor(q / (turn / _CONFIG.places)).astype(np.intp) + posture * 10**6
    level = np.floor(_CONFIG.classes * np.log10(np.abs(v) / max(fastest, 1e-12)))
    points = [_point(place[rows], v[rows], torque[rows])
              for rows in (level == each for each in np.unique(level))]
    known = [point for point in points if point is not None]
    return np.array(known, dtype=np.float64).reshape(-1, 4).T


def _point(place: Array, v: Array, torque: Array) -> tuple[float, ...] | None:
    """Return mean speed, odd part, its deviation and even part over the places of one class."""
    pairs = []
    for here in (place == each for each in np.unique(place)):
        forth, back = here & (v > 0.0), here & (v < 0.0)
        if forth.any() and back.any():
            pairs.append((v[forth].mean(), v[back].mean(),
                          torque[forth].mean(), torque[back].mean()))
    if len(pairs) < _CONFIG.fewest:
        return None
    ahead, behind, a, b = np.array(pairs).T
    odd = 0.5 * (a - b)
    std = np.std(odd, ddof=1) / np.sqrt(len(odd))
    return (float(np.mean(0.5 * (ahead - behind))), float(np.mean(odd)), float(std),
            float(np.mean(0.5 * (a + b))))


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

"""Laws that the chosen one is not told from, why it was chosen all the same, and what the choice changes.

What is chosen is the simplest law that is not measurably worse than the best on rows that were held out (ladder.py). An alternative
explains the rows that were fitted as well. It may have been as good on those held out, or measurably worse: then these speak
for the chosen law, but they are the same few rows, and another day may fall out otherwise.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.effects import find_effect
from pipelines.model.friction.ladder import Ladder, Tried
from pipelines.model.rigid.body import Array
from pipelines.model.words import plain_number

__all__ = ["undecided"]

_POINTS = 60  # speeds each way


def undecided(ladder: Ladder, slowest: float, fastest: float, alone: bool) -> tuple[tuple[str, str], ...]:
    """Of every alternative: what is undecided, and what to record.

    Args:
        slowest, fastest: speeds that were driven [rad/s].
        alone: whether the joint was driven alone, so that the first of a fit's rigid numbers is its inertia.
    """
    side = np.geomspace(max(slowest, 1e-3 * fastest), fastest, _POINTS)
    speed = np.concatenate([-side[::-1], side])
    return tuple((f"{ladder.chosen.law.title} or {alternative.law.title}: {_why(ladder, alternative)}; "
                  f"{_apart(ladder.chosen, alternative, speed, alone)}", find_effect(alternative.law.members[-1]).words.experiment)
                 for alternative in ladder.alternatives)


def _why(ladder: Ladder, alternative: Tried) -> str:
    """What speaks for the chosen law."""
    chosen = ladder.chosen
    sizes = f"{chosen.law.size} numbers against {alternative.law.size}"
    held_out = "held-out logs" if ladder.by == "logs" else "held-out blocks"
    if not ladder.alike(alternative):
        best = ladder.best  # what chance was asked of, ladder.py
        more = plain_number(100.0 * (alternative.validate_rms / best.validate_rms - 1.0))
        than = "" if best is chosen else f" than {best.law.title}, the best of all"
        return (f"of what was fitted both leave as much; the first, {sizes}, is taken because of the {held_out} the second leaves "
                f"{more} % more (rms){than}, which is more than chance")
    if chosen.law.size < alternative.law.size:
        return f"nothing tells them apart, and the first is taken for it is plainer, {sizes}"
    return f"nothing tells them apart, and the first, {sizes}, is taken for it leaves a little less of the {held_out}"


def _apart(chosen: Tried, alternative: Tried, speed: Array, alone: bool) -> str:
    """How far their curves lie apart at most over the speeds that were driven, and their inertias."""
    one, other = chosen.fit.curve(speed), alternative.fit.curve(speed)
    most = int(np.argmax(np.abs(one - other)))
    torque, rate, inertia = ("N m", "rad/s", "kg m²") if chosen.fit.joint.revolute else ("N", "m/s", "kg")
    share = 100.0 * abs(float(one[most] - other[most])) / max(abs(float(one[most])), 1e-300)
    words = (f"what the choice changes: the curve by at most {plain_number(float(abs(one[most] - other[most])))} {torque}, at "
             f"{plain_number(float(abs(speed[most])))} {rate} ({plain_number(share)} % of the friction there)")
    if not alone:
        return words
    moved = abs(chosen.fit.inertia - alternative.fit.inertia)
    hidden = moved < float(chosen.fit.std[0])
    return f"{words}; the inertia by {'less than its uncertainty' if hidden else f'{plain_number(moved)} {inertia}'}"

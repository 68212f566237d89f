"""Orders of waves along a joint's angle that its travel tells apart.

    orders_along(travel, revolute)      waves in a turn; of a slide, in 2π metres
"""

from __future__ import annotations

import math

import numpy as np

__all__ = ["NEARLY", "orders_along"]

# Of a turn, that may be missing where whole orders are looked for. Stops leave many joints 330 or 340 degrees, which tell waves of
# neighbouring whole orders apart; a drive with 7, 12 and 28 waves, recorded over .95 of a turn, was taken for 6.8 and its like.
NEARLY = 0.1
_CLOSED = 0.02  # the same, where what a joint does comes back to where it began: `Effect.goes_round`
_WAVES = 1.5  # in the range travelled, at least: fewer are the curve of a spring (causes.md: a full turn tells them apart)
_HIGHEST = 150.0  # order that is searched for; of a slide: of its whole travel
_FINEST = 1000.0  # of a slide: a wave of 6 mm, as leads of screws have them; on more than a metre of travel the waves are longer
_MOST = 200  # orders on the grid
_LEAST = 1e-3  # [rad or m] of travel, that a grid is made for


def orders_along(travel: float, revolute: bool) -> list[float]:
    """From the fewest waves in `travel` [rad or m], in steps of half of what it can tell apart: whole ones over many turns.

    Where the joint closes its circle, or nearly, whole orders are among them, on a closed one from one on, for what comes back to
    where it began is no spring.
    """
    travel, turn = max(travel, _LEAST), 2.0 * math.pi
    fewest = _WAVES * turn / travel
    if revolute and travel > (1.0 - NEARLY) * turn:
        first = 1.0 if travel > (1.0 - _CLOSED) * turn else math.ceil(fewest)
        return list(np.arange(first, _HIGHEST, 0.5 if travel < 2.0 * turn else 1.0).tolist())
    lowest = max(1.0, fewest)
    # A slide's wave is counted in 2π metres, and its travel is what a turn is to a joint's.
    highest = max(_HIGHEST if revolute else float(np.clip(_HIGHEST * turn / travel, _HIGHEST, _FINEST)), 4.0 * lowest)
    return list(np.arange(lowest, highest, max(math.pi / travel, (highest - 1.0) / _MOST)).tolist())

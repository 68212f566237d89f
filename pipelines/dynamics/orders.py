"""Orders of waves along a joint's angle that its travel resolves.

    orders_along(travel, revolute)      waves in a turn; of a slide, in 2π metres
"""

from __future__ import annotations

import math

import numpy as np

from pipelines.dynamics.config import ORDERS

__all__ = ["orders_along"]


def orders_along(travel: float, revolute: bool) -> list[float]:
    """Return orders from the fewest waves in `travel` [rad or m], in half steps of what it tells.

    Over many turns whole ones. Where the joint closes its circle, or nearly, whole orders are among
    them, on a closed one from one on, for what comes back to where it began is no spring.
    """
    travel, turn = max(travel, ORDERS.least), 2.0 * math.pi
    fewest = ORDERS.waves * turn / travel
    if revolute and travel > (1.0 - ORDERS.nearly) * turn:
        first = 1.0 if travel > (1.0 - ORDERS.closed) * turn else math.ceil(fewest)
        step = 0.5 if travel < 2.0 * turn else 1.0
        return list(np.arange(first, ORDERS.highest, step).tolist())
    lowest, highest = max(1.0, fewest), ORDERS.highest
    if not revolute:  # its wave is counted in 2π metres, its travel is what a turn is to a joint
        highest = float(np.clip(ORDERS.highest * turn / travel, ORDERS.highest, ORDERS.finest))
    highest = max(highest, 4.0 * lowest)
    step = max(math.pi / travel, (highest - 1.0) / ORDERS.most)
    return list(np.arange(lowest, highest, step).tolist())

"""What shows in held-out logs alone: these fitted too, and blocks of time held out in their place.

    alone = only_held_out(fitted, floor, held, own)     a joint is far off in those held out, none in those fitted
    found = … fitted_too(logs) …                        the same question of all of them
    named = at_floor(left, floor)                       nothing is left but what an arm in order leaves

A drive that clips does so where a log asks for more torque than it gives. Where the fitted logs never do, what they say is right
and says nothing of it, and the held-out logs only tell that something is wrong. Fitted as well they tell what; but nothing of
another kind judges it then, so no name is given unless with it every joint is down at the floor.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.asked.inputs import Logs

__all__ = ["JudgedBy", "at_floor", "fitted_too", "only_held_out"]

JudgedBy = Literal["logs", "blocks", "blocks of all logs"]  # the last: of those of role validate too, where they alone show it

_FAR, _NEAR = 2.5, 1.4  # times the floor: beyond any arm in order, and what one may leave of logs that it was fitted to
_DOWN = 1.3  # times the floor, up to which an extended model is in order


def only_held_out(fitted: Array, floor: Array, held: Array, own: Array) -> bool:
    """Whether the nominal model leaves far more than an arm in order of the held-out logs, and no more of the fitted ones.

    Args:
        fitted, floor: (joints,) [N m] rms that it leaves of the fitted logs, and their floor; `held`, `own`: of those held out.
    """
    return bool((fitted <= _NEAR * floor).all() and (held > _FAR * own).any())


def fitted_too(logs: Logs) -> Logs:
    """The same logs with none to judge; first those that show it, for what is drawn and simulated are the first."""
    return replace(logs, identify=(*logs.validate, *logs.identify), validate=())


def at_floor(left: Array, floor: Array) -> bool:
    """Whether no joint, (joints,) [N m] rms held out, is above what an arm in order leaves."""
    return bool((left <= _DOWN * np.maximum(floor, 1e-12)).all())

"""What shows in held-out logs alone: these fitted too, and blocks of time held out in their place.

    alone = only_held_out(fitted, floor, held, own)     a joint is far off in those held out, none in those fitted
    found = … fitted_too(logs) …                        the same question of all of them
    left = of_those_held_out(pooled, fitted, share)     what it leaves of those that show it
    named = at_floor(left, floor)                       no more than an arm in order, or a diagnosis that knows one, leaves

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

__all__ = ["JudgedBy", "at_floor", "fitted_too", "of_those_held_out", "only_held_out", "share_held_out"]

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


def share_held_out(logs: Logs) -> float:
    """Of the time of all logs, how much was held out."""
    times = [sum(log.n_samples * log.sample_time for log in some) for some in (logs.validate, logs.identify)]
    return times[0] / sum(times)


def of_those_held_out(pooled: Array, fitted: Array, share: float) -> Array:
    """(joints,) [N m] rms left at most of the logs that show it, where all together leave `pooled`: of the others no model leaves
    less than the one that was fitted to them alone, `fitted`, or many logs in order would hide the rest of one that is not.

        left² = (pooled² - (1 - share) fitted²) / share
    """
    return np.sqrt(np.maximum(np.square(pooled) - (1.0 - share) * np.square(np.minimum(fitted, pooled)), 0.0) / share)


def at_floor(left: Array, floor: Array) -> bool:
    """Whether no joint, (joints,) [N m] rms held out, is above what an arm in order leaves."""
    return bool((left <= _DOWN * np.maximum(floor, 1e-12)).all())

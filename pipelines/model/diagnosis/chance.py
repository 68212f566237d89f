"""Whether what a cause takes off the held-out error may be chance.

    by_chance(before, after, place, judge, blocks)      at no joint that it acts on, or is seen at, does the error fall surely
    no_gain(before, after, place, judge, blocks)        nor does that of all joints together
    no_name(step, before, after, place, judge, blocks)  or it does by so little that an arm in order shows as much
"""

from __future__ import annotations

import numpy as np

from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.gains import surely_less, torque_gain
from pipelines.model.diagnosis.refit import Refined
from pipelines.model.diagnosis.search import Step

__all__ = ["BY_CHANCE", "by_chance", "no_gain", "no_name"]

BY_CHANCE = "its gain on held-out torque is within what chance does, or too little to be told from an arm in order"

_MOST = 0.5  # of what is seen of an effect
_HALF = 0.5
_NOTHING = 1e-9  # of the torque at the joint that an effect acts on most: what is smaller is rounding
# Of the held-out root mean square at some joint, that a cause takes away at least. Ten replicas know the floor to about a tenth,
# and the best of a thousand shapes takes a fortieth off the logs of an arm in order, held-out ones too: its ripple is in all.
_LITTLE = 0.05
_FAR = 2.0  # times its threshold, that a cause gains where no ripple of the twin comes near


def no_gain(before: Refined, after: Refined, place: int, judge: Data | None, blocks: int) -> bool:
    """Whether effect number `place` of `after`, which `before` lacks, takes no more off the held-out error than chance: neither
    off that of its own joints nor off that of all together, each in units of its own. A single joint has but some of the rows."""
    return by_chance(before, after, place, judge, blocks) and not surely_less(before, after, judge, blocks)


def no_name(step: Step, before: Refined, after: Refined, place: int, judge: Data | None, blocks: int) -> bool:
    """Whether effect number `place` of `after`, which `before` lacks and `step` has found, takes no more off the held-out error
    than chance does, or so little that it is not told from an arm in order.

    What gained many times what the twin shows of it is told, however little it takes.
    """
    if not by_chance(before, after, place, judge, blocks, _LITTLE):
        return False
    return not _stands_out(step) or no_gain(before, after, place, judge, blocks)


def _stands_out(step: Step) -> bool:
    """Whether it gained many times its threshold."""
    return any(trial.accepted and trial.gain > _FAR * trial.threshold > 0.0 for trial in step.trials)


def by_chance(before: Refined, after: Refined, place: int, judge: Data | None, blocks: int, least: float = 0.0) -> bool:
    """Whether, of all joints that effect number `place` of `after`, which `before` lacks, acts on, or is seen at, no held-out error
    falls by more than chance does.

    What falls elsewhere is due to other numbers, moved by the fit. An effect is seen at the joint where most of it is left when the
    model has imitated what it can: a drive of joint 3 that gives too little looks there like a lighter arm, which joint 2 does not
    have to move.

    Args:
        least: share of its root mean square that a held-out error has to fall by.
    """
    gain = torque_gain(before, after, judge, blocks)
    torque = after.model.torque(after.data) - after.model.without(place).torque(after.data)
    acts = after.data.rms(torque)
    seen = np.bincount(after.data.joint, before.fit.project(torque) ** 2, minlength=len(acts))
    # without it the whole torque may be worked out in another order
    own = (acts > _NOTHING * acts.max()) | (seen > _MOST * seen.sum())
    # An event, torque that is clipped once say, is in one block of time only, and drawn blocks do not repeat it; but what was
    # fitted to other time does not take half of the power off by chance.
    sure = (gain.ci95[:, 1] < 0.0) & (gain.after <= (1.0 - least) * gain.before)
    return not (sure | (gain.after**2 < _HALF * gain.before**2))[own].any()

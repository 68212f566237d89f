"""Whether what a cause takes off the held-out error may be chance.

    by_chance(before, after, place, judge, blocks)      at no joint that it acts on, or is seen at, does the error fall surely
    no_gain(before, after, place, judge, blocks)        nor does that of all joints together, theirs with it
    no_name(step, before, after, place, judge, blocks)  or by so little that an arm in order shows as much
    by_all_time(before, after, place, judge, blocks)    it falls surely, where fitted logs held out block by block count as well
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.fit.flips import by_flips
from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.searched.search import Step
from pipelines.model.diagnosis.worth.gains import surely_less, torque_gain
from pipelines.model.diagnosis.worth.held_out import held_out_left

__all__ = ["BY_CHANCE", "by_all_time", "by_chance", "no_gain", "no_name"]

BY_CHANCE = "its gain on held-out torque is within what chance does, or too little to be told from an arm in order"

_MOST = 0.5  # of what is seen of an effect
_HALF = 0.5
_NOTHING = 1e-9  # of the torque at the joint that an effect acts on most: what is smaller is rounding
# Of the held-out root mean square at some joint, that a cause takes away at least. Ten replicas know the floor to about a tenth,
# and the best of a thousand shapes takes a fortieth off the logs of an arm in order, held-out ones too: its ripple is in all.
_LITTLE = 0.05
_TWICE = 2.0  # times its threshold. Of causes that surely took less, true ones had gained 2.4 to 11 times theirs, a false one 1.3.
# The same. Of those that a few seconds of held-out logs left open, and all time bore out, true ones had gained 3.5 to 9 times
# theirs, false ones 2.2 at most.
_FAR = 3.0
_RARE = 0.005  # at most, that chance gains as much: the shape was chosen by the fitted logs, among a dozen
# The same of a cause beside which none was found. Of 10 causes that passed their thresholds and no more, all 4 true ones stood
# alone, by .001 to .012, and what stood beside another was never true: the rest of that one, whose law is not the machine's.
_SELDOM = 0.02
_PARTS = 20  # of the held-out time, and of the fitted


def no_name(step: Step, before: Refined, after: Refined, place: int, judge: Data | None, blocks: int,
            white: bool = False, lone: bool = False) -> bool:
    """Whether effect number `place` of `after`, which `before` lacks and `step` has found, takes no more off the held-out error
    than chance does, or so little that it is not told from an arm in order.

    What gained twice its threshold needs no more than that the error surely falls; what gained three times as much, that it does so
    over all time: which shape it has was no choice among chances then, and a few seconds of held-out logs tell little. Of whitened
    rows little is signal: all time is asked at once. So it is of a cause that stands alone, for what else should it be the rest of.

    Args:
        lone: nothing else was found, and the simulated arm is nearer with it.
    """
    if lone and by_all_time(before, after, place, judge, blocks, _SELDOM):
        return False
    if white:
        return not by_all_time(before, after, place, judge, blocks)
    times = max((trial.gain / trial.threshold for trial in step.trials if trial.accepted and trial.threshold > 0.0), default=0.0)
    if times <= _TWICE:
        return by_chance(before, after, place, judge, blocks, _LITTLE)
    chance = no_gain(before, after, place, judge, blocks)
    return chance and (times <= _FAR or not by_all_time(before, after, place, judge, blocks))


def no_gain(before: Refined, after: Refined, place: int, judge: Data | None, blocks: int) -> bool:
    """Whether effect number `place` of `after`, which `before` lacks, takes no more off the held-out error than chance: neither off
    that of its own joints nor off that of all together. A single joint has but some of the rows."""
    return (by_chance(before, after, place, judge, blocks)
            and not surely_less(before, after, _own(before, after, place), judge, blocks))


def by_chance(before: Refined, after: Refined, place: int, judge: Data | None, blocks: int, least: float = 0.0) -> bool:
    """Whether, of all joints that effect number `place` of `after`, which `before` lacks, acts on, or is seen at, no held-out error
    falls by more than chance does.

    Args:
        least: share of its root mean square that a held-out error has to fall by.
    """
    gain = torque_gain(before, after, judge, blocks)
    # An event, torque that is clipped once say, is in one block of time only, and drawn blocks do not repeat it; but what was
    # fitted to other time does not take half of the power off by chance.
    sure = (gain.ci95[:, 1] < 0.0) & (gain.after <= (1.0 - least) * gain.before)
    return not (sure | (gain.after**2 < _HALF * gain.before**2))[_own(before, after, place)].any()


def by_all_time(before: Refined, after: Refined, place: int, judge: Data | None, blocks: int, rare: float = _RARE) -> bool:
    """Whether the error at the joints that effect number `place` of `after`, which `before` lacks, acts on, or is seen at, falls
    far beyond chance over the held-out logs and the fitted ones together, and falls on the held-out ones at all.

    Of the fitted logs each block is left by the numbers that the rest of the time asks for (Stone 1974): no row counts that its own
    numbers were fitted to.
    """
    own = _own(before, after, place)
    held = _gains(before, after, own, judge, blocks)
    every = held if judge is None else np.concatenate([held, _gains(before, after, own, None, blocks)])
    return float(held.sum()) > 0.0 and by_flips(every) <= rare


def _gains(before: Refined, after: Refined, own: npt.NDArray[np.bool_], judge: Data | None, blocks: int) -> Array:
    """(parts,) of squared error at the joints `own`, each in units of what `before` leaves of the fitted logs, less the ripple of a
    drive in order where rows are steady."""
    data = after.data if judge is None else judge
    left = (held_out_left(one, judge, blocks) * before.weight[data.joint] for one in (before, after))
    ours, theirs = (np.square(x if data.ripple is None else data.ripple.out_of(x, before.weight)) for x in left)
    gained = np.where(data.counts & own[data.joint], ours - theirs, 0.0)
    return np.asarray(np.bincount(data.blocks(_PARTS), gained), dtype=np.float64)


def _own(before: Refined, after: Refined, place: int) -> npt.NDArray[np.bool_]:
    """(joints,) that an effect acts on, or is seen at.

    What falls elsewhere is due to other numbers, moved by the fit. An effect is seen at the joint where most of it is left when the
    model has imitated what it can: a drive of joint 3 that gives too little looks there like a lighter arm, which joint 2 does not
    have to move.
    """
    torque = after.model.torque(after.data) - after.model.without(place).torque(after.data)
    acts = after.data.rms(torque)
    seen = np.bincount(after.data.joint, before.fit.project(torque) ** 2, minlength=len(acts))
    # without it the whole torque may be worked out in another order
    return np.asarray((acts > _NOTHING * acts.max()) | (seen > _MOST * seen.sum()))

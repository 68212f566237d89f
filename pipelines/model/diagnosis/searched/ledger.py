"""Every hypothesis of a step with what it gained, what it had to exceed, and why it was accepted or not."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.result import Trial
from pipelines.model.diagnosis.screened.screen import Screened
from pipelines.model.effects.base import Effect

__all__ = ["ACCEPTED", "ENOUGH", "GIVES_WAY", "IMPOSSIBLE", "UNBELIEVABLE", "WEAKER", "Tried", "ledger"]

ACCEPTED = "accepted"
WEAKER = "weaker than others"
BETTER = "below its threshold, and decidedly more than the best that is above its own"  # accepted all the same
_BY_FIT = "below its threshold to first order, and most of what its joint leaves when fitted exactly"  # likewise
UNBELIEVABLE = "the arm could not have moved so with it"
IMPOSSIBLE = "impossible numbers"
GIVES_WAY = "something that gives way explains more, and what does these logs do not tell"  # so that nothing is taken up
ENOUGH = "as many causes as are looked for had been found"  # likewise
_LESS = "explains less than the one that the search took up"  # be that named or not
_REFUSED = "time held out does not bear it out"
_THERE = "found there already, and not asked again"
_TOO_LITTLE = "takes next to nothing"  # so that nobody has asked what it would have to
_SHOWN = 12  # lines of a step, of causes that stay below their thresholds


@dataclass(frozen=True, eq=False)
class Tried:
    """A hypothesis fitted exactly."""

    screened: Screened
    effect: Effect
    log: int | None
    done: Refined
    error: float  # squared weighted error as a share of that before: held out; of an event, of the logs it happened in
    rank: float  # lowest first: the same, and what is left of the fitted logs, on a par
    visibility: float
    sure: bool = False  # it leaves less than another with a number fewer, by more than the number is worth
    believable: bool = True  # an arm with it could have moved as it did
    of_size: bool = True  # it needs no torque beyond any that the machine has given

    @property
    def possible(self) -> bool:
        """Whether the cause's numbers lie in their ranges, and the logs could be of an arm with them."""
        return self.believable and self.of_size and self.done.model.effects[-1].possible

    @property
    def lean(self) -> Tried:
        """Without what is there anyway: what another process need not send."""
        return replace(self, screened=self.screened.lean, done=self.done.lean)

    def whole(self, screened: Screened, before: Refined) -> Tried:
        """A `lean` one with what it was fitted to, and beside."""
        return replace(self, screened=screened, done=self.done.with_rows(before.data, before.model))


def ledger(screened: Sequence[Screened], judged: Sequence[Screened], thresholds: Thresholds, tried: Sequence[Tried],
            best: Tried | None, now: Refined, number: int, refused: Collection[int] = (),
            near: Collection[int] = (), none: str = "") -> tuple[Trial, ...]:
    """The lines of step `number`, greatest gain first; `judged` holds the gains that `thresholds` are for, `refused` the ids of
    those screened that time held out does not bear out, or, of an event, what is left when it is fitted exactly, `near` those that
    only an exact fit tells, and `none` why nothing was taken up where there is no `best`."""
    exact = {id(one.screened): one for one in tried}
    there = {(one.effect.name, one.effect.joint) for one in now.model.effects}
    rows: list[Trial] = []
    order = sorted(range(len(screened)), key=lambda k: -judged[k].gain[0])
    for k in order:
        one, gain = screened[k], float(judged[k].gain[0])
        fitted = exact.get(id(one))
        accepted = best is not None and fitted is best
        if fitted is None and gain <= thresholds.gain[k] and len(rows) >= _SHOWN:
            continue
        reason = (_BY_FIT if accepted and gain <= thresholds.gain[k] and id(one) in near else
                  BETTER if accepted and gain <= thresholds.gain[k] else
                  ACCEPTED if accepted else
                  _TOO_LITTLE if np.isinf(thresholds.gain[k]) else
                  "below its threshold" if gain <= thresholds.gain[k] else
                  "comes again at other moments" if not one.stands_out else
                  _REFUSED if id(one) in refused and fitted is None else
                  _THERE if fitted is None and (one.cause, one.joint) in there else
                  WEAKER if fitted is None else
                  UNBELIEVABLE if not fitted.believable else
                  IMPOSSIBLE if not fitted.possible else
                  "held-out error does not fall" if fitted.error >= 1.0 else
                  "the error, held out and fitted on a par, does not fall" if fitted.rank >= 1.0 else
                  "fitted exactly it stays below its threshold" if fitted.log is not None and id(one) in refused else
                  _REFUSED if id(one) in refused else
                  "takes more numbers, or a second of its kind" if best is not None and fitted.rank < best.rank else
                  (none or _REFUSED) if best is None else
                  _LESS)
        gained = np.nan if fitted is None else 1.0 - fitted.done.rss / now.rss
        rows.append(Trial(number, one.cause, one.joint, gain / now.rss, float(thresholds.gain[k] / now.rss),
                          float(one.visibility[0]), gained, accepted, reason))
    return tuple(rows)

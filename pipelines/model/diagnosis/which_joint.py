"""Whether logs tell at which joint a cause is.

    why = at_which(step, compared)        empty where they do

Of two joints' torque scales only the ratio shows: a drive that gives a tenth too little is the other that gives a ninth too much,
and masses that nobody knows fit either. A name at the wrong joint is worse than none, so that there is none then. What is the same
torque by whichever joint it is told, a motor that turns with two of them, is no such case.
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.ledger import Tried
from pipelines.model.diagnosis.search import Step

__all__ = ["at_which"]

_AS_LITTLE = 0.01  # of what the best leaves, fitted and held out, another leaves more at most
_AS_MUCH = 0.05  # of what the best takes away, another takes less at most
_GIVE = "give logs from before it happened, of role reference"
_SEE = "see by `rrrid estimate-bps` at which of them base parameters and friction are other than in the reference logs"
_ONE_TORQUE = 0.9  # cosine from which two are the same torque


def at_which(step: Step, compared: bool = False) -> str:
    """Why the cause that `step` has found cannot be told at its joint; empty where it can.

    Args:
        compared: whether there are reference logs. The later logs have masses and friction of their own here: which joint's have
            moved is another question, that those logs may answer.
    """
    best = step.best
    if best is None or best.log is not None or best.effect.joint is None:
        return ""
    others = [one for one in step.rivals if _elsewhere(one, best) and _as_good(one, best, step) and not _one_torque(one, best)]
    if not others:
        return ""
    title, first = best.effect.title, _SEE if compared else _GIVE
    places = " or ".join(f"at joint {one.effect.joint}{_number(one)}" for one in (best, *others))
    return (f"{_lower(title)} {places} explains it, and this look does not tell at which. {best.effect.remedy} "
            f"To tell: {first}; or {_lower(best.effect.experiment).rstrip('.')}")


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def _number(one: Tried) -> str:
    """What it would be there: its first number."""
    effect = one.done.model.effects[-1]
    value = effect.values.get(effect.effect.parameters[0].name)
    return "" if value is None else f" ({effect.effect.parameters[0].name} {value:.3g})"


def _elsewhere(one: Tried, best: Tried) -> bool:
    return one.effect.name == best.effect.name and one.effect.joint != best.effect.joint and one.log is None and one.possible


def _as_good(one: Tried, best: Tried, step: Step) -> bool:
    """Whether it leaves hardly more, of the fitted rows and of those held out."""
    fitted, gain = one.done.rss - best.done.rss, step.before.rss - best.done.rss
    held_out = one.error - best.error
    return (fitted <= min(_AS_LITTLE * best.done.rss, _AS_MUCH * gain)
            and held_out <= min(_AS_LITTLE * best.error, _AS_MUCH * (1.0 - best.error)))


def _one_torque(one: Tried, best: Tried) -> bool:
    mine, theirs = (_torque(each) for each in (best, one))
    return float(mine @ theirs) > _ONE_TORQUE * float(np.linalg.norm(mine) * np.linalg.norm(theirs))


def _torque(one: Tried) -> Array:
    """(rows,) [N m] of the hypothesis alone."""
    model, data = one.done.model, one.done.data
    return np.asarray(model.torque(data) - model.without(len(model.effects) - 1).torque(data))

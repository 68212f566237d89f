"""What each cause is worth in the order in which causes are told: each refitted with those before it, the last with all.

    worth(found, named, order, simulated, prepared, beside, blocks)        of the causes in `order`
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from pipelines.model.arm import Acting
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.result import Gain
from pipelines.model.diagnosis.searched.beside import acted
from pipelines.model.diagnosis.searched.search import Found
from pipelines.model.diagnosis.worth.gains import Simulation, gain_of, simulation_errors, torque_gain

__all__ = ["Worth", "with_some", "worth"]


@dataclass(frozen=True, eq=False)
class Worth:
    """What a cause brings beside those that are told before it."""

    gain: Gain
    before: Refined
    after: Refined
    simulated: tuple[Simulation, Simulation]  # the arm before and after


def worth(found: Found, named: Sequence[int], order: Sequence[Sequence[int]], simulated: Sequence[Simulation], prepared: Prepared,
          beside: Sequence[Acting], blocks: int) -> list[Worth]:
    """One a cause, in `order`.

    Args:
        named: numbers of the steps whose causes the final model holds.
        order: places in `named`, as they are told: of each cause one, or those of all its waves.
        simulated: the nominal arm and that after each step: where the order is another, only what lies between is simulated anew;
            where a step was dropped, all.
        beside: effects that the rows are without, and the arms that are simulated are not.
    """
    as_found = list(range(len(named)))
    whole = sorted(named) == as_found and len(simulated) == len(named) + 1  # nothing that was found is dropped
    if whole and list(order) == [[k] for k in as_found]:
        models = [found.nominal, *(found.steps[k + 1].before for k in as_found[:-1]), found.final]
        runs = list(simulated)
    else:
        parts = ([place for one in order[:count] for place in one] for count in range(1, len(order)))
        models = [found.nominal, *(with_some(found, part) for part in parts), found.final]
        known = {0: simulated[0], len(order): simulated[-1]} if whole else None
        runs = simulation_errors([acted(one.model.arm, beside) for one in models], prepared.judging or prepared.motions, known)
    return [Worth(gain_of(torque_gain(before, after, prepared.judge, blocks), was, now), before, after, (was, now))
            for (before, after), (was, now) in zip(pairwise(models), pairwise(runs), strict=True)]


def with_some(found: Found, places: Sequence[int]) -> Refined:
    """The final model with some of its effects only, in the order in which they act, fitted anew."""
    final = found.final
    model = replace(final.model, effects=tuple(final.model.effects[place] for place in sorted(places)))
    return refine(model, final.data, final.weight)

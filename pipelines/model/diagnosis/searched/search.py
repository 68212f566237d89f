"""Find the causes one after the other: screen, refit the best and its rivals exactly, keep the best, look at what is left.

    rough = provisional(case)       the greatest causes, without thresholds: the twin is then made of the model beside them
    found = search(case, most, rough)
    found.final                     the nominal model with every cause that paid
    found.steps                     what each step tried

A step ends the search where no cause exceeds its threshold, or where the best, fitted exactly, brings nothing on what was held
out. Rivals are ranked by the error they leave on held-out rows; of those that leave nearly the same, the one with fewest numbers,
or with one more that is worth it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.result import Trial
from pipelines.model.diagnosis.screened.arms_alike import remember
from pipelines.model.diagnosis.screened.screen import Screened, screen
from pipelines.model.diagnosis.searched.barred import better_than
from pipelines.model.diagnosis.searched.borne_out import borne_out
from pipelines.model.diagnosis.searched.case import Case, HeldOut, held_out
from pipelines.model.diagnosis.searched.gate import CLOSE, Gate, gate_of, once_more
from pipelines.model.diagnosis.searched.hypotheses import best_form, each_fitted, first_order_missed, plainer
from pipelines.model.diagnosis.searched.ledger import ENOUGH, GIVES_WAY, Tried, ledger
from pipelines.model.diagnosis.searched.parsimony import PARSIMONY, different, fewest
from pipelines.model.diagnosis.searched.reweighted import reweighted
from pipelines.model.diagnosis.searched.unnameable import unnameable

__all__ = ["Explored", "Found", "Step", "beside_another", "gap_first", "gives_way", "glance", "greatest", "last_step",
           "provisional", "search"]

_RIVALS = 6  # fitted exactly
_LEAST, _LEAST_WHITE = 2e-3, 2e-4  # of the squared residual: no cause is fitted for less; of whitened rows
_GREAT, _LARGE = 3, 0.3  # causes taken away before the noise is looked at; share of a joint's residual that makes one great
_WORTH = 0.05  # of the squared residual of its joint
_MISSED, _NEAR = 0.1, 0.5  # of what the second of two takes away: one in their place may miss so much; to first order


@dataclass(frozen=True, eq=False)
class Explored:
    """Every cause on what one model leaves, and the greatest of them fitted exactly."""

    before: Refined
    screened: tuple[Screened, ...]
    tried: tuple[Tried, ...]  # best first


@dataclass(frozen=True, eq=False)
class Step:
    """One search for one cause."""

    before: Refined
    best: Tried | None  # accepted
    rivals: tuple[Tried, ...]  # above their thresholds, best first
    screened: tuple[Screened, ...]
    thresholds: Thresholds
    trials: tuple[Trial, ...]
    other: Screened | None = None  # what explains more than anything that can be named by the residual, and cannot be


@dataclass(frozen=True, eq=False)
class Found:
    """The outcome of a search."""

    nominal: Refined
    steps: tuple[Step, ...]
    final: Refined


def glance(case: Case) -> Explored:
    """Every cause on what the nominal model leaves, to first order; none is fitted."""
    now = refine(case.model, case.data, case.weight)
    return Explored(now, _screened(case, now), ())


def provisional(case: Case, seen: Explored | None = None) -> tuple[Explored, ...]:
    """The causes that explain the most of what a joint leaves, right or wrong, until none explains a third of it.

    Args:
        seen: at a `glance`.
    """
    first = seen or glance(case)
    now, screened, found = first.before, first.screened, list[Explored]()
    while True:
        one = _explored(case, now, screened, None)
        found.append(one)
        best = fewest(one.tried)
        if len(found) == _GREAT or best is None or _share(best.screened, now) < _LARGE:
            return tuple(found)
        now = reweighted(best.done, case)
        screened = _screened(case, now)


def greatest(rough: Sequence[Explored]) -> list[tuple[str, int | None]]:
    """Of what `provisional` found, the causes that explain much of what their joint leaves, and their joints."""
    found = [(one, best) for one in rough if (best := fewest(one.tried)) is not None]
    return [(best.effect.name, best.effect.joint) for one, best in found if _share(best.screened, one.before) >= _LARGE]


def beside_another(rough: Sequence[Explored], case: Case) -> Iterator[Explored]:
    """What shows beside what `provisional` took away and one more of its last look that explains much of what its joint leaves and
    lasts, best first: a cause that ranks above it is no reason that it bends the numbers of the model less.
    """
    last = rough[-1]
    for one in last.tried:
        if one.log is None and one.possible and _share(one.screened, last.before) >= _LARGE:
            now = reweighted(one.done, case)
            yield Explored(now, _screened(case, now), ())


def search(case: Case, most: int, rough: Sequence[Explored] = (), ends: Callable[[Refined], bool] | None = None,
           vain: Callable[[Refined, Sequence[Screened]], bool] | None = None) -> Found:
    """Up to `most` causes, the same at several joints being one; what `rough` explored already is not done again, as long as it
    leads the same way.

    Args:
        ends: whether nothing more is worth looking for beside the model with the cause that was found last.
        vain: whether nothing at all is, by what exceeds its threshold beside the nominal model, before any of that is fitted.
    """
    now = rough[0].before if rough else refine(case.model, case.data, case.weight)
    nominal = now
    steps: list[Step] = []
    asked: list[tuple[Explored, Gate]] = []
    joined: set[str] = set()
    while True:
        number = len(steps) + 1
        same = number <= len(rough) and rough[number - 1].before is now
        screened = rough[number - 1].screened if same else _screened(case, now)
        gate = gate_of(case, now, screened)
        if vain is not None and not steps and vain(now, gate.passed):
            break
        explored = rough[number - 1] if same else _explored(case, now, screened, gate)
        if same and (not case.floored or _others(case, explored, gate)):
            explored = _explored(case, now, screened, gate, explored.tried)
        found = different((one.effect.name, one.effect.joint) for one in now.model.effects)
        step = _step(case, explored, gate, number, found < most)
        steps.append(step)
        asked.append((explored, gate))
        if step.best is None:
            break
        # Once a cause: what came in place of two might give way to another of them again, and so on without end.
        alone = None if step.best.effect.name in joined else _one_for_two(case, steps, asked)
        if alone is not None:
            place, instead, best = alone
            del steps[place:], asked[place + 1:]
            steps.append(instead)
            joined.add(best.effect.name)
            now, rough = reweighted(best.done, case), ()
            continue
        follows = number < len(rough) and same and step.best is fewest(rough[number - 1].tried)
        now = rough[number].before if follows else reweighted(step.best.done, case)
        if ends is not None and ends(now):
            break
    return Found(nominal, tuple(steps), now)


def last_step(case: Case, done: Refined, number: int) -> Step:
    """What every cause shows beside all that was found; none is fitted."""
    screened = _screened(case, done)
    return _step(case, Explored(done, screened, ()), gate_of(case, done, screened), number, False)


def _one_for_two(case: Case, steps: Sequence[Step], asked: Sequence[tuple[Explored, Gate]]) -> tuple[int, Step, Tried] | None:
    """The place of an earlier step, that step as it should have been, and what it should have found: where the same cause was found
    at two joints, the joint at which it leaves as little alone.

    Of the scales of all torques only their ratios show: one joint's is that of all the others the other way round.
    """
    last = steps[-1]
    if last.best is None or last.best.effect.joint is None:
        return None
    name = last.best.effect.name
    error = held_out(last.best.done, case)
    for place, earlier in enumerate(steps[:-1]):
        if earlier.best is None or earlier.best.effect.name != name:
            continue
        for rival in earlier.rivals:
            if rival.effect.name != name or rival.effect.joint == earlier.best.effect.joint or rival.log is not None:
                continue
            if rival.error >= 1.0 or not rival.possible:
                continue
            gain = max(last.before.rss - last.best.done.rss, 1e-300)
            if first_order_missed(rival, place, last.best, case) > _NEAR * gain:
                continue
            effects = (*rival.done.model.effects, *last.before.model.effects[place + 1:])
            alone = refine(replace(last.before.model, effects=effects), case.data, last.before.weight)
            missed = (alone.rss - last.best.done.rss) / gain
            if held_out(alone, case) > (1.0 + PARSIMONY) * error or missed > _MISSED:
                continue
            instead = _step(case, *asked[place], place + 1, True, rival)
            if instead.best is rival:
                return place, instead, rival
    return None


def gives_way(explored: Explored) -> bool:
    """Whether what explains most, to first order, is something that gives way, and worth a second look."""
    most = max(explored.screened, key=lambda one: one.gain[0])
    return most.family.shapes[0].evidence != "residual" and _share(most, explored.before) > _WORTH


def gap_first(explored: Explored) -> bool:
    """Whether the best of those fitted exactly is a gap."""
    best = fewest(explored.tried)
    return best is not None and best.effect.evidence == "reversals"


def _share(one: Screened, now: Refined) -> float:
    """Gain as a share of the squared residual of the cause's own joint, or of all."""
    own = now.residual if one.joint is None else now.residual[now.data.joint == one.joint - 1]
    return float(one.gain[0] / max(float(own @ own), 1e-300))


def _screened(case: Case, now: Refined) -> tuple[Screened, ...]:
    arms = case.arms(now.model)
    found = tuple(screen(case.data, now.fit, case.families, arms))
    remember(case.data, arms.asked)
    return found


def _explored(case: Case, now: Refined, screened: Sequence[Screened], gate: Gate | None, there: Sequence[Tried] = ()) -> Explored:
    """The greatest causes fitted exactly, as far as they are wanted: what stays below its threshold need not be.

    Args:
        gate: None: all are wanted.
        there: those that are fitted already.
    """
    great = _great(case, now, screened, screened if gate is None else gate.asked)
    error = HeldOut.of(now, case) if great else HeldOut(np.nan, now.weight)
    done = {id(one.screened): one for one in there}
    asked = [one for one in great if id(one) not in done]
    done |= {id(one.screened): one for one in each_fitted(case, now, asked, error)}
    tried = [done[id(one)] for one in great]
    # What only its best law tells, where nothing else passes, is asked by that.
    able = [one for one in tried if gate is None or gate.told(one, now)] or tried
    best = fewest(sorted(able, key=lambda one: one.rank))
    plain = None if best is None else plainer(case, now, tried, best, error)
    if plain is not None:
        best, tried = plain, [plain if one.screened is plain.screened else one for one in tried]
    lasting = best
    if best is not None and best.log is not None:  # an event may be refused yet
        lasting = fewest(sorted((one for one in able if one.log is None), key=lambda one: one.rank))
    tried = [best_form(case, now, one, error) if one in (best, lasting) else one for one in tried]
    return Explored(now, tuple(screened), tuple(sorted(tried, key=lambda one: one.rank)))


def _great(case: Case, now: Refined, screened: Sequence[Screened], wanted: Sequence[Screened]) -> list[Screened]:
    """Of those wanted the greatest: what is below its threshold or not borne out, however great, is no rival of what is not."""
    taken = {(e.effect.name, e.effect.joint) for e in now.model.effects}
    asked = {id(one) for one in wanted}
    able = [one for one in screened if one.family.event or (one.cause, one.joint) not in taken
            or (case.again and any(one.shape[0].again(log.motion) for log in case.data.logs))]
    least = _LEAST_WHITE if case.white else _LEAST
    able = [one for one in able if one.gain[0] >= least * now.rss and one.stands_out and id(one) in asked
            and one.family.shapes[0].evidence in case.nameable]
    able = sorted(able, key=lambda one: -one.gain[0])
    return [one for one in able[:_RIVALS] if one.gain[0] >= CLOSE * able[0].gain[0]]


def _others(case: Case, explored: Explored, gate: Gate) -> bool:
    """Whether others than were explored are the greatest of those that pass."""
    tried = {id(one.screened) for one in explored.tried}
    return any(id(one) not in tried for one in _great(case, explored.before, explored.screened, gate.asked))


def _step(case: Case, explored: Explored, gate: Gate, number: int, more: bool, chosen: Tried | None = None) -> Step:
    now, screened, thresholds = explored.before, explored.screened, gate.thresholds
    tried = [one for one in explored.tried if gate.told(one, now)]
    bound = {id(one): gain for one, gain in zip(screened, thresholds.gain, strict=True)}
    # What happened once no other time asks for: fitted exactly it has to take as much as its columns had to.
    happened = {id(one.screened) for one in tried if one.log is not None and now.rss - one.done.rss <= bound[id(one.screened)]}
    refused = gate.refused | happened
    tried = [one for one in tried if id(one.screened) not in happened]
    again = once_more(case, now, screened)
    asked = [one for one in tried if not case.floored or id(one.screened) in again]
    refused |= {id(one.screened) for one in asked if one.error >= 1.0 or not borne_out(case, one.screened, now, one.done)}
    tried = [one for one in tried if id(one.screened) not in refused]
    best = (chosen or fewest(tried)) if more else None
    better = None if best is None or chosen is not None else better_than(best, case, now, screened, gate)
    if better is not None:
        best, tried = better, [better, *tried]
    other = unnameable(gate.passed, best, explored.tried, now, case)
    best = None if other is not None else best
    fitted_there = explored.tried if better is None or best is not better else (better, *explored.tried)
    trials = ledger(screened, gate.judged, thresholds, fitted_there, best, now, number, refused,
                    [id(one) for one in gate.near], GIVES_WAY if other is not None else "" if more else ENOUGH)
    return Step(now, best, tuple(tried), screened, thresholds, trials, other)

"""A second look where the noise is white: what slow noise hides from plain least squares.

    done = looked_again(done, case, prepared, twin, most, floor)

The first look weighs every row alike. Where the drive's zero wanders slowly and a cause is quicker than that, it sees the wander.
The second one takes out of the rows what the noise of an arm in order, the twin's, makes alike in neighbouring ones
(`whitening`), and what the ripple of its torque constants has in common wherever a joint comes by (`ripple`), and searches again:
with thresholds of the same replicas through the same, and by the same rules. Generalised least squares (Aitken 1935) lose nothing
that plain ones see, where the noise is that of the twin, and tell causes apart that are alike where the wander is. Where the
second look finds as many causes at every joint as the first has found, under other names or more, and they leave no more of the
rows as they are, it is believed. What is next to nothing beside a greater cause, and may as well be what that one's law does not
have, has to be found by both looks, as long as no joint stands high without it. What happened once is no matter of noise that is
slow: where the first look names such a thing, it is all. So it is where it names a gap, which is looked for below the frequencies
at which it rings, and where logs have rows of different spacing: no one filter makes the noise of all of them white.

What it found is then told in newton metres of the rows as they are: beside the nominal model of the first look, every model with
the numbers that the second one has fitted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.believed.pruned import NEAR_THE_FLOOR, TOO_SLIGHT, Settled, settled
from pipelines.model.diagnosis.fitted.own_motion import following, put_right
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.floor.twin import Twin
from pipelines.model.diagnosis.named.verdict import REST_OF_A_LAW, Ruling, excess, explained, rule, stands_high
from pipelines.model.diagnosis.rows.whitening import Whitening
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found, Step, last_step, search

__all__ = ["looked_again"]

Name = tuple[str, int | None]  # a cause and its joint

_LITTLE = 1e-2  # of what stands above the floor: what only the first look has found explains no more, where it is not believed
_LEAST = 1e-3  # of the same: what only the second look has found beside others explains at least
_MORE, _FEW = 1.1, 0.1  # times what the first look leaves above the floor, and floors: the second one leaves no more
_CHANCE, _MANY = 2.0, 0.3  # standard deviations of what one run of an arm in order leaves, if that is more; no more than so much
_ALIKE = 1.02  # times the shortest spacing of rows, that the longest is
_USELESS = 1e-3  # of the squared residual of a joint: of whitened rows most is noise that no model can be below


def looked_again(done: Settled, case: Case, prepared: Prepared, twin: Twin, most: int, floor: Array) -> Settled:
    """What is believed after a second look: what was before, or as much at every joint by other names, or more; or less by what
    was next to nothing.

    Args:
        floor: (joints,) [N m] of rows as they are.
    """
    once = {family.cause for family in case.families if family.event}
    named = [best.effect for k in done.ruling.named if (best := done.found.steps[k].best) is not None]
    enough = any(effect.name in once or effect.evidence == "reversals" for effect in named)
    far = done.ruling.verdict == "unknown" and done.ruling.reason not in (NEAR_THE_FLOOR, TOO_SLIGHT)
    if far or enough or not _evenly(case, twin):
        return done
    there, whitened, usual = _in_white(case, twin)
    found = search(there, most)
    if _of(found.steps) == _names(done):
        return done  # what is named would be the same, and its simulation is dear
    mended = put_right(found.nominal.fit, found.final.fit, usual)
    ready = replace(prepared, data=there.data, judge=there.judge)
    ruling = _less_the_rest(rule(found, whitened.rms, True, mended), found, done)
    again = settled(found, ruling, there, ready, whitened.rms)
    if again.ruling.verdict != "cause" or _names(done) == _names(again):
        return done
    plain = _as_they_are(again, done, case)
    return plain if _believed(done, plain, floor, twin.scatter) else done


def _believed(first: Settled, second: Settled, floor: Array, scatter: Array) -> bool:
    """Whether the second look, told of rows as they are, takes the place of the first.

    Args:
        scatter: (joints,) relative standard deviation of the power that an arm in order leaves: where noise is slow, a wrong cause
            may take in what one log has of it by chance, and stand below the floor.
    """
    before, now = _names(first), _names(second)
    if now < before:
        # One in a hundred of a great cause may stand far above the floor: what the first look explains is no noise then.
        opened = stands_high(second.found.final.rms, floor) & ~stands_high(first.found.final.rms, floor)
        return _share(first, before - now, floor) < _LITTLE and not opened.any()
    if before and before < now and _share(second, now - before, floor) < _LEAST:
        return False
    left = [excess(one.found.final.rms, floor) for one in (first, second)]
    named = {joint for _, joint in before | now}
    there = scatter if None in named else scatter[[joint - 1 for joint in named if joint]]
    few = float(np.clip(_CHANCE * np.linalg.norm(there), _FEW, _MANY))
    return _joints(first) <= _joints(second) and left[1] <= _MORE * left[0] + few


def _evenly(case: Case, twin: Twin) -> bool:
    """Whether the rows of all logs are as far apart."""
    every = (*case.data.logs, *(() if case.judge is None else case.judge.logs), *twin.data.logs)
    steps = [float(np.median(np.diff(one.t))) for one in every if one.rows > 1]
    return max(steps) <= _ALIKE * min(steps)


def _in_white(case: Case, twin: Twin) -> tuple[Case, Twin, Array]:
    """The case and its twin in whitened rows; (joints,) the most that any replica's residual follows a joint's own motion there."""
    whitening = Whitening.of(twin.data, np.array([replace(one).left for one in twin.fits]))
    noise = 1.0 / np.maximum(twin.rms, 1e-12)  # whitening keeps it
    judge = None if case.judge is None else case.judge.whitened(whitening, noise)
    there = replace(case, data=case.data.whitened(whitening, noise), judge=judge,
                    families=tuple(f for f in case.families if not f.event))
    weight = 1.0 / np.maximum(refine(there.model, there.data, there.weight).rms, 1e-12)
    same = twin.through(whitening, noise)
    first, residuals = same.weighted(weight)
    bounds = Thresholds.of_twin(first, residuals, there.families, case.model.nominal, _USELESS, twin.replicas)
    return replace(there, weight=weight, thresholds=bounds, white=True), same, following(first, residuals).max(axis=1)


def _names(done: Settled) -> set[Name]:
    return _of(done.found.steps[k] for k in done.ruling.named)


def _less_the_rest(ruling: Ruling, found: Found, first: Settled) -> Ruling:
    """Without what the first look found in the rest of a law that is not the machine's: white rows, of which most is noise, show
    less of what stays above the floor there."""
    rest = _of(first.found.steps[k] for k, why in first.ruling.doubts.items() if why == REST_OF_A_LAW)
    steps = [step for step in found.steps if step.best is not None]
    again = {k: REST_OF_A_LAW for k in ruling.named if _of([steps[k]]) & rest}
    return replace(ruling, named=tuple(k for k in ruling.named if k not in again), doubts={**ruling.doubts, **again})


def _of(steps: Iterable[Step]) -> set[Name]:
    return {(best.effect.name, best.effect.joint) for step in steps if (best := step.best) is not None}


def _share(done: Settled, names: set[Name], floor: Array) -> float:
    """What the causes of these names explain together of what stands above the floor, in rows as they are."""
    nominal, total = done.found.nominal.rms, 0.0
    for k in done.ruling.named:
        step = done.found.steps[k]
        if _of([step]) & names and step.best is not None:
            total += explained(step.before.rms, step.best.done.rms, nominal, floor)
    return total


def _joints(done: Settled) -> Counter[int | None]:
    """How many causes it names at each joint."""
    return Counter(joint for _, joint in _names(done))


def _as_they_are(again: Settled, first: Settled, case: Case) -> Settled:
    """Every model on rows as they are, beside the nominal one of the `first` look; numbers are as sure as white rows say."""
    found, data = again.found, replace(case.data, steady=True)

    def plain(done: Refined, weight: Array | None = None) -> Refined:
        if done is found.nominal:
            return first.found.nominal
        left = case.data.rms(case.data.y - done.model.torque(case.data))
        return refine(done.model, data, 1.0 / np.maximum(left, 1e-12) if weight is None else weight, steps=0)

    def step(one: Step) -> Step:
        before = plain(one.before)
        rivals = {id(rival): replace(rival, done=plain(rival.done, before.weight)) for rival in one.rivals}
        best = one.best and (rivals.get(id(one.best)) or replace(one.best, done=plain(one.best.done, before.weight)))
        return replace(one, before=before, best=best, rivals=tuple(rivals.values()))

    final = replace(plain(found.final), known=found.final.covariance())
    steps = [step(one) for one in found.steps if one.best is not None]
    steps[0] = replace(steps[0], screened=first.found.steps[0].screened)  # of all causes, what rows as they are can tell
    last = last_step(case, final, len(steps) + 1)
    return replace(again, found=Found(first.found.nominal, (*steps, last), final))

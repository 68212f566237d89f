"""Find the causes one after the other: screen, refit the best and its rivals exactly, keep the best, look at what is left.

    rough = provisional(case)       the greatest causes, without thresholds: the twin is then made of the model beside them
    found = search(case, most, rough)
    found.final                     the nominal model with every cause that paid
    found.steps                     what each step tried

A step ends the search where no cause exceeds its threshold, or where the best, fitted exactly, brings nothing on what was held
out. Rivals are ranked by the error they leave on held-out rows; of those that leave nearly the same, the one with fewest numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.candidates import Family, lay_family
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.ledger import Tried, ledger
from pipelines.model.diagnosis.nominal import Fit, orthonormal
from pipelines.model.diagnosis.refit import Refined, refine
from pipelines.model.diagnosis.result import Trial
from pipelines.model.diagnosis.screen import INVISIBLE, Screened, screen
from pipelines.model.diagnosis.thresholds import Thresholds, without_twin
from pipelines.model.diagnosis.through import beyond_first_order
from pipelines.model.effects.base import Effect

__all__ = ["Case", "Explored", "Found", "Step", "Tried", "clean", "cross_validated", "gap_first", "gives_way",
           "held_out", "held_out_left", "provisional", "search"]

_RIVALS = 6  # fitted exactly
_CLOSE = 0.25  # of the best gain: weaker ones are no rivals
_LEAST = 2e-3  # of the squared residual: no cause is fitted for less
_GREAT, _LARGE = 3, 0.3  # causes taken away before the noise is looked at; share of a joint's residual that makes one great
_WORTH = 0.05  # of the squared residual of its joint
_MORE = 1.05  # times what the best takes away
_PARSIMONY = 0.02  # of what the best takes away
_WORSE = 1.1  # times what the best leaves of its joint: a fault far above the noise tells such causes apart
_CONFIRMED = 0.9  # of the held-out error: an event that others confirm leaves less
_FALLS = 0.02  # of the held-out error, that a cause takes off at least where no floor says what is left to explain
_DECIDED = 0.9  # of the squared error that another law of the same cause leaves, at least
_SETTLED = 0.02  # of a weight
_ROUNDS = 3  # of weights


Changed = Callable[[Refined, Sequence[bool]], tuple[Sequence[Screened], Thresholds]]


@dataclass(frozen=True, eq=False)
class Case:
    """What is diagnosed."""

    data: Data  # that is fitted
    judge: Data | None  # that judges; None: blocks of the fitted
    model: Exact  # nominal
    weight: Array  # (joints,)
    families: tuple[Family, ...]
    thresholds: Thresholds | None  # None: a share of the residual
    blocks: int = 10
    nameable: tuple[str, ...] = ("residual",)  # kinds of evidence there are
    changed: Changed | None = None  # what has changed since the reference logs
    again: bool = True  # a cause that may act more than once at its place may be found more than once
    beside: tuple[Acting, ...] = ()  # effects whose torque is subtracted from the rows: known from elsewhere, or standing


@dataclass(frozen=True, eq=False)
class Explored:
    """Every cause on what one model leaves, and the greatest of them fitted exactly."""

    before: Refined
    screened: tuple[Screened, ...]
    tried: tuple[Tried, ...]  # best first


@dataclass(frozen=True, eq=False)
class _Gate:
    """What the causes that were screened have to exceed."""

    judged: Sequence[Screened]  # with the gains that the thresholds are for
    thresholds: Thresholds
    passed: tuple[Screened, ...]


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


def provisional(case: Case) -> tuple[Explored, ...]:
    """The causes that explain the most of what a joint leaves, right or wrong, until none explains a third of it."""
    now, found = refine(case.model, case.data, case.weight), []
    for _ in range(_GREAT):
        screened = _screened(case, now)
        one = _explored(case, now, screened, screened)
        found.append(one)
        best = _fewest(one.tried)
        if best is None or _share(best.screened, now) < _LARGE:
            break
        now = _reweighted(best.done)
    return tuple(found)


def search(case: Case, most: int, rough: Sequence[Explored] = ()) -> Found:
    """Up to `most` causes; what `rough` explored already is not done again, as long as it leads the same way."""
    now = rough[0].before if rough else refine(case.model, case.data, case.weight)
    nominal, steps = now, []
    for number in range(1, most + 2):
        same = number <= len(rough) and rough[number - 1].before is now
        screened = rough[number - 1].screened if same else _screened(case, now)
        gate = _gate(case, now, screened)
        step = _step(case, rough[number - 1] if same else _explored(case, now, screened, gate.passed), gate, number, number <= most)
        steps.append(step)
        if step.best is None:
            break
        follows = number < len(rough) and same and step.best is _fewest(rough[number - 1].tried)
        now = rough[number].before if follows else _reweighted(step.best.done)
    return Found(nominal, tuple(steps), now)


def gives_way(explored: Explored) -> bool:
    """Whether what explains most, to first order, is something that gives way, and worth a second look."""
    most = max(explored.screened, key=lambda one: one.gain[0])
    return most.family.shapes[0].evidence != "residual" and _share(most, explored.before) > _WORTH


def gap_first(explored: Explored) -> bool:
    """Whether the best of those fitted exactly is a gap."""
    best = _fewest(explored.tried)
    return best is not None and best.effect.evidence == "reversals"


def _share(one: Screened, now: Refined) -> float:
    """Gain as a share of the squared residual of the cause's own joint, or of all."""
    own = now.residual if one.joint is None else now.residual[now.data.joint == one.joint - 1]
    return float(one.gain[0] / max(float(own @ own), 1e-300))


def _screened(case: Case, now: Refined) -> tuple[Screened, ...]:
    return tuple(screen(case.data, now.fit, case.families, now.model.arm))


def _explored(case: Case, now: Refined, screened: Sequence[Screened], wanted: Sequence[Screened]) -> Explored:
    """The greatest causes fitted exactly, as far as they are wanted: what stays below its threshold need not be."""
    taken = {(e.effect.name, e.effect.joint) for e in now.model.effects}
    able = [one for one in screened if one.family.event or (one.cause, one.joint) not in taken
            or (case.again and one.shape[0].again(case.data.logs[0].motion))]
    order = sorted((one for one in able if one.gain[0] >= _LEAST * now.rss), key=lambda one: -one.gain[0])
    able = [one for one in order if one.family.shapes[0].evidence in case.nameable and one.stands_out]
    asked = {id(one) for one in wanted}
    great = [one for one in able[:_RIVALS] if one.gain[0] >= _CLOSE * able[0].gain[0] and id(one) in asked]
    error = held_out(now, case) if great else np.nan
    tried = [_fitted(case, now, one, error) for one in great]
    best = _fewest(sorted(tried, key=lambda one: one.rank))
    tried = [_best_form(case, now, one, error) if one is best else one for one in tried]
    return Explored(now, tuple(screened), tuple(sorted(tried, key=lambda one: one.rank)))


def _best_form(case: Case, now: Refined, best: Tried, error: float) -> Tried:
    """The cause by the law that leaves decidedly less of its joint, fitted and held out, where it has more than one."""
    if best.log is not None:
        return best
    chosen, least = best, _DECIDED * _left_at(case, best)
    for form in best.effect.forms():
        other = _refitted(case, now, best.screened, form, error)
        if other.error < 1.0 and other.possible and (left := _left_at(case, other)) < least:
            chosen, least = other, left
    return chosen


def _left_at(case: Case, tried: Tried) -> float:
    """Squared error at the cause's joint: the mean of fitted and held out by their product."""
    joint, done = tried.effect.joint, tried.done
    held = done.data if case.judge is None else case.judge
    powers = [np.square(done.data.rms(done.left)), np.square(held.rms(held_out_left(done, case.judge, case.blocks)))]
    each = np.sqrt(powers[0] * powers[1]) * np.square(done.weight)
    return float(each.sum() if joint is None else each[joint - 1])


def _gate(case: Case, now: Refined, screened: Sequence[Screened]) -> _Gate:
    judged: Sequence[Screened] = screened
    if case.changed is not None:
        most = max((one.gain[0] for one in screened), default=0.0)
        judged, thresholds = case.changed(now, [bool(one.gain[0] >= _CLOSE**2 * most) for one in screened])
    else:
        thresholds = without_twin(screened, now.rss, now.weight) if case.thresholds is None else case.thresholds.at(now.weight)
    passed = tuple(one for one, seen, bound in zip(screened, judged, thresholds.gain, strict=True)
                   if seen.gain[0] > bound and one.stands_out)
    return _Gate(judged, thresholds, passed)


def _step(case: Case, explored: Explored, gate: _Gate, number: int, more: bool) -> Step:
    now, screened, thresholds = explored.before, explored.screened, gate.thresholds
    passes = {id(one) for one in gate.passed}
    tried = [one for one in explored.tried if id(one.screened) in passes]
    if case.thresholds is None and case.changed is None:
        tried = [one for one in tried if one.error <= 1.0 - _FALLS]
    best = _fewest(tried) if more else None
    other = _other(gate.passed, best, explored.tried, now, case.nameable)
    best = None if other is not None else best
    trials = ledger(screened, gate.judged, thresholds, explored.tried, best, now, number)
    return Step(now, best, tuple(tried), screened, thresholds, trials, other)


def _other(passing: Sequence[Screened], best: Tried | None, tried: Sequence[Tried], now: Refined,
           nameable: Sequence[str]) -> Screened | None:
    """What gives way explains more than all that the residual can name, to first order even; what was not fitted exactly counts
    with what it explains to first order."""
    there = [one for one in passing if one.family.shapes[0].evidence not in nameable]
    most = max(there, key=lambda one: one.gain[0], default=None)
    fitted = {id(one.screened) for one in tried}
    untried = [float(one.gain[0]) for one in passing if one.family.shapes[0].evidence in nameable and id(one) not in fitted]
    taken = max([0.0 if best is None else now.rss - best.done.rss, *untried])
    return most if most is not None and most.gain[0] > _MORE * taken else None


def _fewest(tried: Sequence[Tried]) -> Tried | None:
    """Of those that leave nearly as little as the best, the one with fewest numbers; none where the best leaves no less."""
    possible = [one for one in tried if one.error < 1.0 and one.possible]
    if not possible:
        return None
    least = possible[0].rank
    joint = possible[0].screened.joint
    near = [one for one in possible if one.rank - least <= _PARSIMONY * (1.0 - least) and one.screened.joint == joint
            and (joint is None or one.done.rms[joint - 1] <= _WORSE * possible[0].done.rms[joint - 1])]
    return min(near, key=lambda one: (one.done.model.effects[-1].count, one.rank))


def _fitted(case: Case, now: Refined, one: Screened, error: float) -> Tried:
    """A cause fitted exactly beside everything that was found before; `error` is what was left held out without it."""
    if one.family.event:
        return _happened(case, now, one, error)
    effect = one.shape[0].full()
    if effect.fixed_amplitudes is not None:
        effect = _given(case, now, one, np.array(effect.fixed_amplitudes)).full()
    return _refitted(case, now, one, effect, error)


def _refitted(case: Case, now: Refined, one: Screened, effect: Effect, error: float) -> Tried:
    table = _laid(case.data, effect, now.model.arm)
    start = (now.model.with_effect(effect, _amplitudes(now.fit, table)) if one.amplitude is None else
             beyond_first_order(now, effect, one.amplitude))
    done = refine(start, case.data, now.weight)
    left = held_out(done, case) / error
    rank = float(np.nan_to_num(np.sqrt(left * done.rss / now.rss), nan=np.inf))
    return Tried(one, effect, None, done, left, rank, _visibility(now, table))


def _given(case: Case, now: Refined, one: Screened, amplitudes: Array) -> Effect:
    """The shape that leaves least with the amplitudes that physics gives; screening, which fits them, takes half of a gap twice as
    wide for the same."""
    best, least = one.shape[0], np.inf
    for laid in lay_family(case.data, one.family, now.model.arm):
        for k, table in enumerate(laid.table):
            column = np.zeros(case.data.rows)
            column[laid.rows] = amplitudes @ table
            left = float(np.sum(np.square(now.fit.residual - now.fit.project(column))))
            if left < least:
                best, least = one.family.shapes[laid.first + k], left
    return best


def _happened(case: Case, now: Refined, one: Screened, error: float) -> Tried:
    """An event: in one log, which no other can confirm; or in all at the same time, where the held-out ones do."""
    log, effect = one.logs[0], one.shape[0].full()
    whole = _laid(case.data, effect, now.model.arm)
    table = whole if log is None else np.where(case.data.log_of == log - case.data.first, whole, 0.0)
    once = refine(now.model.with_effect(effect, _amplitudes(now.fit, table), log), case.data, now.weight)
    tried = Tried(one, effect, log, once, once.rss / now.rss, once.rss / now.rss, _visibility(now, table))
    if case.judge is None or log is None:
        return tried
    named = once.model.effects[-1]
    always = refine(now.model.with_effect(named.effect, np.array(named.amplitudes)), case.data, now.weight)
    seen = held_out(always, case) / error
    rank = float(np.sqrt(seen * always.rss / now.rss))
    return Tried(one, effect, None, always, seen, rank, tried.visibility) if seen < _CONFIRMED else tried


def _visibility(now: Refined, table: Array) -> float:
    return float(np.linalg.norm(now.fit.project(table))) / max(float(np.linalg.norm(table * now.weights)), 1e-300)


def clean(explored: Explored, most: int = 8) -> Array:
    """(rows,) [N m] what is left when everything that the most promising causes could explain is taken away, right or wrong.

    Noise is in it, and hardly any fault: a fault would pass for noise, and the twin would be too noisy to show anything.
    """
    now, fit = explored.before, explored.before.fit
    best = sorted((one for one in explored.screened if not one.family.event), key=lambda one: -one.gain[0])[:most]
    tables = [_laid(now.data, one.shape[0].full(), now.model.arm) for one in best]
    basis = orthonormal(np.concatenate([fit.project(table) for table in tables]))
    residual = fit.residual - (basis @ fit.residual) @ basis
    return np.asarray(residual / fit.weights)


def _laid(data: Data, effect: Effect, arm: Arm) -> Array:
    laid = next(iter(lay_family(data, Family(effect.name, effect.joint, (effect,)), arm)))
    out = np.zeros((laid.table.shape[1], data.rows))
    out[:, laid.rows] = laid.table[0]
    return out


def _amplitudes(fit: Fit, table: Array) -> Array:
    """Zero for a column that the model has already: what is left of it is rounding, and would be blown up."""
    c = fit.project(table)
    size = np.linalg.norm(c, axis=1)
    size = np.where(size > INVISIBLE * np.linalg.norm(table * fit.weights, axis=1), size, np.inf)
    unit = c / size[:, None]
    solved, *_ = np.linalg.lstsq(unit @ unit.T, unit @ fit.residual, rcond=1e-8)
    return np.asarray(solved / size)


def held_out(done: Refined, case: Case) -> float:
    """Squared weighted error on what the model was not fitted to."""
    data = done.data if case.judge is None else case.judge
    return float(np.sum(np.square(held_out_left(done, case.judge, case.blocks) * done.weight[data.joint])))


def held_out_left(done: Refined, judge: Data | None, blocks: int) -> Array:
    """(rows,) [N m] of the judging logs; of the fitted ones, block by block, where there are none."""
    return cross_validated(done, blocks) if judge is None else judge.y - done.model.torque(judge)


def cross_validated(done: Refined, blocks: int) -> Array:
    """(rows,) [N m] what is left of every stretch of time by the numbers that the rest asks for, to first order.

    What happened once, no other time asks for: the numbers of an event stay as they are.
    """
    once = {k for where, one in enumerate(done.model.effects) if one.log is not None for k in done.of_effect(where)}
    table, residual = np.delete(done.slopes, sorted(once), axis=0) * done.weights, done.residual
    size = np.linalg.norm(table, axis=1)
    unit = table / np.where(size > 0.0, size, 1.0)[:, None]
    place = done.data.blocks(blocks)
    left, gram, moment = np.empty_like(residual), unit @ unit.T, unit @ residual
    ridge = 1e-9 * np.eye(len(gram))
    for block in range(int(place.max()) + 1):
        held = place == block
        own = unit[:, held]
        shift = np.linalg.solve(gram - own @ own.T + ridge, moment - own @ residual[held])
        left[held] = residual[held] - shift @ own
    return left / done.weights


def _reweighted(done: Refined) -> Refined:
    """Joints weighted by what this model leaves of them."""
    for _ in range(_ROUNDS):
        weight = 1.0 / np.maximum(done.rms, 1e-12)
        settled = np.abs(weight / done.weight - 1.0).max() < _SETTLED
        done = refine(done.model, done.data, weight)
        if settled:
            break
    return done

"""One cause fitted exactly beside all that was found before it, by each of its laws; an event in the log it happened in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.linear import solved
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Family, lay_family
from pipelines.model.diagnosis.screened.screen import INVISIBLE, Screened, gains_of
from pipelines.model.diagnosis.screened.through import beyond_first_order
from pipelines.model.diagnosis.searched.case import Case, HeldOut
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.worth.held_out import held_out_left
from pipelines.model.effects.base import Effect

__all__ = ["apart_from", "as_seen", "best_form", "each_fitted", "first_order_missed", "fitted", "laid_whole", "plainer"]

_CONFIRMED = 0.9  # of the held-out error: an event that others confirm leaves less, and a cause in a shape that is not the best
_NEARLY = 0.95  # of what the best shape explains
_MOST, _OTHERS = 0.5, 3  # of what a joint leaves, that a cause has to take to be asked in other shapes; how many these are
_TELLS = 3.0  # standard deviations of a further number
_ROUNDING = 1e-12  # of the largest variance, each number in its own deviations


def each_fitted(case: Case, now: Refined, several: Sequence[Screened], error: HeldOut) -> list[Tried]:
    """Each of several causes, by two processes."""
    found = shared_out(lambda one: fitted(case, now, one, error).lean, several)
    return [tried.whole(one, now) for one, tried in zip(several, found, strict=True)]


def fitted(case: Case, now: Refined, one: Screened, error: HeldOut) -> Tried:
    """A cause fitted exactly beside everything that was found before; `error` is that without it."""
    if one.family.event:
        return _happened(case, now, one, error)
    effect = one.shape[0].full()
    if effect.fixed_amplitudes is not None:
        effect = _given(case, now, one, np.array(effect.fixed_amplitudes)).full()
    tried = _refitted(case, now, one, effect, error)
    if effect.fixed_amplitudes is not None or one.amplitude is not None:
        return tried
    if tried.possible and tried.error >= 1.0:
        return (_as_screened(case, now, one, effect, error) or
                (_borne_out_elsewise(case, now, one, error) if _takes_most(now, one) else None) or tried)
    return tried if tried.possible or not effect.free else _in_range(case, now, one, error) or tried


def as_seen(case: Case, now: Refined, one: Screened, exactly: bool) -> Refined:
    """The model with a cause as it was screened; to first order, or fitted exactly from there."""
    effect = one.shape[0]
    start = now.model.with_effect(effect, _amplitudes(now.fit, laid_whole(case.data, effect, now.model.arm)))
    return refine(start, case.data, now.weight) if exactly else refine(start, case.data, now.weight, steps=0)


def plainer(case: Case, now: Refined, tried: Sequence[Tried], best: Tried, error: HeldOut) -> Tried | None:
    """The cause that, in the form that screening takes, has one number more than `best` at its joint and is worth it; None where
    none is.

    A spring along one line beside an offset, say: where gravity takes most of either, the spring's whole polynomial would be too
    much for what it explains beyond the offset. A number is worth log n of the squared residual in units of its variance
    (Schwarz 1978), and it has to lie three deviations from `best`, by a covariance that allows for a coloured residual.
    """
    worth = []
    for one in tried:
        shape = one.screened.shape[0]
        if one is best or one.screened.joint != best.screened.joint or one.log is not None or shape == one.effect:
            continue
        plain = replace(_refitted(case, now, one.screened, shape, error), sure=True)
        numbers = plain.done.model.effects[-1].count - best.done.model.effects[-1].count
        price = numbers * np.log(case.data.rows) * plain.done.rss / case.data.rows
        pays = numbers == 1 and plain.possible and plain.rank < best.rank and plain.done.rss < best.done.rss - price
        if pays and _beyond(case.data, plain, best) >= _TELLS:
            worth.append(plain)
    return min(worth, key=lambda one: one.rank, default=None)


def _beyond(data: Data, more: Tried, less: Tried) -> float:
    """Distance, in deviations, of the numbers of `more` from the nearest that give the torque of `less`; 0 where a number is not
    told at all, infinite where a law's shape is fitted with it."""
    place, arm = len(more.done.model.effects) - 1, more.done.model.arm
    index = more.done.of_effect(place)
    amplitudes = np.array(more.done.model.effects[place].amplitudes)
    if len(index) != len(amplitudes):
        return np.inf
    covariance = more.done.covariance()[np.ix_(index, index)]
    if set(index) & set(more.done.unseen) or not np.isfinite(covariance).all():
        return 0.0
    own, other = (laid_whole(data, one.done.model.effects[place].effect, arm) for one in (more, less))
    return apart_from(amplitudes, covariance, np.stack([solved(own, column) for column in other], axis=1))


def apart_from(numbers: Array, covariance: Array, plane: Array) -> float:
    """Deviations between `numbers` a (k,) and the nearest point of a plane D (k, m) (Wald 1943):

        √ min over λ of (a - D λ)ᵀ C⁻¹ (a - D λ)
    """
    size = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / size[:, None] / size)
    white = vectors.T / np.sqrt(np.maximum(values, _ROUNDING * values[-1]))[:, None] / size
    left, there = white @ numbers, white @ plane
    return float(np.linalg.norm(left - there @ np.linalg.lstsq(there, left, rcond=None)[0]))


def _as_screened(case: Case, now: Refined, one: Screened, full: Effect, error: HeldOut) -> Tried | None:
    """With the numbers alone that screening takes, where held-out time clearly bears out these; None where it does not.

    A spring along one line goes on beyond the angles in which it was seen; of five powers of the angle each goes its own way there.
    """
    if one.shape[0] == full:
        return None
    tried = _refitted(case, now, one, one.shape[0], error)
    return tried if tried.possible and tried.error < _CONFIRMED else None


def _takes_most(now: Refined, one: Screened) -> bool:
    """Whether a cause takes more than half of what its joint leaves, or of all."""
    own = now.residual if one.joint is None else now.residual[now.data.joint == one.joint - 1]
    return bool(one.gain[0] > _MOST * float(own @ own))


def _near_best(case: Case, now: Refined, one: Screened) -> list[Effect]:
    """The screened shapes that explain nearly the most, best first."""
    found = []
    for laid in lay_family(case.data, one.family, case.arms(now.model).of(one.family)):
        gains, _, _ = gains_of(laid, now.fit, now.residual[None])
        for k in np.flatnonzero(gains[:, 0] >= _NEARLY * one.gain[0]).tolist():
            found.append((float(gains[k, 0]), one.family.shapes[laid.first + k].full()))
    return [shape for _, shape in sorted(found, key=lambda each: -each[0])]


def _borne_out_elsewise(case: Case, now: Refined, one: Screened, error: HeldOut) -> Tried | None:
    """In another of the screened shapes that explain nearly the most, which held-out time clearly bears out, for it is asked more
    than once; None where there is none.

    Over less than a turn, friction that is greatest once in a turn and friction that is twice are alike; over other angles they
    are not.
    """
    others = [shape for shape in _near_best(case, now, one) if shape != one.shape[0].full()][:_OTHERS]
    tried = [_refitted(case, now, one, shape, error) for shape in others]
    confirmed = [other for other in tried if other.possible and other.error < _CONFIRMED]
    return min(confirmed, key=lambda other: other.error, default=None)


def _in_range(case: Case, now: Refined, one: Screened, error: HeldOut) -> Tried | None:
    """In that of the screened shapes which asks for least, of those that explain nearly the most with numbers that can be; None
    where there is none.

    Of a drift that is seen only at its beginning, size and time constant grow together beyond anything; what the logs tell is how
    fast it begins. Of all ends that it may come to, the nearest one goes least beyond what was seen.
    """
    near = [(shape, _amplitudes(now.fit, laid_whole(case.data, shape, now.model.arm))) for shape in _near_best(case, now, one)]
    able = [(float(np.linalg.norm(amplitudes)), shape) for shape, amplitudes in near if shape.possible(shape.values(amplitudes))]
    if not able:
        return None
    _, best = min(able, key=lambda each: each[0])
    tried = _refitted(case, now, one, best, error, best.free)
    return tried if tried.possible else None


def _refitted(case: Case, now: Refined, one: Screened, effect: Effect, error: HeldOut, held: tuple[str, ...] = ()) -> Tried:
    table = laid_whole(case.data, effect, now.model.arm)
    start = (now.model.with_effect(effect, _amplitudes(now.fit, table), held=held) if one.amplitude is None else
             beyond_first_order(now, effect, one.amplitude))
    done = refine(start, case.data, now.weight)
    left = error.share(done, case)
    rank = float(np.nan_to_num(np.sqrt(left * done.rss / now.rss), nan=np.inf))
    believable = done.model.effects[-1].effect.believable([log.motion for log in case.data.logs], done.model.nominal)
    return Tried(one, effect, None, done, left, rank, _visibility(now, table), believable=believable, of_size=_of_size(done))


def _of_size(done: Refined) -> bool:
    """Whether no torque among the numbers of the last effect is beyond the largest that the fitted logs show of joints of its kind.

    A hump of friction far wider than the speeds that were seen is a straight line there, of any height that its width makes up for.
    """
    last, values = done.model.effects[-1].effect, done.model.effects[-1].values
    largest = done.data.largest_torque(last.joint)
    return all(abs(values[q.name]) <= largest for q in last.parameters if q.unit == "N m" and not q.shape)


def best_form(case: Case, now: Refined, best: Tried, error: HeldOut) -> Tried:
    """The cause by the law that leaves decidedly less of its joint, fitted and held out, where it has more than one; each further
    number has to leave decidedly less again."""
    if best.log is not None:
        return best
    chosen, least = best, _left_at(case, best)
    forms = best.effect.forms()
    tried = shared_out(lambda form: _refitted(case, now, best.screened, form, error).lean, forms)
    for form, lean in zip(forms, tried, strict=True):
        other = replace(lean.whole(best.screened, now), sure=best.sure)
        further = chosen is best or _count(other) > _count(chosen)
        if other.error < 1.0 and other.possible and (left := _left_at(case, other)) < (form.decided if further else 1.0) * least:
            chosen, least = other, left
    return chosen


def _count(tried: Tried) -> int:
    return tried.done.model.effects[-1].count


def _left_at(case: Case, tried: Tried) -> float:
    """Squared error at the cause's joint: the mean of fitted and held out by their product."""
    joint, done = tried.effect.joint, tried.done
    held = done.data if case.judge is None else case.judge
    powers = [np.square(done.data.rms(done.left)), np.square(held.rms(held_out_left(done, case.judge, case.blocks)))]
    each = np.sqrt(powers[0] * powers[1]) * np.square(done.weight)
    return float(each.sum() if joint is None else each[joint - 1])


def _given(case: Case, now: Refined, one: Screened, amplitudes: Array) -> Effect:
    """The shape that leaves least with the amplitudes that physics gives; screening, which fits them, takes half of a gap twice as
    wide for the same."""
    best, least = one.shape[0], np.inf
    for laid in lay_family(case.data, one.family, case.arms(now.model).of(one.family)):
        for k, table in enumerate(laid.table):
            column = np.zeros(case.data.rows)
            column[laid.rows] = amplitudes @ table
            left = float(np.sum(np.square(now.fit.residual - now.fit.project(column))))
            if left < least:
                best, least = one.family.shapes[laid.first + k], left
    return best


def _happened(case: Case, now: Refined, one: Screened, error: HeldOut) -> Tried:
    """An event: in one log, which no other can confirm; or in all at the same time from their start, where the held-out ones do."""
    log, effect = one.logs[0], one.shape[0].full()
    whole = laid_whole(case.data, effect, now.model.arm)
    table = whole if log is None else np.where(case.data.log_of == log - case.data.first, whole, 0.0)
    once = refine(now.model.with_effect(effect, _amplitudes(now.fit, table), log), case.data, now.weight)
    tried = Tried(one, effect, log, once, once.rss / now.rss, once.rss / now.rss, _visibility(now, table))
    if case.judge is None or log is None:
        return tried
    named = once.model.effects[-1]
    always = refine(now.model.with_effect(named.effect, np.array(named.amplitudes)), case.data, now.weight)
    seen = error.share(always, case)
    rank = float(np.sqrt(seen * always.rss / now.rss))
    return Tried(one, effect, None, always, seen, rank, tried.visibility) if seen < _CONFIRMED else tried


def _visibility(now: Refined, table: Array) -> float:
    return float(np.linalg.norm(now.fit.project(table))) / max(float(np.linalg.norm(table * now.weights)), 1e-300)


def laid_whole(data: Data, effect: Effect, arm: Arm) -> Array:
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


def first_order_missed(rival: Tried, place: int, last: Tried, case: Case) -> float:
    """Squared weighted torque of effect number `place` and the last one together that `rival` cannot do to first order, beside all
    else: a fit, which tells it exactly, costs ten times as much."""
    done, two = last.done, (place, len(last.done.model.effects) - 1)
    others = replace(done.model, effects=tuple(e for k, e in enumerate(done.model.effects) if k not in two))
    own = laid_whole(case.data, rival.done.model.effects[-1].effect, done.model.arm)
    rest = np.delete(done.slopes, [k for which in two for k in done.of_effect(which)], axis=0)
    missed = fit_columns(case.data, np.concatenate([rest, own]), done.model.torque(case.data) - others.torque(case.data),
                         done.weight).residual
    return float(missed @ missed)

"""The second question: what has changed since the reference logs.

    since = since_reference(prepared, settings)
    since.case         the later logs less the standing effects, with the gate that lets pass only what has changed
    since.floor        what the nominal model and the standing effects leave of the reference logs
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.linear import covariance
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns, fit_nominal, law_slopes, orthonormal, rows_of
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.floor.by_speed import floor_by_speed
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.reference.absorbed import Absorbed, Sessions, Unexplained, absorbed
from pipelines.model.diagnosis.reference.standing import (
    Chance,
    Chosen,
    Mask,
    apart,
    bounds,
    changes,
    fit_changed,
    joined,
    standing_set,
)
from pipelines.model.diagnosis.reference.standing_shapes import fitted_shapes
from pipelines.model.diagnosis.reference.stood import ANYTHING, Share, share_before
from pipelines.model.diagnosis.result import Standing
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Arms, Family, families, lay_one, whole_motion
from pipelines.model.diagnosis.screened.screen import Screened
from pipelines.model.diagnosis.searched.beside import less
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.unseen.injection import Probe
from pipelines.model.diagnosis.worth.numbers import of_amplitudes, told
from pipelines.model.effects.base import Effect
from pipelines.model.estimation.regression import Columns

__all__ = ["Known", "Moved", "OfReference", "Probed", "Since", "since_reference"]

_NEARLY = 0.9  # of the length of columns, that others can imitate
_ALLOWED, _SHARE = 3.0, 0.1  # standard deviations of the reference logs alone; of an amplitude: no law is that of the machine

Probed = Callable[[Refined, Data | None, Arms], tuple[Probe, Thresholds]]
Moved = Callable[[Refined, Sequence[Family]], Absorbed | Unexplained | None]
Known = tuple[Array, Mapping[tuple[str, int | None], float]]  # weights (joints,) and gains with these


@dataclass(frozen=True, eq=False)
class OfReference:
    """What the reference logs say before they are held against later ones."""

    data: Data  # rows of the reference logs, then of the later ones
    later: Mask  # which of them are later ones
    every: tuple[Family, ...]
    arm: Arm  # the nominal model of the reference logs
    standing: tuple[Chosen, ...]
    columns: Columns  # the nominal laws, in shapes that were fitted beside what stands
    beta: Array  # numbers of that model


@dataclass(frozen=True, eq=False)
class Since:
    """What is asked with reference logs."""

    case: Case
    floor: Array  # (joints,) [N m]
    left: Array  # (rows,) [N m] of the reference logs, by the model that has the standing effects
    standing: tuple[Standing, ...]
    acting: tuple[Acting, ...]  # the same, for a model, after those that were taken out before
    absorbed: Moved  # see `absorbed`: beside what was found in the later logs
    chance: Chance
    probed: Probed  # beside a final model: what limits are looked for with
    floor_of: Callable[[Data], Array]  # (joints,) [N m] of logs of another motion
    stood: tuple[Effect, ...]  # those of the standing effects that later logs have shown
    of_reference: OfReference


def _of_reference(prepared: Prepared, reference: Data, chosen: DiagnosisSettings) -> OfReference:
    """What stands by the reference logs alone."""
    columns, fit = fit_nominal(reference, prepared.columns)
    arm = Exact.start(columns, fit).arm
    data, later = joined(reference, prepared.data)
    every = families(columns.laws, whole_motion(data), arm, chosen.without)
    standing, columns, beta = fitted_shapes(standing_set(reference, fit, every, arm), columns, fit)
    return OfReference(data, later, every, arm, standing, columns, beta)


def since_reference(prepared: Prepared, reference: Data, chosen: DiagnosisSettings, before: Sequence[Acting] = (),
                    known: Known | None = None, stood: Sequence[Effect] = (), known_alone: OfReference | None = None) -> Since:
    """Standing effects, the gate for changes, and causes that base parameters show.

    Args:
        before: effects that were taken out of the rows already.
        stood: effects of which is known that they stand as well, in these shapes.
        known: what chance gives each cause on the same reference logs, where an earlier diagnosis has found it.
        known_alone: what the reference logs say by themselves, where it is known.
    """
    own = known_alone or _of_reference(prepared, reference, chosen)
    data, later, every, arm, columns, beta = own.data, own.later, own.every, own.arm, own.columns, own.beta
    standing = _with(own.standing, stood, data, arm)
    base = rows_of(data, columns)
    nominal = np.concatenate([base, *law_slopes(data, columns, beta[:len(base)])[0]])
    common = _torques(data, standing, arm)
    whole = fit_columns(data, np.concatenate([apart(nominal, later), common]))
    alone = fit_columns(reference, np.concatenate([nominal, common])[:, ~later])
    sizes, spreads = _sizes(alone, whole, standing)
    before_and_after = [one.effect for one in standing]
    now = less(prepared.data, _known(prepared.data, standing, sizes, arm), before_and_after)
    judge = prepared.judge and less(prepared.judge, _known(prepared.judge, standing, sizes, arm), before_and_after)
    start = fit_columns(now, np.concatenate([rows_of(now, columns), *law_slopes(now, columns, beta[:len(base)])[0]]))

    standing = _paying(standing, len(nominal), alone) if stood else standing
    left = alone.left
    floor = reference.rms(left)
    weight, there = (1.0 / np.maximum(floor, 1e-12), {}) if known is None else known
    chance = Chance.of(data, later, nominal, common, weight, arm,
                       {family: there[family.cause, family.joint] for family in every if (family.cause, family.joint) in there})

    def changed(found: Refined, wanted: Sequence[bool]) -> tuple[Sequence[Screened], Thresholds]:
        return changes(data, later, nominal, common, _slopes(found, later), found.weight, every, wanted, arm, chance)

    def probed(found: Refined, judge: Data | None, seen: Arms) -> tuple[Probe, Thresholds]:
        fit = fit_changed(data, later, nominal, common, _slopes(found, later), found.weight)
        return Probe.of(found, judge, seen, (data, fit, later)), bounds(every, [True] * len(every), fit, later, chance)

    def share(found: Refined, place: int) -> Share:
        effects = found.model.effects
        if _farther(effects[place].effect, standing, prepared.data, reference):
            return ANYTHING
        rest = [k for other in range(len(effects)) if other != place for k in found.of_effect(other)]
        slopes = np.zeros((len(rest), data.rows))
        slopes[:, later] = found.slopes[rest]
        others = np.concatenate([apart(nominal, later), slopes])
        return share_before(lay_one(data, effects[place].effect, arm), data, later, others, common, found.weight)

    acting = tuple(of_amplitudes(one.effect, size, spread, arm.robot.revolute)
                   for one, size, spread in zip(standing, sizes, spreads, strict=True))
    model = replace(Exact.start(columns, start), standing=tuple(one for one in acting if one.effect.adds))
    kept = len(columns.kept)

    def sessions(found: Refined) -> Sessions:
        """The numbers of what was found stay free: they were fitted beside base parameters that could do a part of it."""
        rows, _ = joined(reference, less(prepared.data, found.of_effects))
        return Sessions(rows, later, base[:kept], nominal[kept:], np.concatenate([common, _slopes(found, later)]), whole.weight)

    def of_one_set(found: Refined, effect: Effect) -> float:
        two = sessions(found)
        left = two.fit(moved=False, more=two.acting(effect, arm)).residual
        return float(left @ left)

    case = Case(now, judge, model, start.weight, every, None, chosen.blocks, changed=changed,
                shared=of_one_set, beside=(*before, *acting), before=share)

    def moved(found: Refined, laws: Sequence[Family]) -> Absorbed | Unexplained | None:
        return absorbed(sessions(found), arm, laws, chance.moved(kept) if laws else 0.0, chosen.without)

    shown = tuple(Standing(own.effect.name, own.effect.joint, told(own), one.gain)
                  for one, own in zip(standing, acting, strict=True))
    return Since(case, floor, left, shown, case.beside, moved, chance, probed,
                 partial(floor_by_speed, reference, left), tuple(stood), own)


def _farther(effect: Effect, standing: Sequence[Chosen], now: Data, reference: Data) -> bool:
    """Whether the same stands at its joint, and the later logs go where the reference logs say nothing of that."""
    stands = any((one.effect.name, one.effect.joint) == (effect.name, effect.joint) for one in standing)
    return stands and effect.beyond(*([one.motion for one in rows.logs] for rows in (now, reference)))


def _with(standing: Sequence[Chosen], stood: Sequence[Effect], data: Data, arm: Arm) -> tuple[Chosen, ...]:
    """With what stands as well, in place of nearly the same at its joint: a wave of another order stays."""
    out = list(standing)
    for effect in stood:
        columns = lay_one(data, effect, arm)
        basis = orthonormal(columns)
        like = [one for one in out if (one.effect.name, one.effect.joint) == (effect.name, effect.joint)
                and _covered(lay_one(data, one.effect, arm), basis)]
        out = [*(one for one in out if one not in like), Chosen(effect, 0.0, np.zeros(len(columns)))]
    return tuple(out)


def _covered(columns: Array, basis: Array) -> bool:
    """Whether the orthonormal rows of `basis` are most of the columns."""
    return bool(np.linalg.norm(columns @ basis.T) >= _NEARLY * np.linalg.norm(columns))


def _paying(standing: Sequence[Chosen], first: int, alone: Fit) -> tuple[Chosen, ...]:
    """Those of which nobody knows it with the share of the squared residual of their joint that they take away in the reference
    logs, beside all others; the columns of all are those of the fit from number `first` on."""
    found = []
    for one in standing:
        own, first = range(first, first + len(one.amplitudes)), first + len(one.amplitudes)
        if one.gain:
            found.append(one)
            continue
        left = fit_columns(alone.data, np.delete(alone.table, own, axis=0), alone.y, alone.weight).residual
        here = np.full(alone.data.rows, True) if one.effect.joint is None else alone.data.joint == one.effect.joint - 1
        gain = 1.0 - float(np.sum(np.square(alone.residual[here]))) / max(float(np.sum(np.square(left[here]))), 1e-300)
        found.append(replace(one, gain=max(gain, 0.0)))
    return tuple(found)


def _slopes(found: Refined, later: Mask) -> Array:
    """(n, rows) slopes of the effects found so far, which act in the later rows."""
    places = [k for place in range(len(found.model.effects)) for k in found.of_effect(place)]
    more = np.zeros((len(places), len(later)))
    more[:, later] = found.slopes[places]
    return more


def _torques(data: Data, standing: Sequence[Chosen], arm: Arm) -> Array:
    """(amplitudes, rows) columns of all standing effects."""
    return np.concatenate([np.zeros((0, data.rows)), *(lay_one(data, one.effect, arm) for one in standing)])


def _sizes(alone: Fit, whole: Fit, standing: Sequence[Chosen]) -> tuple[list[Array], list[Array]]:
    """Amplitudes of each and their covariance, the last of either fit: of the `whole`, of before and after, which tells an offset
    from weight better than the reference logs do `alone`, as far as these allow them; else theirs, for the later logs have what has
    changed as well. What has changed pulls the shared ones a little, too: how far the two are apart belongs to their deviations."""
    sizes, spreads = [], []
    left = sum(len(one.amplitudes) for one in standing)
    every = [(fit.beta, covariance(fit.table * fit.weights, fit.residual)) for fit in (alone, whole)] if standing else []
    for one in standing:
        own = slice(-left, len(one.amplitudes) - left or None)
        (mine, narrow), (both, wide) = ((beta[own], spread[own, own]) for beta, spread in every)
        allowed = np.maximum(_ALLOWED * np.sqrt(np.maximum(np.diag(narrow), 0.0)), _SHARE * np.abs(mine))
        shared = bool((np.abs(both - mine) <= allowed).all())
        sizes.append(both if shared else mine)
        spreads.append(wide + np.outer(both - mine, both - mine) if shared else narrow)
        left -= len(one.amplitudes)
    return sizes, spreads


def _known(data: Data, standing: Sequence[Chosen], sizes: Sequence[Array], arm: Arm) -> Array:
    """(rows,) [N m] of the standing effects."""
    torque = np.zeros(data.rows)
    for one, size in zip(standing, sizes, strict=True):
        torque += size @ lay_one(data, one.effect, arm)
    return torque

"""Compute detection limits in closed form, and list causes that are not identifiable.

    limits = limits_of(later, state, baseline)
    causes = without_limit(result, frf)            those that no list of the result has

A cause of amplitude a adds a² h to T_c, h its share of H_c (`screening`). It is found with
95 % where

    a √h > √threshold + 1.65

√T_c is about normal with unit variance, and 1.65 its one-sided 95 % deviate (Scharf & Friedlander
1994, power of the matched subspace detector).

Of shapes that differ, an order say, the limit is that of one that a quarter of them do not reach.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.diagnosis.baseline import Baseline
from pipelines.diagnosis.candidates import Group
from pipelines.diagnosis.config import LIMITS
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.result import (
    DetectionLimit,
    Diagnosis,
    NotIdentifiable,
    Value,
    WithoutLimit,
)
from pipelines.diagnosis.state import State
from pipelines.diagnosis.unnamed import Key
from pipelines.effects import all_effects
from pipelines.effects.base import Effect, FrictionLaw, Quantity
from pipelines.estimation.joint_table import Array
from pipelines.friction.laws import LADDER

__all__ = ["Limits", "limits_of", "without_limit"]

_TOO_MUCH = "these logs cannot show it: no arm has so much of it that they would"


@dataclass(frozen=True)
class Limits:
    """Detection limits, and causes that these logs cannot show."""

    detection_limits: tuple[DetectionLimit, ...]
    not_identifiable: tuple[NotIdentifiable, ...]


@dataclass(frozen=True, eq=False)
class _Shape:
    """One shape of a cause."""

    effect: Effect
    hidden: Array  # H_c, of its amplitudes
    length: Array  # of its columns
    cross: Array  # coefficients by which the model imitates them, of unit columns
    group: Group

    @property
    def freedom(self) -> int:
        return self.group.width

    def power(self, amplitudes: Array) -> float:
        """Return what these amplitudes add to T_c."""
        return float(amplitudes @ self.hidden @ amplitudes)

    @property
    def identifiability(self) -> float:
        """Share of its first column that the model cannot imitate."""
        return float(np.sqrt(max(self.hidden[0, 0], 0.0)) / max(self.length[0], 1e-300))


def limits_of(later: Later, state: State, baseline: Baseline) -> Limits:
    """Return the limits beside the model that was found."""
    shapes: dict[Key, list[_Shape]] = {}
    norms = np.r_[state.known.base.norms, state.effects.norms]
    cross = later.cross_with(state)
    solved = state.factor.solve(cross)
    for group, square in zip(later.dictionary.groups, later.squares, strict=True):
        at, family = group.columns, later.dictionary.families.get(group.key)
        if group.kind != "named" or family is None:
            continue
        shape = family.shapes[group.shape]
        if group.amplitude is not None and shape.parameters.fixed is None:  # a lag's slope is there
            continue
        length = np.sqrt(np.maximum(np.diag(square), 0.0))
        part = np.abs(solved[:, at]) * norms[:, None] / np.maximum(length, 1e-300)
        hidden = square - cross[:, at].T @ solved[:, at]
        shapes.setdefault(group.key, []).append(_Shape(shape, hidden, length, part, group))
    there = {(one.effect.name, one.effect.joint) for one in state.model.effects}
    told = [_limit(later, own, baseline) for key, own in shapes.items() if key not in there]
    return Limits(
        tuple(one for one in told if isinstance(one, DetectionLimit)),
        tuple(one for one in told if isinstance(one, NotIdentifiable)),
    )


def _limit(
    later: Later, shapes: Sequence[_Shape], baseline: Baseline
) -> DetectionLimit | NotIdentifiable:
    """Return the smallest of a cause that would have been found, or why none would."""
    visible = max(one.identifiability for one in shapes)
    first = shapes[0].effect
    if visible < LIMITS.visible:
        reason = f"absorbed by {_hiding(later, shapes[0])}; needs other motion"
        return NotIdentifiable(first.name, first.joint, reason, first.words.experiment)
    needed = {
        one.freedom: np.sqrt(baseline.threshold(one.group, one.freedom, later.rows.count))
        + LIMITS.power
        for one in shapes
    }
    if first.parameters.fixed is None:
        reach = [np.sqrt(max(s.hidden[0, 0], 0.0)) / needed[s.freedom] for s in shapes]
        one = shapes[int(np.argsort(reach)[int(LIMITS.worst * (len(reach) - 1))])]
        least = needed[one.freedom] / np.sqrt(max(one.hidden[0, 0], 1e-300))
        share = later.shares[later.dictionary.groups.index(one.group)]
        usual = later.usual / np.maximum(one.length[0] * np.sqrt(share), 1e-300)  # (joints,)
        slight = first.parameters.slight(later.rows.data.logs[0].motion.sample_time)
        least = max(least, float(usual.min()), slight)
        return _told(later, one, least * np.eye(one.freedom)[0], visible)
    amplitudes = np.array(first.parameters.fixed)
    seen = [s for s in shapes if s.power(amplitudes) > needed[s.freedom] ** 2]
    if not seen:
        return NotIdentifiable(first.name, first.joint, _TOO_MUCH, first.words.experiment)
    size, way = first.words.size, -1.0 if first.words.falling else 1.0
    best = min(seen, key=lambda s: way * float(getattr(s.effect, size)))
    return _told(later, best, amplitudes, visible)


def _told(
    later: Later, one: _Shape, amplitudes: Array, visible: float
) -> DetectionLimit | NotIdentifiable:
    """Return the parameter that goes with the amplitudes, where an arm can have as much of it."""
    effect, joint = one.effect, one.effect.joint
    values = effect.values(amplitudes)
    turning = joint is None or later.dataset.arm.robot.revolute[joint - 1]
    beyond = NotIdentifiable(effect.name, joint, _TOO_MUCH, effect.words.experiment)
    if effect.parameters.fixed is not None:
        q = next(q for q in effect.parameters if q.name == effect.words.size)
        size = Value(values[q.name], None, q.unit_at(turning))
        less = effect.words.falling
        return DetectionLimit(effect.name, joint, q.name, size, {}, visible, less)
    main = _main(effect, values)
    if main is None:
        return beyond
    size = Value(abs(values[main.name]), None, main.unit_at(turning))
    most = max(abs(main.low), main.high)
    if main.unit == "N m":  # no torque beyond the largest that the machine has given
        most = min(most, later.rows.data.largest_torque(joint))
    if abs(values[main.name]) > most:
        return beyond
    shown = effect.reported(values)
    at = {
        q.name: Value(values[q.name], None, q.unit_at(turning))
        for q in effect.parameters
        if q.shape and q.name in shown and np.isfinite(values.get(q.name, np.nan))
    }
    return DetectionLimit(effect.name, joint, main.name, size, at, visible)


def _main(effect: Effect, values: dict[str, float]) -> Quantity | None:
    """Return the parameter that is the size of an effect; None where no value is finite."""
    sizes = (q for q in effect.parameters if not (q.shape or q.derived) and values.get(q.name))
    return next((q for q in sizes if np.isfinite(values[q.name])), None)


def _hiding(later: Later, one: _Shape) -> str:
    """Return the names of the nominal parameters that imitate a shape."""
    names = [column.name for column in later.dataset.model.columns.names]
    share = one.cross[: len(names)].max(axis=1)
    most = [n for n, x in zip(names, share, strict=True) if x > LIMITS.main]
    return ", ".join(most) or "all base parameters together"


_NOMINAL = "it is part of the nominal model, whose friction is fitted to these logs"
_LAW = (
    "it is another law of friction for the nominal model, and no fault: "
    "fit-friction chooses among the laws"
)
_RESPONSES = (
    "the frequency responses show none at the joints that they are of, "
    "below the highest frequency that they excite"
)
_STILL = "the base parameters are not found to have moved since the reference logs as it moves them"
_NOT_ASKED = "it was looked for; no detection limit was computed"


def without_limit(
    told: Diagnosis, frf: bool, without: Collection[str] = ()
) -> tuple[WithoutLimit, ...]:
    """Return every cause that none of the other lists has, with what is known of it.

    Without laws that are only the plainer form of another, unless the nominal model has them.

    Args:
        frf: whether there are frequency responses.
        without: names of causes that were left out.
    """
    lists = (told.findings, told.baseline_effects, told.detection_limits, told.not_identifiable)
    there = {one.cause for some in lists for one in some}
    laws = set() if told.nominal is None else {law.effect.name for law in told.nominal.friction}
    refused = {one.cause: one.reason for one in told.rejected}
    return tuple(
        WithoutLimit(
            kind.name,
            f"rejected: {refused[kind.name]}" if kind.name in refused else _seen(kind, laws, frf),
        )
        for kind in all_effects()
        if kind.name not in there | _stand_ins() - laws and kind.name not in without
    )


def _stand_ins() -> set[str]:
    """Laws that are the plainer form of another, and on no rung of the ladder of fit-friction."""
    laws = [kind for kind in all_effects() if issubclass(kind, FrictionLaw)]
    plainer = {name for kind in laws for names in kind.plainer for name in names}
    return plainer - {name for law in LADDER for name in law.members}


def _seen(kind: type[Effect], laws: Collection[str], frf: bool) -> str:
    if kind.name in laws:
        return _NOMINAL
    if kind.evidence == "frequency responses" and frf:
        return _RESPONSES
    return {"none": _LAW, "base parameters": _STILL}.get(kind.evidence, _NOT_ASKED)

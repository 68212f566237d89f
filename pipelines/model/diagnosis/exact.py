"""Fit an arm with its effects exactly: every number at once, the torque computed as the effects act, not to first order.

    model = Exact.start(columns, fit)                     the nominal model
    tried = model.with_effect(effect, amplitudes)         a cause more
    done = refine(tried, data)                            Gauss-Newton over everything
    done.residual, done.basis                             what is left, and what the model can imitate

The numbers are the base parameters, amplitudes and shapes of the friction laws, amplitudes and free shapes of the effects. Slopes
by what is linear in the nominal model are its columns; those by an effect's numbers are differences of the whole torque.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.linear import covariance, solved, visibility
from pipelines.model.diagnosis.nominal import Fit, effect_rows, law_rows, law_slopes, nominal_arm, rigid_rows
from pipelines.model.diagnosis.record import recorded
from pipelines.model.effects.base import Effect, Quantity
from pipelines.model.estimation.regression import Columns
from pipelines.model.rigid.body import Motion

__all__ = ["Exact", "Named", "Refined", "number_moved", "refine"]

_STEPS = 8
_SHARES = (1.0, 0.4, 0.1)  # of a step, until one leaves less
_RIDGES = (0.0, 1e-4, 1e-2)  # of unit columns: two numbers that do nearly the same would be moved far apart
_GAIN = 1e-5  # of the squared residual: less is no progress
_DIFFERENCE = 1e-3  # of a number, for slopes
_FARTHEST = 0.5  # of ln shape, a step
_INVISIBLE = 1e-3  # η below which a number is one that the others are as well


@dataclass(frozen=True)
class Named:
    """An effect with its amplitudes."""

    effect: Effect
    amplitudes: tuple[float, ...]
    log: int | None = None  # number of the log it belongs to, where it happened once; None: it acts in all

    @property
    def values(self) -> dict[str, float]:
        return self.effect.values(np.array(self.amplitudes))

    @property
    def free_shapes(self) -> list[Quantity]:
        return [q for q in self.effect.parameters if q.name in self.effect.free]

    @property
    def free_amplitudes(self) -> bool:
        return self.effect.fixed_amplitudes is None

    @property
    def count(self) -> int:
        """Numbers that are fitted."""
        return len(self.free_shapes) + (len(self.amplitudes) if self.free_amplitudes else 0)

    @property
    def possible(self) -> bool:
        """Whether every number lies in its range, amplitudes of derived sign apart."""
        return self.effect.possible(self.values)


@dataclass(frozen=True, eq=False)
class Exact:
    """A model with all its numbers."""

    columns: Columns  # laws in their shapes
    beta: Array  # of the rigid body and the laws
    effects: tuple[Named, ...]

    @classmethod
    def start(cls, columns: Columns, fit: Fit) -> Exact:
        count = len(columns.kept) + sum(not q.shape for law in columns.laws for q in law.parameters)
        return cls(columns, fit.beta[:count].copy(), ())

    def with_effect(self, effect: Effect, amplitudes: Array, log: int | None = None) -> Exact:
        given = amplitudes if effect.fixed_amplitudes is None else effect.fixed_amplitudes
        return replace(self, effects=(*self.effects, Named(effect, tuple(map(float, given)), log)))

    def without(self, place: int) -> Exact:
        return replace(self, effects=tuple(e for k, e in enumerate(self.effects) if k != place))

    @cached_property
    def nominal(self) -> Arm:
        return nominal_arm(self.columns, self.beta)

    @cached_property
    def arm(self) -> Arm:
        """With every effect that does not belong to one log."""
        return self.arm_in(-1)

    def arm_in(self, log: int) -> Arm:
        """As it was in log number `log`."""
        turning = self.columns.body.robot.revolute
        acting = [Acting.of(one.effect, one.values, revolute=one.effect.joint is None or turning[one.effect.joint - 1])
                  for one in self.effects if one.log in (None, log)]
        return self.nominal.extended(*acting)

    @property
    def core(self) -> int:
        """How many of the effects the torque has to be worked out with as a whole: all up to the last that does not just add."""
        if any(one.effect.last for one in self.effects):
            return len(self.effects)
        return max((k + 1 for k, one in enumerate(self.effects) if not one.effect.adds), default=0)

    def torque(self, data: Data) -> Array:
        """(rows,)"""
        core = self.core
        parts = [self.added(data, one) for one in self.effects[core:]]
        return np.asarray(sum(parts, self.core_torque(data, core)))

    def core_torque(self, data: Data, core: int) -> Array:
        """(rows,) of the nominal model and the first `core` effects."""
        if core:
            inner = replace(self, effects=self.effects[:core])
            return data.lay_each(lambda log, motion: inner.arm_in(log).torque(motion))
        if not all(law.from_motion for law in self.columns.laws):
            return data.lay(self.nominal.torque)
        kept = len(self.columns.kept)
        torque, first = self.beta[:kept] @ rigid_rows(data, self.columns), kept
        for law in self.columns.laws:
            count = sum(not q.shape for q in law.parameters)
            torque = torque + self.beta[first:first + count] @ law_rows(data, law, self.columns)
            first += count
        return np.asarray(torque)

    def added(self, data: Data, one: Named) -> Array:
        """(rows,) what an effect adds, beside the nominal model, in the logs it belongs to."""
        return np.asarray(one.effect.amplitudes(one.values) @ self.columns_of(data, one))

    def columns_of(self, data: Data, one: Named) -> Array:
        """(k, rows) the same of each of its amplitudes."""
        columns = effect_rows(data, one.effect.at(one.values), self.nominal)
        return columns if one.log is None else np.where(data.log_of == one.log - data.first, columns, 0.0)

    def moved(self, shift: Array, names: list[tuple[int, int, str]]) -> Exact:
        """Every number moved: base first, then what `names` says: shapes of laws, numbers of effects."""
        first = len(self.beta)
        laws, effects = list(self.columns.laws), list(self.effects)
        for (kind, place, name), by in zip(names, shift[first:].tolist(), strict=True):
            if kind == 0:
                laws[place] = _shape_moved(laws[place], name, by)
            else:
                effects[place] = number_moved(effects[place], name, by)
        return Exact(replace(self.columns, laws=tuple(laws)), self.beta + shift[:first], tuple(effects))


def _shape_moved(effect: Effect, name: str, by: float) -> Effect:
    """A shape of positive range moves by its logarithm, any other by itself."""
    quantity = next(q for q in effect.parameters if q.name == name)
    here = float(getattr(effect, name))
    there = here * float(np.exp(np.clip(by, -_FARTHEST, _FARTHEST))) if quantity.low > 0.0 else here + by
    shape: dict[str, Any] = {name: float(np.clip(there, quantity.low, quantity.high))}
    return replace(effect, **shape)


def number_moved(one: Named, name: str, by: float) -> Named:
    """Amplitude number `name`, or the shape of that name, moved: a shape of positive range by its logarithm."""
    if name.isdigit():
        amplitudes = list(one.amplitudes)
        amplitudes[int(name)] += by
        return replace(one, amplitudes=tuple(amplitudes))
    return replace(one, effect=_shape_moved(one.effect, name, by))


@dataclass(frozen=True, eq=False)
class Refined:
    """A model fitted exactly."""

    model: Exact
    data: Data
    weight: Array  # (joints,)
    left: Array  # (rows,) [N m]
    slopes: Array  # (numbers, rows) unweighted
    names: tuple[tuple[int, int, str], ...]  # of the slopes behind those of the base

    @cached_property
    def weights(self) -> Array:
        return np.asarray(self.weight[self.data.joint])

    @property
    def residual(self) -> Array:
        """(rows,) weighted."""
        return np.asarray(self.left * self.weights)

    @cached_property
    def fit(self) -> Fit:
        """As a linear fit around the solution: what is orthogonal to it, the model cannot imitate by moving a little."""
        return Fit(self.data, self.slopes, self.left, self.weight, np.zeros(len(self.slopes)), self.data.y - self.left)

    @cached_property
    def rss(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def rms(self) -> Array:
        return self.data.rms(self.left)

    def of_effect(self, place: int) -> list[int]:
        """Which slopes belong to effect number `place`."""
        first = len(self.model.beta)
        return [first + k for k, (kind, which, _) in enumerate(self.names) if kind == 1 and which == place]

    def covariance(self) -> Array:
        """(numbers, numbers): (JᵀJ)⁻¹ with the residual's own autocorrelation allowed for."""
        return covariance(self.slopes * self.weights, self.residual)


def refine(model: Exact, data: Data, weight: Array, steps: int = _STEPS, target: Array | None = None) -> Refined:
    """Gauss-Newton with halved steps until the squared weighted residual no longer falls."""
    with np.errstate(all="ignore"):  # a step too far may run away: it is not taken then
        return _refined(model, data, weight, steps, data.y if target is None else target)


def _refined(model: Exact, data: Data, weight: Array, steps: int, y: Array) -> Refined:
    weights = weight[data.joint]
    rigid = rigid_rows(data, model.columns)
    left = y - model.torque(data)
    now = float(np.sum(np.square(left * weights)))
    slopes, names = _slopes(model, data, rigid)
    for _ in range(steps):
        better = False
        for ridge in _RIDGES:
            shift = _within(model, names, slopes * weights, left * weights, ridge)
            for share in _SHARES:
                there = model.moved(share * shift, names)
                other = y - there.torque(data)
                power = float(np.sum(np.square(other * weights)))
                if power < now:
                    better = True
                    break
            if better:
                break
        if not better:
            break
        gained, model, left, now = 1.0 - power / now, there, other, power
        slopes, names = _slopes(model, data, rigid)
        if gained < _GAIN:
            break
    return Refined(model, data, weight, left, slopes, tuple(names))


def _slopes(model: Exact, data: Data, rigid: Array) -> tuple[Array, list[tuple[int, int, str]]]:
    if any(one.effect.passing for one in model.effects):
        return _slopes_through(model, data)
    laws = [law_rows(data, law, model.columns) for law in model.columns.laws]
    bent, which = law_slopes(data, model.columns, model.beta)
    names = [(0, place, name) for place, name in which]
    more, core = list(bent), model.core
    here = model.core_torque(data, core) if core else np.zeros(0)
    for place, one in enumerate(model.effects):
        own = model.columns_of(data, one) if place >= core else None
        alone = here if own is None else one.effect.amplitudes(one.values) @ own
        for name, step in _steps(one):
            names.append((1, place, name))
            if own is not None and name.isdigit():  # it is linear in its amplitudes
                more.append(own[int(name)][None])
                continue
            moved = number_moved(one, name, step)
            if own is not None:
                there = model.added(data, moved)
            else:
                effects = (*model.effects[:place], moved, *model.effects[place + 1:core])
                there = replace(model, effects=effects).core_torque(data, core)
            more.append((there - alone)[None] / step)
    return np.concatenate([rigid, *laws, *more]), names


def _slopes_through(model: Exact, data: Data) -> tuple[Array, list[tuple[int, int, str]]]:
    """The same where all torque passes through an effect, a lag of the record: what is linear passes as well."""
    columns, arm, kept = model.columns, model.arm, list(model.columns.kept)

    def linear(motion: Motion) -> Array:
        rigid = columns.body.regressor(motion.q, motion.dq, motion.ddq)[:, :, kept]
        return recorded(arm, np.concatenate([rigid, *(law.columns(motion, columns.arm) for law in columns.laws)], axis=2), motion)

    def alone(one: Named) -> Array:
        return data.lay_each(lambda log, motion: recorded(
            arm, one.effect.at(one.values).columns(motion, model.nominal) @ np.array(one.amplitudes), motion)
            if one.log in (None, log) else np.zeros_like(motion.q))

    here, more = model.torque(data), []
    names = [(0, place, name) for place, name in law_slopes(data, columns, model.beta)[1]]
    for place, _, name in names:
        step = np.array([*np.zeros(len(model.beta)), _DIFFERENCE])
        more.append((model.moved(step, [(0, place, name)]).torque(data) - here)[None] / _DIFFERENCE)
    for place, one in enumerate(model.effects):
        for name, size in _steps(one):
            names.append((1, place, name))
            there = number_moved(one, name, size)
            if one.effect.adds:
                more.append((alone(there) - alone(one))[None] / size)
            else:
                effects = (*model.effects[:place], there, *model.effects[place + 1:])
                more.append((replace(model, effects=effects).torque(data) - here)[None] / size)
    return np.concatenate([data.lay(linear), *more]), names


def _steps(one: Named) -> list[tuple[str, float]]:
    """Numbers of an effect and how far each is moved for its slope."""
    found = []
    if one.free_amplitudes:
        size = max((abs(a) for a in one.amplitudes), default=0.0) or 1e-3
        found = [(str(k), _DIFFERENCE * max(abs(a), 0.1 * size)) for k, a in enumerate(one.amplitudes)]
    for q in one.free_shapes:
        here = abs(float(getattr(one.effect, q.name)))
        wide = min(q.high - q.low, 1e2)
        step = _DIFFERENCE if q.low > 0.0 else _DIFFERENCE * max(here, 1e-2 * wide)
        top = float(getattr(one.effect, q.name)) >= q.high
        found.append((q.name, -step if top else step))
    return found


def _within(model: Exact, names: list[tuple[int, int, str]], table: Array, y: Array, ridge: float) -> Array:
    """The step for every number; the others do without one that would leave its range, and stays at its end, and without one of
    an effect that the rest of the model does as well: rounding would move it anywhere."""
    first = len(model.beta)
    own = [first + k for k, (kind, _, _) in enumerate(names) if kind == 1]
    stuck = [k for k, eta in zip(own, visibility(table, own), strict=True) if eta < _INVISIBLE]
    shift = _without(table, y, ridge, stuck)
    beyond = [first + k for k, which in enumerate(names) if _beyond(model, which, float(shift[first + k]))]
    return _without(table, y, ridge, [*stuck, *beyond]) if beyond else shift


def _without(table: Array, y: Array, ridge: float, stuck: list[int]) -> Array:
    free = np.ones(len(table), dtype=bool)
    free[stuck] = False
    shift = np.zeros(len(table))
    shift[free] = solved(table[free], y, ridge)
    return shift


def _beyond(model: Exact, which: tuple[int, int, str], by: float) -> bool:
    """Whether a shape stands at the end of its range, and `by` points out of it."""
    kind, place, name = which
    if name.isdigit():
        return False
    effect = model.columns.laws[place] if kind == 0 else model.effects[place].effect
    quantity = next(q for q in effect.parameters if q.name == name)
    here = float(getattr(effect, name))
    return (here <= quantity.low and by < 0.0) or (here >= quantity.high and by > 0.0)

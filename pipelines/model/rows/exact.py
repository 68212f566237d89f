"""Compute the torque of an arm with its effects exactly, and its slopes by every number.

    model = Exact.start(columns, fit)                     the nominal model
    model = model.with_effect(effect, amplitudes)         and a cause
    model.torque(data), model.arm
    slopes, names = slopes_of(model, data, rigid)

The numbers are the base parameters, amplitudes and shapes of the friction laws, amplitudes and free
shapes of the effects. Slopes by what is linear are columns; all others, and those by
base parameters and friction beside effects that act on the torque, are differences of the torque.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.effects.base import ArmModel, Effect, FrictionLaw, Quantity, adds
from pipelines.estimation.regression import Columns
from pipelines.io.log import Array
from pipelines.model.rows.data import Data
from pipelines.model.rows.nominal import (
    Fit,
    effect_rows,
    law_rows,
    law_slopes,
    nominal_arm,
    rigid_rows,
    several_rows,
)

__all__ = ["Exact", "Named", "Which", "difference", "further_slopes", "law_of", "nominal_slopes", "number_moved", "recorded",
           "slopes_of"]

def recorded(arm: Arm, table: Array, motion: Motion) -> Array:
    """Return columns (samples, joints, k) as `arm` records them.

    Where the log tells the torque at its start, that is no column's: each begins with nothing.
    """
    for acting in arm.effects:
        if acting.effect.acts_on != "record":
            continue

        def through(torque: Array, one: Acting = acting) -> Array:
            return one.effect.apply(motion, arm, one.values, lambda *_: torque.copy())

        nothing = through(np.zeros(table.shape[:2]))
        table = np.stack([through(column) - nothing for column in np.moveaxis(table, 2, 0)], axis=2)
    return table


_FARTHEST = 0.5  # of ln shape, a step


@dataclass(frozen=True)
class Named:
    """An effect with its amplitudes."""

    effect: Effect
    amplitudes: tuple[float, ...]
    log: int | None = None  # number of the log it belongs to, where it happened once; None: it acts in all
    tied: tuple[str, ...] = ()  # shapes that are those of the friction at its joint
    held: tuple[str, ...] = ()  # shapes that are not fitted

    @property
    def values(self) -> dict[str, float]:
        return self.effect.values(np.array(self.amplitudes))

    @property
    def free_shapes(self) -> list[Quantity]:
        return [q for q in self.effect.parameters if q.name in self.effect.free and q.name not in (*self.tied, *self.held)]

    @property
    def free_amplitudes(self) -> bool:
        return self.effect.parameters.fixed is None

    @property
    def count(self) -> int:
        """Numbers that are fitted."""
        return len(self.free_shapes) + (len(self.amplitudes) if self.free_amplitudes else 0)

    @property
    def possible(self) -> bool:
        """Return whether every number lies in its range, amplitudes of derived sign apart."""
        return self.effect.possible(self.values)


@dataclass(frozen=True, eq=False)
class NominalArm:
    """Base parameters and laws of all models that differ in their effects alone."""

    columns: Columns
    beta: Array

    @cached_property
    def arm(self) -> Arm:
        return nominal_arm(self.columns, self.beta)


@dataclass(frozen=True, eq=False)
class Exact:
    """A model with all its numbers."""

    columns: Columns  # laws in their shapes
    beta: Array  # of the rigid body and the laws
    effects: tuple[Named, ...]
    standing: tuple[Acting, ...] = ()  # that just add; their torque was subtracted from the rows, over the motion as it was read
    of: NominalArm | None = field(default=None, repr=False)  # handed on by `replace`

    def __post_init__(self) -> None:
        if self.of is None or self.of.columns is not self.columns or self.of.beta is not self.beta:
            object.__setattr__(self, "of", NominalArm(self.columns, self.beta))

    @classmethod
    def start(cls, columns: Columns, fit: Fit) -> Exact:
        count = len(columns.kept) + sum(not q.shape for law in columns.laws for q in law.parameters)
        return cls(columns, fit.beta[:count].copy(), ())

    def with_effect(self, effect: Effect, amplitudes: Array, log: int | None = None, held: tuple[str, ...] = ()) -> Exact:
        given = amplitudes if effect.parameters.fixed is None else effect.parameters.fixed
        tied = tuple(q.name for q in effect.parameters if q.shared and law_of(self.columns.laws, effect, q.name) is not None)
        return replace(self, effects=(*self.effects, Named(effect, tuple(map(float, given)), log, tied, held)))

    def without(self, place: int) -> Exact:
        return replace(self, effects=tuple(e for k, e in enumerate(self.effects) if k != place))

    @property
    def nominal(self) -> Arm:
        """The arm without effects: one and the same object for models that differ in these alone."""
        assert self.of is not None
        return self.of.arm

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

    def torque_in(self, log: int, motion: Motion) -> Array:
        """(samples, joints) [N m] in log number `log`, less what stands beside the model where nothing acts on it."""
        arm = self.arm_in(log)
        if not self.standing:
            return arm.torque(motion)
        known = self._standing_torque(motion)

        def inside(there: Motion, own: ArmModel) -> Array:
            same = there is motion and isinstance(own, Arm) and own.base is self.nominal.base and own.body is self.nominal.body
            return own.torque(there) + (known if same else _added(self.standing, there, own))

        return np.asarray(arm.torque(motion, inside) - known)

    def _standing_torque(self, motion: Motion) -> Array:
        """(samples, joints) [N m] of the standing effects, kept with the motion."""
        key = ("standing", self.standing, self.nominal)
        return motion.kept(key, lambda: _added(self.standing, motion, self.nominal))

    @property
    def core(self) -> int:
        """How many of the effects the torque has to be worked out with as a whole: all up to the last that does not just add."""
        if any(one.effect.acts_on != "load" for one in self.effects):
            return len(self.effects)
        return max((k + 1 for k, one in enumerate(self.effects) if not adds(one.effect)), default=0)

    def torque(self, data: Data, laid: Sequence[Array] | None = None) -> Array:
        """(rows,); `laid` as in `laid`, where it is known."""
        core, parts = self.core, self.laid(data) if laid is None else laid
        added = [one.effect.amplitudes(one.values) @ part for one, part in zip(self.effects[core:], parts, strict=True)]
        return np.asarray(sum(added, self.core_torque(data, core)))

    def laid(self, data: Data) -> list[Array]:
        """Columns (k, rows) of each of the effects that just add."""
        return [self.columns_of(data, one) for one in self.effects[self.core:]]

    def core_torque(self, data: Data, core: int) -> Array:
        """(rows,) of the nominal model and the first `core` effects, which act on what stands beside it as well."""
        if core:
            inner = replace(self, effects=self.effects[:core])
            return data.lay_each(inner.torque_in)
        return self._nominal_rows(data)

    def _nominal_rows(self, data: Data) -> Array:
        if not all(law.from_motion for law in self.columns.laws):
            return data.lay(self.nominal.torque)
        kept = len(self.columns.kept)
        torque, first = rigid_rows(data, self.columns, self.beta[:kept]), kept
        for law in self.columns.laws:
            count = sum(not q.shape for q in law.parameters)
            torque = torque + effect_rows(data, law, self.columns.arm, self.beta[first:first + count])
            first += count
        return np.asarray(torque)

    def added(self, data: Data, *several: Named) -> list[Array]:
        """(rows,) what an effect adds beside the nominal model, in the logs it belongs to, each with other numbers."""
        rows = several_rows(data, [one.effect.at(one.values) for one in several], self.nominal)
        return [np.asarray(one.effect.amplitudes(one.values) @ self._of_log(data, one, own))
                for one, own in zip(several, rows, strict=True)]

    def columns_of(self, data: Data, one: Named) -> Array:
        """(k, rows) the same of each of its amplitudes."""
        return self._of_log(data, one, effect_rows(data, one.effect.at(one.values), self.nominal))

    def _of_log(self, data: Data, one: Named, columns: Array) -> Array:
        return columns if one.log is None else np.where(data.log_of == one.log - data.first, columns, 0.0)

    def moved(self, shift: Array, names: Sequence[tuple[int, int, str]]) -> Exact:
        """Every number moved: base first, then what `names` says: shapes of laws, numbers of effects."""
        first = len(self.beta)
        laws, effects = list(self.columns.laws), list(self.effects)
        for (kind, place, name), by in zip(names, shift[first:].tolist(), strict=True):
            if kind == 0:
                laws[place] = _shape_moved(laws[place], name, by)
            else:
                effects[place] = number_moved(effects[place], name, by)
        effects = [_following(one, laws) for one in effects]
        columns = replace(self.columns, laws=tuple(laws))
        return replace(self, columns=columns, beta=self.beta + shift[:first], effects=tuple(effects))


def _added(standing: Sequence[Acting], motion: Motion, arm: ArmModel) -> Array:
    """(samples, joints) [N m] of effects that just add theirs."""
    return np.asarray(sum(one.effect.torque(motion, arm, one.values) for one in standing))


def law_of(laws: Sequence[Effect], effect: Effect, name: str) -> int | None:
    """Return the number of the law at the joint of `effect` that has a shape `name`."""
    return next((k for k, law in enumerate(laws) if law.joint == effect.joint
                 and any(q.shape and q.name == name for q in law.parameters)), None)


def _following(one: Named, laws: Sequence[Effect]) -> Named:
    """The effect with what it shares with the friction at its joint."""
    at = {name: law_of(laws, one.effect, name) for name in one.tied}
    shape: dict[str, Any] = {name: getattr(laws[k], name) for name, k in at.items() if k is not None}
    return replace(one, effect=replace(one.effect, **shape)) if shape else one


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


Which = tuple[int, int, str]  # 0 a law, 1 an effect; its place; the number of an amplitude, or the name of a shape

_DIFFERENCE = 1e-3  # of a number


def difference(one: Exact, other: Exact, which: Which) -> float:
    """Return by how much a number of one model lies above that of another of the same effects, as `number_moved` counts it."""
    kind, place, name = which
    if name.isdigit():
        return one.effects[place].amplitudes[int(name)] - other.effects[place].amplitudes[int(name)]
    a, b = (model.effects[place].effect if kind else model.columns.laws[place] for model in (one, other))
    here, there = (float(getattr(x, name)) for x in (a, b))
    quantity = next(q for q in a.parameters if q.name == name)
    return float(np.log(here / there)) if quantity.low > 0.0 else here - there


def slopes_of(model: Exact, data: Data, rigid: Array, laid: Sequence[Array] | None = None) -> tuple[Array, list[Which]]:
    """(numbers, rows) slopes of the torque by every number, those of `rigid` columns first; and which they are behind the base.

    Args:
        laid: as `model.laid(data)` makes it, where it is known.
    """
    further, names = further_slopes(model, data, range(1, data.n_joints + 1), laid)
    by_nominal = nominal_slopes(model)
    if by_nominal is not None:
        return np.concatenate([data.lay_each(by_nominal), further]), names
    laws = [law_rows(data, law, model.columns) for law in model.columns.laws]
    return np.concatenate([rigid, *laws, further]), names


def nominal_slopes(model: Exact) -> Callable[[int, Motion], Array] | None:
    """Return what gives the slopes (samples, joints, k) by base parameters and friction in a log; None: no effect changes them.

    Each is a difference of the torque that effects make of the nominal one, at the motion as they read it. Effects that add their
    torque change none; of an effect by the session's clock it is a share of the friction at its joint. What effects on the whole
    arm change, as a tilt by its angle, is neglected.
    """
    acting = tuple(one for one in model.effects if one.effect.scope == "joint"
                   and (not adds(one.effect) or one.effect.clock == "session"))
    if not acting:
        return None
    core, columns = replace(model, effects=acting), model.columns
    adding = [one for one in model.effects if adds(one.effect) and one not in acting]
    size = _DIFFERENCE * np.where(core.beta != 0.0, np.abs(core.beta), 1.0)  # what acts on the torque may have kinks

    def by_column(motion: Motion) -> Array:
        laws = [law.columns(motion, columns.arm) * isinstance(law, FrictionLaw) for law in columns.laws]  # others are effects
        rigid = columns.body.regressor(motion.q, motion.dq, motion.ddq)[:, :, list(columns.kept)]
        return np.ascontiguousarray(np.moveaxis(np.concatenate([rigid, *laws], axis=2), 2, 0))

    def slopes(log: int, motion: Motion) -> Array:
        seen: list[tuple[Motion, Array, Array]] = []

        def torque(arm: Arm, number: int | None = None) -> Array:
            def inside(read: Motion, _: ArmModel) -> Array:
                if not seen or not _alike(seen[0][0], read):
                    each, more = by_column(read), [one for one in adding if one.log in (None, log)]
                    added = sum((one.effect.torque(read, core.nominal, one.values) for one in more), np.zeros_like(read.q))
                    seen[:] = [(read, each, np.tensordot(core.beta, each, 1) + added)]
                each, whole = seen[0][1:]
                return np.array(whole) if number is None else np.asarray(whole + size[number] * each[number])

            return arm.torque(motion, inside)

        here = torque(core.arm_in(log))
        there = (torque(replace(core, beta=core.beta + step).arm_in(log), k) for k, step in enumerate(np.diag(size)))
        return np.stack([(one - here) / by for one, by in zip(there, size, strict=True)], axis=2)

    return slopes


def _alike(one: Motion, other: Motion) -> bool:
    return one is other or all(map(np.array_equal, (one.q, one.dq, one.ddq), (other.q, other.dq, other.ddq)))


def further_slopes(
    model: Exact, data: Data, joints: Container[int | None], laid: Sequence[Array] | None = None
) -> tuple[Array, list[Which]]:
    """Return the slopes (numbers, rows) by all that is not a base parameter, and which they are.

    Args:
        joints: of whose friction laws the shapes are among them.
    """
    laws = model.columns.laws
    bent, which = law_slopes(data, model.columns, model.beta)
    own = [k for k, (place, _) in enumerate(which) if laws[place].joint in joints]
    bent, names = [bent[k] for k in own], [(0, *which[k]) for k in own]
    make = _slopes_through if _through(model) else _slopes_beside
    more = make(model, data, bent, names, laid)
    return np.concatenate([np.zeros((0, data.rows)), *more]), names


def _through(model: Exact) -> bool:
    """Return whether all torque passes through an effect, a lag of the record."""
    return any(one.effect.acts_on == "record" for one in model.effects)


def _slopes_beside(
    model: Exact, data: Data, bent: list[Array], names: list[Which], laid: Sequence[Array] | None
) -> list[Array]:
    more, core = list(bent), model.core
    here = model.core_torque(data, core) if core else np.zeros(0)
    whole = any(one.effect.acts_on in ("encoder", "drive") for one in model.effects)
    if whole:  # friction is felt where the joint truly is, and comes late
        more = [_of_law(model, data, here, one) for one in names]
    columns = model.laid(data) if laid is None else laid
    for place, one in enumerate(model.effects):
        own = columns[place - core] if place >= core else None
        alone = here if own is None else one.effect.amplitudes(one.values) @ own
        steps = [(name, step) for name, step in _steps(one) if own is None or not name.isdigit()]
        if own is not None:  # it is linear in its amplitudes
            amplitudes = [name for name, _ in _steps(one) if name.isdigit()]
            names += [(1, place, name) for name in amplitudes]
            more += [own[int(name)][None] for name in amplitudes]
        there = _with(model, data, place, core, [number_moved(one, name, step) for name, step in steps])
        names += [(1, place, name) for name, _ in steps]
        for (name, step), torque in zip(steps, there, strict=True):
            if _is_nothing(one, name):  # of what the arm does not feel either way no slope is left, and not the curvature
                other = _with(model, data, place, core, [number_moved(one, name, -step)])[0]
                more.append((torque - other)[None] / (2.0 * step))
            else:
                more.append((torque - alone)[None] / step)
        for name in () if whole else one.tied:  # it moves with the friction at its joint
            law = (0, law_of(model.columns.laws, one.effect, name), name)
            if law in names:
                torque = _with(model, data, place, core, [number_moved(one, name, _DIFFERENCE)])[0]
                more[names.index(law)] = more[names.index(law)] + (torque - alone)[None] / _DIFFERENCE
    return more


def _with(model: Exact, data: Data, place: int, core: int, moved: Sequence[Named]) -> list[Array]:
    """(rows,) of an effect with each of these numbers: of what just adds its torque, else that of the whole core."""
    if place >= core:
        return model.added(data, *moved)
    return [replace(model, effects=(*model.effects[:place], one, *model.effects[place + 1:core])).core_torque(data, core)
            for one in moved]


def _is_nothing(one: Named, name: str) -> bool:
    """Return whether a number is an amplitude that is 0."""
    return name.isdigit() and one.amplitudes[int(name)] == 0.0


def _slopes_through(
    model: Exact, data: Data, bent: list[Array], names: list[Which], laid: Sequence[Array] | None
) -> list[Array]:
    arm = model.arm

    def alone(one: Named) -> Array:
        """(k, rows) of each of its amplitudes."""
        def columns(motion: Motion) -> Array:
            return recorded(arm, one.effect.at(one.values).columns(motion, model.nominal), motion)

        return model._of_log(data, one, data.lay(columns))

    here = model.torque(data)
    as_read = not any(one.effect.acts_on in ("encoder", "drive") for one in model.effects)
    more = [_of_law(model, data, here, one) for one in names]
    for place, one in enumerate(model.effects):
        steps = _steps(one)
        names += [(1, place, name) for name, _ in steps]
        own = alone(one) if adds(one.effect) and as_read else None
        for name, size in steps:
            there = number_moved(one, name, size)
            if own is not None and name.isdigit():  # it is linear in its amplitudes
                more.append(own[int(name)][None])
            elif own is not None:
                more.append((np.array(there.amplitudes) @ alone(there) - np.array(one.amplitudes) @ own)[None] / size)
            else:
                effects = (*model.effects[:place], there, *model.effects[place + 1:])
                more.append((replace(model, effects=effects).torque(data) - here)[None] / size)
    return more


def _of_law(model: Exact, data: Data, here: Array, law: Which) -> Array:
    """(1, rows) slope of the whole torque, which is `here`, by a shape of a friction law."""
    step = np.array([*np.zeros(len(model.beta)), _DIFFERENCE])
    return (model.moved(step, [law]).torque(data) - here)[None] / _DIFFERENCE


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

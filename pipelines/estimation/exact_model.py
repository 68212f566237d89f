"""Compute the torque of an arm with its effects exactly, and its slopes by every number.

    model = Exact.start(columns, fit)                     the nominal model
    model = model.with_effect(effect, amplitudes)         and a cause
    model.torque(data), model.arm
    slopes, names = slopes_of(model, data, rigid)

The numbers are the base parameters, amplitudes and shapes of the friction laws, amplitudes and free
shapes of the effects. Slopes by what is linear are columns; all others, and those by base
parameters and friction of models with effects that act on the torque, are differences.
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
from pipelines.estimation.nominal import arm_of
from pipelines.estimation.nominal_fit import (
    Fit,
    effect_rows,
    law_rows,
    law_slopes,
    rigid_rows,
    several_rows,
)
from pipelines.estimation.regression import Columns
from pipelines.estimation.rows import Data
from pipelines.io.log import Array

_FARTHEST = 0.5  # numerics: of ln shape, a step
_DIFFERENCE = 1e-3  # numerics: of a number

Which = tuple[int, int, str]  # 0 a law, 1 an effect; its place; an amplitude's number or a shape


@dataclass(frozen=True)
class Named:
    """An effect with its amplitudes."""

    effect: Effect
    amplitudes: tuple[float, ...]
    log: int | None = None  # number of the log where it happened once; None: it acts in all
    tied: tuple[str, ...] = ()  # shapes that are those of the friction at its joint
    held: tuple[str, ...] = ()  # shapes that are not fitted

    @property
    def values(self) -> dict[str, float]:
        return self.effect.values(np.array(self.amplitudes))

    @property
    def free_shapes(self) -> list[Quantity]:
        fixed = (*self.tied, *self.held)
        free = (q for q in self.effect.parameters if q.name in self.effect.free)
        return [q for q in free if q.name not in fixed]

    @property
    def free_amplitudes(self) -> bool:
        return self.effect.parameters.fixed is None

    @property
    def count(self) -> int:
        """Numbers that are fitted."""
        return len(self.free_shapes) + (len(self.amplitudes) if self.free_amplitudes else 0)

    @property
    def possible(self) -> bool:
        """Return whether every number lies in its range."""
        return self.effect.possible(self.values)


@dataclass(frozen=True, eq=False)
class NominalArm:
    """Base parameters and laws of all models that differ in their effects alone."""

    columns: Columns
    beta: Array

    @cached_property
    def arm(self) -> Arm:
        return arm_of(self.columns, self.beta)


@dataclass(frozen=True, eq=False)
class Exact:
    """A model with all its numbers."""

    columns: Columns  # laws in their shapes
    beta: Array  # of the rigid body and the laws
    effects: tuple[Named, ...]
    # that add torque; it was subtracted from the rows, over the motion as it was read
    standing: tuple[Acting, ...] = ()
    of: NominalArm | None = field(default=None, repr=False)  # handed on by `replace`

    def __post_init__(self) -> None:
        same = self.of and self.of.columns is self.columns and self.of.beta is self.beta
        if not same:
            object.__setattr__(self, "of", NominalArm(self.columns, self.beta))

    @classmethod
    def start(cls, columns: Columns, fit: Fit) -> Exact:
        laws = sum(not q.shape for law in columns.laws for q in law.parameters)
        return cls(columns, fit.beta[: len(columns.kept) + laws].copy(), ())

    def with_effect(
        self, effect: Effect, amplitudes: Array, log: int | None = None, held: tuple[str, ...] = ()
    ) -> Exact:
        fixed, laws = effect.parameters.fixed, self.columns.laws
        given = tuple(map(float, amplitudes if fixed is None else fixed))
        shared = (q.name for q in effect.parameters if q.shared)
        tied = tuple(name for name in shared if law_of(laws, effect, name) is not None)
        return replace(self, effects=(*self.effects, Named(effect, given, log, tied, held)))

    def without(self, place: int) -> Exact:
        effects = tuple(e for k, e in enumerate(self.effects) if k != place)
        return replace(self, effects=effects)

    @property
    def nominal(self) -> Arm:
        """The arm without effects: one object for models that differ in these alone."""
        assert self.of is not None
        return self.of.arm

    @cached_property
    def arm(self) -> Arm:
        """The arm with every effect that does not belong to one log."""
        return self.arm_in(-1)

    def arm_in(self, log: int) -> Arm:
        """Return the arm as it was in log number `log`."""
        turning, acting = self.columns.body.robot.revolute, []
        for one in self.effects:
            if one.log in (None, log):
                joint = one.effect.joint
                turns = joint is None or turning[joint - 1]
                acting.append(Acting.of(one.effect, one.values, revolute=turns))
        return self.nominal.extended(*acting)

    def torque_in(self, log: int, motion: Motion) -> Array:
        """Return (samples, joints) [N m] in log number `log`, less that of standing effects."""
        arm = self.arm_in(log)
        if not self.standing:
            return arm.torque(motion)
        # kept with the motion
        key, nominal = ("standing", self.standing, self.nominal), self.nominal
        known = motion.kept(key, lambda: _added(self.standing, motion, nominal))

        def inside(there: Motion, own: ArmModel) -> Array:
            same = isinstance(own, Arm) and own.base is nominal.base and own.body is nominal.body
            if same and there is motion:
                return own.torque(there) + known
            return own.torque(there) + _added(self.standing, there, own)

        return np.asarray(arm.torque(motion, inside) - known)

    @property
    def core(self) -> int:
        """How many effects need the whole torque: all up to the last that does not just add."""
        if any(one.effect.acts_on != "load" for one in self.effects):
            return len(self.effects)
        places = (k + 1 for k, one in enumerate(self.effects) if not adds(one.effect))
        return max(places, default=0)

    def torque(self, data: Data, laid: Sequence[Array] | None = None) -> Array:
        """(rows,); `laid` as in `laid`, where it is known."""
        core, parts = self.core, self.laid(data) if laid is None else laid
        pairs = zip(self.effects[core:], parts, strict=True)
        added = [one.effect.amplitudes(one.values) @ part for one, part in pairs]
        return np.asarray(sum(added, self.core_torque(data, core)))

    def laid(self, data: Data) -> list[Array]:
        """Return the columns (k, rows) of each of the effects that just add."""
        return [self.columns_of(data, one) for one in self.effects[self.core :]]

    def core_torque(self, data: Data, core: int) -> Array:
        """(rows,) of the nominal model and the first `core` effects."""
        if core:
            return data.lay_each(replace(self, effects=self.effects[:core]).torque_in)
        if not all(law.from_motion for law in self.columns.laws):
            return data.lay(self.nominal.torque)
        first = len(self.columns.kept)
        torque = rigid_rows(data, self.columns, self.beta[:first])
        for law in self.columns.laws:
            count = sum(not q.shape for q in law.parameters)
            amplitudes = self.beta[first : first + count]
            torque = torque + effect_rows(data, law, self.columns.arm, amplitudes)
            first += count
        return np.asarray(torque)

    def added(self, data: Data, *several: Named) -> list[Array]:
        """Return the torque (rows,) that an effect adds, each with other numbers."""
        rows = several_rows(data, [one.effect.at(one.values) for one in several], self.nominal)
        return [
            np.asarray(one.effect.amplitudes(one.values) @ self._of_log(data, one, own))
            for one, own in zip(several, rows, strict=True)
        ]

    def columns_of(self, data: Data, one: Named) -> Array:
        """(k, rows) the same of each of its amplitudes."""
        columns = effect_rows(data, one.effect.at(one.values), self.nominal)
        return self._of_log(data, one, columns)

    def _of_log(self, data: Data, one: Named, columns: Array) -> Array:
        if one.log is None:
            return columns
        return np.where(data.log_of == one.log - data.first, columns, 0.0)

    def moved(self, shift: Array, names: Sequence[Which]) -> Exact:
        """Return the model with every number moved: base first, then what `names` says."""
        first = len(self.beta)
        laws, effects = list(self.columns.laws), list(self.effects)
        for (kind, place, name), by in zip(names, shift[first:].tolist(), strict=True):
            if kind == 0:
                laws[place] = _shape_moved(laws[place], name, by)
            else:
                effects[place] = number_moved(effects[place], name, by)
        for k, one in enumerate(effects):  # what is shared with the friction at its joint follows
            at = {name: law_of(laws, one.effect, name) for name in one.tied}
            shape: dict[str, Any] = {
                name: getattr(laws[law], name) for name, law in at.items() if law is not None
            }
            if shape:
                effects[k] = replace(one, effect=replace(one.effect, **shape))
        columns = replace(self.columns, laws=tuple(laws))
        beta = self.beta + shift[:first]
        return replace(self, columns=columns, beta=beta, effects=tuple(effects))


def _added(standing: Sequence[Acting], motion: Motion, arm: ArmModel) -> Array:
    """Return the torque (samples, joints) [N m] of effects that just add theirs."""
    return np.asarray(sum(one.effect.torque(motion, arm, one.values) for one in standing))


def law_of(laws: Sequence[Effect], effect: Effect, name: str) -> int | None:
    """Return the number of the law at the joint of `effect` that has a shape `name`."""
    for k, law in enumerate(laws):
        if law.joint == effect.joint and any(q.shape and q.name == name for q in law.parameters):
            return k
    return None


def _shape_moved(effect: Effect, name: str, by: float) -> Effect:
    """Return the effect with a shape moved: by its logarithm where its range is positive."""
    quantity = next(q for q in effect.parameters if q.name == name)
    value = float(getattr(effect, name))
    if quantity.low > 0.0:
        value *= float(np.exp(np.clip(by, -_FARTHEST, _FARTHEST)))
    else:
        value += by
    shape: dict[str, Any] = {name: float(np.clip(value, quantity.low, quantity.high))}
    return replace(effect, **shape)


def number_moved(one: Named, name: str, by: float) -> Named:
    """Return the effect with amplitude number `name`, or the shape of that name, moved."""
    if name.isdigit():
        amplitudes = list(one.amplitudes)
        amplitudes[int(name)] += by
        return replace(one, amplitudes=tuple(amplitudes))
    return replace(one, effect=_shape_moved(one.effect, name, by))


def difference(one: Exact, other: Exact, which: Which) -> float:
    """Return by how much a number of `one` lies above that of `other`, as it is moved."""
    kind, place, name = which
    if name.isdigit():
        k = int(name)
        return one.effects[place].amplitudes[k] - other.effects[place].amplitudes[k]
    a, b = (m.effects[place].effect if kind else m.columns.laws[place] for m in (one, other))
    here, there = (float(getattr(x, name)) for x in (a, b))
    quantity = next(q for q in a.parameters if q.name == name)
    return float(np.log(here / there)) if quantity.low > 0.0 else here - there


def slopes_of(
    model: Exact, data: Data, rigid: Array, laid: Sequence[Array] | None = None
) -> tuple[Array, list[Which]]:
    """Return the slopes (numbers, rows) of the torque, and which they are after the base.

    Args:
        rigid: columns of the rigid body.
        laid: as `model.laid(data)` makes it, where it is known.
    """
    further, names = further_slopes(model, data, range(1, data.n_joints + 1), laid)
    by_nominal = nominal_slopes(model)
    if by_nominal is not None:
        return np.concatenate([data.lay_each(by_nominal), further]), names
    laws = [law_rows(data, law, model.columns) for law in model.columns.laws]
    return np.concatenate([rigid, *laws, further]), names


def nominal_slopes(model: Exact) -> Callable[[int, Motion], Array] | None:
    """Return what gives the slopes (samples, joints, k) by base and friction in a log.

    None: no effect changes them. Each is a difference of the torque that effects make of the
    nominal one, at the motion as they read it. Effects that add their torque change none; of an
    effect by the session's clock it is a share of the friction at its joint. What effects on the
    whole arm change, as a tilt by its angle, is neglected.
    """
    own = (one for one in model.effects if one.effect.scope == "joint")
    changing = [one for one in own if not adds(one.effect) or one.effect.clock == "session"]
    if not changing:
        return None
    core, columns = replace(model, effects=tuple(changing)), model.columns
    adding = [one for one in model.effects if adds(one.effect) and one not in changing]
    # what acts on the torque may have kinks
    size = _DIFFERENCE * np.where(core.beta != 0.0, np.abs(core.beta), 1.0)

    def by_column(m: Motion) -> Array:
        # other laws than friction are effects
        laws = [law.columns(m, columns.arm) * isinstance(law, FrictionLaw) for law in columns.laws]
        rigid = columns.body.regressor(m.q, m.dq, m.ddq)[:, :, list(columns.kept)]
        return np.ascontiguousarray(np.moveaxis(np.concatenate([rigid, *laws], axis=2), 2, 0))

    def slopes(log: int, motion: Motion) -> Array:
        seen: list[tuple[Motion, Array, Array]] = []

        def torque(arm: Arm, number: int | None = None) -> Array:
            def inside(read: Motion, _: ArmModel) -> Array:
                if not seen or not _alike(seen[0][0], read):
                    each = by_column(read)
                    whole = np.tensordot(core.beta, each, 1)
                    more = [one for one in adding if one.log in (None, log)]
                    parts = (one.effect.torque(read, core.nominal, one.values) for one in more)
                    seen[:] = [(read, each, whole + sum(parts, np.zeros_like(read.q)))]
                each, whole = seen[0][1:]
                if number is None:
                    return np.array(whole)
                return np.asarray(whole + size[number] * each[number])

            return arm.torque(motion, inside)

        start = torque(core.arm_in(log))
        found = []
        for k, (step, by) in enumerate(zip(np.diag(size), size, strict=True)):
            moved = replace(core, beta=core.beta + step).arm_in(log)
            found.append((torque(moved, k) - start) / by)
        return np.stack(found, axis=2)

    return slopes


def _alike(one: Motion, other: Motion) -> bool:
    pairs = ((one.q, other.q), (one.dq, other.dq), (one.ddq, other.ddq))
    return one is other or all(np.array_equal(a, b) for a, b in pairs)


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
    bent = [bent[k] for k in own]
    names: list[Which] = [(0, *which[k]) for k in own]
    if any(one.effect.acts_on == "record" for one in model.effects):  # all torque passes it
        more = _slopes_through(model, data, names)
    else:
        more = _slopes_of_parts(model, data, bent, names, laid)
    return np.concatenate([np.zeros((0, data.rows)), *more]), names


def _slopes_of_parts(
    model: Exact, data: Data, bent: list[Array], names: list[Which], laid: Sequence[Array] | None
) -> list[Array]:
    """Return slopes of effects that add their torque apart from the rest; `names` grows."""
    more, core = list(bent), model.core
    start = model.core_torque(data, core) if core else np.zeros(0)
    # friction is felt where the joint truly is, and comes late
    whole = any(one.effect.acts_on in ("encoder", "drive") for one in model.effects)
    if whole:
        more = [_of_law(model, data, start, one) for one in names]
    columns = model.laid(data) if laid is None else laid
    for place, one in enumerate(model.effects):
        own = columns[place - core] if place >= core else None
        alone = start if own is None else one.effect.amplitudes(one.values) @ own
        steps = _steps(one)
        if own is not None:  # it is linear in its amplitudes
            linear = [name for name, _ in steps if name.isdigit()]
            steps = [step for step in steps if not step[0].isdigit()]
            names += [(1, place, name) for name in linear]
            more += [own[int(name)][None] for name in linear]
        moved = [number_moved(one, name, step) for name, step in steps]
        names += [(1, place, name) for name, _ in steps]
        torques = _with(model, data, place, core, moved)
        for (name, step), torque in zip(steps, torques, strict=True):
            # of an amplitude of 0 no slope is left in either direction, and not the curvature
            if name.isdigit() and one.amplitudes[int(name)] == 0.0:
                back = number_moved(one, name, -step)
                other = _with(model, data, place, core, [back])[0]
                more.append((torque - other)[None] / (2.0 * step))
            else:
                more.append((torque - alone)[None] / step)
        for name in () if whole else one.tied:  # it moves with the friction at its joint
            place_of_law = law_of(model.columns.laws, one.effect, name)
            if (0, place_of_law, name) in names:
                at = names.index((0, place_of_law or 0, name))
                with_it = number_moved(one, name, _DIFFERENCE)
                torque = _with(model, data, place, core, [with_it])[0]
                more[at] = more[at] + (torque - alone)[None] / _DIFFERENCE
    return more


def _with(model: Exact, data: Data, place: int, core: int, moved: Sequence[Named]) -> list[Array]:
    """(rows,) of an effect with each of these numbers; of the whole core where it is in it."""
    if place >= core:
        return model.added(data, *moved)
    before, after = model.effects[:place], model.effects[place + 1 : core]
    models = (replace(model, effects=(*before, one, *after)) for one in moved)
    return [one.core_torque(data, core) for one in models]


def _slopes_through(model: Exact, data: Data, names: list[Which]) -> list[Array]:
    """Return slopes where all torque passes through an effect, a lag of the record."""
    arm = model.arm

    def alone(one: Named) -> Array:
        """(k, rows) of each of its amplitudes, as the arm records them."""

        def columns(motion: Motion) -> Array:
            table = one.effect.at(one.values).columns(motion, model.nominal)
            return _recorded(arm, table, motion)

        return model._of_log(data, one, data.lay(columns))

    start = model.torque(data)
    as_read = not any(one.effect.acts_on in ("encoder", "drive") for one in model.effects)
    more = [_of_law(model, data, start, one) for one in names]
    for place, one in enumerate(model.effects):
        steps = _steps(one)
        names += [(1, place, name) for name, _ in steps]
        own = alone(one) if adds(one.effect) and as_read else None
        for name, size in steps:
            moved = number_moved(one, name, size)
            if own is not None and name.isdigit():  # it is linear in its amplitudes
                more.append(own[int(name)][None])
            elif own is not None:
                there = np.array(moved.amplitudes) @ alone(moved)
                more.append((there - np.array(one.amplitudes) @ own)[None] / size)
            else:
                effects = (*model.effects[:place], moved, *model.effects[place + 1 :])
                torque = replace(model, effects=effects).torque(data)
                more.append((torque - start)[None] / size)
    return more


def _recorded(arm: Arm, table: Array, motion: Motion) -> Array:
    """Return columns (samples, joints, k) as `arm` records them.

    The torque that a log has at its start is no column's: each begins with nothing.
    """
    for acting in arm.effects:
        if acting.effect.acts_on != "record":
            continue

        def through(torque: Array, one: Acting = acting) -> Array:
            return one.effect.apply(motion, arm, one.values, lambda *_: torque.copy())

        nothing = through(np.zeros(table.shape[:2]))
        columns = (through(column) - nothing for column in np.moveaxis(table, 2, 0))
        table = np.stack(list(columns), axis=2)
    return table


def _of_law(model: Exact, data: Data, start: Array, law: Which) -> Array:
    """(1, rows) slope of the whole torque, which is `start`, by a shape of a friction law."""
    step = np.array([*np.zeros(len(model.beta)), _DIFFERENCE])
    return (model.moved(step, [law]).torque(data) - start)[None] / _DIFFERENCE


def _steps(one: Named) -> list[tuple[str, float]]:
    """Return the numbers of an effect and how far each is moved for its slope."""
    found = []
    if one.free_amplitudes:
        size = max((abs(a) for a in one.amplitudes), default=0.0) or 1e-3
        steps = (_DIFFERENCE * max(abs(a), 0.1 * size) for a in one.amplitudes)
        found = [(str(k), step) for k, step in enumerate(steps)]
    for q in one.free_shapes:
        value = float(getattr(one.effect, q.name))
        wide = min(q.high - q.low, 1e2)
        step = _DIFFERENCE if q.low > 0.0 else _DIFFERENCE * max(abs(value), 1e-2 * wide)
        found.append((q.name, -step if value >= q.high else step))
    return found

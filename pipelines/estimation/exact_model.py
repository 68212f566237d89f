"""Compute the torque of an arm with its effects exactly, and its slopes by every number.

    model = Exact.start(columns, fit)                     the nominal model
    model = model.with_effect(effect, amplitudes)         and a cause
    model.torque(data), model.arm
    slopes, names = slopes_of(model, data, rigid)

The numbers are the base parameters, amplitudes and shapes of the friction laws, amplitudes and free
shapes of the effects. Slopes by what is linear are columns, all others differences. Effects that
just add torque are laid by themselves; those before the last that does more, the core, need the
torque of the whole arm.
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
from pipelines.estimation.nominal import (
    Fit,
    arm_of,
    effect_rows,
    law_slopes,
    rigid_rows,
    several_rows,
    with_shape,
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
        free = set(self.effect.free) - {*self.tied, *self.held}
        return [q for q in self.effect.parameters if q.name in free]

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

    def moved(self, name: str, by: float) -> Named:
        """Return the effect with amplitude number `name`, or the shape of that name, moved."""
        if not name.isdigit():
            return replace(self, effect=_shape_moved(self.effect, name, by))
        amplitudes = list(self.amplitudes)
        amplitudes[int(name)] += by
        return replace(self, amplitudes=tuple(amplitudes))

    @property
    def steps(self) -> list[tuple[str, float]]:
        """The numbers that are fitted, and how far each is moved for its slope."""
        found = []
        if self.free_amplitudes:
            size = max((abs(a) for a in self.amplitudes), default=0.0) or 1e-3
            steps = (_DIFFERENCE * max(abs(a), 0.1 * size) for a in self.amplitudes)
            found = [(str(k), step) for k, step in enumerate(steps)]
        for q in self.free_shapes:
            value, wide = float(getattr(self.effect, q.name)), min(q.high - q.low, 1e2)
            step = _DIFFERENCE if q.low > 0.0 else _DIFFERENCE * max(abs(value), 1e-2 * wide)
            found.append((q.name, -step if value >= q.high else step))
        return found


@dataclass(frozen=True, eq=False)
class _Base:
    """The arm without effects: one object for all models that differ in these alone."""

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
    base: _Base | None = field(default=None, repr=False)  # handed on by `replace`

    def __post_init__(self) -> None:
        base = self.base
        if base is None or base.columns is not self.columns or base.beta is not self.beta:
            object.__setattr__(self, "base", _Base(self.columns, self.beta))

    @classmethod
    def start(cls, columns: Columns, fit: Fit) -> Exact:
        return cls(columns, fit.beta[: len(columns.names)].copy(), ())

    def with_effect(
        self, effect: Effect, amplitudes: Array, log: int | None = None, held: tuple[str, ...] = ()
    ) -> Exact:
        fixed, laws = effect.parameters.fixed, self.columns.laws
        given = tuple(map(float, amplitudes if fixed is None else fixed))
        shared = (q.name for q in effect.parameters if q.shared)
        tied = tuple(name for name in shared if law_of(laws, effect, name) is not None)
        return replace(self, effects=(*self.effects, Named(effect, given, log, tied, held)))

    def without(self, place: int) -> Exact:
        return replace(self, effects=(*self.effects[:place], *self.effects[place + 1 :]))

    @property
    def nominal(self) -> Arm:
        """The arm without effects: one object for models that differ in these alone."""
        assert self.base is not None
        return self.base.arm

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
        arm, nominal = self.arm_in(log), self.nominal
        if not self.standing:
            return arm.torque(motion)

        def added(there: Motion, own: ArmModel) -> Array:
            parts = (one.effect.torque(there, own, one.values) for one in self.standing)
            return np.asarray(sum(parts))

        # kept with the motion
        key = ("standing", self.standing, nominal)
        known = motion.kept(key, lambda: added(motion, nominal))

        def inside(there: Motion, own: ArmModel) -> Array:
            same = isinstance(own, Arm) and own.base is nominal.base and own.body is nominal.body
            return own.torque(there) + (known if same and there is motion else added(there, own))

        return np.asarray(arm.torque(motion, inside) - known)

    @property
    def core(self) -> int:
        """Count the effects before, and with, the last one that does more than add its torque."""
        if self.misread:
            return len(self.effects)
        places = (k + 1 for k, one in enumerate(self.effects) if not adds(one.effect))
        return max(places, default=0)

    @property
    def misread(self) -> bool:
        """True if an effect changes where or when all torque is seen, also friction."""
        return any(one.effect.acts_on != "load" for one in self.effects)

    def torque(self, data: Data, laid: Sequence[Array] | None = None) -> Array:
        """(rows,); `laid` as in `laid`, where it is known."""
        core, parts = self.core, self.laid(data) if laid is None else laid
        pairs = zip(self.effects[core:], parts, strict=True)
        added = [one.effect.amplitudes(one.values) @ part for one, part in pairs]
        return np.asarray(sum(added, self.core_torque(data, core)))

    def laid(self, data: Data) -> list[Array]:
        """Return the columns (k, rows) of each of the effects that just add."""
        return [self.columns_of(data, one)[0] for one in self.effects[self.core :]]

    def core_torque(self, data: Data, core: int) -> Array:
        """(rows,) of the nominal model and the first `core` effects."""
        if core:
            return data.lay_each(replace(self, effects=self.effects[:core]).torque_in)
        columns = self.columns
        if not all(law.from_motion for law in columns.laws):
            return data.lay(self.nominal.torque)
        torque = rigid_rows(data, columns, self.beta[: len(columns.kept)])
        for law, part in zip(columns.laws, columns.parts, strict=True):
            torque = torque + effect_rows(data, law, columns.arm, self.beta[part])
        return np.asarray(torque)

    def columns_of(self, data: Data, *several: Named) -> list[Array]:
        """Return the columns (k, rows) of an effect, with several numbers."""
        shapes = [one.effect.at(one.values) for one in several]
        rows, log = several_rows(data, shapes, self.nominal), several[0].log
        if log is None:
            return rows
        return [np.where(data.log_of == log - data.first, columns, 0.0) for columns in rows]

    def with_each(self, data: Data, place: int, *several: Named) -> list[Array]:
        """Return the torque (rows,) of effect number `place` with each of these numbers.

        Of one that does not just add, that of the whole core.
        """
        core = self.core
        if place >= core:
            pairs = zip(several, self.columns_of(data, *several), strict=True)
            return [one.effect.amplitudes(one.values) @ columns for one, columns in pairs]
        before, after = self.effects[:place], self.effects[place + 1 : core]
        models = (replace(self, effects=(*before, one, *after)) for one in several)
        return [one.core_torque(data, core) for one in models]

    def moved(self, shift: Array, names: Sequence[Which]) -> Exact:
        """Return the model with every number moved: base first, then what `names` says."""
        first = len(self.beta)
        laws, effects = list(self.columns.laws), list(self.effects)
        for (kind, place, name), by in zip(names, shift[first:].tolist(), strict=True):
            if kind == 0:
                laws[place] = _shape_moved(laws[place], name, by)
            else:
                effects[place] = effects[place].moved(name, by)
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


def law_of(laws: Sequence[Effect], effect: Effect, name: str) -> int | None:
    """Return the number of the law at the joint of `effect` that has a shape `name`."""
    for k, law in enumerate(laws):
        if law.joint == effect.joint and any(q.shape and q.name == name for q in law.parameters):
            return k
    return None


def _positive(effect: Effect, name: str) -> bool:
    return any(q.name == name and q.low > 0.0 for q in effect.parameters)


def _shape_moved(effect: Effect, name: str, by: float) -> Effect:
    """Return the effect with a shape moved: by its logarithm where its range is positive."""
    value = float(getattr(effect, name))
    if _positive(effect, name):
        value *= float(np.exp(np.clip(by, -_FARTHEST, _FARTHEST)))
    else:
        value += by
    return with_shape(effect, name, value)


def difference(one: Exact, other: Exact, which: Which) -> float:
    """Return by how much a number of `one` lies above that of `other`, as it is moved."""
    kind, place, name = which
    if name.isdigit():
        k = int(name)
        return one.effects[place].amplitudes[k] - other.effects[place].amplitudes[k]
    a, b = (m.effects[place].effect if kind else m.columns.laws[place] for m in (one, other))
    here, there = (float(getattr(x, name)) for x in (a, b))
    return float(np.log(here / there)) if _positive(a, name) else here - there


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
    laws = [effect_rows(data, law, model.columns.arm) for law in model.columns.laws]
    return np.concatenate([rigid, *laws, further]), names


def nominal_slopes(model: Exact) -> Callable[[int, Motion], Array] | None:
    """Return what gives the slopes (samples, joints, k) by base and friction in a log.

    None: no effect changes them. Each is a difference of the torque that effects make of the
    nominal one, at the motion as they read it. Effects that add their torque change none; of an
    effect by the session's clock it is a share of the friction at its joint. What effects on the
    whole arm change, as a tilt by its angle, is neglected.
    """

    def changes(one: Named) -> bool:
        effect = one.effect
        return effect.scope == "joint" and (not adds(effect) or effect.clock == "session")

    core = replace(model, effects=tuple(filter(changes, model.effects)))
    if not core.effects:
        return None
    columns = model.columns
    adding = [one for one in model.effects if adds(one.effect) and not changes(one)]
    # what acts on the torque may have kinks
    size = _DIFFERENCE * np.where(core.beta != 0.0, np.abs(core.beta), 1.0)

    def by_column(m: Motion) -> Array:
        # other laws than friction are effects
        laws = [law.columns(m, columns.arm) * isinstance(law, FrictionLaw) for law in columns.laws]
        rigid = columns.body.regressor(m.q, m.dq, m.ddq)[:, :, list(columns.kept)]
        return np.ascontiguousarray(np.moveaxis(np.concatenate([rigid, *laws], axis=2), 2, 0))

    def slopes(log: int, motion: Motion) -> Array:
        seen: list[tuple[Motion, Array, Array]] = []  # of the motion as it was last read
        more = [one for one in adding if one.log in (None, log)]

        def torque(arm: Arm, number: int | None = None) -> Array:
            def inside(read: Motion, _: ArmModel) -> Array:
                if not seen or not _alike(seen[0][0], read):
                    each = by_column(read)
                    parts = (one.effect.torque(read, core.nominal, one.values) for one in more)
                    seen[:] = [(read, each, sum(parts, np.tensordot(core.beta, each, 1)))]
                each, whole = seen[0][1:]
                return whole + (0.0 if number is None else size[number] * each[number])

            return arm.torque(motion, inside)

        start = torque(core.arm_in(log))
        found = []
        for k, step in enumerate(np.diag(size)):
            moved = replace(core, beta=core.beta + step).arm_in(log)
            found.append((torque(moved, k) - start) / size[k])
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
    laws, core = model.columns.laws, model.core
    bent, which = law_slopes(data, model.columns, model.beta)
    own = [k for k, (place, _) in enumerate(which) if laws[place].joint in joints]
    found: dict[Which, Array] = {(0, *which[k]): bent[k] for k in own}
    whole = model.core_torque(data, core) if core else np.zeros(0)
    if model.misread:  # friction is felt where the joint truly is, and comes late
        shift = np.append(np.zeros(len(model.beta)), _DIFFERENCE)
        for which_law in found:
            there = model.moved(shift, [which_law]).torque(data)
            found[which_law] = (there - whole)[None] / _DIFFERENCE
    columns = model.laid(data) if laid is None else laid
    for place, one in enumerate(model.effects):
        steps, alone = dict(one.steps), whole
        if place >= core:  # it is linear in its amplitudes
            by_amplitude = columns[place - core]
            alone = one.effect.amplitudes(one.values) @ by_amplitude
            for name in [name for name in steps if name.isdigit()]:
                found[1, place, name] = by_amplitude[int(name)][None]
                del steps[name]
        moved = [one.moved(name, step) for name, step in steps.items()]
        torques = model.with_each(data, place, *moved) if moved else []
        for (name, step), torque in zip(steps.items(), torques, strict=True):
            back, by = alone, step
            # of an amplitude of 0 no slope is left in either direction, and not the curvature
            if name.isdigit() and one.amplitudes[int(name)] == 0.0:
                back, by = model.with_each(data, place, one.moved(name, -step))[0], 2.0 * step
            found[1, place, name] = (torque - back)[None] / by
        for name in () if model.misread else one.tied:  # it moves with the friction at its joint
            law = law_of(laws, one.effect, name)
            if law is not None and (0, law, name) in found:
                torque = model.with_each(data, place, one.moved(name, _DIFFERENCE))[0]
                found[0, law, name] = found[0, law, name] + (torque - alone)[None] / _DIFFERENCE
    return np.concatenate([np.zeros((0, data.rows)), *found.values()]), list(found)

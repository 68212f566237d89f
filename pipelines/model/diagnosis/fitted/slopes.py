"""Slopes of an exact model's torque by every number of it.

    slopes, names = slopes_of(model, data, rigid)

Those by what is linear are columns: of the nominal model, and of effects that only add theirs. Those by any other number of an
effect are differences of the torque.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.exact import Exact, Named, law_of, number_moved
from pipelines.model.diagnosis.fitted.nominal import law_rows, law_slopes
from pipelines.model.diagnosis.fitted.record import recorded
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.effects.base import adds
from pipelines.model.rigid.body import Motion

__all__ = ["Which", "further_slopes", "slopes_of"]

Which = tuple[int, int, str]  # 0 a law, 1 an effect; its place; the number of an amplitude, or the name of a shape

_DIFFERENCE = 1e-3  # of a number


def slopes_of(model: Exact, data: Data, rigid: Array, laid: Sequence[Array] | None = None) -> tuple[Array, list[Which]]:
    """(numbers, rows) slopes of the torque by every number, those of `rigid` columns first; and which they are behind the base.

    Args:
        laid: as `model.laid(data)` makes it, where it is known.
    """
    further, names = further_slopes(model, data, range(1, data.n_joints + 1), laid)
    if not _through(model):
        laws = [law_rows(data, law, model.columns) for law in model.columns.laws]
        return np.concatenate([rigid, *laws, further]), names
    columns, arm, kept = model.columns, model.arm, list(model.columns.kept)

    def linear(motion: Motion) -> Array:
        own = columns.body.regressor(motion.q, motion.dq, motion.ddq)[:, :, kept]
        return recorded(arm, np.concatenate([own, *(law.columns(motion, columns.arm) for law in columns.laws)], axis=2), motion)

    return np.concatenate([data.lay(linear), further]), names


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
        return data.lay_each(lambda log, motion: recorded(
            arm, one.effect.at(one.values).columns(motion, model.nominal) @ np.array(one.amplitudes), motion)
            if one.log in (None, log) else np.zeros_like(motion.q))

    here = model.torque(data)
    as_read = not any(one.effect.acts_on in ("encoder", "drive") for one in model.effects)
    more = [_of_law(model, data, here, one) for one in names]
    for place, one in enumerate(model.effects):
        for name, size in _steps(one):
            names.append((1, place, name))
            there = number_moved(one, name, size)
            if adds(one.effect) and as_read:
                more.append((alone(there) - alone(one))[None] / size)
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

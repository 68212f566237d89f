"""List every cause at every joint in every shape, and lay their columns over the rows.

    for family in families(columns, motion, arm): ...
    for laid in lay_family(data, family, arm): ...           its columns, a few shapes at a time

An effect whose non-linear number is one of the friction fitted at its joint, how sharply it changes
sign say, takes it from there: what a second law would gain by another one is an artefact of
reversals.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.effects import all_effects
from pipelines.effects.base import Effect, everywhere
from pipelines.errors import UsageError
from pipelines.io.log import Array
from pipelines.model.rows.data import Data, LogData

__all__ = ["Family", "Laid", "Wanted", "families", "first_samples", "lay_family", "place_of", "usable", "whole_motion"]

Indices = npt.NDArray[np.intp]
Columns = npt.NDArray[np.floating]  # in single precision: there are many, and none is fitted

_AT_ONCE = 48  # columns
_AWAY = 1e12  # [N m]: what is larger runs away, and is no torque any more


@dataclass(frozen=True)
class Family:
    """One cause at one place."""

    cause: str
    joint: int | None
    shapes: tuple[Effect, ...]

    @property
    def event(self) -> bool:
        """Whether it happens once, in one log: its non-linear numbers belong to that."""
        return self.shapes[0].clock == "log"


@dataclass(frozen=True, eq=False)
class Laid:
    """Columns of some shapes of a family, on the rows where they are not zero."""

    first: int  # shape
    table: Columns  # (shapes, k, rows here)
    rows: Indices  # which of all rows


def place_of(cause: str, joint: int | None) -> str:
    """As causes are written on the command line: "cogging:2", "gravity_tilt"."""
    return cause if joint is None else f"{cause}:{joint}"


def families(laws: Sequence[Effect], motion: Motion, arm: Arm, without: Sequence[str] = ()) -> tuple[Family, ...]:
    """Every effect at every place, but those that the nominal model holds, and those left out.

    Args:
        laws: of the nominal model.
        motion: of all logs, for the range of shapes.
    """
    nominal = {law.name for law in laws}
    found = []
    for kind in all_effects():
        if kind.name in nominal or kind.name in without or kind.evidence in ("none", "base parameters"):
            continue
        for effect in everywhere(kind, arm.robot.revolute):
            found.append(Family(kind.name, effect.joint, _shapes(effect, laws, motion, arm)))
    return tuple(found)


def _shapes(effect: Effect, laws: Sequence[Effect], motion: Motion, arm: Arm) -> tuple[Effect, ...]:
    shared: dict[str, Any] = {}
    for law in laws:
        if law.joint == effect.joint:
            shared |= {q.name: getattr(law, q.name) for q in law.parameters if q.shape
                       and q.name in {own.name for own in effect.parameters if own.shape}}
    shaped = replace(effect, **shared)
    return tuple(dict.fromkeys(replace(one, **shared) for one in shaped.shapes(motion, arm)))


def whole_motion(data: Data) -> Motion:
    """The motions of all logs one behind the other, time from the start of each: for ranges, never for slopes."""
    motions = [one.motion for one in data.logs]
    t = np.concatenate([motion.t - motion.t[0] for motion in motions])  # logs of one session may share its clock
    whole = Motion(t, *(np.concatenate([getattr(motion, name) for motion in motions]) for name in ("q", "dq", "ddq")),
                   log_sample_time=max(motion.sample_time for motion in motions))
    asked = [motion.tau for motion in motions if motion.tau is not None]
    return replace(whole, tau=np.concatenate(asked)) if len(asked) == len(motions) else whole


def lay_family(data: Data, family: Family, arm: Arm) -> Iterator[Laid]:
    """The columns of every shape, a few shapes at a time."""
    with np.errstate(all="ignore"):
        width = int(family.shapes[0].columns(first_samples(data), arm).shape[2])
    size = max(1, _AT_ONCE // max(width, 1))
    for first in range(0, len(family.shapes), size):
        yield _lay_some(data, family.shapes[first:first + size], first, arm)


def _lay_some(data: Data, some: Sequence[Effect], first: int, arm: Arm) -> Laid:
    joint = some[0].joint if some[0].from_motion else None
    with np.errstate(all="ignore"):
        if joint is not None:
            acting = np.arange(data.n_joints) == joint - 1
            parts = [_laid_own(one, some, joint, arm) for one in data.logs]
        else:
            laid = [_laid_anywhere(one, some, arm) for one in data.logs]
            acting = np.array([any(x[:, :, j].any() for x in laid) for j in range(data.n_joints)])
            parts = [x[:, :, acting].reshape(*x.shape[:2], -1) for x in laid]
    rows = np.flatnonzero(acting[data.joint])
    return Laid(first, data.clear(np.concatenate(parts, axis=2), rows), rows)


def _laid_own(one: LogData, some: Sequence[Effect], joint: int, arm: Arm) -> Columns:
    """(shapes, k, rows of the joint) of effects that act on it alone."""
    table = some[0].own_columns(some, one.motion, arm)
    for shape in table:
        shape[...] = _finite(shape)
    rows = one.lay_signals(table.reshape(-1, table.shape[2]).astype(np.float32), np.full(len(some) * table.shape[1], joint - 1))
    return rows.reshape(len(some), table.shape[1], -1)


def _laid_anywhere(one: LogData, some: Sequence[Effect], arm: Arm) -> Columns:
    """(shapes, k, joints, rows)"""
    tables = [_finite(table).transpose(2, 1, 0) for table in some[0].several(some, one.motion, arm)]
    k, joints, samples = tables[0].shape
    acting = np.flatnonzero([any(table[:, j].any() for table in tables) for j in range(joints)])
    flat = np.empty((len(some), k, len(acting), samples), np.float32)
    for into, table in zip(flat, tables, strict=True):
        into[...] = table[:, acting]
    found = np.zeros((len(some), k, joints, one.rows), np.float32)
    laid = one.lay_signals(flat.reshape(-1, samples), np.tile(acting, len(some) * k))
    found[:, :, acting] = laid.reshape(len(some), k, len(acting), one.rows)
    return found


def _finite(table: Array) -> Array:
    """Columns that run away, of an arm that is badly known, are none."""
    return table if bool((np.abs(table) < _AWAY).all()) else np.zeros_like(table)


def first_samples(data: Data) -> Motion:
    """Return a few samples of the motion, from which the number of columns is seen."""
    motion = data.logs[0].motion
    return Motion(motion.t[:8], motion.q[:8], motion.dq[:8], motion.ddq[:8], None if motion.tau is None else motion.tau[:8])


@dataclass(frozen=True)
class Wanted:
    """A cause to extend the model by, and where its non-linear numbers start."""

    effect: Effect
    start: Mapping[str, float] = field(default_factory=dict)

    @property
    def place(self) -> str:
        return place_of(self.effect.name, self.effect.joint)


def usable(mine: Family | None, one: Wanted, laws: Sequence[Effect], revolute: Sequence[bool]) -> Family:
    """The shapes of a wanted cause, `mine`, where a model with such friction `laws` can take it up.

    Raises:
        UsageError: C02, it cannot.
    """
    if mine is None:
        why, remedy = _missing(one, laws, revolute)
        raise UsageError("C02", f"{one.place}: {why}", where="--with", remedy=remedy)
    if mine.event:
        raise UsageError("C02", f"{one.place} happens once: no model of the arm holds it", where="--with",
                         remedy="leave the moment out of the logs instead")
    return mine


def _missing(one: Wanted, laws: Sequence[Effect], revolute: Sequence[bool]) -> tuple[str, str]:
    """Why nothing can be fitted there, and what to do."""
    effect = one.effect
    if effect.name in {law.name for law in laws}:
        return "the nominal model has it already", "name a cause that the nominal model lacks"
    if effect.evidence == "none":
        return "it is a law of friction for a nominal model, and no cause", "extend a model that has it: --model FILE"
    if effect.evidence == "base parameters":
        return ("the base parameters take it up, and no reference logs show that they moved as it moves them",
                "name reference logs from before it: --reference PATH")
    places = [place_of(other.name, other.joint) for other in everywhere(type(effect), revolute)]
    return ("this arm does not have it there",
            f"write {' or '.join(places)}" if places else "name another cause: no place of this arm has it")

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
from pipelines.estimation.least_squares import Indices
from pipelines.estimation.rows import Data, LogData
from pipelines.io.log import Array

Table = npt.NDArray[np.floating]  # in single precision: there are many, and none is fitted

_AT_ONCE = 48  # numerics: columns
_AWAY = 1e12  # numerics: [N m] what is larger runs away, and is no torque any more


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
    table: Table  # (shapes, k, rows here)
    rows: Indices  # which of all rows


@dataclass(frozen=True)
class Wanted:
    """A cause to extend the model by, and where its non-linear numbers start."""

    effect: Effect
    start: Mapping[str, float] = field(default_factory=dict)

    @property
    def place(self) -> str:
        return place_of(self.effect.name, self.effect.joint)


def place_of(cause: str, joint: int | None) -> str:
    """Return a cause as the command line has it: "cogging:2", "gravity_tilt"."""
    return cause if joint is None else f"{cause}:{joint}"


def families(
    laws: Sequence[Effect], motion: Motion, arm: Arm, without: Sequence[str] = ()
) -> tuple[Family, ...]:
    """Return every effect at every place, but those of the nominal model, and those left out.

    Args:
        laws: of the nominal model.
        motion: of all logs, for the range of shapes.
    """
    excluded = {law.name for law in laws} | set(without)
    found = []
    for kind in all_effects():
        if kind.name in excluded or kind.evidence in ("none", "base parameters"):
            continue
        for effect in everywhere(kind, arm.robot.revolute):
            own = {q.name for q in effect.parameters if q.shape}
            shared: dict[str, Any] = {}
            for law in laws:
                if law.joint == effect.joint:
                    shapes = (q.name for q in law.parameters if q.shape and q.name in own)
                    shared |= {name: getattr(law, name) for name in shapes}
            grid = replace(effect, **shared).shapes(motion, arm)
            unique = dict.fromkeys(replace(one, **shared) for one in grid)
            found.append(Family(kind.name, effect.joint, tuple(unique)))
    return tuple(found)


def whole_motion(data: Data) -> Motion:
    """Return the motions of all logs in a row: for ranges, never for slopes."""
    motions = [one.motion for one in data.logs]
    # from the start of each: logs of one session may share its clock
    t = np.concatenate([motion.t - motion.t[0] for motion in motions])
    q, dq, ddq = (
        np.concatenate([getattr(motion, name) for motion in motions]) for name in ("q", "dq", "ddq")
    )
    step = max(motion.sample_time for motion in motions)
    whole = Motion(t, q, dq, ddq, log_sample_time=step)
    commands = [motion.tau for motion in motions if motion.tau is not None]
    if len(commands) < len(motions):
        return whole
    return replace(whole, tau=np.concatenate(commands))


def lay_family(data: Data, family: Family, arm: Arm) -> Iterator[Laid]:
    """Yield the columns of every shape, a few shapes at a time."""
    with np.errstate(all="ignore"):
        width = int(family.shapes[0].columns(first_samples(data), arm).shape[2])
    size = max(1, _AT_ONCE // max(width, 1))
    for first in range(0, len(family.shapes), size):
        some = family.shapes[first : first + size]
        joint = some[0].joint if some[0].from_motion else None
        with np.errstate(all="ignore"):
            if joint is not None:
                acting = np.arange(data.n_joints) == joint - 1
                parts = [_laid_own(one, some, joint, arm) for one in data.logs]
            else:
                laid = [_laid_anywhere(one, some, arm) for one in data.logs]
                joints = range(data.n_joints)
                acting = np.array([any(x[:, :, j].any() for x in laid) for j in joints])
                parts = [x[:, :, acting].reshape(*x.shape[:2], -1) for x in laid]
        rows = np.flatnonzero(acting[data.joint])
        yield Laid(first, data.clear(np.concatenate(parts, axis=2), rows), rows)


def _laid_own(one: LogData, some: Sequence[Effect], joint: int, arm: Arm) -> Table:
    """(shapes, k, rows of the joint) of effects that act on it alone."""
    table = some[0].own_columns(some, one.motion, arm)
    for shape in table:
        shape[...] = _finite(shape)
    flat = table.reshape(-1, table.shape[2]).astype(np.float32)
    rows = one.lay_signals(flat, np.full(len(flat), joint - 1))
    return rows.reshape(len(some), table.shape[1], -1)


def _laid_anywhere(one: LogData, some: Sequence[Effect], arm: Arm) -> Table:
    """(shapes, k, joints, rows)"""
    every = some[0].several(some, one.motion, arm)
    tables = [_finite(table).transpose(2, 1, 0) for table in every]
    k, joints, samples = tables[0].shape
    anywhere = [any(table[:, j].any() for table in tables) for j in range(joints)]
    acting = np.flatnonzero(anywhere)
    flat = np.empty((len(some), k, len(acting), samples), np.float32)
    for into, table in zip(flat, tables, strict=True):
        into[...] = table[:, acting]
    found = np.zeros((len(some), k, joints, one.rows), np.float32)
    laid = one.lay_signals(flat.reshape(-1, samples), np.tile(acting, len(some) * k))
    found[:, :, acting] = laid.reshape(len(some), k, len(acting), one.rows)
    return found


def _finite(table: Array) -> Array:
    """Return zeros for columns that run away, of an arm that is badly known."""
    return table if bool((np.abs(table) < _AWAY).all()) else np.zeros_like(table)


def first_samples(data: Data) -> Motion:
    """Return a few samples of the motion, which show the number of columns."""
    m = data.logs[0].motion
    tau = None if m.tau is None else m.tau[:8]
    return Motion(m.t[:8], m.q[:8], m.dq[:8], m.ddq[:8], tau)


def usable(
    mine: Family | None, one: Wanted, laws: Sequence[Effect], revolute: Sequence[bool]
) -> Family:
    """Return the shapes of a wanted cause, `mine`, that a model with such friction can take up.

    Raises:
        UsageError: C02, it cannot.
    """
    if mine is None:
        why, remedy = _missing(one, laws, revolute)
        raise UsageError("C02", f"{one.place}: {why}", "--with", remedy)
    if mine.event:
        words = f"{one.place} happens once: no model of the arm holds it"
        raise UsageError("C02", words, "--with", "leave the moment out of the logs instead")
    return mine


def _missing(one: Wanted, laws: Sequence[Effect], revolute: Sequence[bool]) -> tuple[str, str]:
    """Return why nothing can be fitted there, and what to do."""
    effect = one.effect
    if effect.name in {law.name for law in laws}:
        remedy = "name a cause that the nominal model lacks"
        return "the nominal model has it already", remedy
    if effect.evidence == "none":
        words = "it is a law of friction for a nominal model, and no cause"
        return words, "extend a model that has it: --model FILE"
    if effect.evidence == "base parameters":
        words = "the base parameters take it up, and no reference logs show that they moved as it "
        return f"{words}moves them", "name reference logs from before it: --reference PATH"
    others = everywhere(type(effect), revolute)
    places = [place_of(other.name, other.joint) for other in others]
    remedy = "name another cause: no place of this arm has it"
    if places:
        remedy = f"write {' or '.join(places)}"
    return "this arm does not have it there", remedy

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
        """True if it happens once, in one log, to which its non-linear numbers belong."""
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
    commands = [motion.tau for motion in motions if motion.tau is not None]
    tau = np.concatenate(commands) if len(commands) == len(motions) else None
    return Motion(t, q, dq, ddq, tau, log_sample_time=max(m.sample_time for m in motions))


def lay_family(data: Data, family: Family, arm: Arm) -> Iterator[Laid]:
    """Yield the columns of every shape, a few shapes at a time."""
    with np.errstate(all="ignore"):
        width = int(family.shapes[0].columns(first_samples(data), arm).shape[2])
    size = max(1, _AT_ONCE // max(width, 1))
    for first in range(0, len(family.shapes), size):
        some = family.shapes[first : first + size]
        with np.errstate(all="ignore"):
            laid = [_laid(one, some, arm) for one in data.logs]
        acting = np.unique(np.concatenate([joints for joints, _ in laid]))
        parts = []
        for joints, table in laid:
            whole = np.zeros((*table.shape[:2], len(acting), table.shape[3]), np.float32)
            whole[:, :, np.searchsorted(acting, joints)] = table
            parts.append(whole.reshape(*table.shape[:2], -1))
        rows = np.flatnonzero(np.isin(data.joint, acting))
        yield Laid(first, data.clear(np.concatenate(parts, axis=2), rows), rows)


def _laid(one: LogData, some: Sequence[Effect], arm: Arm) -> tuple[Indices, Table]:
    """Return the joints that some shapes act on, and (shapes, k, joints, rows) there."""
    if some[0].from_motion and some[0].joint is not None:
        own = np.array([some[0].index])
        tables = list(some[0].own_columns(some, one.motion, arm)[:, :, None])
    else:
        every = [t.transpose(2, 1, 0) for t in some[0].several(some, one.motion, arm)]
        joints = range(every[0].shape[1])
        own = np.flatnonzero([any(table[:, j].any() for table in every) for j in joints])
        tables = [table[:, own] for table in every]
    flat = np.zeros((len(some), *tables[0].shape), np.float32)
    for into, table in zip(flat, tables, strict=True):
        if (np.abs(table) < _AWAY).all():  # of an arm that is badly known a column may run away
            into[...] = table
    shapes, k, count, samples = flat.shape
    laid = one.lay_signals(flat.reshape(-1, samples), np.tile(own, shapes * k))
    return own, laid.reshape(shapes, k, count, one.rows)


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
    effect = one.effect
    if mine is not None and not mine.event:
        return mine
    if mine is not None:
        why, remedy = "it happens once: no model of the arm holds it", "leave its moment out"
    elif effect.name in {law.name for law in laws}:
        why, remedy = "the nominal model has it already", "name a cause that it lacks"
    elif effect.evidence == "base parameters":
        why = "no reference logs show that the base parameters moved as it moves them"
        remedy = "name reference logs from before it: --reference PATH"
    else:
        places = (place_of(o.name, o.joint) for o in everywhere(type(effect), revolute))
        why, remedy = "this arm does not have it there", f"write {' or '.join(places) or 'another'}"
    raise UsageError("C02", f"{one.place}: {why}", "--with", remedy)

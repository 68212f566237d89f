"""Candidate columns: every cause at every joint in every shape, and shapes without a name.

    dictionary = Dictionary.of(dataset, config)
    dictionary.groups                      what each run of columns is
    dictionary.table(rows)                 the columns over some rows

A group is what is screened at once: one shape of one cause at one joint, or a shape without a name.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset, Rows
from pipelines.diagnosis.unnamed import Key, Make, Unnamed
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.effects import all_effects
from pipelines.effects.base import Effect, everywhere
from pipelines.effects.drives import TorqueLag
from pipelines.estimation.candidate_columns import Family, Laid, families, lay_family, whole_motion
from pipelines.estimation.joint_table import Array, Indices, Table

__all__ = ["Dictionary", "Group", "Kind", "laid"]

_SMALL = 1e-6  # numerics: an amplitude that every range holds which holds its sign
_ROUNDED = 1e-9  # numerics: of travel [rad or m], or share of an order, that is rounding

# of compliance rows show the class, responses the cause
Kind = Literal["named", "compliance", "unnamed"]


@dataclass(frozen=True)
class Group:
    """Columns that are screened together."""

    key: Key
    shape: int  # number of the shape of its family
    first: int  # column
    width: int
    standing: bool  # healthy machines have it in small
    kind: Kind
    reads_torque: bool = False  # its columns hold the logged torque itself
    amplitude: float | None = None  # that its columns are exact for; None: they are for any
    sign: int = 0  # of its only amplitude, where physics gives it

    @property
    def family(self) -> str:
        """The cause, or of shapes without a name their kind."""
        return self.key[0].split()[0]

    @property
    def columns(self) -> Indices:
        return np.arange(self.first, self.first + self.width)

    @property
    def span(self) -> slice:
        return slice(self.first, self.first + self.width)


@dataclass(frozen=True, eq=False)
class Dictionary:
    """All candidates of a dataset."""

    groups: tuple[Group, ...]
    families: dict[Key, Family]
    later: Table
    reference: Table | None

    @property
    def known(self) -> Table:
        """The columns over the rows of the reference, or over the later rows without one."""
        return self.later if self.reference is None else self.reference

    @classmethod
    def of(
        cls, dataset: Dataset, config: DiagnosisConfig, exclude: Sequence[str] = ()
    ) -> Dictionary:
        """Return every candidate, with its columns over the reference and the later rows."""
        found = _families(dataset, exclude)
        standing = {key: _standing(family, dataset) for key, family in found.items()}
        plain = Unnamed.of(dataset, config).every
        tables: list[Table | None] = []
        for rows in (dataset.later, dataset.reference):
            if rows is None:
                tables.append(None)
                continue
            groups: list[Group] = []
            parts: list[Table] = []
            for family in found.values():
                if not family.event:
                    _lay(rows, family, standing, dataset.arm, groups, parts)
            for key, make in plain.items():
                _lay_unnamed(rows, key, make, groups, parts)
            tables.append(Table.stacked(parts).compact())
        assert tables[0] is not None
        return cls(tuple(groups), found, tables[0], tables[1])

    @property
    def event(self) -> Family | None:
        return next((family for family in self.families.values() if family.event), None)

    def standing(self) -> Indices:
        """Return the columns that healthy machines have in small."""
        return np.concatenate([g.columns for g in self.groups if g.standing])


def _families(dataset: Dataset, exclude: Sequence[str]) -> dict[Key, Family]:
    motion = whole_motion(dataset.later.data)
    found = {}
    for family in families(dataset.model.columns.laws, motion, dataset.arm, exclude):
        shapes = family.shapes
        if dataset.session_start is not None:
            session: dict[str, Any] = {"since": dataset.session_start}
            shapes = tuple(replace(s, **session) if s.clock == "session" else s for s in shapes)
        found[family.cause, family.joint] = Family(family.cause, family.joint, shapes)
    changeable = () if dataset.reference is None else all_effects()
    for kind in changeable:  # what base parameters absorb without a reference
        if kind.evidence == "base parameters" and kind.name not in exclude:
            for effect in everywhere(kind, dataset.arm.robot.revolute):
                shapes = tuple(effect.shapes(dataset.later.data.logs[0].motion, dataset.arm))
                found[kind.name, effect.joint] = Family(kind.name, effect.joint, shapes)
    return found


def _lay(
    rows: Rows,
    family: Family,
    standing: Mapping[Key, Collection[int]],
    arm: Arm,
    groups: list[Group],
    parts: list[Table],
) -> None:
    seen, key, first = (
        sum(part.width for part in parts),
        (family.cause, family.joint),
        family.shapes[0],
    )
    kind: Kind = "compliance" if first.evidence == "frequency responses" else "named"
    reads = first.parameters.reads_torque and rows.data.logs[0].motion.tau is not None
    for one, table in laid(rows, family, arm):
        parts.append(table)
        shapes, width, _ = one.table.shape
        for number in range(one.first, one.first + shapes):
            shape, stands = family.shapes[number], number in standing[key]
            known = _amplitude(shape), _sign(shape) if width == 1 else 0
            groups.append(Group(key, number, seen, width, stands, kind, reads, *known))
            seen += width


def laid(rows: Rows, family: Family, arm: Arm) -> Iterator[tuple[Laid, Table]]:
    """Return the columns of every shape of a cause over rows, and which shapes they are of."""
    fine = family.shapes[0].evidence == "reversals"  # a gap is crossed within samples
    for one in lay_family(rows.data if fine else rows.data.coarse, family, arm):
        shapes, width, _ = one.table.shape
        yield one, rows.table(one.table.reshape(shapes * width, -1), one.rows).compact()


def _amplitude(shape: Effect) -> float | None:
    """Return the amplitude of a lag's columns, or the one that physics gives; None: it is free."""
    if isinstance(shape, TorqueLag):
        return shape.looked_for or None
    return shape.parameters.fixed[0] if shape.parameters.fixed else None


def _sign(shape: Effect) -> int:
    """Return the sign that the only amplitude of a shape has; 0: it may have either."""
    can = {sign: shape.possible(shape.values([sign * _SMALL])) for sign in (-1, 1)}
    return sum(sign for sign, possible in can.items() if possible)


def _standing(family: Family, dataset: Dataset) -> set[int]:
    """Return the shapes of a family, by number, that healthy machines have in small.

    Of waves, these are all whole orders, and orders that the travel resolves: 2π / travel apart.
    """
    shapes, parameters = family.shapes, family.shapes[0].parameters
    order = next((q.name for q in parameters if q.several), None)
    if order is None or family.joint is None:
        return {0} if parameters.healthy != 0.0 else set()
    q = np.concatenate([one.motion.q[:, family.joint - 1] for one in dataset.later.data.logs])
    apart = (1.0 + _ROUNDED) * 2.0 * np.pi / max(float(np.ptp(q)), _ROUNDED)
    last, kept = -np.inf, set[int]()
    for number, shape in enumerate(shapes):
        following = getattr(shapes[min(number + 1, len(shapes) - 1)], order)
        if not shape.free or following - last > apart:
            kept.add(number)
            last = getattr(shape, order)
    return kept


def _lay_unnamed(rows: Rows, key: Key, make: Make, groups: list[Group], parts: list[Table]) -> None:
    j = (key[1] or 1) - 1

    def on_joint(motion: Motion) -> Array:
        own = make(motion)
        out = np.zeros((len(own), rows.n_joints, own.shape[1]))
        out[:, j] = own
        return out

    part, first = rows.table(rows.data.lay(on_joint)).compact(), sum(one.width for one in parts)
    standing = key[0].split()[0] in ("ripple", "friction")
    groups.append(Group(key, 0, first, part.width, standing, "unnamed"))
    parts.append(part)

"""Candidate columns: every cause at every joint in every shape, and shapes without a name.

    dictionary = Dictionary.of(dataset, config)
    dictionary.groups                      what each run of columns is
    dictionary.table(rows)                 the columns over some rows

A group is what is screened at once: one shape of one cause at one joint. Groups without a name are
splines of the position, speed and torque of a joint, ripple of its drive, of any order, the form of
its friction law, and dry and viscous friction that drift: where one of these predicts better than
every cause, the cause is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.polynomial.legendre import legvander

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset, Rows
from pipelines.diagnosis.table import Array, Indices, Table
from pipelines.model.arm import Arm
from pipelines.model.effects import all_effects
from pipelines.model.effects.base import Effect, everywhere
from pipelines.model.effects.torque_lag import TorqueLag
from pipelines.model.rigid.body import Motion
from pipelines.model.rows.families import Family, Laid, families, lay_family, place_of, whole_motion

__all__ = ["FORM", "Dictionary", "Group", "Key", "Kind", "in_words", "laid"]

FORM = "friction form"
_WORDS = {
    "spline of q": "a curve over the position of joint {}",
    "spline of dq": "a curve over the speed of joint {}",
    "spline of tau": "a curve over the torque of joint {}",
    "drift of friction": "friction of joint {} that drifts",
    FORM: "another law of friction at joint {}",
}
_ROUNDED = 1e-9  # numerics: of travel [rad or m], or share of an order, that is rounding

Key = tuple[str, int | None]  # a cause, or a shape without a name, and its joint

# of compliance rows show the class, responses the cause
Kind = Literal["named", "compliance", "unnamed"]


def in_words(key: Key) -> str:
    """Return "cogging:2" of a cause, and what it is of a shape without a name."""
    cause, joint = key
    if cause.startswith("ripple "):
        return f"a torque ripple of joint {joint}, {cause.removeprefix('ripple ')} a turn,"
    return _WORDS[cause].format(joint) if cause in _WORDS else place_of(cause, joint)


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
    length: float | None = None  # [s] of the lag that its columns are of; None: they hold for any

    @property
    def family(self) -> str:
        """The cause, or of shapes without a name their kind."""
        return self.key[0].split()[0]

    @property
    def columns(self) -> Indices:
        return np.arange(self.first, self.first + self.width)


@dataclass(frozen=True, eq=False)
class Dictionary:
    """All candidates of a dataset."""

    groups: tuple[Group, ...]
    families: dict[Key, Family]
    later: Table
    reference: Table | None

    @property
    def known(self) -> Table:
        """The columns over the rows that tell what is usual on this machine."""
        return self.later if self.reference is None else self.reference

    @classmethod
    def of(
        cls, dataset: Dataset, config: DiagnosisConfig, exclude: Sequence[str] = ()
    ) -> Dictionary:
        """Return every candidate, with its columns over the reference and the later rows."""
        found = _families(dataset, exclude)
        standing = {key: _standing(family, dataset) for key, family in found.items()}
        plain = _unnamed(dataset, config)
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
            tables.append(Table.stacked(parts))
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
    seen = sum(part.width for part in parts)
    compliant = family.shapes[0].evidence == "frequency responses"
    kind: Kind = "compliance" if compliant else "named"
    for one, table in laid(rows, family, arm):
        parts.append(table)
        shapes, width, _ = one.table.shape
        for k in range(shapes):
            number = one.first + k
            groups.append(
                Group(
                    (family.cause, family.joint),
                    number,
                    seen,
                    width,
                    number in standing[family.cause, family.joint],
                    kind,
                    family.shapes[0].parameters.reads_torque
                    and rows.data.logs[0].motion.tau is not None,
                    _length(family.shapes[number]),
                )
            )
            seen += width


def laid(rows: Rows, family: Family, arm: Arm) -> Iterator[tuple[Laid, Table]]:
    """Return the columns of every shape of a cause over rows, and which shapes they are of."""
    for one in lay_family(rows.data, family, arm):
        shapes, width, _ = one.table.shape
        yield one, rows.table(one.table.reshape(shapes * width, -1), one.rows).compact()


def _length(shape: Effect) -> float | None:
    """Return the amplitude that the columns of a shape are exact for; None: they are its slope."""
    return shape.looked_for or None if isinstance(shape, TorqueLag) else None


def _standing(family: Family, dataset: Dataset) -> set[int]:
    """Return the shapes of a family, by number, that healthy machines have in small.

    Of waves that differ in order they have all that the travel tells apart, 2π / travel from one to
    the next, and all of whole orders.
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


Make = Callable[[Motion], Array]  # (samples, k) on one joint


def _unnamed(dataset: Dataset, config: DiagnosisConfig) -> dict[Key, Make]:
    """Return the shapes without a name: splines of q, dq and torque, ripple, form of friction.

    The form of a friction law is a sum of sigmoids tanh(dq / w) of any widths w (Kostić et al.
    2004, eq. 7): no law has the form of a machine's friction at every speed.
    """
    motions = [
        one.motion for rows in (dataset.reference, dataset.later) if rows for one in rows.data.logs
    ]
    nominal, found = dataset.model.nominal, dict[Key, Make]()

    def signal(kind: str, motion: Motion, j: int) -> Array:
        values = nominal.torque(motion) if kind == "tau" else getattr(motion, kind)
        return np.asarray(values[:, j])

    from scipy.interpolate import BSpline

    def spline(kind: str, j: int) -> Make:
        every = np.concatenate([signal(kind, motion, j) for motion in motions])
        low, high = float(every.min()), float(every.max())
        knots = np.r_[[low] * 3, np.linspace(low, high, config.knots - 2), [high] * 3]
        inside = high - 1e-9 * (high - low)
        return lambda motion: np.asarray(
            BSpline.design_matrix(np.clip(signal(kind, motion, j), low, inside), knots, 3).toarray()
        )

    def ripple(order: int, j: int) -> Make:
        def make(motion: Motion) -> Array:
            angle = order * motion.q[:, j]
            waves = np.stack([np.sin(angle), np.cos(angle)], 1)
            return np.asarray(signal("tau", motion, j)[:, None] * waves)

        return make

    def widths_of(j: int) -> Array:
        top = max(float(np.abs(motion.dq[:, j]).max()) for motion in motions)
        own = [law for law in dataset.model.columns.laws if law.joint == j + 1]
        sharp = next((law.sharpness for law in own if hasattr(law, "sharpness")), 1.0 / top)
        return np.asarray(np.geomspace(0.5 / sharp, top, config.form_widths))

    def form(j: int) -> Make:
        widths = widths_of(j)
        return lambda motion: np.asarray(np.tanh(motion.dq[:, j, None] / widths))

    clocks = [one.motion.t for one in dataset.later.data.logs]
    start = dataset.session_start if dataset.reference is None else None  # two days have no clock
    session = [np.concatenate(clocks)] if start is not None else clocks
    span = max(1e-9, *(float(np.ptp(t)) for t in session))

    def drift(j: int) -> Make:
        def make(motion: Motion) -> Array:
            since = (motion.t - (motion.t[0] if start is None else start)) / span
            course = legvander(np.clip(2.0 * since - 1.0, -1.0, 1.0), config.drift_order)[:, 1:]
            dq = motion.dq[:, j]
            sharp = widths_of(j)[0]
            return np.concatenate([course * np.tanh(dq / sharp)[:, None], course * dq[:, None]], 1)

        return make

    for j in range(dataset.later.n_joints):
        found[FORM, j + 1] = form(j)
        found["drift of friction", j + 1] = drift(j)
        for kind in ("q", "dq", "tau"):
            found[f"spline of {kind}", j + 1] = spline(kind, j)
        for order in range(1, config.ripple_orders + 1):
            found[f"ripple {order}", j + 1] = ripple(order, j)
    return found


def _lay_unnamed(rows: Rows, key: Key, make: Make, groups: list[Group], parts: list[Table]) -> None:
    j = (key[1] or 1) - 1

    def on_joint(motion: Motion) -> Array:
        own = make(motion)
        out = np.zeros((len(own), rows.n_joints, own.shape[1]))
        out[:, j] = own
        return out

    part = rows.table(rows.data.lay(on_joint)).compact()
    first = sum(one.width for one in parts)
    standing = key[0].split()[0] in ("ripple", "friction")
    groups.append(Group(key, 0, first, part.width, standing, "unnamed"))
    parts.append(part)

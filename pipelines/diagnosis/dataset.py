"""Rows of a session and of its reference, whitened and weighted, and their nominal model.

dataset = load(prepare(logs, recipe))
dataset.later.y, dataset.later.nominal        the rows that are diagnosed
dataset.reference                             the rows of role "reference"
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected
from pipelines.estimation.exact_model import Exact, further_slopes, nominal_slopes
from pipelines.estimation.joint_table import Array, Indices, Table, by_joint, in_rows
from pipelines.estimation.nominal import fit_columns, fit_nominal, rows_of
from pipelines.estimation.preparation import Prepared
from pipelines.estimation.regression import Columns
from pipelines.estimation.rows import Data, Kept, Whitening
from pipelines.io.log import ExperimentLog

__all__ = ["Dataset", "Rows", "load"]


@dataclass(frozen=True, eq=False)
class NoiseLevel:
    """Standard deviation of each joint's noise over its speed, constant within bins."""

    edges: Array  # (joints, bins - 1) speeds between the bins
    std: Array  # (joints, bins) [N m]

    @classmethod
    def of(
        cls, noise: Array, speed: Array, joint: Indices, counts: npt.NDArray[np.bool_], bins: int
    ) -> NoiseLevel:
        """Return the level of `noise` (rows,) [N m] in bins of equal count."""
        edges, std = [], []
        for j in range(int(joint.max()) + 1):
            own = (joint == j) & counts
            if not own.any():  # its rows are zero in everything
                edges.append(np.zeros(bins - 1))
                std.append(np.ones(bins))
                continue
            inner = np.quantile(speed[own], np.arange(1, bins) / bins)
            at = np.searchsorted(inner, speed[own])
            rows = np.maximum(np.bincount(at, None, bins), 1)
            power = np.bincount(at, noise[own] ** 2, bins) / rows
            edges.append(inner)
            std.append(np.sqrt(np.where(power > 0.0, power, power.max())))
        return cls(np.array(edges), np.array(std))

    def at(self, speed: Array, joint: Indices) -> Array:
        """Return the level (rows,) [N m] at speeds of joints."""
        out = np.empty(len(speed))
        for j, (edges, std) in enumerate(zip(self.edges, self.std, strict=True)):
            own = joint == j
            out[own] = std[np.searchsorted(edges, speed[own])]
        return out


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of some logs, in units of the noise's standard deviation."""

    data: Data
    columns: Columns
    weight: Array  # (rows,) [1/(N m)]
    nominal: Table  # columns of base parameters and friction laws
    level: NoiseLevel | None = None

    @classmethod
    def of(cls, data: Data, model: Exact, rms: Array | None = None) -> Rows:
        """Return the rows of data in units of the residual.

        Args:
            rms: (joints,) [N m] of the residual; None: what the nominal model leaves.
        """
        table = rows_of(data, model.columns)
        size = fit_columns(data, table).rms if rms is None else np.where(rms > 0.0, rms, 1.0)
        weight = 1.0 / size[data.joint]
        nominal = Table.of(table * weight, data.joint, data.n_joints)
        return cls(data, model.columns, weight, nominal)

    @property
    def n_joints(self) -> int:
        return self.data.n_joints

    @property
    def count(self) -> int:
        return self.data.rows

    @cached_property
    def coarse(self) -> Rows:
        """The same rows from fewer samples: exact enough for the direction of a step."""
        data = self.data.coarse
        return self if data is self.data else replace(self, data=data)

    @cached_property
    def y(self) -> tuple[Array, ...]:
        return self.signal(self.data.y)

    @cached_property
    def joint(self) -> Indices:
        return self.data.joint

    def signal(self, x: Array) -> tuple[Array, ...]:
        """Return torque (…, rows) [N m] joint by joint, in units of the noise."""
        return by_joint(x * self.weight, self.joint, self.n_joints)

    def table(self, columns: npt.NDArray[Any], rows: Indices | None = None) -> Table:
        """Return columns (k, rows) [N m] in units of the noise.

        Args:
            rows: which of all rows these are, each joint's all or none; the others are zero.
        """
        weight = self.weight.astype(columns.dtype)
        if rows is None:
            return Table.of(columns * weight, self.joint, self.n_joints)
        table = Table.of(columns * weight[rows], self.joint[rows], self.n_joints)
        return table.over(np.bincount(self.joint, minlength=self.n_joints))

    def torque(self, model: Exact) -> tuple[Array, ...]:
        """Return the torque of an exact model, joint by joint, in units of the noise."""
        return self.signal(model.torque(self.data))

    def mixed(self, model: Exact) -> Table | None:
        """Return the slopes by the nominal numbers beside the effects; None: they are `nominal`."""
        slopes = nominal_slopes(model)
        return None if slopes is None else self.table(self.data.lay_each(slopes))

    def slopes(
        self, model: Exact, joints: Container[int | None]
    ) -> tuple[Table, list[tuple[int, int, str]]]:
        """Return the slopes of the torque by the numbers of the effects, and their names.

        Args:
            joints: of whose friction laws the shapes are among them.
        """
        every, names = further_slopes(model, self.data, joints)
        return self.table(every), names

    def blocks(self, length: float) -> tuple[Indices, ...]:
        """Return the block of `length` [s] that each row belongs to, of each joint."""
        which = np.floor(self.data.t / length).astype(np.intp) + 1_000_000 * self.data.log_of
        _, numbered = np.unique(which, return_inverse=True)
        return tuple(numbered[self.joint == j] for j in range(self.n_joints))

    def less(self, torque: Array | None) -> Rows:
        """Return the rows less a torque (rows,) [N m] without whitening; None: as measured."""
        return replace(self, data=replace(self.data, known=torque))

    @cached_property
    def speed(self) -> Array:
        """(rows,) |dq| of each row's joint."""
        laid = [np.abs(one.at_rows(one.motion.dq)).T.ravel() for one in self.data.logs]
        return np.concatenate(laid)

    def whitened(self, noise: Sequence[Array], bins: int) -> tuple[Rows, Callable[[Table], Table]]:
        """Return the rows in which `noise`, in units of these rows, is white and of unit variance.

        The noise of a joint is one autoregressive process (Aitken 1935) of a level that depends on
        its speed: at reversals no friction law is exact, and positions are coarse. The second that
        is returned brings columns over these rows there.
        """
        flat = in_rows(noise, self.joint) / self.weight
        whitening = Whitening.of(self.data, flat[None])
        white = self.data.through(whitening, flat)
        level = NoiseLevel.of(white, self.speed, self.joint, self.data.counts, bins)
        weight = 1.0 / level.at(self.speed, self.joint)
        before, after = (by_joint(w, self.joint, self.n_joints) for w in (self.weight, weight))

        def through(table: Table) -> Table:
            return table.mapped(lambda x, j: self._through(whitening, x / before[j], j) * after[j])

        there = self.data.whitened(whitening)
        return Rows(there, self.columns, weight, through(self.nominal), level), through

    def _through(self, whitening: Whitening, x: Array, joint: int) -> Array:
        first, out = 0, []
        for one in self.data.logs:
            own = x[:, first : first + one.rows]
            joints = np.full(len(own), joint, dtype=np.intp)
            out.append(whitening.through(own, joints, one.stretches))
            first += one.rows
        return np.concatenate(out, axis=1)


@dataclass(frozen=True, eq=False)
class Dataset:
    """The rows that are diagnosed, and the reference rows of the same machine, if there are any."""

    model: Exact  # nominal, as the reference has it, or else the rows themselves
    reference: Rows | None
    later: Rows
    frf: tuple[ExperimentLog, ...]
    session_start: float | None  # [s] when the later logs begin; None: on no common clock
    cleared: Rows | None = None  # the later rows less the causes found before

    @property
    def arm(self) -> Arm:
        return self.model.arm

    @property
    def known(self) -> Rows:
        """The rows of the reference; without one, the later rows without the causes found."""
        return self.reference or self.cleared or self.later

    @property
    def noise_ratio(self) -> Array:
        """(joints,) variance of the later rows' noise, over the reference's at such speeds."""
        later, level = self.later, self.known.level
        if level is None:
            return np.ones(later.n_joints)
        usual = level.at(later.speed, later.joint)
        power = np.bincount(later.joint, usual**2) / np.bincount(later.joint)
        return np.asarray(self.noise_power / power)

    @property
    def noise_power(self) -> Array:
        """(joints,) [(N m)²] variance of the later rows' noise."""
        later = self.later
        return np.asarray(np.bincount(later.joint, later.weight**-2) / np.bincount(later.joint))


def load(prepared: Prepared, frf: Sequence[ExperimentLog] = ()) -> Dataset:
    """Return the rows of prepared logs, with the nominal model of the reference or of themselves.

    Validation logs are rows like the others: the score predicts each block from all others.

    Raises:
        InputRejected: T08, a joint is held in all reference logs.
    """
    own, judged, before = prepared.data, prepared.judge, prepared.reference
    kept = Kept()
    every = enumerate((*own.logs, *(judged.logs if judged else ())))
    later = Data(tuple(replace(one, place=k, kept=kept) for k, one in every), first=own.first)
    if before is not None:
        _refuse_held(before)
    columns, fit = fit_nominal(before or later, _columns(prepared))
    model = Exact.start(columns, fit)
    reference = None if before is None else Rows.of(before, model)
    return Dataset(model, reference, Rows.of(later, model), tuple(frf), _session_start(later))


def _session_start(data: Data) -> float | None:
    """Return when the logs begin, None where two overlap: then each has a clock of its own."""
    spans = sorted((float(one.motion.t[0]), float(one.motion.t[-1])) for one in data.logs)
    apart = all(before[1] < after[0] for before, after in pairwise(spans))
    return spans[0][0] if apart else None


def _columns(prepared: Prepared) -> Columns:
    """Return the nominal columns; the curve by which friction changes its sign is fitted too.

    That curve is not known, and none is a fault. Effects on the load or the drive act on the
    friction as well, and do so by its curve.
    """
    own = prepared.columns
    if any(speed > 0.0 for speed in prepared.recipe.min_speed):
        return own
    laws = (law.forms()[-1] if law.evidence == "none" else law for law in own.laws)
    return replace(own, laws=tuple(laws))


def _refuse_held(reference: Data) -> None:
    """Refuse reference logs that say nothing of a joint."""
    moving = np.bincount(reference.joint[reference.counts], minlength=reference.n_joints)
    if not moving.all():
        joint = int(np.argmin(moving)) + 1
        raise InputRejected(
            "T08",
            f"joint {joint} is held in the logs of role 'reference'",
            remedy=f"record a reference in which joint {joint} moves, or leave the reference out",
        )

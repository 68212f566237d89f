"""Rows of a session and of its reference, whitened and weighted, and their nominal model.

    dataset = load(logs, config)
    dataset.later.y, dataset.later.nominal        the rows that are diagnosed
    dataset.reference                             the rows of role "reference"

The noise covariance Σ is one: an autoregressive model of each joint's reference residual, by which
all rows pass (Aitken 1935), and its standard deviation, in units of which they are expressed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.table import Array, Indices, Table, by_joint
from pipelines.errors import InputRejected
from pipelines.log.experiment import ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import (
    fit_columns,
    fit_nominal,
    law_slopes,
    rigid_rows,
    rows_of,
)
from pipelines.model.diagnosis.fitted.slopes import slopes_of
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.rows.whitening import Whitening
from pipelines.model.estimation.regression import Columns

__all__ = ["Dataset", "Rows", "load"]


@dataclass(frozen=True, eq=False)
class Rows:
    """Whitened rows of some logs, in units of the noise's standard deviation."""

    data: Data
    columns: Columns
    weight: Array  # (joints,) [1/(N m)]
    nominal: Table  # slopes by base parameters and friction laws

    @property
    def n_joints(self) -> int:
        return self.data.n_joints

    @property
    def count(self) -> int:
        return self.data.rows

    @cached_property
    def y(self) -> tuple[Array, ...]:
        return self.signal(self.data.y)

    @cached_property
    def joint(self) -> Indices:
        return self.data.joint

    def signal(self, x: Array) -> tuple[Array, ...]:
        """Return torque (…, rows) [N m] joint by joint, in units of the noise."""
        return by_joint(x * self.weight[self.joint], self.joint, self.n_joints)

    def table(self, columns: Array) -> Table:
        """Return columns (k, rows) [N m] in units of the noise."""
        return Table.of(columns * self.weight[self.joint], self.joint, self.n_joints)

    def torque(self, model: Exact) -> tuple[Array, ...]:
        """Return the torque of an exact model, joint by joint, in units of the noise."""
        return self.signal(model.torque(self.data))

    def slopes(self, model: Exact) -> tuple[Table, list[tuple[int, int, str]]]:
        """Return the slopes of the torque by the numbers of the effects, and their names."""
        every, names = slopes_of(model, self.data, rigid_rows(self.data, model.columns))
        first = len(model.beta)
        places = [k for k, name in enumerate(names) if name[0] == 1]
        return self.table(every[[first + k for k in places]]), [names[k] for k in places]

    def blocks(self, length: float) -> tuple[Indices, ...]:
        """Return the block of `length` [s] that each row belongs to, of each joint."""
        which = np.floor(self.data.t / length).astype(np.intp) + 1_000_000 * self.data.log_of
        _, numbered = np.unique(which, return_inverse=True)
        return tuple(numbered[self.joint == j] for j in range(self.n_joints))


@dataclass(frozen=True, eq=False)
class Dataset:
    """The rows that are diagnosed, and the reference rows of the same machine."""

    model: Exact  # nominal, as the reference has it
    reference: Rows
    later: Rows
    held_out: tuple[int, ...]  # places of the later logs that no fit of an effect saw
    law_names: tuple[tuple[int, str], ...]  # shapes of friction laws, behind the base parameters
    frf: tuple[ExperimentLog, ...]
    session_start: float  # [s] clock time at which the later logs begin

    @property
    def arm(self) -> Arm:
        return self.model.arm

    @property
    def n_base(self) -> int:
        """Numbers of the nominal model that are linear."""
        return len(self.model.beta)


def load(logs: Sequence[ExperimentLog], config: DiagnosisConfig) -> Dataset:
    """Return the rows of the logs, by their roles.

    Raises:
        InputRejected: S01, no log of role "reference";
            and as `prepare`, logs that give no rows.
    """
    roles = Logs.by_role(logs)
    if not roles.reference:
        raise InputRejected(
            "S01",
            "no log of role 'reference'",
            remedy="record the arm before, or name an earlier recording with that role",
        )
    ready = prepare(roles, DiagnosisSettings(cutoff_hz=config.cutoff_hz))
    assert ready.reference is not None
    columns, fit = fit_nominal(ready.reference, ready.columns)
    model = Exact.start(columns, fit)
    whitening = Whitening.of(ready.reference, fit.left[None])
    reference = ready.reference.whitened(whitening)
    own = ready.data.whitened(whitening).logs
    judged = ready.judge.whitened(whitening).logs if ready.judge else ()
    later = Data((*own, *judged), first=ready.data.first)
    table, shapes = _nominal(reference, columns, model.beta)
    weight = 1.0 / fit_columns(reference, table).rms
    later_table, _ = _nominal(later, columns, model.beta)
    plain = [
        Rows(data, columns, weight, Table.of(t * weight[data.joint], data.joint, data.n_joints))
        for data, t in ((reference, table), (later, later_table))
    ]
    start = min(float(one.motion.t[0]) for one in later.logs)
    return Dataset(
        model,
        plain[0],
        plain[1],
        tuple(range(len(own), len(own) + len(judged))),
        tuple(shapes),
        roles.frf,
        start,
    )


def _nominal(data: Data, columns: Columns, beta: Array) -> tuple[Array, list[tuple[int, str]]]:
    slopes, shapes = law_slopes(data, columns, beta)
    return np.concatenate([rows_of(data, columns), *slopes]), shapes


def moved(
    model: Exact,
    base: Array,
    names: Sequence[tuple[int, str]],
    effects: Array,
    effect_names: Sequence[tuple[int, int, str]],
) -> Exact:
    """Return the model with its nominal numbers moved by `base` and its effects' by `effects`."""
    laws = [(0, place, name) for place, name in names]
    return model.moved(np.concatenate([base, effects]), [*laws, *effect_names])

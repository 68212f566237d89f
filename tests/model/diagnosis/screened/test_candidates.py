"""Columns of a cause beside torque logging delay: SciPy's low-pass says what the record makes of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Family, lay_family
from pipelines.model.effects.base import Effect
from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.concave_friction import ConcaveFriction
from pipelines.model.effects.torque_lag import TorqueLag
from tests.model.diagnosis.arms import arm, hidden

_LATE = 0.05  # [s]


@pytest.fixture(scope="module")
def data() -> Data:
    return prepare(Logs((hidden(1),)), DiagnosisSettings()).data


def late(joint: int) -> Arm:
    lag = TorqueLag(joint=joint)
    return replace(arm(), effects=(Acting.of(lag, lag.values(np.array([_LATE]))),))


def logged(data: Data, effect: Effect, joint: int) -> Array:
    """Rows (k, joints, rows) of the columns of `effect`, those of `joint` through a low-pass."""
    one = data.logs[0]
    t = one.motion.t - one.motion.t[0]
    table = effect.columns(one.motion, arm()).copy()
    for k in range(table.shape[2]):
        _, y, _ = lsim(([1.0], [_LATE, 1.0]), table[:, joint - 1, k], t, X0=[table[0, joint - 1, k] * _LATE])
        table[:, joint - 1, k] = y
    return one.lay(table)


@pytest.mark.parametrize("effect", [Cogging(joint=2, order=5.0, harmonics=1), ConcaveFriction(joint=2)], ids=lambda e: e.name)
@pytest.mark.parametrize("joint", [1, 2, 3])
def test_a_late_record_changes_the_columns_of_its_own_joint_only(data: Data, effect: Effect, joint: int) -> None:
    laid, = lay_family(data, Family(effect.name, 2, (effect,)), late(joint))
    expected = logged(data, effect, joint).reshape(laid.table.shape[1], -1)
    assert np.allclose(laid.table[0], expected[:, laid.rows], atol=2e-3 * np.abs(expected).max())
    assert not np.delete(expected, laid.rows, axis=1).any()


def test_columns_laid_beside_one_record_are_not_those_beside_another(data: Data) -> None:
    family = Family("cogging", 2, (Cogging(joint=2, order=5.0, harmonics=1),))
    now, slow, other = (next(iter(lay_family(data, family, x))).table for x in (arm(), late(2), late(3)))
    assert np.array_equal(now, other)
    assert np.abs(now - slow).max() > 0.1 * np.abs(now).max()

"""Drives that mix the torques of a moment: what a model makes of it in rows is what it makes of every sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting
from pipelines.model.effects.base import Effect
from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.spring import Spring
from pipelines.model.effects.time_delay import TimeDelay
from pipelines.model.effects.torque_crosstalk import TorqueCrosstalk
from pipelines.model.effects.torque_gain import TorqueGain
from pipelines.model.rows.data import Data, Whitening, mixable, mixed
from pipelines.model.rows.exact import Exact
from pipelines.model.rows.nominal import fit_nominal
from pipelines.model.rows.prepare import DiagnosisSettings, Logs, Prepared, prepare
from tests.diagnosis.arms import hidden


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    return prepare(Logs((hidden(1), hidden(2))), DiagnosisSettings())


@pytest.fixture(scope="module")
def model(prepared: Prepared) -> Exact:
    """Weak drive, crosstalk, a spring and a wave that was in one log only, and a wave that stands."""
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    stands = Cogging(2, order=11.0, harmonics=1)
    found = (Exact.start(columns, fit).with_effect(TorqueGain(2), TorqueGain(2).amplitudes({"gain_error": -0.1}))
             .with_effect(Spring(2, degree=1, highest=1), np.array([3.0, 1.0]))
             .with_effect(TorqueCrosstalk(3, from_joint=2.0), np.array([0.2]))
             .with_effect(TorqueGain(3), TorqueGain(3).amplitudes({"gain_error": 0.05}))
             .with_effect(Cogging(1, order=7.0, harmonics=1), np.array([0.3, -0.2]), log=1))
    return replace(found, standing=(Acting.of(stands, stands.values([0.4, 0.1])),))


def by_sample(model: Exact, data: Data) -> Array:
    return data.lay_each(lambda log, motion: model.torque_in(log, motion))


def test_rows_of_mixed_torque_are_the_rows_mixed(model: Exact, prepared: Prepared) -> None:
    """In the order in which the drives were found, what stands beside them mixed as well."""
    wanted = by_sample(model, prepared.data)
    np.testing.assert_allclose(model.torque(prepared.data), wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())
    bare = replace(model, effects=())
    assert prepared.data.rms(wanted - by_sample(bare, prepared.data)).min() > 0.1


def test_the_work_is_done_in_rows(model: Exact, prepared: Prepared, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Exact, "torque_in", None)
    model.torque(prepared.data)


@pytest.mark.parametrize(("more", "amplitude", "log"), [(TimeDelay(1), 0.001, None), (TorqueCrosstalk(1, from_joint=3.0), 0.3, 1)])
def test_by_samples_where_one_of_them_does_more(more: Effect, amplitude: float, log: int | None, model: Exact,
                                                prepared: Prepared) -> None:
    """A delay hangs on the time before, and crosstalk in one of the logs on which it is."""
    there = model.with_effect(more, np.array([amplitude]), log)
    wanted = by_sample(there, prepared.data)
    np.testing.assert_allclose(there.torque(prepared.data), wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())
    assert np.abs(wanted - by_sample(model, prepared.data)).max() > 1e-3


def test_not_where_rows_of_some_joints_do_not_count(model: Exact) -> None:
    """A row that does not count is zero in everything, and would be missed in those it is mixed into."""
    slow = prepare(Logs((hidden(1), hidden(2))), DiagnosisSettings(min_speed=(0.0, 0.3, 0.0))).data
    assert not slow.counts.all()
    assert not mixable(slow)
    wanted = by_sample(model, slow)
    np.testing.assert_allclose(model.torque(slow), wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())


def test_not_where_each_joint_is_whitened_by_itself(model: Exact, prepared: Prepared) -> None:
    data = prepared.data
    white = data.whitened(Whitening.of(data, data.y[None]))
    assert mixable(data)
    assert not mixable(white)
    wanted = by_sample(model, white)
    np.testing.assert_allclose(model.torque(white), wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())


def test_every_log_by_itself(prepared: Prepared) -> None:
    """Rows of a joint stand behind each other, log by log."""
    data = prepared.data
    swapped = mixed(data, np.eye(3)[[1, 0, 2]], np.where(data.joint == 0, 1.0, 2.0) * (1.0 + data.log_of))
    np.testing.assert_array_equal(swapped, np.where(data.joint == 1, 1.0, 2.0) * (1.0 + data.log_of))

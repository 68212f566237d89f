"""A log that lost samples is one whose controller went on: a twin can be made of it, and an arm in order is not blamed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.log.experiment import ExperimentLog
from pipelines.model.diagnosis.bridged import bridged
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.inputs import Logs
from pipelines.model.diagnosis.settings import DiagnosisSettings
from tests.diagnose.sessions import session
from tests.faulty import dropped, retimed


def holed(log: ExperimentLog, first: int = 1000, samples: int = 400) -> ExperimentLog:
    return dropped(log, lambda k: (k < first) | (k >= first + samples))


def test_the_reference_goes_on_where_samples_are_lost() -> None:
    """Over 40 ms of a reference of a few hertz, as far as a straight line would be off by several milliradians; nothing was
    measured there."""
    log = session()[0]
    found = bridged(holed(log, samples=40))
    np.testing.assert_allclose(found.t, log.t, atol=1e-9)
    np.testing.assert_allclose(found["q_ref"], log["q_ref"], atol=1e-4)
    lost = np.zeros(log.n_samples, dtype=bool)
    lost[1000:1040] = True
    for name in ("q", "tau"):
        assert np.isnan(found[name][lost]).all()
        np.testing.assert_array_equal(found[name][~lost], log[name][~lost])


def test_what_lost_nothing_or_cannot_be_run_again_is_left_as_it_is() -> None:
    log = session()[0]
    uneven = retimed(log, lambda t: np.where(np.arange(len(t)) > 500, t + 0.4 * log.sample_time, t))
    for one in (log, uneven, holed(log, samples=1500), replace(holed(log), controller=None)):
        assert bridged(one) is one


@pytest.mark.parametrize("samples", [20, 400])
def test_an_arm_in_order_whose_recorder_lost_samples_is_in_order(samples: int) -> None:
    """Without a twin, one percent of a residual passes for a ripple of the drive."""
    fitted, judging = session()
    found = diagnose(Logs((holed(fitted, samples=samples),), (judging,)),
                     DiagnosisSettings(replicas=3, limits=False, evidence=False))
    assert (found.floor_origin, found.verdict) == ("twin", "nothing-wrong")

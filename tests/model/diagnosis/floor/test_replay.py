"""A log that lost samples is one whose controller went on: a twin can be made of it, and an arm in order is not blamed."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.log.experiment import ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.floor.replay import as_recorded, experiment_of
from tests.diagnose.sessions import session
from tests.faulty import dropped, retimed


def holed(log: ExperimentLog, first: int = 1000, samples: int = 400) -> ExperimentLog:
    return dropped(log, lambda k: (k < first) | (k >= first + samples))


def test_the_reference_goes_on_where_samples_are_lost() -> None:
    """Over 40 ms of a reference of a few hertz, as far as a straight line would be off by several milliradians; its speed and
    acceleration are those of the same curve. What is simulated is taken where the log has samples."""
    log = session()[0]
    short = holed(log, samples=40)
    found, whole = experiment_of(short), experiment_of(log)
    np.testing.assert_allclose(found.q_ref, whole.q_ref, atol=1e-4)
    np.testing.assert_allclose(found.dq_ref, whole.dq_ref, atol=2e-2)
    gap = slice(1000, 1040)
    slope = np.gradient(found.q_ref, log.sample_time, axis=0)
    np.testing.assert_allclose(found.dq_ref[gap], slope[gap], atol=1e-2)
    x = np.arange(log.n_samples, dtype=float)[:, None] * np.ones(3)
    np.testing.assert_array_equal(as_recorded(short, x)[:, 0], np.delete(x[:, 0], np.arange(1000, 1040)))
    np.testing.assert_array_equal(as_recorded(short, x[None])[0], as_recorded(short, x))
    assert as_recorded(log, x) is x
    assert as_recorded(short, as_recorded(short, x)).shape == short.q.shape


def test_samples_lost_here_and_there_on_a_clock_that_is_a_little_fast_are_put_back() -> None:
    log = session()[0]
    fast = retimed(dropped(log, lambda k: k % 50 != 25), lambda t: 1.0001 * t)
    found = experiment_of(fast)
    assert found.n_samples == log.n_samples
    np.testing.assert_allclose(found.q_ref, log["q_ref"], atol=1e-5)


def test_what_cannot_be_put_back_is_refused() -> None:
    log = session()[0]
    uneven = retimed(log, lambda t: np.where(np.arange(len(t)) > 500, t + 0.4 * log.sample_time, t))
    for one in (uneven, holed(log, samples=1500)):
        with pytest.raises(InputRejected, match="RRID-T05"):
            experiment_of(one)


@pytest.mark.slow
@pytest.mark.parametrize("samples", [20, 400])
def test_an_arm_in_order_whose_recorder_lost_samples_is_in_order(samples: int) -> None:
    """Without a twin, one percent of a residual passes for a ripple of the drive."""
    fitted, judging = session()
    found = diagnose(Logs((holed(fitted, samples=samples),), (judging,)),
                     DiagnosisSettings(replicas=3, limits=False, evidence=False))
    assert (found.floor_origin, found.verdict) == ("twin", "nothing-wrong")


@pytest.mark.slow
def test_samples_lost_here_and_there_are_no_alarm() -> None:
    fitted, judging = session()
    found = diagnose(Logs((dropped(fitted, lambda k: k % 97 != 96),), (judging,)),
                     DiagnosisSettings(replicas=3, limits=False, evidence=False))
    assert (found.floor_origin, found.verdict) == ("twin", "nothing-wrong")

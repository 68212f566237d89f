"""No extended model is worse than the nominal one by more than a tenth on any held-out log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from pipelines.diagnosis.result import Diagnosis
from pipelines.dynamics.arm import Arm
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.preparation import Logs
from pipelines.io.log import Array, ExperimentLog
from tests.diagnose.sessions import but, session
from tests.diagnosis.asking import answered

_HZ = 40.0


def error(arm: Arm, log: ExperimentLog) -> float:
    """Norm of the torque error over a whole log, a held command centred, below 40 Hz: by hand, beside the diagnosis's own rows."""
    motion = reconstruct(log, Reconstruction()).motion
    model = arm.torque(motion)
    left = 0.5 * (log.tau[1:] + log.tau[:-1]) - 0.5 * (model[1:] + model[:-1])
    return float(np.linalg.norm(smooth(left, 1.0 / log.sample_time)[200:-200]))


def smooth(x: Array, rate: float) -> Array:
    from scipy.signal import butter, filtfilt

    b, a = butter(4, _HZ / (rate / 2.0))
    return np.asarray(filtfilt(b, a, x, axis=0))


def found(judging: Sequence[ExperimentLog]) -> Diagnosis:
    fitted = tuple(log for log in session("cogging", 2) if log.role == "identify")
    return answered(Logs(fitted, tuple(judging)), exclude=but("cogging", "torque_offset"))


@pytest.mark.slow
def test_a_cause_that_one_held_out_log_does_not_bear_out_is_not_accepted() -> None:
    """Cogging in what is fitted and in one held-out log; the other one comes of the same arm without it."""
    rippled = next(log for log in session("cogging", 2) if log.role == "validate")
    smoothly = replace(next(log for log in session() if log.role == "validate"), name="smooth")
    alone = found([rippled])
    assert [(one.cause, one.joint) for one in alone.findings] == [("cogging", 2)]
    assert alone.nominal is not None
    assert alone.extended is not None
    assert error(alone.extended, rippled) < 0.5 * error(alone.nominal, rippled)
    assert error(alone.extended, smoothly) > 1.1 * error(alone.nominal, smoothly)  # it would harm there
    both = found([rippled, smoothly])
    assert both.nominal is not None
    after = both.nominal if both.extended is None else both.extended
    for log in (rippled, smoothly):
        assert error(after, log) <= 1.1 * error(both.nominal, log)

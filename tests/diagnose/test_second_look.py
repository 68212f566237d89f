"""A second look in white rows: a ripple below a drive's slow wander, which plain least squares do not tell from it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from pipelines.log.experiment import ExperimentLog
from pipelines.model.diagnosis import diagnose as whole
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.inputs import Logs
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.diagnosis.settings import DiagnosisSettings
from tests.diagnose.sessions import but, session

JOINT = 2
WANDER, FADES = 0.1, 0.1  # [N m] std, [s] in which its zero forgets where it was
WAVES = 30.0  # a radian


def wandering(log: ExperimentLog, seed: int, ripple: float) -> ExperimentLog:
    """The log with a drive whose zero wanders as an autoregression of first order, and a ripple of so many N m over the angle."""
    pole = np.exp(-log.sample_time / FADES)
    white = np.random.default_rng(seed).standard_normal(log.n_samples + 5000)
    zero = WANDER * lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[5000:]
    tau = log.tau.copy()
    tau[:, JOINT - 1] += zero + ripple * np.sin(WAVES * log.q[:, JOINT - 1] + 0.4)
    return replace(log, signals={**log.signals, "tau": replace(log.signals["tau"], values=tau)})


def diagnosed(ripple: float) -> Diagnosis:
    logs = [wandering(log, k, ripple) for k, log in enumerate(session(seconds=6.0))]
    return diagnose(Logs.by_role(logs), DiagnosisSettings(
        replicas=4, most=2, without=but("cogging", "encoder_eccentricity", "torque_offset"), evidence=False, limits=False))


def test_a_ripple_below_slow_noise_is_named_at_a_second_look(monkeypatch: pytest.MonkeyPatch) -> None:
    """As large as the wander, but thirty waves a radian. What it brings is told in newton metres of the rows as they are: on the
    held-out log its own power, and not that of whitened rows, of which most is noise."""
    ripple = 0.1
    found = diagnosed(ripple)
    assert [(one.cause, one.joint) for one in found.findings] == [("cogging", JOINT)]
    size = found.findings[0].parameters["amplitude"]
    assert size.std is not None
    assert abs(size.value - ripple) < 3.0 * size.std < ripple
    gain = found.findings[0].gain.validate_torque_rms
    np.testing.assert_allclose(np.sqrt(gain.before**2 - gain.after**2)[JOINT - 1], ripple / np.sqrt(2.0), rtol=0.3)

    def once(done: Any, *_: Any) -> Any:
        return done

    monkeypatch.setattr(whole, "looked_again", once)
    assert diagnosed(ripple).verdict == "nothing-wrong"


def test_slow_noise_alone_is_nothing_wrong() -> None:
    assert diagnosed(0.0).verdict == "nothing-wrong"

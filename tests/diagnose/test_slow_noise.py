"""A drive's zero wanders slowly: that is no fault, and a quick ripple below it is found all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from bench import experiments
from bench.draw import draw_machine
from bench.faults.drive import Cogging
from bench.plant import record
from pipelines.diagnosis.result import Diagnosis
from pipelines.estimation.preparation import Logs
from pipelines.io.log import ExperimentLog
from tests.diagnose.sessions import but
from tests.diagnosis.asking import answered
from tests.healthy import with_signal

JOINT = 2
WANDER, FADES = 0.05, 0.1  # [N m] std, [s] in which the drive's zero forgets where it was
RIPPLE = 0.05  # [N m]


def wandering(log: ExperimentLog, seed: int) -> ExperimentLog:
    """The log of a drive whose zero wanders as an autoregression of first order."""
    pole = np.exp(-log.sample_time / FADES)
    white = np.random.default_rng(seed).standard_normal(log.n_samples + 5000)
    tau = log.tau.copy()
    tau[:, JOINT - 1] += WANDER * lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[5000:]
    return with_signal(log, tau=tau)


def diagnosed(ripple: float, waves: float, seed: int, seconds: float = 6.0) -> Diagnosis:
    """Of two excitations of so many seconds on an arm that has felt the ripple, so many `waves` a turn."""
    machine = draw_machine(7, "fault")
    faults = (Cogging(JOINT, waves, ripple, phase=0.8, second_phase=2.1),) if ripple else ()
    plans = [
        replace(
            experiments.excitation(machine, seed + k, seconds, 1), name=f"excitation-{k + 1}", role=role
        )
        for k, role in enumerate(("identify", "validate"))
    ]
    logs = record(machine, faults, plans, seed)
    spoilt = [wandering(log, 10 * seed + k) for k, log in enumerate(logs)]
    few = but("cogging", "encoder_eccentricity", "torque_offset")
    return answered(Logs.by_role(spoilt), exclude=few)


@pytest.mark.slow
@pytest.mark.parametrize(("waves", "seed"), [(90.0, 4), (90.0, 5)])
def test_a_ripple_below_slow_noise_is_named(waves: float, seed: int) -> None:
    """As large as the wander, but quicker. What it brings is told in newton metres of the rows as they are: on the held-out log
    its own power, with its second harmonic."""
    found = diagnosed(RIPPLE, waves, seed)
    assert [(one.cause, one.joint) for one in found.findings] == [("cogging", JOINT)]
    size = found.findings[0].parameters["amplitude"]
    assert size.std is not None
    assert abs(size.value - RIPPLE) < 3.0 * size.std < 0.3 * RIPPLE
    gain = found.findings[0].gain.validate_torque_rms
    taken = (gain.before**2 - gain.after**2)[JOINT - 1]
    np.testing.assert_allclose(np.sqrt(taken), RIPPLE / np.sqrt(2.0), rtol=0.3)


@pytest.mark.parametrize("seed", [1, 2])
def test_slow_noise_alone_is_no_fault(seed: int) -> None:
    assert diagnosed(0.0, 0.0, seed, 3.0).verdict == "no-fault-found"

"""A drive's zero that wanders slowly is no fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from bench import experiments
from bench.draw import draw_machine
from bench.plant import record
from pipelines.diagnosis.result import Diagnosis
from pipelines.estimation.preparation import Logs
from pipelines.io.log import ExperimentLog
from tests.diagnose.sessions import but
from tests.diagnosis.asking import answered
from tests.healthy import with_signal

JOINT = 2
WANDER, FADES = 0.05, 0.1  # [N m] std, [s] in which the drive's zero forgets where it was


def wandering(log: ExperimentLog, seed: int) -> ExperimentLog:
    """The log of a drive whose zero wanders as an autoregression of first order."""
    pole = np.exp(-log.sample_time / FADES)
    white = np.random.default_rng(seed).standard_normal(log.n_samples + 5000)
    tau = log.tau.copy()
    tau[:, JOINT - 1] += WANDER * lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[5000:]
    return with_signal(log, tau=tau)


def diagnosed(seed: int) -> Diagnosis:
    """Of two excitations of three seconds."""
    machine = draw_machine(7, "fault")
    plans = [
        replace(
            experiments.excitation(machine, seed + k, 3.0, 1), name=f"excitation-{k + 1}", role=role
        )
        for k, role in enumerate(("identify", "validate"))
    ]
    logs = record(machine, (), plans, seed)
    spoilt = [wandering(log, 10 * seed + k) for k, log in enumerate(logs)]
    few = but("cogging", "torque_offset")
    return answered(Logs.by_role(spoilt), exclude=few)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_slow_noise_alone_is_no_fault(seed: int) -> None:
    assert diagnosed(seed).verdict == "no-fault-found"

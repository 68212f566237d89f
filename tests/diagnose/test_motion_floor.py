"""The floor of the held-out logs is that of their motion: of a healthy machine of the test bench it is what their residual is."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from pipelines.bench import experiments
from pipelines.bench.machine import draw_machine
from pipelines.bench.session import record
from pipelines.log.experiment import ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.floor.drive_noise import _roughness
from pipelines.model.diagnosis.result import Diagnosis
from tests.diagnose.sessions import but


@lru_cache(maxsize=1)
def recorded() -> tuple[ExperimentLog, ...]:
    """A quick excitation to fit, slow sweeps and a slow excitation that judge; a machine in order."""
    machine = draw_machine(7, "fault")
    plans = [experiments.excitation(machine, 1, 6.0, 1), experiments.free(machine, 2, 6.0).judging(),
             experiments.excitation(machine, 3, 14.0, 1).judging()]
    return tuple(record(machine, (), plans, 1))


def asked(logs: tuple[ExperimentLog, ...]) -> Diagnosis:
    few = DiagnosisSettings(replicas=2, most=1, without=but("torque_offset"), evidence=False, limits=False)
    return diagnose(Logs.by_role(logs), few)


@pytest.mark.slow
def test_a_healthy_arm_leaves_of_held_out_logs_what_the_simulated_one_does() -> None:
    """Within a third at every joint, although its motion is another one than that of the logs that were fitted."""
    found = asked(recorded())
    assert found.verdict == "nothing-wrong"
    assert found.held_out_floor is not None
    np.testing.assert_allclose(found.residual_rms.validate / found.held_out_floor, 1.0, rtol=0.33)


def test_without_a_controller_nobody_can_tell() -> None:
    """What was driven by nobody knows what cannot be simulated."""
    logs = tuple(log if log.role == "identify" else replace(log, controller=None) for log in recorded())
    assert asked(logs).held_out_floor is None


def test_a_recording_of_a_few_rows_tells_no_noise() -> None:
    """A third of a second, thinned out: fewer rows than the quiet windows have."""
    assert np.isnan(_roughness(np.zeros((3, 4)), 0.01)).all()
    rng = np.random.default_rng(1)
    np.testing.assert_allclose(_roughness(rng.standard_normal((3, 30)), 0.01), np.sqrt(0.8), rtol=0.6)

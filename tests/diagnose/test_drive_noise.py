"""The floor by a twin, of an arm in order in MuJoCo: its drives' noise is told from what the low-pass leaves of it."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.other_plants.cases import Case
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from tests.diagnose.sessions import but


@pytest.mark.slow
@pytest.mark.parametrize(("sample_time", "cutoff_hz"), [
    (4e-3, None), *(pytest.param(1e-3, hz, marks=pytest.mark.slow) for hz in (20.0, None))])
def test_the_floor_is_what_an_arm_in_order_leaves_however_narrow_the_low_pass(sample_time: float, cutoff_hz: float | None) -> None:
    """Within a half: a narrow low-pass leaves little that is quick of white noise, which the noise was guessed by."""
    logs = Case("wrist", "tanh", "pid", sample_time, noise=0.01, motions=(("fourier", "identify"),), duration=10.0).logs()
    found = diagnose(Logs.by_role(logs), DiagnosisSettings(
        replicas=3, most=1, without=but("torque_offset"), evidence=False, limits=False, cutoff_hz=cutoff_hz))
    assert (found.verdict, found.floor_origin) == ("nothing-wrong", "twin")
    np.testing.assert_allclose(found.residual_rms.floor, found.residual_rms.identify, rtol=0.5)

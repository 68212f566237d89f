"""What gives way is named by frequency responses: the sample arm stands on a table that does, at 28 Hz, hardly damped."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.log.files import open_log
from pipelines.model.diagnosis.compliance import compliance
from sample_logs.make_model import synthetic_arm

SAMPLES = Path(__file__).resolve().parents[3] / "sample_logs" / "rrr-healthy"


def test_a_soft_base_is_named_with_its_frequency() -> None:
    """sample_logs/README.md: 28 Hz, damping ratio 0.04; joint 1 feels it in both postures."""
    found = compliance([open_log(SAMPLES / f"frf-1-{posture}.h5").log for posture in (1, 2)], synthetic_arm())
    assert found is not None
    assert not found.rigid
    assert [(one.cause, one.joint, one.origin) for one in found.findings] == [("base_resonance", None, "frequency responses")]
    numbers = found.findings[0].parameters
    assert numbers["frequency"].value == pytest.approx(28.0, abs=0.2)
    assert numbers["damping_ratio"].value == pytest.approx(0.04, rel=0.1)


def test_without_responses_nothing_is_said() -> None:
    assert compliance((), synthetic_arm()) is None

"""What gives way is named by frequency responses: the sample arm stands on a table that does, at 28 Hz, hardly damped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.diagnosis.compliance import Compliance, compliance, untold
from pipelines.io.files import open_log
from sample_logs.make_model import synthetic_arm

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs" / "rrr-healthy"


def test_a_soft_base_is_named_with_its_frequency() -> None:
    """sample_logs/README.md: 28 Hz, damping ratio 0.04; joint 1 feels it in both postures."""
    found = compliance([open_log(SAMPLES / f"frf-1-{posture}.h5").log for posture in (1, 2)], synthetic_arm())
    assert found is not None
    assert [one.place for one in found.named] == ["base_resonance"]
    numbers = found.named[0].values
    assert numbers["frequency"] == pytest.approx(28.0, abs=0.2)
    assert numbers["damping_ratio"] == pytest.approx(0.04, rel=0.1)
    answers = found.answers(found.named[0])
    assert [(one.joint, one.posture.shape) for one in answers] == [(1, (3,)), (1, (3,))]
    for one in answers:  # a dip, then a rise beside the frequency of the base, and no such thing elsewhere
        sure = (one.coherence > 0.9) & (one.frequency < 45.0)
        assert 27.0 < one.frequency[sure][np.argmax(one.measured[sure])] < 31.0
        assert one.fitted[sure] == pytest.approx(one.measured[sure], rel=0.1)
        level = one.fitted[(one.frequency > 45.0) & (one.frequency < 100.0)]
        assert np.ptp(level) < 0.1 * level.mean() < np.ptp(one.fitted)


@pytest.mark.slow
def test_a_gap_is_told_from_a_spring_by_responses_alone() -> None:
    """Without them, and beside a spring, it has no name; where they show a rigid arm it has."""
    sprung = compliance([open_log(SAMPLES / f"frf-1-{posture}.h5").log for posture in (1, 2)], synthetic_arm())
    beside = next(one for one in untold(sprung) if one.cause == "backlash")
    assert "show compliance" in beside.reason
    assert "Measure frequency responses" not in beside.record
    assert untold(Compliance((), "")) == ()
    assert "backlash" not in [one.cause for one in untold(None, ("backlash",))]

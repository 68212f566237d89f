"""The figure that proves a finding is drawn over what the cause depends on."""

from __future__ import annotations

from pipelines.model.diagnosis.evidence import proof
from tests.model.diagnosis.test_whole_orders import searched


def test_a_wave_of_the_angle_is_shown_over_the_angle() -> None:
    """A rotor that turns once, one way, tells the same over time; what it does then is what it does there."""
    (step, *_) = searched({7.0: 0.04, 28.0: 0.03}, 1, runs=1).steps
    assert step.best is not None
    assert proof(step.before, step.best.done, 1).against == "position"

"""Fits to the later rows: where they end, and how sure the numbers are that a diagnosis reports."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import Diagnosis, pose
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.trained import covariance
from pipelines.effects.angle import Cogging
from pipelines.estimation.preparation import Logs
from tests.diagnosis.arms import hidden, wave
from tests.diagnosis.asking import causes, diagnosed, prepared_for


@pytest.fixture(scope="module")
def later() -> Later:
    """Rows of an arm with a wave of 0.1 N m, 11 periods a turn, at joint 2, beside their prior."""
    logs = Logs.by_role([hidden(1, wave), hidden(2, wave, "validate")])
    return pose(prepared_for(logs), DiagnosisConfig())


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return diagnosed(hidden(1, wave), hidden(2, wave), hidden(3, wave, "validate"))


@pytest.mark.parametrize("order", [10.7, 11.2])
@pytest.mark.parametrize("amplitude", [0.001, 0.5])
@pytest.mark.slow
def test_a_fit_ends_at_the_same_numbers_wherever_it_starts(
    later: Later, order: float, amplitude: float
) -> None:
    """Order to 1e-3 a turn, cost to 2 units of the noise's variance: far below what decides."""
    state = later.start()
    ends = []
    for effect, start in (
        (Cogging(2, order=order, harmonics=1), amplitude),
        (Cogging(2, order=11.0, harmonics=1), 0.1),
    ):
        model = state.model.with_effect(effect, np.array([start, 0.0]))
        ends.append(later.fit(model, state.theta, later.beside(state.belief, effect)))
    one, other = ends
    assert abs(one.cost - other.cost) <= 2.0
    assert one.model.effects[0].effect.order == pytest.approx(
        other.model.effects[0].effect.order, abs=1e-3
    )


@pytest.mark.slow
def test_no_number_is_surer_than_it_moves_with_what_healthy_joints_have_in_small(
    found: Diagnosis,
) -> None:
    """The deviation holds the change between the fits with and without standing numbers."""
    assert causes(found) == [("cogging", 2)]
    look = found.look
    place = len(look.reported.model.beta)
    with_them = look.selection.end.model.effects[0].amplitudes[0]
    without = look.reported.model.effects[0].amplitudes[0]
    variance = look.covariance[place, place]
    assert variance >= (with_them - without) ** 2
    assert variance >= covariance(look.later, look.selection.end)[place, place]

"""A cause that somebody names is found once at its place; two starts of one cause are two."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from pipelines.effects.angle import Cogging
from pipelines.estimation.candidate_columns import Wanted
from pipelines.estimation.preparation import Logs
from tests.diagnosis.asking import extended
from tests.diagnosis.rotor import turned


def orders(hidden: Mapping[float, float], *wanted: Wanted) -> list[float]:
    """First orders of the waves that the extended model has, of a rotor with these `hidden` amplitudes [N m] of each order."""
    logs = Logs((turned(1, hidden, 0.0), turned(2, hidden, 0.0)), (turned(3, hidden, 0.0),))
    found = extended(logs, *wanted, cutoff_hz=40.0)
    assert found.arm is not None
    assert not found.rejected
    return sorted(acting.values["order"] for acting in found.arm.effects)


@pytest.mark.slow
def test_what_acts_once_is_found_once() -> None:
    assert orders({7.0: 0.05}, Wanted(Cogging(joint=1))) == [7.0]


@pytest.mark.slow
@pytest.mark.parametrize("starts", [(7.0, 12.0), (12.0, 7.0)])
def test_two_starts_at_one_place_are_two(starts: tuple[float, ...]) -> None:
    """The last of them does not take the place of the others; what nobody named there is not looked for."""
    wanted = [Wanted(Cogging(joint=1), {"order": order}) for order in starts]
    assert orders({7.0: 0.05, 28.0: 0.03, 12.0: 0.014}, *wanted) == [7.0, 12.0]

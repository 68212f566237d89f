"""Which of two causes at a joint only mends the shape of the other, on made-up numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.believed import mended
from pipelines.model.diagnosis.screened.candidates import Family
from tests.model.diagnosis.believed.test_pruned import among, twins
from tests.model.diagnosis.made_up import effect, left, searched


@pytest.fixture
def alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twins take half of what the other one took."""
    monkeypatch.setattr(mended, "imitated", lambda step, family, case: 0.5)


@pytest.mark.usefixtures("alike")
def test_what_only_mends_the_shape_of_an_earlier_cause_is_no_cause() -> None:
    """The second takes off a hundredth of what the nominal model leaves, and is a twin of the first at its joint."""
    one, other = twins()
    found = searched(left(0.5, 0.01, 0.01), (effect(one, 1), left(0.05, 0.01, 0.01)), (effect(other, 1), left(0.01, 0.01, 0.01)))
    assert mended.not_mending(found, [0, 1], among(effect(other, 1))) == [0]


def test_a_twin_by_name_that_could_not_have_passed_for_the_earlier_is_one_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what the first took away it takes a fiftieth: it mends no shape of that."""
    monkeypatch.setattr(mended, "imitated", lambda step, family, case: 0.02)
    one, other = twins()
    found = searched(left(0.5, 0.01, 0.01), (effect(one, 1), left(0.05, 0.01, 0.01)), (effect(other, 1), left(0.01, 0.01, 0.01)))
    assert mended.not_mending(found, [0, 1], among(effect(other, 1))) == [0, 1]


@pytest.mark.parametrize(("joint", "rest", "kept"), [(2, 0.0101, [0]), (2, 0.06, [0, 1]), (3, 0.0101, [0, 1])])
def test_a_trace_of_a_law_like_one_that_stands_is_the_rest_of_that(joint: int, rest: float, kept: list[int]) -> None:
    """Beside a great cause it takes a thousandth off what the nominal model leaves, at the joint where a law of friction stands."""
    found = searched(left(0.1, 0.1, 0.01), (effect("encoder_crosstalk", 1), left(0.01, rest, 0.01)),
                     (effect("stribeck", 2), left(0.01, 0.01, 0.01)))
    case = among(effect("encoder_crosstalk", 1), effect("stribeck", 2))
    case.beside = (SimpleNamespace(effect=effect("concave_friction", joint)),)
    assert mended.not_mending(found, [0, 1], case) == kept


@pytest.mark.parametrize(("joint", "rest", "kept"), [(1, 0.012, [0]), (1, 0.05, [0, 1]), (2, 0.012, [0, 1])])
def test_a_trace_at_the_joint_of_a_gap_is_what_no_law_of_it_has(joint: int, rest: float, kept: list[int]) -> None:
    """A tenth of a millisecond beside a gap at the joint, that takes a hundredth of what it left; elsewhere it is a cause."""
    before = [0.1, 0.1, 0.01]
    between = [0.01, 0.01, 0.01]
    between[joint - 1] = rest
    found = searched(left(*before), (effect("backlash", 1), left(*between)), (effect("time_delay", joint), left(0.01, 0.01, 0.01)))
    assert mended.not_mending(found, [0, 1], among(effect("backlash", 1), effect("time_delay", joint))) == kept


@pytest.mark.parametrize(("again", "rest", "kept"), [(5.0, 0.012, [0]), (0.5, 0.012, [0, 1]), (5.0, 0.06, [0, 1])])
def test_a_trace_elsewhere_is_the_rest_of_a_gap_that_would_take_more_of_it(again: float, rest: float, kept: list[int]) -> None:
    """Of what was left when joint 3 was found eccentric, one more gap at joint 2 takes five times as much."""
    gap, other = effect("backlash", 2), effect("encoder_eccentricity", 3)
    found = searched(left(0.01, 0.1, 0.1), (gap, left(0.01, 0.01, rest)), (other, left(0.01, 0.01, 0.01)))
    found.steps[1].screened = [SimpleNamespace(cause=one.name, joint=one.joint, gain=np.array([gain]))
                               for one, gain in ((gap, again), (other, 1.0))]
    assert mended.not_mending(found, [0, 1], among(gap, other)) == kept


@pytest.mark.parametrize(("share", "kept"), [(0.9, [0]), (0.2, [0, 1])])
def test_what_an_earlier_law_would_take_in_a_looser_form_is_the_rest_of_it(share: float, kept: list[int],
                                                                           monkeypatch: pytest.MonkeyPatch) -> None:
    """Two and a half waves beside a spring a hundred times as great: the polynomial with more terms takes as much of them."""
    spring, waves = effect("spring", 1), effect("cogging", 1)
    found = searched(left(0.5, 0.01, 0.01), (spring, left(0.05, 0.01, 0.01)), (waves, left(0.01, 0.01, 0.01)))

    def taken(step: Any, family: Any, case: Any) -> float:
        return share if step is found.steps[1] and family.shapes == (spring.looser(),) else 0.0

    monkeypatch.setattr(mended, "imitated", taken)
    case = SimpleNamespace(families=(Family("cogging", 1, (waves,)),), judge=None, blocks=10, beside=())
    assert mended.not_mending(found, [0, 1], case) == kept


@pytest.mark.usefixtures("alike")
def test_a_twin_that_takes_off_much_is_one_of_its_own() -> None:
    one, other = twins()
    found = searched(left(0.5, 0.01, 0.01), (effect(one, 1), left(0.3, 0.01, 0.01)), (effect(other, 1), left(0.01, 0.01, 0.01)))
    assert mended.not_mending(found, [0, 1], among(effect(other, 1), effect(other, 2))) == [0, 1]


@pytest.mark.usefixtures("alike")
def test_the_same_at_another_joint_is_no_twin() -> None:
    one, other = twins()
    found = searched(left(0.5, 0.05, 0.01), (effect(one, 1), left(0.01, 0.05, 0.01)), (effect(other, 2), left(0.01, 0.01, 0.01)))
    assert mended.not_mending(found, [0, 1], among(effect(other, 1), effect(other, 2))) == [0, 1]

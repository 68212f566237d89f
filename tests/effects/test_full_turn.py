"""A joint that closes its circle does so for every effect: what comes back to where it began is a wave, and no spring."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.effects import find_effect
from pipelines.effects.base import Effect

FREE: Any = SimpleNamespace(robot=SimpleNamespace(revolute=(True,), joints=(SimpleNamespace(position=(-np.inf, np.inf)),)))
SLIDE: Any = SimpleNamespace(robot=SimpleNamespace(revolute=(False,), joints=(SimpleNamespace(position=(-np.inf, np.inf)),)))


def turning(by: float) -> Motion:
    """To and fro over `by` rad."""
    t = np.linspace(0.0, 10.0, 2001)
    q = 0.5 * by * np.sin(t)[:, None]
    return Motion(t, q, 0.5 * by * np.cos(t)[:, None], -q)


def effect(name: str) -> Effect:
    return find_effect(name)(joint=1)


@pytest.mark.parametrize(("turns", "closed"), [(0.95, False), (0.985, True), (1.5, True)])
def test_what_closes_its_circle_has_no_curved_spring(turns: float, closed: bool) -> None:
    spring: Any = next(iter(effect("spring").shapes(turning(2.0 * np.pi * turns), FREE)))
    assert (spring.highest == 1) is closed


@pytest.mark.parametrize(("degrees", "told"), [(300.0, False), (330.0, True), (340.0, True), (540.0, True)])
def test_stops_that_leave_330_degrees_leave_whole_orders(degrees: float, told: bool) -> None:
    """Neighbours of them differ by nearly one wave in the range travelled."""
    motion = turning(np.deg2rad(degrees))
    first: Any = next(iter(effect("cogging").shapes(motion, FREE)))
    assert first.whole is told


def test_short_of_a_full_turn_one_wave_is_the_curve_of_a_spring() -> None:
    """A cable that tightens towards a stop: on a circle that is not closed no wave of one or one and a half takes its place."""
    lowest = [min(one.order for one in effect("cogging").shapes(turning(2.0 * np.pi * turns), FREE))  # type: ignore[attr-defined]
              for turns in (0.95, 1.0)]
    assert lowest == [2.0, 1.0]


@pytest.mark.parametrize("period", [0.008, 0.03, 0.1])
def test_a_slide_is_searched_for_the_teeth_that_slides_have(period: float) -> None:
    """Leads of screws and poles of linear motors: over 0.6 m a wave of the grid follows them within half a period."""
    motion = turning(0.6)
    true = 2.0 * np.pi / period
    orders = [one.order for one in effect("cogging").shapes(motion, SLIDE)]  # type: ignore[attr-defined]
    assert np.abs(np.array(orders) - true).min() * 0.6 <= np.pi

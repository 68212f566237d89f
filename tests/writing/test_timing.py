"""The speed of the tip: fast and slow phases, nothing beyond the pace, at rest in corners."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.writing.path import Page, TipPath, lay_out
from pipelines.writing.timing import Pace, TimeLaw, time_law
from tests.writing.judge import OFFSETS, WEIGHTS

PACES = (Pace(), Pace(slow=0.0), Pace(fast=2.0, slow=0.3, acceleration=20.0, jerk=2000.0), Pace(fast=0.05, slow=0.05))


@pytest.fixture(scope="module")
def path() -> TipPath:
    return lay_out("RRRID 2004 S8", Page())


@pytest.fixture(params=PACES, ids=range(len(PACES)))
def pace(request: pytest.FixtureRequest) -> Pace:
    chosen: Pace = request.param
    return chosen


def sampled(law: TimeLaw) -> np.ndarray:
    """Times spread over all of the law, those of its phases among them."""
    return np.unique(np.concatenate([np.linspace(-0.1, law.duration + 0.1, 20_001), law.start]))


def test_speed_and_acceleration_are_derivatives(path: TipPath, pace: Pace) -> None:
    """ds/dt and dv/dt by eighth-order differences, away from where a phase ends."""
    law, h = time_law(path, pace), 2e-6
    t = np.random.default_rng(3).uniform(0.0, law.duration, 3000)
    t = t[np.abs(t[:, None] - law.start).min(axis=1) > 5 * h]
    _, v, a = law.at(t)
    there = [law.at(t + k * h) for k in OFFSETS]
    slope, rise = (sum(w * x[i] for w, x in zip(WEIGHTS, there, strict=True)) / h for i in (0, 1))
    assert np.abs(slope - v).max() <= 1e-8
    assert np.abs(rise - a).max() <= 1e-6 * np.abs(a).max()


def test_nothing_beyond_the_pace(path: TipPath, pace: Pace) -> None:
    """Speed, acceleration along and across the path, and jerk stay within it; speed and acceleration are continuous."""
    law = time_law(path, pace)
    t = sampled(law)
    _, v, a = law.at(t)
    radius = np.array([piece.radius for piece in path.pieces])[law.piece[law.phase(t)]]
    assert v.max() <= pace.fast * (1 + 1e-12)
    assert np.abs(a).max() <= pace.acceleration * (1 + 1e-12)
    assert (v**2 / radius).max() <= pace.acceleration * (1 + 1e-9)
    assert np.abs(np.diff(a) / np.diff(t))[np.diff(t) > 1e-6].max() <= pace.jerk * (1 + 1e-6)
    before, after = law.at(law.start - 1e-9), law.at(law.start + 1e-9)
    assert max(np.abs(x - y).max() for x, y in zip(before, after, strict=True)) <= 3e-9 * max(pace.jerk, pace.fast)

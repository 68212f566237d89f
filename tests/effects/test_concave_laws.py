"""Friction that levels off by laws of several authors: what is fitted to some speeds holds at others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipelines.dynamics.body import Array
from pipelines.dynamics.functions import NUMBERS
from pipelines.effects.friction import ConcaveFriction
from sample_logs.make_model import synthetic_arm

ARM = synthetic_arm()
FITTED, OTHERS = np.geomspace(0.02, 3.0, 300), np.geomspace(5e-3, 8.0, 77)
AMPLITUDE, SPEED = 0.8, 0.4


def curve(form: ConcaveFriction, amplitude: float, v: Array) -> Array:
    return form.curve(v, ARM, form.values([amplitude]))


def fitted(law: Callable[[Array], Array]) -> tuple[ConcaveFriction, float]:
    """The form that leaves least, with its numbers, and its amplitude."""
    first, best = ConcaveFriction(2, speed=0.3), []
    for form in first.forms():
        bounds = [(q.low, q.high) for name in form.free for q in form.parameters if q.name == name]

        def at(x: Array, form: ConcaveFriction = form) -> ConcaveFriction:
            numbers: dict[str, Any] = dict(zip(form.free, map(float, x), strict=False))
            return replace(form, **numbers)

        found = least_squares(lambda x, at=at: curve(at(x), x[-1], FITTED) - law(FITTED),
                              [*(getattr(form, name) for name in form.free), 1.0],
                              bounds=([*(low for low, _ in bounds), 0.0], [*(high for _, high in bounds), 20.0]))
        best.append((found.cost, at(found.x), float(found.x[-1])))
    _, form, amplitude = min(best, key=lambda one: one[0])
    return form, amplitude


@pytest.mark.parametrize(("law", "left"), [
    (lambda v: AMPLITUDE * np.tanh(v / SPEED), 1e-6),
    (lambda v: AMPLITUDE * v / (v + SPEED), 1e-6),
    (lambda v: AMPLITUDE * v / np.sqrt(np.square(v) + SPEED**2), 1e-6),
    (lambda v: AMPLITUDE * np.arctan(v / SPEED) / (0.5 * np.pi), 0.03),
], ids=["tanh", "Cross 1965", "Carreau 1972", "none of these"])
def test_a_law_fitted_to_some_speeds_holds_at_others(law: Callable[[Array], Array], left: float) -> None:
    """Torque within `left` of the amplitude, at speeds up to nearly three times the fastest of the fit."""
    form, amplitude = fitted(law)
    assert np.abs(curve(form, amplitude, OTHERS) - law(OTHERS)).max() < max(left * AMPLITUDE, 1e-5)
    assert form.possible(form.values([amplitude]))
    if left < 1e-3:
        assert (form.speed, amplitude) == pytest.approx((SPEED, AMPLITUDE), rel=1e-3)


@pytest.mark.parametrize("knee", [0.7, 1.0, 2.0, 4.0])
def test_it_simulates_as_it_fits(knee: float) -> None:
    form = ConcaveFriction(2, speed=0.3, knee=knee)
    load = form.own_load(form.values([AMPLITUDE]))
    assert load is not None
    v = np.concatenate([-OTHERS, [0.0], OTHERS])
    np.testing.assert_allclose([load(0.0, speed, NUMBERS) for speed in v.tolist()], curve(form, AMPLITUDE, v), rtol=1e-12, atol=1e-15)

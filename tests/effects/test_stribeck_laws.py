"""The hump of friction at low speed by laws of several authors: what is fitted to some speeds holds at others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipelines.dynamics.body import Array
from pipelines.effects.friction import Stribeck
from sample_logs.make_model import synthetic_arm

ARM = synthetic_arm()
FITTED, OTHERS = np.geomspace(5e-3, 4.0, 300), np.geomspace(3e-3, 8.0, 77)
AMPLITUDE, SPEED = 0.8, 0.15


def curve(form: Stribeck, amplitude: float, v: Array) -> Array:
    return form.curve(v, ARM, form.values([amplitude]))


def fitted(law: Callable[[Array], Array]) -> tuple[Stribeck, float]:
    """The form that leaves least, with its numbers, and its amplitude."""
    first = Stribeck(2, speed=0.3)
    wanted, best = law(FITTED) * np.tanh(first.sharpness * FITTED), []
    for form in first.forms():
        names = [name for name in form.free if name != "sharpness"]
        bounds = [(q.low, q.high) for name in names for q in form.parameters if q.name == name]

        def at(x: Array, form: Stribeck = form, names: list[str] = names) -> Stribeck:
            numbers: dict[str, Any] = dict(zip(names, map(float, x), strict=False))
            return replace(form, **numbers)

        found = least_squares(lambda x, at=at: curve(at(x), x[-1], FITTED) - wanted,
                              [*(getattr(form, name) for name in names), 1.0],
                              bounds=([*(low for low, _ in bounds), 0.0], [*(high for _, high in bounds), 20.0]))
        best.append((found.cost, at(found.x), float(found.x[-1])))
    _, form, amplitude = min(best, key=lambda one: one[0])
    return form, amplitude


@pytest.mark.parametrize(("law", "left"), [
    (lambda v: AMPLITUDE * np.exp(-np.square(v / SPEED)), 1e-6),
    (lambda v: AMPLITUDE * np.exp(-v / SPEED), 1e-6),
    (lambda v: AMPLITUDE / (1.0 + (np.e - 1.0) * np.square(v / SPEED)), 1e-6),
    (lambda v: AMPLITUDE / (1.0 + np.expm1(0.5) * np.square(v / SPEED))**2, 1e-6),
    (lambda v: AMPLITUDE * np.exp(-v / SPEED) * (1.0 + v / SPEED), 0.02),
], ids=["Gauss", "Tustin 1947", "Hess and Soom 1990", "between", "none of these"])
def test_a_law_fitted_to_some_speeds_holds_at_others(law: Callable[[Array], Array], left: float) -> None:
    """Torque within `left` of the amplitude; whoever the author, speed is where 1/e is left."""
    form, amplitude = fitted(law)
    missed = curve(form, amplitude, OTHERS) - law(OTHERS) * np.tanh(form.sharpness * OTHERS)
    assert np.abs(missed).max() < max(left * AMPLITUDE, 1e-5)
    falls = np.interp(-1.0 / np.e, -law(np.geomspace(1e-3, 5.0, 4000)) / AMPLITUDE, np.geomspace(1e-3, 5.0, 4000))
    assert form.speed == pytest.approx(float(falls), rel=1e-3 if left < 1e-3 else 0.05)
    assert amplitude == pytest.approx(AMPLITUDE, rel=0.03)

"""Curves of friction by laws of several authors: what is fitted to some speeds holds at others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipelines.dynamics.body import Array
from pipelines.dynamics.functions import NUMBERS
from pipelines.effects.friction import ConcaveFriction, Stribeck
from sample_logs.make_model import synthetic_arm

Law = Callable[[Array], Array]
Form = ConcaveFriction | Stribeck
ARM = synthetic_arm()
AMPLITUDE, KNEE, HUMP = 0.8, 0.4, 0.15  # [N m], [rad/s] over which friction levels off, and falls


def curve(form: Form, amplitude: float, v: Array) -> Array:
    return form.curve(v, ARM, form.values([amplitude]))


def fitted(first: Form, v: Array, wanted: Array) -> tuple[Form, float]:
    """The form that leaves least, with its numbers, and its amplitude."""
    best = []
    for form in first.forms():
        names = [name for name in form.free if name != "sharpness"]
        bounds = [(q.low, q.high) for name in names for q in form.parameters if q.name == name]

        def at(x: Array, form: Form = form, names: list[str] = names) -> Form:
            return replace(form, **dict(zip(names, map(float, x), strict=False)))  # type: ignore[arg-type]

        found = least_squares(lambda x, at=at: curve(at(x), x[-1], v) - wanted,
                              [*(getattr(form, name) for name in names), 1.0],
                              bounds=([*(low for low, _ in bounds), 0.0], [*(high for _, high in bounds), 20.0]))
        best.append((found.cost, at(found.x), float(found.x[-1])))
    _, form, amplitude = min(best, key=lambda one: one[0])
    return form, amplitude


@pytest.mark.parametrize(("law", "left"), [
    (lambda v: AMPLITUDE * np.tanh(v / KNEE), 1e-6),
    (lambda v: AMPLITUDE * v / (v + KNEE), 1e-6),
    (lambda v: AMPLITUDE * v / np.sqrt(np.square(v) + KNEE**2), 1e-6),
    (lambda v: AMPLITUDE * np.arctan(v / KNEE) / (0.5 * np.pi), 0.03),
], ids=["tanh", "Cross 1965", "Carreau 1972", "none of these"])
def test_friction_that_levels_off_holds_at_other_speeds(law: Law, left: float) -> None:
    """Torque within `left` of the amplitude, at speeds up to nearly three times the fastest of the fit."""
    known, others = np.geomspace(0.02, 3.0, 300), np.geomspace(5e-3, 8.0, 77)
    form, amplitude = fitted(ConcaveFriction(2, speed=0.3), known, law(known))
    assert np.abs(curve(form, amplitude, others) - law(others)).max() < max(left * AMPLITUDE, 1e-5)
    assert form.possible(form.values([amplitude]))
    if left < 1e-3:
        assert (form.speed, amplitude) == pytest.approx((KNEE, AMPLITUDE), rel=1e-3)


@pytest.mark.parametrize("knee", [0.7, 4.0])
def test_friction_that_levels_off_simulates_as_it_fits(knee: float) -> None:
    form = ConcaveFriction(2, speed=0.3, knee=knee)
    load = form.own_load(form.values([AMPLITUDE]))
    assert load is not None
    v = np.linspace(-8.0, 8.0, 155)
    np.testing.assert_allclose([load(0.0, speed, NUMBERS) for speed in v.tolist()], curve(form, AMPLITUDE, v), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(("law", "left"), [
    (lambda v: AMPLITUDE * np.exp(-np.square(v / HUMP)), 1e-6),
    (lambda v: AMPLITUDE * np.exp(-v / HUMP), 1e-6),
    (lambda v: AMPLITUDE / (1.0 + (np.e - 1.0) * np.square(v / HUMP)), 1e-6),
    (lambda v: AMPLITUDE * np.exp(-v / HUMP) * (1.0 + v / HUMP), 0.02),
], ids=["Gauss", "Tustin 1947", "Hess and Soom 1990", "none of these"])
def test_a_hump_of_friction_holds_at_other_speeds(law: Law, left: float) -> None:
    """Torque within `left` of the amplitude; whoever the author, speed is where 1/e is left."""
    known, others, first = np.geomspace(5e-3, 4.0, 300), np.geomspace(3e-3, 8.0, 77), Stribeck(2, speed=0.3)
    form, amplitude = fitted(first, known, law(known) * np.tanh(first.sharpness * known))
    missed = curve(form, amplitude, others) - law(others) * np.tanh(form.sharpness * others)
    assert np.abs(missed).max() < max(left * AMPLITUDE, 1e-5)
    every = np.geomspace(1e-3, 5.0, 4000)
    falls = np.interp(-1.0 / np.e, -law(every) / AMPLITUDE, every)
    assert form.speed == pytest.approx(float(falls), rel=1e-3 if left < 1e-3 else 0.05)
    assert amplitude == pytest.approx(AMPLITUDE, rel=0.03)

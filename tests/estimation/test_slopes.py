"""Slopes of a model's torque by its numbers, against what geometry gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.effects.base import Effect
from pipelines.effects.bodies import GravityTilt
from pipelines.effects.drives import TorqueGain
from pipelines.effects.friction import ViscousDrift
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact, slopes_of
from pipelines.estimation.model_fit import refine
from pipelines.estimation.nominal import fit_nominal, rigid_rows
from pipelines.estimation.preparation import Logs, prepare
from tests.diagnosis.arms import hidden

ANGLE = 0.08  # [rad]


def test_across_a_tilt_the_slope_is_that_of_its_sine_and_has_nothing_of_the_curvature() -> None:
    """Gravity g (cos α down + sin α (x, y)/α) with α = |(x, y)|: at y = 0 its slope by y is sin α/α of a level arm's. Half the
    step's part of the curvature, 4e-6 of the weight, would be all there is for an arm in one plane, and no number of it."""
    prepared = prepare(Logs((hidden(1),)), Recipe())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit).with_effect(GravityTilt(), np.array([ANGLE, 0.0, 0.0, 0.0]))
    slopes, names = slopes_of(model, prepared.data, rigid_rows(prepared.data, columns))
    found = slopes[len(model.beta) + names.index((1, 0, "1"))]
    level = prepared.data.lay(lambda motion: GravityTilt().columns(motion, model.nominal)[..., 1:2])[0]
    np.testing.assert_allclose(found, np.sin(ANGLE) / ANGLE * level, atol=1e-7 * np.abs(level).max())


def test_a_law_that_takes_no_torque_has_no_shape_either() -> None:
    """Joint 1 without dry friction: nothing tells how sharply that would change its sign."""
    prepared = prepare(Logs((hidden(1),)), Recipe())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    place = next(
        k for k, law in enumerate(columns.laws) if (law.joint, law.name) == (1, "coulomb")
    )
    linear = [sum(not q.shape for q in law.parameters) for law in columns.laws]
    first = len(columns.kept) + sum(linear[:place])
    assert any(one[:2] == (0, place) for one in refine(model, prepared.data, fit.weight).names)
    beta = np.where(np.arange(len(model.beta)) == first, 0.0, model.beta)
    without = refine(replace(model, beta=beta), prepared.data, fit.weight, steps=0)
    assert not any(one[:2] == (0, place) for one in without.names)
    assert len(without.slopes) == len(beta) + len(without.names)


@pytest.mark.parametrize(("effect", "amplitude"), [(TorqueGain(2), 0.12), (ViscousDrift(2, time_constant=3.0), -0.7)])
def test_slopes_by_base_parameters_and_friction_are_those_of_the_torque_with_the_effect(effect: Effect, amplitude: float) -> None:
    """A drive that passes on 12 % more passes on 12 % more of each; friction that loses seven tenths acts less."""
    prepared = prepare(Logs((hidden(1),)), Recipe())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit).with_effect(effect, np.array([amplitude]))
    slopes, _ = slopes_of(model, prepared.data, rigid_rows(prepared.data, columns))
    here = model.torque(prepared.data)
    for number in range(len(model.beta)):
        moved = model.beta.copy()
        moved[number] += 1e-3
        there = replace(model, beta=moved).torque(prepared.data)
        np.testing.assert_allclose(slopes[number], (there - here) / 1e-3, atol=1e-6 * np.abs(here).max())

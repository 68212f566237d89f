"""An effect that changes sign with the friction at its joint does so over the same speed, in a fit as in the arm."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.dynamics.body import Array, Motion
from pipelines.effects import find_effect
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.model_fit import refine
from pipelines.estimation.nominal import fit_nominal
from pipelines.estimation.preparation import Logs, Prepared, prepare
from tests.diagnosis.arms import hidden

STEP = 1e-4
WIDTH = 60.0  # [s/rad] of the rubbing, and of nothing else


def rubbing(motion: Motion) -> Array:
    """0.2 N m of friction at joint 2, more or less of it along the turn."""
    out = np.zeros_like(motion.q)
    out[:, 1] = 0.2 * np.sin(2.0 * motion.q[:, 1] + 0.4) * np.tanh(WIDTH * motion.dq[:, 1])
    return out


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    return prepare(Logs((hidden(1, rubbing),), (hidden(3, rubbing, "validate"),)), Recipe())


def started(prepared: Prepared) -> tuple[Exact, Array]:
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    effect = find_effect("position_friction")(joint=2, order=2.0, harmonics=1)  # type: ignore[call-arg]
    return Exact.start(columns, fit).with_effect(effect, np.array([0.1, 0.05])), fit.weight


def widths(model: Exact) -> tuple[float, float]:
    """Of friction at joint 2, and of the effect."""
    law = next(law for law in model.columns.laws if law.joint == 2 and hasattr(law, "sharpness"))
    return float(law.sharpness), float(model.effects[0].effect.sharpness)  # type: ignore[attr-defined]


def test_both_are_one_number_in_a_fit(prepared: Prepared) -> None:
    model, weight = started(prepared)
    done = refine(model, prepared.data, weight)
    law, own = widths(done.model)
    assert own == law
    assert not [name for kind, _, name in done.names if kind == 1 and name == "sharpness"]
    assert done.model.effects[0].values["amplitude"] == pytest.approx(0.2, rel=0.05)


def test_the_slope_by_it_is_that_of_both(prepared: Prepared) -> None:
    """Against the difference of the whole torque."""
    model, weight = started(prepared)
    done = refine(model, prepared.data, weight, steps=1)
    place = next(k for k, (kind, law, name) in enumerate(done.names)
                 if (kind, name) == (0, "sharpness") and done.model.columns.laws[law].joint == 2)
    shift = np.zeros(len(done.slopes))
    shift[len(done.model.beta) + place] = STEP
    names = list(done.names)
    up, down = (done.model.moved(sign * shift, names).torque(prepared.data) for sign in (1.0, -1.0))
    apart = (up - down) / (2.0 * STEP)
    slope = done.slopes[len(done.model.beta) + place]
    assert np.abs(slope - apart).max() < 5e-3 * np.abs(apart).max()

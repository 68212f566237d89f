"""An extension fits the curve by which dry friction changes its sign, as a diagnosis does."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.effects import find_effect
from pipelines.estimation.candidate_columns import Wanted
from pipelines.estimation.preparation import Logs
from pipelines.io.log import Array
from tests.diagnosis.arms import hidden, wave
from tests.diagnosis.asking import extended
from tests.model.estimation.experiments import COULOMB


def waving(motion: Motion, rooted: bool) -> Array:
    """A wave at joint 2; friction that changes its sign as v/√(v² + ε²) does, by about as much as tanh, or as the logs have it."""
    x = 100.0 * motion.dq
    return wave(motion) + rooted * np.array(COULOMB) * (x / np.sqrt(1.0 + x**2) - np.tanh(x))


@pytest.mark.slow
@pytest.mark.parametrize("rooted", [True, False])
def test_an_extension_fits_the_curve(rooted: bool) -> None:
    def logs(load: bool) -> Logs:
        def torque(motion: Motion) -> Array:
            return waving(motion, rooted) if load else rooted * (waving(motion, True) - wave(motion))

        return Logs((hidden(1, torque), hidden(2, torque)), (hidden(3, torque, "validate"),))

    found = extended(logs(True), Wanted(find_effect("cogging")(joint=2), {"order": 11.0}))
    assert found.arm is not None
    assert found.findings[0].parameters["amplitude"].value == pytest.approx(0.1, rel=0.03)
    curves = [one.values["roundness"] for one in found.arm.friction if "roundness" in one.values]
    assert curves == pytest.approx([2.0 if rooted else 1.0] * 3, abs=0.4)
    in_order = extended(logs(False)).before.validate  # without the wave, by the same curve
    assert (found.after.validate < 1.1 * in_order).all()

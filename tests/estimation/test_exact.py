"""What stands beside a model is worked out once a motion, and acted on by every effect as if it was an effect before it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting
from pipelines.effects import all_effects, find_effect
from pipelines.effects.base import Effect, adds
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.nominal import fit_nominal
from pipelines.estimation.preparation import Logs, Prepared, prepare
from tests.diagnosis.arms import hidden
from tests.effects.test_every_effect import drawn, placed

ACTING = [kind for kind in all_effects() if not adds(placed(kind))]
STANDING = ("cogging", "stribeck", "torque_offset")


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    return prepare(Logs((hidden(1), hidden(2))), Recipe())


@pytest.fixture(scope="module")
def nominal(prepared: Prepared) -> Exact:
    return Exact.start(*fit_nominal(prepared.data, prepared.columns))


@pytest.mark.slow
@pytest.mark.parametrize("stands", STANDING)
@pytest.mark.parametrize("kind", ACTING, ids=lambda kind: kind.name)
def test_what_stands_is_acted_on(kind: type[Effect], stands: str, nominal: Exact, prepared: Prepared) -> None:
    """Also by what reads another motion, asks another arm, or comes late; in two logs, one after the other and again."""
    effect, values = placed(kind), drawn(placed(kind), 3)
    before = placed(find_effect(stands))
    own = nominal.with_effect(effect.at(values), effect.amplitudes(values))
    model = replace(own, standing=(Acting.of(before, drawn(before, 3)),))
    for log in (0, 1, 0):
        motion, arm = prepared.data.logs[log].motion, model.arm_in(log)
        known = sum(one.effect.torque(motion, model.nominal, one.values) for one in model.standing)
        whole = replace(arm, effects=(*model.standing, *arm.effects)).torque(motion)
        np.testing.assert_allclose(model.torque_in(log, motion), whole - known, rtol=0, atol=1e-9 * np.abs(whole).max())

"""What differs between rows of one state is noise, whatever they have in common beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.estimation.estimate import Recipe
from pipelines.estimation.preparation import Logs, prepare
from pipelines.estimation.repeated_states import Repeated
from pipelines.estimation.rows import Data
from pipelines.io.log import Array
from tests.diagnosis.arms import hidden

NOISE = 0.05


@pytest.fixture(scope="module")
def twice() -> Data:
    """One motion in two logs, neither of which declares a period."""
    return prepare(Logs((hidden(1), replace(hidden(1), name="again"))), Recipe()).data


def wrong(data: Data, size: float) -> Array:
    """Torque (rows,) that hangs on position and speed, `size` of root mean square."""
    found = data.lay(lambda motion: np.sin(9.0 * motion.q) + np.sign(motion.dq))
    return np.asarray(size * found / found.std())


@pytest.mark.parametrize("size", [0.0, 0.02, 2.0])
def test_noise_beside_a_wrong_model(twice: Data, size: float) -> None:
    rng = np.random.default_rng(1)
    left = wrong(twice, size) + rng.normal(size=twice.rows) * NOISE
    pairs = Repeated.of(twice)
    common, differing = pairs.parts(left)
    assert pairs.noise(left) == pytest.approx(np.full(3, NOISE**2), rel=0.2)
    assert np.mean(common - differing) == pytest.approx(size**2, rel=0.2, abs=1e-4)


def test_where_nothing_comes_again_nobody_knows_the_noise() -> None:
    data = prepare(Logs((hidden(1), hidden(2))), Recipe()).data
    assert np.isnan(Repeated.of(data).noise(np.ones(data.rows))).all()

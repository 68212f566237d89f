"""What differs between rows of one state is noise, whatever they have in common beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import diagnose_prepared
from pipelines.diagnosis.findings import weigh
from pipelines.diagnosis.trained import Standing, train
from pipelines.effects import effect_names
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.judgements import Repeated
from pipelines.estimation.preparation import Logs, prepare
from pipelines.estimation.rows import Data
from pipelines.io.log import Array, ExperimentLog
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


def with_torque(seed: int, noise: float) -> ExperimentLog:
    """The same motion in every log, with torque outside the library and with noise of its own."""
    log, rng = hidden(1), np.random.default_rng(seed)
    more = 0.2 * np.sin(9.0 * log.q) + noise * rng.normal(size=log.tau.shape)
    tau = replace(log.signals["tau"], values=log.tau + more)
    return replace(log, name=f"log-{seed}", signals={**log.signals, "tau": tau})


def test_the_noise_floor_is_the_noise_and_not_the_error_of_the_model() -> None:
    """Without reference logs: of motion that comes again, whatever else the model lacks."""
    config = DiagnosisConfig()
    noisy, clean = (prepare(Logs(tuple(with_torque(seed, size) for seed in (1, 2, 3))), config.recipe()) for size in (NOISE, 0.0))
    later = diagnose_prepared(noisy, config, exclude=tuple(effect_names())).look.later
    standing = Standing(later.dataset.model)
    worth = weigh(noisy, train(noisy, later, (), 10, standing), standing, whole=False)
    noise = noisy.data.rms(noisy.data.y - clean.data.y)
    assert worth.floor_origin == "repeated motion"
    assert worth.rms(0).identify.min() > 5.0 * noise.max()
    assert worth.floor == pytest.approx(noise, rel=0.2)

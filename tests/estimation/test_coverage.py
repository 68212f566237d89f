"""A hundred simulated experiments: the estimates are right, and as uncertain as they say."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.estimate import Recipe, fit_logs, motions_of
from pipelines.estimation.motion import Reconstruction
from pipelines.estimation.nominal import nominal_columns
from pipelines.io.log import Array
from tests.estimation.experiments import arm, experiment, truth

pytestmark = pytest.mark.slow
SEEDS = range(100)


@pytest.fixture(scope="module")
def deviations() -> tuple[list[str], Array]:
    """(estimate - truth) / std of every parameter (experiments, parameters), the 13 rigid ones first."""
    columns = nominal_columns(arm().robot, symmetric=True)
    names = [column.name for column in columns.names]
    rows = []
    for seed in SEEDS:
        found = fit_logs(motions_of([experiment(seed)], Reconstruction()), columns, Recipe(Reconstruction())).estimate
        rows.append((found.beta - truth(names)) / found.std)
    return names, np.array(rows)


def test_truth_lies_within_two_standard_deviations(deviations: tuple[list[str], Array]) -> None:
    """In 92 to 98 % of all rigid parameters (95.4 % of a normal distribution), and of friction alike."""
    names, z = deviations
    assert names[:13] == [f"p{k}" for k in range(1, 16) if k not in (4, 15)]
    assert 0.92 <= np.mean(np.abs(z[:, :13]) < 2.0) <= 0.98
    assert 0.92 <= np.mean(np.abs(z[:, 13:]) < 2.0) <= 0.98


def test_no_parameter_is_biased(deviations: tuple[list[str], Array]) -> None:
    """The mean over 100 experiments lies within 0.3 standard deviations: chance alone leaves 0.1."""
    names, z = deviations
    mean = dict(zip(names, z.mean(axis=0), strict=True))
    assert {name: value for name, value in mean.items() if abs(value) > 0.3} == {}


def test_each_standard_deviation_is_right(deviations: tuple[list[str], Array]) -> None:
    """The scatter over 100 experiments is the predicted one, parameter by parameter; chance alone leaves 7 %."""
    _, z = deviations
    assert np.all(np.abs(z.std(axis=0) - 1.0) < 0.3)

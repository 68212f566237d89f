"""The logs that most of these tests start from."""

from __future__ import annotations

import pytest

from pipelines.io.log import ExperimentLog
from tests.estimation.experiments import experiment


@pytest.fixture(scope="module")
def good() -> ExperimentLog:
    return experiment(0)


@pytest.fixture(scope="module")
def held_out() -> ExperimentLog:
    return experiment(1, role="validate")

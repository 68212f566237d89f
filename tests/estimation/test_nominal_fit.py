"""The linear fit under a diagnosis: what numbers it gives to columns that tell nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.estimation.estimate import Recipe
from pipelines.estimation.nominal import fit_columns, fit_nominal, rows_of
from pipelines.estimation.preparation import Logs, prepare
from pipelines.io.files import open_log
from sample_logs.make_model import synthetic_arm
from tests.diagnosis.arms import hidden


@pytest.mark.parametrize("place", [0, 5])
def test_a_column_of_zeros_has_the_number_zero(place: int) -> None:
    """A load's moment across a planar arm moves nothing; its number was rounding divided by nothing, 1e137."""
    prepared = prepare(Logs((hidden(1),)), Recipe())
    table = rows_of(prepared.data, prepared.columns)
    plain, more = fit_columns(prepared.data, table), fit_columns(prepared.data, np.insert(table, place, 0.0, axis=0))
    assert more.beta[place] == 0.0
    np.testing.assert_allclose(np.delete(more.beta, place), plain.beta, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(more.left, plain.left, atol=1e-9)


@pytest.mark.slow
def test_three_sigmoids_are_found_from_where_they_are(samples: Path) -> None:
    """The model of the arm that made these logs leaves their noise; from the coarse grid alone two of its sigmoids merged, and at
    joint 3 it left 0.12 N m."""
    logs = [open_log(samples / f"rrr-closed-form/{name}.h5").log for name in ("excitation-1", "free-1")]
    prepared = prepare(Logs.by_role(logs), Recipe(), synthetic_arm())
    _, fit = fit_nominal(prepared.data, prepared.columns)
    assert (fit.rms < np.array([0.006, 0.004, 0.002])).all()

"""Columns of a search are computed on fewer samples than those of a fit."""

from __future__ import annotations

import numpy as np

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.estimation.candidate_columns import families, lay_family, whole_motion
from pipelines.estimation.nominal import arm_of, fit_nominal
from pipelines.estimation.preparation import Logs, prepare
from tests.diagnosis.arms import hidden


def test_columns_of_a_search_are_those_of_all_samples_nearly() -> None:
    """To a fifteenth, so that a gain is less by a two-hundredth; of everything but a gap, which is crossed within samples."""
    prepared = prepare(Logs((hidden(1),)), DiagnosisConfig().recipe())
    data = prepared.data
    columns, fit = fit_nominal(data, prepared.columns)
    arm = arm_of(columns, fit.beta)
    coarse = data.coarse
    assert len(coarse.logs[0].motion.t) < 0.6 * len(data.logs[0].motion.t)
    np.testing.assert_array_equal(coarse.t, data.t)
    seen = set()
    for family in families(columns.laws, whole_motion(data), arm):
        if family.event or family.shapes[0].evidence == "reversals":
            continue
        for fine, other in zip(lay_family(data, family, arm), lay_family(coarse, family, arm), strict=True):
            size = np.linalg.norm(fine.table, axis=-1)
            away = np.linalg.norm(other.table - fine.table, axis=-1)
            assert np.all(away <= size / 15.0 + 1e-9), (family.cause, family.joint)
            seen.add(family.cause)
    assert len(seen) > 15

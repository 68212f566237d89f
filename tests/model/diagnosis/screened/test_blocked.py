"""Sums over blocks give what least squares without the block give, shape by shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.screened.blocked import Blocked
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.searched.hypotheses import laid_whole
from tests.model.diagnosis.searched.test_borne_out import SETTINGS, wandering


@pytest.mark.parametrize("cause", ["cogging", "concave_friction", "spring"])
def test_each_block_is_judged_by_numbers_and_a_shape_that_the_others_chose(cause: str) -> None:
    """By numpy.linalg.lstsq on the rows out of the block, for three shapes; the one that leaves least there is taken."""
    prepared = prepare(Logs((wandering(3, 0.01),)), SETTINGS)
    data = prepared.data
    columns, fit = fit_nominal(data, prepared.columns)
    model = Exact.start(columns, fit)
    now = refine(model, data, fit.weight)
    family = next(one for one in families(columns.laws, whole_motion(data), model.arm) if one.cause == cause)
    family = replace(family, shapes=family.shapes[:9:4])
    blocked = Blocked.of(now, 8)
    slopes = now.slopes * now.weights
    slopes /= np.linalg.norm(slopes, axis=1)[:, None]

    def left(table: np.ndarray, block: int) -> tuple[float, float]:
        held = blocked.place == block
        solved = np.linalg.lstsq(table[:, ~held].T, now.residual[~held], rcond=1e-10)[0]
        rest = now.residual - solved @ table
        return float(np.sum(rest[~held]**2)), float(np.sum(rest[held]**2))

    wanted = []
    for block in range(8):
        tried = [left(np.concatenate([slopes, laid_whole(data, shape, model.arm) * now.weights]), block) for shape in family.shapes]
        wanted.append(left(slopes, block)[1] - min(tried)[1])
    assert blocked.gains(family, model.arm) == pytest.approx(np.array(wanted), rel=1e-3, abs=1e-4 * now.rss)

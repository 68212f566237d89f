"""A diagnosis within a run, whose logs come with their motion, works on the same equations as one of the recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.estimation.estimate import Recipe
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.preparation import Logs, prepare
from pipelines.io.files import open_log
from pipelines.io.log import ExperimentLog, derive


def with_motion(log: ExperimentLog) -> ExperimentLog:
    """As `reconstruct` hands it on."""
    how = Reconstruction()
    return derive(log, "reconstruct", how.as_settings(), reconstruct(log, how).signals())


@pytest.mark.slow
def test_motion_that_was_handed_on_is_sharpened_as_well(samples: Path) -> None:
    """Were it not, the speed would pass through zero late at every reversal, in a run alone."""
    logs = [open_log(samples / f"rrr-changed/{name}.h5").log for name in ("excitation-3", "excitation-4")]
    bare, handed = (prepare(Logs.by_role(some), Recipe()) for some in (logs, [with_motion(log) for log in logs]))
    plain = reconstruct(logs[0], Reconstruction()).motion
    for (_, one), (_, two) in zip((*bare.motions, *bare.judging), (*handed.motions, *handed.judging), strict=True):
        np.testing.assert_array_equal(one.motion.ddq, two.motion.ddq)
    assert np.abs(bare.motions[0][1].motion.ddq - plain.ddq).max() > 0.0

"""Viscous friction that comes out negative is named, with its joint, its size and what to look at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.io.log import ExperimentLog
from tests.estimate_bps.estimates import SYMMETRIC, stage
from tests.healthy import VISCOUS, with_signal
from tests.seeds import rarely


def overcompensated(log: ExperimentLog, joint: int) -> ExperimentLog:
    """Return the log of a drive that subtracts twice the viscous friction of `joint`, from 0, from the torque it logs."""
    speed = np.gradient(log.q[:, joint], log.sample_time)
    return with_signal(log, tau=log.tau - 2.0 * VISCOUS[joint] * speed[:, None] * (np.arange(3) == joint))


@pytest.mark.parametrize("joint", [*rarely(0), 2])
def test_negative_viscous_friction_is_named(joint: int, good: ExperimentLog, tmp_path: Path) -> None:
    """A gate: --check ends in 1. The number is the truth within its standard deviation."""
    outcome = stage(tmp_path, overcompensated(good, joint), settings=SYMMETRIC, check=True)
    told = [check for check in outcome.checks if "viscous friction" in check.message]
    assert [(check.code, check.gate) for check in told] == [("RRID-D15", True)]
    assert f"joint {joint + 1} is negative, -" in told[0].message
    for words in ("sign", "compensated", "late", "law"):
        assert words in told[0].remedy
    assert outcome.exit_code == 1


def test_friction_that_takes_power_is_not_remarked(good: ExperimentLog, tmp_path: Path) -> None:
    assert not [check for check in stage(tmp_path, good, check=True).checks if "viscous" in check.message]

"""Joint speeds and accelerations of the RRR arm from a motion of its tip: Pinocchio leads them back to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipelines.dynamics.rrr_kinematics import joint_rates, rrr_geometry
from tests.dynamics.serial_arms import ARMS
from tests.writing.judge import TipJudge


def test_pinocchio_moves_the_tip_as_asked(shared: Path, tmp_path: Path) -> None:
    """1000 random states on all branches, away from singular postures: velocity and acceleration to 1e-11 relative."""
    arm = ARMS["rrr"](shared, tmp_path)
    geometry = rrr_geometry(arm.robot)
    rng = np.random.default_rng(4)
    q = rng.uniform(-np.pi, np.pi, (1000, 3))
    W = geometry.a2 * np.cos(q[:, 1]) + geometry.a3 * np.cos(q[:, 1] + q[:, 2])
    q = q[(np.abs(np.sin(q[:, 2])) > 0.2) & (np.abs(W) > 0.1)]
    velocity, acceleration = rng.uniform(-1, 1, (len(q), 3)), rng.uniform(-10, 10, (len(q), 3))
    dq, ddq = joint_rates(geometry, q, velocity, acceleration)
    found_velocity, found_acceleration = TipJudge(arm).rates(q, dq, ddq)
    assert np.abs(found_velocity - velocity).max() <= 1e-12
    assert np.abs(found_acceleration - acceleration).max() <= 1e-11 * max(1.0, np.abs(ddq).max())

"""What any drive in order has is of the size of drives of its kind."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.rows.imperfections import small_loads
from pipelines.model.rigid.body import Motion


@pytest.mark.parametrize(("rated", "most"), [
    ((2000.0, 60.0, 5.0), (2000.0, 60.0, 60.0)), ((np.inf, np.inf, np.inf), (7.0, 7.0, 7.0))])
def test_the_cogging_of_a_wrist_is_none_of_a_slide(rated: tuple[float, ...], most: tuple[float, ...]) -> None:
    """Joint 1 slides at up to 2 kN, joints 2 and 3 turn: 2e-5 of the largest rated torque of their own kind, not of a force. Where
    none is rated, of the largest that there was."""
    t = np.linspace(0.0, 1.0, 2001)
    q = np.stack([0.5 * t, 7.0 * t, 7.0 * t], axis=1)  # no torque, so that the ripple of its constant is none
    tau = np.zeros_like(q)
    if not np.isfinite(rated).any():
        tau[-1] = 7.0
    arm: Any = SimpleNamespace(torque=lambda motion: tau, robot=SimpleNamespace(
        joints=[SimpleNamespace(torque=one) for one in rated], revolute=(False, True, True)))
    rng = np.random.default_rng(3)
    found = small_loads(Motion(t, q, np.zeros_like(q), np.zeros_like(q)), arm, np.zeros(3), 5e-4, rng, rng)[:-1]
    np.testing.assert_allclose(np.abs(found).max(axis=0), 2e-5 * np.array(most), rtol=0.02)

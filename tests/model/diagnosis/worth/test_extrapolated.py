"""What a model may leave of other motion for want of numbers, against numbers drawn as they scatter."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.worth import extrapolated as module


def test_it_is_what_numbers_drawn_by_their_covariance_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two joints: the motion of the second is far from any that was fitted, and its torque scatters more."""
    rng = np.random.default_rng(4)
    slopes, joint = rng.normal(size=(3, 400)), np.repeat([0, 1], 200)
    slopes[:, 200:] *= 8.0
    root = rng.normal(size=(3, 3))
    rows: Any = SimpleNamespace(rms=lambda x: np.sqrt(np.bincount(joint, x**2) / np.bincount(joint)))
    done: Any = SimpleNamespace(model=None, weight=None, covariance=lambda: root @ root.T)
    monkeypatch.setattr(module, "refine", lambda model, judge, weight, steps: SimpleNamespace(slopes=slopes))
    drawn = np.array([rows.rms((root @ b) @ slopes) for b in rng.normal(size=(4000, 3))])
    told = module.extrapolated(done, rows)
    assert told == pytest.approx(np.sqrt(np.mean(drawn**2, axis=0)), rel=0.05)
    assert told[1] > 4.0 * told[0]

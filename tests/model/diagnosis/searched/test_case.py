"""How what is held out is weighed: a joint has its say there by how quiet it is there; on made-up numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.searched import case as module
from pipelines.model.diagnosis.searched.case import HeldOut

JOINT = np.repeat([0, 1], 50)


def model(fitted: tuple[float, float], held: tuple[float, float]) -> Any:
    """What it leaves of two joints [N m rms], of the fitted logs, which weigh it, and of those held out."""
    return SimpleNamespace(weight=1.0 / np.array(fitted), held=np.array(held)[JOINT])


@pytest.mark.parametrize(("before", "first", "second", "less"), [
    # Joint 1 is disturbed for a moment of the fitted logs alone: held out, a cause takes all of it, and joint 2 is worse by chance.
    (model((0.23, 0.01), (0.05, 0.011)), 0.01, 0.0115, True),
    # Nothing disturbs it: weights are those of the fit, and what makes joint 2 much worse is no cause of joint 1.
    (model((0.05, 0.01), (0.05, 0.011)), 0.04, 0.0140, False),
    (model((0.23, 0.01), (0.05, 0.011)), 0.049, 0.0140, False)])
def test_a_joint_that_is_quiet_held_out_is_weighed_by_that(before: Any, first: float, second: float, less: bool,
                                                           monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "held_out_left", lambda done, judge, blocks: done.held)
    judge = SimpleNamespace(joint=JOINT, rms=lambda left: np.sqrt(np.bincount(JOINT, left**2) / np.bincount(JOINT)))
    case: Any = SimpleNamespace(judge=judge, blocks=10)
    held = HeldOut.of(before, case)
    assert held.share(before, case) == pytest.approx(1.0)
    assert (held.weight >= before.weight).all()
    assert (held.share(model((0.01, 0.01), (first, second)), case) < 1.0) is less

"""A motion keeps what was made of it for the very objects that asked."""

from __future__ import annotations

import numpy as np

from pipelines.dynamics.body import Motion


def test_a_motion_keeps_the_last_torques_of_the_very_objects() -> None:
    """Equal objects are others: what they compare by may be arrays."""
    x = np.zeros((4, 2))
    x.flags.writeable = False
    motion, asked = Motion(np.zeros(4), x, x, x), list[int]()

    def work() -> np.ndarray:
        asked.append(len(asked))
        return np.full(3, float(len(asked)))

    one, other = (x.copy(),), (x.copy(),)
    first = motion.kept(("torque", one), work)
    assert motion.kept(("torque", one), work) is first
    assert not first.flags.writeable
    motion.kept(("torque", other), work)
    motion.kept(("friction", one), work)
    assert motion.kept(("torque", one), work) is first
    assert len(asked) == 3
    for k in range(40):
        motion.kept(("torque", np.full(1, k)), work)
    assert motion.kept(("torque", one), work)[0] == 44.0


def test_a_motion_that_may_be_written_to_keeps_nothing() -> None:
    x = np.zeros((4, 2))
    motion = Motion(np.zeros(4), x, x, x)
    first = motion.kept(("sum",), lambda: x + 1.0)
    x[:] = 3.0
    assert first.max() == 1.0
    assert motion.kept(("sum",), lambda: x + 1.0).max() == 4.0

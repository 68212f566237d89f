"""What the sway of held joints does to the driven one: columns against MuJoCo's inverse dynamics of the whole arm."""

from __future__ import annotations

import numpy as np
import pytest

from bench.draw import paper_machine
from bench.dynamics import RigidDynamics
from pipelines.friction.weak_form import Sway, sway_columns

HELD = np.array([0.4, -1.1, 0.7])  # [rad]


def left_over(joint: int, size: float) -> tuple[float, float]:
    """Torque that sway of `size` [rad] makes at the driven joint, and what the columns leave of it, rms [N m]."""
    t = np.arange(0.0, 4.0, 1e-3)
    j = joint - 1
    q, dq, ddq = (np.zeros((len(t), 3)) for _ in range(3))
    for k in range(3):
        a, w = (1.5, 2.0) if k == j else (size, 3.0 + 2.3 * k)
        q[:, k], dq[:, k], ddq[:, k] = HELD[k] + a * np.sin(w * t), a * w * np.cos(w * t), -a * w * w * np.sin(w * t)
    rigid = RigidDynamics(paper_machine().robot)
    whole = rigid.torque(q, dq, ddq)[:, j]
    for k in (k for k in range(3) if k != j):
        q[:, k], dq[:, k], ddq[:, k] = HELD[k], 0.0, 0.0
    apart = whole - rigid.torque(q, dq, ddq)[:, j]
    sways = [Sway(size * np.sin((3.0 + 2.3 * k) * t), size * (3.0 + 2.3 * k) * np.cos((3.0 + 2.3 * k) * t), k < j)
             for k in range(3) if k != j]
    columns = sway_columns(t, q[:, j], dq[:, j], sways, True)
    mean = 0.5 * (apart[1:] + apart[:-1])
    rest = mean - columns @ np.linalg.lstsq(columns, mean, rcond=1e-10)[0]
    return float(np.sqrt(np.mean(apart**2))), float(np.sqrt(np.mean(rest**2)))


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_the_columns_are_all_of_it_to_first_order(joint: int) -> None:
    """At 3 mrad less than a hundredth is left, and of half the sway a quarter: what is left is of second order."""
    torque, rest = left_over(joint, 3e-3)
    assert rest < 0.01 * torque
    half = left_over(joint, 1.5e-3)[1]
    assert 3.0 < rest / half < 5.0

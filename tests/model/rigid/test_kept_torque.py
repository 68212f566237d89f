"""Torques of a chain are kept: the same numbers come out, whatever was asked before and whatever became of the arrays."""

from __future__ import annotations

import numpy as np

from pipelines.model.rigid import kept_torque
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Motion
from pipelines.model.rigid.chain import inverse_dynamics
from tests.model.rigid.serial_arms import Arm

SAMPLES = 400


def test_torques_are_those_of_the_recursion_whatever_was_asked_before(arm: Arm) -> None:
    body = BaseArm(arm.robot)
    q, dq, ddq = arm.states(SAMPLES, 3)
    p = np.random.default_rng(2).normal(size=len(body.parameters))
    asked = [(q, dq, ddq, p), (q, dq, ddq, 2.0 * p), (q, dq, 1.1 * ddq, p), (q, dq, ddq, p), (q + 1e-12, dq, ddq, p)]
    for q, dq, ddq, p in asked:
        np.testing.assert_array_equal(body.torque(q, dq, ddq, p), inverse_dynamics(body.chain, q, dq, ddq, body.standard(p)))


def test_what_is_asked_or_given_may_be_written_to(arm: Arm) -> None:
    body = BaseArm(arm.robot)
    q, dq, ddq = (x.copy() for x in arm.states(SAMPLES, 4))
    p = np.ones(len(body.parameters))
    body.torque(q, dq, ddq, p)[:] = 0.0
    again = body.torque(q, dq, ddq, p)
    again[:] = 0.0
    expected = inverse_dynamics(body.chain, q, dq, ddq, body.standard(p))
    np.testing.assert_array_equal(body.torque(q, dq, ddq, p), expected)
    q[7] += 0.3
    assert np.abs(body.torque(q, dq, ddq, p) - expected).max() > 1e-6


def test_it_is_worked_out_once_and_little_is_kept(arm: Arm) -> None:
    body, count = BaseArm(arm.robot), []
    q = np.zeros((SAMPLES, arm.n))

    def work() -> np.ndarray:
        count.append(1)
        return q + len(count)

    for _ in range(3):
        assert kept_torque.kept(body.chain, (q,), work)[0, 0] == 1.0
    assert len(count) == 1
    few = q[:10]
    for _ in range(2):  # a simulation's steps
        kept_torque.kept(body.chain, (few,), work)
    assert len(count) == 3
    long = np.zeros((200_000, arm.n))
    for k in range(40):
        kept_torque.kept(body.chain, (long + k,), lambda: long)
    assert sum(map(kept_torque._size, kept_torque._known)) < 2 * kept_torque._MOST


def test_a_motion_keeps_the_last_torques_of_the_very_objects() -> None:
    """Equal objects are others: what they compare by may be arrays."""
    x = np.zeros((4, 2))
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
    for k in range(20):
        motion.kept(("torque", np.full(1, k)), work)
    assert motion.kept(("torque", one), work)[0] == 24.0

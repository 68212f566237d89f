"""An encoder that misreads its joint: every other cause acts where the joint truly is, in whatever order they were found."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.effects.angle import Cogging
from pipelines.effects.encoders import EncoderCrosstalk
from pipelines.effects.friction import TorqueOffset
from sample_logs.make_model import synthetic_arm
from tests.dynamics.rrr_arms import random_states

_PART, _ORDER, _AMPLITUDE = 0.015, 35.0, 0.08


@pytest.fixture(scope="module")
def motion() -> Motion:
    return Motion(np.linspace(0.0, 0.199, 200), *random_states(np.random.default_rng(1), 200))


def waving() -> Acting:
    wave = {"amplitude": _AMPLITUDE, "order": _ORDER, "phase": 0.0}
    rest = {f"{name}_{k}": 0.0 for name in ("amplitude", "phase") for k in (2, 3)} | {f"order_{k}": k * _ORDER for k in (2, 3)}
    return Acting.of(Cogging(2, order=_ORDER, harmonics=1), wave | rest)


def acting() -> tuple[Acting, ...]:
    return (Acting.of(EncoderCrosstalk(2, from_joint=1.0), {"coefficient": _PART, "from_joint": 1.0}), waving(),
            Acting.of(TorqueOffset(1), {"offset": 0.3}))


def test_cogging_is_felt_at_the_true_angle(motion: Motion) -> None:
    """q2 reads q2 + 0.015 q1; the motor's poles are where the joint is. At order 35 half a radian of phase hangs on it."""
    arm = synthetic_arm()
    true = Motion(motion.t, *(x - _PART * np.roll(x, 1, axis=1) * np.array([0.0, 1.0, 0.0])
                              for x in (motion.q, motion.dq, motion.ddq)))
    wanted = arm.torque(true)
    wanted[:, 1] += _AMPLITUDE * np.sin(_ORDER * true.q[:, 1])
    wanted[:, 0] += 0.3
    for order in permutations(acting()):
        np.testing.assert_allclose(arm.extended(*order).torque(motion), wanted, atol=1e-9)
        step_by_step: Arm = arm
        for one in order:
            step_by_step = step_by_step.extended(one)
        np.testing.assert_allclose(step_by_step.torque(motion), wanted, atol=1e-9)

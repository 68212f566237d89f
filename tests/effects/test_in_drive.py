"""What all torque of a joint comes through: a spring that is found after it is scaled, mixed and late like everything else."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Array, Motion
from pipelines.effects.angle import Spring
from pipelines.effects.drives import DriveLag, TorqueCrosstalk, TorqueGain
from sample_logs.make_model import synthetic_arm
from tests.dynamics.rrr_arms import random_states

_STIFF, _MIXED, _GAIN = 1.75, -0.1, -0.08


@pytest.fixture(scope="module")
def motion() -> Motion:
    return Motion(np.linspace(0.0, 0.199, 200), *random_states(np.random.default_rng(1), 200))


def sprung(motion: Motion) -> Array:
    """Torque of the arm with a spring at joint 2 that rests at zero."""
    tau = synthetic_arm().torque(motion)
    tau[:, 1] += _STIFF * motion.q[:, 1]
    return tau


def spring() -> Acting:
    effect = Spring(2, degree=1, highest=1)
    return Acting.of(effect, effect.values([_STIFF, 0.0]))


def test_a_spring_mixes_into_the_channel_beside_it(motion: Motion) -> None:
    """τ3 = τ3 + c τ2, and the spring is in τ2."""
    wanted = sprung(motion)
    wanted[:, 2] += _MIXED * wanted[:, 1]
    mixed = Acting.of(TorqueCrosstalk(3, from_joint=2.0), {"coefficient": _MIXED, "from_joint": 2.0})
    for order in permutations((spring(), mixed)):
        np.testing.assert_allclose(synthetic_arm().extended(*order).torque(motion), wanted, atol=1e-9)


def test_a_late_drive_is_late_for_a_spring_too(motion: Motion) -> None:
    """u = τ + T dτ/dt, and the spring is in τ."""
    def at(x: Array) -> Array:
        return np.asarray(np.gradient(x, motion.t[1] - motion.t[0]))

    tau = sprung(motion)
    late = Acting.of(DriveLag(2), {"time_constant": 1e-3})
    found = [synthetic_arm().extended(*order).torque(motion)[:, 1] for order in permutations((spring(), late))]
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)
    behind = 1e-3 * at(tau[:, 1])
    np.testing.assert_allclose(found[0][5:-5], (tau[:, 1] + behind)[5:-5], atol=0.05 * np.abs(behind).max())


def test_a_weak_drive_needs_more_command_for_a_spring_too(motion: Motion) -> None:
    """u = τ/(1 + e)."""
    wanted = sprung(motion)
    wanted[:, 1] /= 1.0 + _GAIN
    weak = Acting.of(TorqueGain(2), {"gain_error": _GAIN})
    for order in permutations((spring(), weak)):
        np.testing.assert_allclose(synthetic_arm().extended(*order).torque(motion), wanted, atol=1e-9)

"""One arm without arrays, whose friction remembers one number, or whose drives change a command: it moves as among many replicas,
which take arrays."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Array
from pipelines.effects.drives import LoadFriction, TorqueCrosstalk, TorqueGain, TorqueSaturation
from pipelines.effects.presliding import Presliding
from pipelines.io.log import Controller
from pipelines.simulation import Noise, Plant, run
from pipelines.simulation.integrate import OneArm
from tests.simulation.arms import KD, KP, experiment, rrr

SAMPLES, MANY = 100, 9  # more replicas than are run one after the other
LAWS = {
    "Dahl": Presliding(joint=2, distance=0.01),
    "LuGre": Presliding(joint=2, distance=0.01, damping_time=0.004),
    "bends first": Presliding(joint=3, distance=0.02, elastic=0.5),
    "Dahl's exponent": Presliding(joint=1, distance=0.01, elastic=-0.4, exponent=0.7),
    "breakaway": Presliding(joint=2, distance=0.005, breakaway=0.6, breakaway_speed=0.2, damping_time=0.001),
}


def acting(law: Presliding, amplitude: float = 2.0) -> Acting:
    return Acting.of(law, law.values([amplitude]))


def plant(*more: Acting) -> Plant:
    return Plant.of(rrr().arm.extended(*more))


ASKED = experiment(Controller("pd", KP, KD, velocity="backward-difference"), SAMPLES)
NOISE = Noise(np.array([0.3, 0.2, 0.1]), np.array([1e-6, 2e-6, 3e-6]))


def by_itself(arm: Plant) -> Array:
    """(samples, joints) [rad] of one replica."""
    return run(arm, ASKED, 4, NOISE, (7,)).true_q[0]


def both(arm: Plant) -> tuple[Array, Array]:
    """(samples, joints) [rad] of one replica by itself, and of the same among many."""
    return by_itself(arm), run(arm, ASKED, 4, NOISE, (7, *range(MANY))).true_q[0]


@pytest.mark.parametrize("name", LAWS)
def test_alone_and_among_many(name: str) -> None:
    """In a loop in plain numbers, to rounding; and it does move otherwise than an arm without it."""
    arm = plant(acting(LAWS[name]))
    assert [hook.remembering[0] for hook in arm.hooks if hook.remembering] == [(LAWS[name].joint or 0) - 1]
    alone, among = both(arm)
    np.testing.assert_allclose(alone, among, rtol=0.0, atol=1e-10)
    assert np.abs(alone - by_itself(plant())).max() > 1e-4


DRIVES = {
    "gain": Acting.of(TorqueGain(joint=2), {"gain_error": -0.1}),
    "crosstalk": Acting.of(TorqueCrosstalk(joint=1, from_joint=2.0), {"coefficient": 0.1, "from_joint": 2.0}),
    "limit": Acting.of(TorqueSaturation(joint=2), {"limit": 6.0, "coefficient": 1.0}),
    "load": Acting.of(LoadFriction(joint=3), {"mu": 0.2, "sharpness": 80.0, "behind": 0.4, "input_side": 0.7}),
}


@pytest.mark.parametrize("names", [*((name,) for name in DRIVES), tuple(DRIVES),
                                   pytest.param(tuple(reversed(DRIVES)), marks=pytest.mark.slow)])
def test_a_command_on_its_way_to_the_joints(names: tuple[str, ...]) -> None:
    """Through one drive, or through all of them in their order, beside friction that remembers; by Runge-Kutta's arrays as well."""
    acting_on = [DRIVES[name] for name in names]
    arm = plant(*acting_on, acting(LAWS["LuGre"]))
    assert OneArm.fits(arm)
    assert sum(hook.drive is not None for hook in arm.hooks) == len(names)
    alone, among = both(arm)
    np.testing.assert_allclose(alone, among, rtol=0.0, atol=1e-10)
    assert np.abs(alone - by_itself(plant(acting(LAWS["LuGre"])))).max() > 1e-5

"""One arm in plain numbers whose rigid body is held over each step: it comes to where arrays come that hold nothing."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.log.experiment import Controller
from pipelines.model.arm import Acting
from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.load_friction import LoadFriction
from pipelines.model.effects.presliding import Presliding
from pipelines.model.effects.spring import Spring
from pipelines.model.effects.stribeck import Stribeck
from pipelines.model.effects.torque_crosstalk import TorqueCrosstalk
from pipelines.model.effects.torque_gain import TorqueGain
from pipelines.model.rigid.body import Array
from pipelines.model.simulation import Noise, Plant, choose_step, run
from pipelines.model.simulation.integrate import RungeKutta
from pipelines.model.simulation.one_held import OneHeld
from pipelines.model.simulation.replicas import Simulated
from tests.model.simulation.arms import KD, KP, TS, experiment, rrr

SAMPLES, FINE = 400, 32
_SLIDES = Presliding(joint=2, distance=0.01, damping_time=0.004)
_SPRING = Spring(joint=3, degree=1, highest=1)
ARMS = {
    "nothing more": (),
    "a spring": (Acting.of(_SPRING, _SPRING.values([3.0, 0.5])),),
    "waves and humps, written out": (
        Acting.of(Cogging(2, order=9.0, harmonics=1), Cogging(2, order=9.0, harmonics=1).values([0.5, -0.2])),
        Acting.of(Stribeck(1, speed=0.2, sharpness=20.0), Stribeck(1, speed=0.2, sharpness=20.0).values([0.8]))),
    "friction that remembers": (Acting.of(_SLIDES, _SLIDES.values([2.0])),),
    "drives": (Acting.of(TorqueGain(2), {"gain_error": 0.1}),
               Acting.of(TorqueCrosstalk(1, from_joint=2.0), {"coefficient": 0.2, "from_joint": 2.0}),
               Acting.of(LoadFriction(2), {"mu": 0.1, "sharpness": 30.0, "behind": 0.0, "input_side": 0.0})),
}


def plant(name: str) -> Plant:
    return Plant.of(rrr().arm.extended(*ARMS[name]))


def moved(arm: Plant, steps: int, exact: bool, replicas: int = 1) -> Array:
    """(samples, joints) [rad] of the last replica."""
    asked = experiment(Controller("pd", KP, KD, velocity="backward-difference"), SAMPLES)
    done: Simulated = run(arm, asked, steps, seeds=range(replicas), exact=exact)
    return np.asarray(done.true_q[-1])


@pytest.mark.parametrize("name", ARMS)
def test_the_shorter_the_step_the_nearer_to_arrays_that_hold_nothing(name: str) -> None:
    """Twelve replicas take arrays. Of second order: half the step takes three quarters off."""
    arm = plant(name)
    wanted = moved(arm, FINE, True, 12)
    far, near = (float(np.abs(moved(arm, steps, False) - wanted).max()) for steps in (4, 8))
    assert 1e-11 < near < far / 3.0
    assert far < 1e-6


@pytest.mark.parametrize("name", ARMS)
def test_sample_by_sample_as_in_a_loop_of_its_own(name: str) -> None:
    """Outside a loop it remembers from one sample to the next what it holds."""
    arm = plant(name)
    ours, theirs = OneHeld(arm, TS, 8), RungeKutta(arm.prepared(2), TS, FINE)
    count = len(arm.own_memories)
    state, states = np.array([[0.1], [-1.0], [0.4], [0.0], [0.2], [-0.1]]), np.zeros((1, count))
    other, others = np.repeat(state, 2, axis=1), np.zeros((2, count))
    for k in range(200):
        command = np.array([[4.0 * np.sin(0.05 * k)], [30.0 * np.cos(0.03 * k)], [3.0]])
        states = ours.advance(np.zeros(1), state, states, command)
        others = theirs.advance(np.zeros(2), other, others, np.repeat(command, 2, axis=1))
    np.testing.assert_allclose(state, other[:, :1], rtol=0.0, atol=2e-5)
    np.testing.assert_allclose(states, others[:1], rtol=0.0, atol=1e-6)
    assert np.ptp(state) > 0.1


def test_it_is_held_where_noise_hides_it_and_nowhere_else() -> None:
    """1e-9 rad where nothing is random, as arms of other kinds."""
    asked = experiment(Controller("pd", KP, KD, velocity="backward-difference"), SAMPLES)
    loud = choose_step(plant("nothing more"), asked, Noise(np.full(3, 0.3), np.zeros(3)))
    calm = choose_step(plant("nothing more"), asked)
    assert not loud.exact
    assert calm.exact
    assert (loud.error <= loud.allowed).all()


def test_an_arm_that_runs_away_ends_in_no_number() -> None:
    ours = OneHeld(plant("nothing more"), TS, 1)
    state = np.full((6, 1), 1e200)
    ours.advance(np.zeros(1), state, np.zeros((1, 0)), np.zeros((3, 1)))
    assert np.isnan(state).all()

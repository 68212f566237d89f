"""One arm in plain numbers whose rigid body is held over each step: it comes to where arrays come that hold nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.io.log import Controller
from pipelines.model.arm import Acting
from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.encoder_eccentricity import EncoderEccentricity
from pipelines.model.effects.load_friction import LoadFriction
from pipelines.model.effects.presliding import Presliding
from pipelines.model.effects.spring import Spring
from pipelines.model.effects.stribeck import Stribeck
from pipelines.model.effects.torque_crosstalk import TorqueCrosstalk
from pipelines.model.effects.torque_gain import TorqueGain
from pipelines.model.rigid.body import Array
from pipelines.model.simulation import Noise, Plant, choose_step, run
from pipelines.model.simulation.replicas import Simulated
from tests.model.simulation.arms import KD, KP, experiment, rrr
from tests.seeds import usually

SAMPLES, FINE = 150, 16
PD = Controller("pd", KP, KD, velocity="backward-difference")
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
    asked = experiment(PD, SAMPLES)
    done: Simulated = run(arm, asked, steps, seeds=range(replicas), exact=exact)
    return np.asarray(done.true_q[-1])


@pytest.mark.parametrize("name", usually(ARMS, "friction that remembers", "nothing more"))
def test_the_shorter_the_step_the_nearer_to_arrays_that_hold_nothing(name: str) -> None:
    """Twelve replicas take arrays. Of second order: half the step takes three quarters off."""
    arm = plant(name)
    wanted = moved(arm, FINE, True, 12)
    far, near = (float(np.abs(moved(arm, steps, False) - wanted).max()) for steps in (4, 8))
    assert 1e-11 < near < far / 3.0
    assert far < 1e-6


def test_it_is_held_where_noise_hides_it_and_nowhere_else() -> None:
    """1e-9 rad where nothing is random, as arms of other kinds."""
    asked = experiment(PD, SAMPLES)
    loud = choose_step(plant("nothing more"), asked, Noise(np.full(3, 0.3), np.zeros(3)))
    calm = choose_step(plant("nothing more"), asked)
    assert not loud.exact
    assert calm.exact
    assert (loud.error <= loud.allowed).all()


def test_an_arm_that_runs_away_is_refused() -> None:
    with pytest.raises(InputRejected, match="D17"):
        run(plant("nothing more"), experiment(replace(PD, kp=-20 * KP, kd=-KD), 3000), 1, exact=False)


LAWS = {
    "in a loop of its own": (PD, ()),
    "an encoder that misreads": (PD, (Acting.of(EncoderEccentricity(1), {"amplitude": 0.002, "phase": 0.3}),)),
    "computed torque": (replace(PD, law="computed-torque", kp=np.full(3, 400.0), kd=np.full(3, 40.0)), ()),
}


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("name", LAWS)
def test_what_is_told_of_a_step_is_what_it_leaves(name: str, noise: float) -> None:
    """Where nothing rubs, all of the error is what was held: it has to be measured in the very integrator that is taken then."""
    law, more = LAWS[name]
    smooth = replace(rrr().arm, friction=()).extended(*more)
    asked, drives = replace(experiment(law, SAMPLES), feedforward_arm=rrr().arm), Noise(np.full(3, noise), np.zeros(3))
    step = choose_step(Plant.of(smooth), asked, drives)
    fine = run(Plant.of(smooth), asked, FINE).true_q[0]
    taken = run(Plant.of(smooth), asked, step.per_sample, exact=step.exact).true_q[0]
    assert (np.sqrt(np.mean((taken - fine) ** 2, axis=0)) <= 1.5 * step.allowed).all()


def test_numbers_of_numpy_are_numbers() -> None:
    hump = Acting.of(Stribeck(2, speed=0.2), {name: np.float64(x) for name, x in Stribeck(2, speed=0.2).values([0.8]).items()})
    assert np.isfinite(moved(Plant.of(rrr().arm.extended(hump)), 1, exact=False)).all()

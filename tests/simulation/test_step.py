"""The integrator's step: as large as a tenth of what noise does allows, judged by Pinocchio in fine steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.effects.friction import Coulomb
from pipelines.errors import InputRejected
from pipelines.io.log import Array, Controller
from pipelines.simulation import Noise, Plant, choose_step, run
from tests.seeds import rarely
from tests.simulation.arms import KD, KP, TS, experiment, rrr, rrr_friction, waving
from tests.simulation.pinocchio_loop import Friction, Loop, backward_pd

NOISE = Noise(np.array([0.020, 0.010, 0.005]), np.zeros(3))
PD = Controller("pd", KP, KD, velocity="backward-difference")


def dry(sharpness: float) -> tuple[Arm, Friction]:
    """The RRR arm with Coulomb friction alone, for both programs."""
    arm, levels = rrr(friction=False).arm, np.array([3.0, 1.5, 0.7])
    laws = tuple(Acting.of(Coulomb(j), {"level": float(level), "sharpness": sharpness}) for j, level in enumerate(levels, 1))
    return replace(arm, friction=laws), lambda v: levels * np.tanh(sharpness * v)


def judged(friction: Friction, samples: int, steps: int) -> Array:
    """Pinocchio's positions under the same PD."""
    q_ref, dq_ref, _ = waving(samples)
    return Loop(rrr().model, friction, TS, steps).run(q_ref[0], dq_ref[0], backward_pd(q_ref, KP, KD), samples)[0]


@pytest.mark.parametrize("sharpness", [None, 100.0, *rarely(2000.0)])
def test_the_chosen_step_costs_a_tenth_of_noise_at_most(sharpness: float | None) -> None:
    """Over the whole run, not only where it was tried; sharper friction takes more steps."""
    samples = 800
    arm, friction = (rrr().arm, rrr_friction()) if sharpness is None else dry(sharpness)
    plant, asked = Plant.of(arm), experiment(PD, samples)
    step = choose_step(plant, asked, NOISE)
    noise = np.sqrt(np.mean(np.diff([run(plant, asked, 8, NOISE, (seed,)).true_q[0] for seed in (1, 2)], axis=0) ** 2, axis=(0, 1)))
    exact = judged(friction, samples, 16 if sharpness != 2000.0 else 32)
    error = np.sqrt(np.mean((run(plant, asked, step.per_sample).true_q[0] - exact) ** 2, axis=0))
    assert (error <= 0.1 * noise).all()
    assert step.per_sample <= (4 if sharpness != 2000.0 else 16)


def test_no_step_is_small_enough_for_a_jump() -> None:
    """Friction that turns over within a hundredth of a thousandth rad/s: refused, with the remedy."""
    arm, _ = dry(2000.0)
    law = replace(arm.friction[2].effect, sharpness=1e8)
    sharp = replace(arm, friction=(*arm.friction[:2], Acting(law, (arm.friction[2].parameters[0], replace(
        arm.friction[2].parameters[1], value=1e8)))))
    with pytest.raises(InputRejected, match="sharpness") as refused:
        choose_step(Plant.of(sharp), experiment(PD, 120))
    assert refused.value.code == "RRID-D17"


def test_a_loop_that_is_unstable_is_refused() -> None:
    """Gains with the wrong sign: the arm runs away, and the joint is named."""
    with pytest.raises(InputRejected, match="joint [123]") as refused:
        run(Plant.of(rrr().arm), experiment(replace(PD, kp=-20 * KP, kd=-KD), 3000), 2)
    assert refused.value.code == "RRID-D17"

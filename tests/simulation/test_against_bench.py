"""The simulation of the true arm against the virtual test bench: a written text under each control law.

What may differ is noise alone: simulated and recorded position are as far apart as two recordings with different noise,
within a factor of two.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from bench.control import ComputedTorque, Decentralised, FeedForward, Law
from bench.draw import paper_machine
from bench.experiments import Experiment as Planned
from bench.machine import Machine
from bench.motions import Reference
from bench.plant import record
from pipelines.dynamics.arm import Arm
from pipelines.io.log import Array
from pipelines.simulation import Experiment, Noise, simulate
from sample_logs.bench_session import arm_of, controllers_model
from sample_logs.make_healthy import text
from tests.seeds import usually

LAWS = ("pd", "pd+feedforward", "computed-torque")
NATURAL = 2.0 * np.pi * 3.2  # [rad/s] of the linearised loop


@lru_cache
def machine() -> Machine:
    """Bodies and friction known to the last digit, nuisances off, drives and encoders as they are."""
    return paper_machine()


def true_arm() -> Arm:
    at_hand = machine()
    return arm_of(at_hand.robot, at_hand.friction)  # type: ignore[arg-type]


def law(name: str, samples: int) -> Law:
    """Each law on a model some per cent off, so that its feedback has to work."""
    if name == "pd":
        return Decentralised()
    model = controllers_model(machine())
    if name == "pd+feedforward":
        return FeedForward(model)
    return ComputedTorque(model, np.zeros((samples, 3)), (NATURAL**2,) * 3, (1.4 * NATURAL,) * 3)


def differences(name: str, reference: Reference) -> tuple[Array, Array]:
    """RMS (joints,) [rad] of simulated minus recorded position, and of the difference of two recordings."""
    at_hand, arm = machine(), true_arm()
    planned = Planned("writing", "writing", reference, law(name, reference.samples))
    one, other = (record(at_hand, [], [planned], seed)[0] for seed in (1, 2))
    noise = Noise(np.array(at_hand.amplifier_noise), np.zeros(3))
    found = simulate(arm, Experiment.of_log(one), noise, (9,))
    return rms(found.q[0] - one.q), rms(one.q - other.q)


def rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0)))


def part(reference: Reference, samples: int) -> Reference:
    return Reference(reference.t[:samples], reference.q[:samples], reference.dq[:samples], reference.ddq[:samples])


@pytest.mark.parametrize("name", usually(LAWS, "pd+feedforward"))
def test_a_letter_is_simulated_to_the_noise(name: str) -> None:
    """2.5 s of writing."""
    ours, noise = differences(name, part(text(machine(), "RRRID"), 2500))
    assert (ours <= 2.0 * noise).all(), (ours / noise).round(2)


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_a_text_is_simulated_to_the_noise(name: str) -> None:
    """10 s of writing."""
    ours, noise = differences(name, part(text(machine(), "RRRID 2004"), 10_000))
    assert (ours <= 2.0 * noise).all(), (ours / noise).round(2)

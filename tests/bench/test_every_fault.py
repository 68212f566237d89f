"""Every fault of the registry changes nothing at no strength, is frozen, and has its parameters."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from bench.control import Decentralised
from bench.draw import draw_machine
from bench.faults import fault_names, find_fault, make
from bench.machine import Fault, Machine
from bench.plant import Recording, run
from tests.bench.machines import sway, unrounded
from tests.seeds import usually

SECONDS = 0.15


@lru_cache
def machine() -> Machine:
    return unrounded(draw_machine(11, "fault"))


@lru_cache
def healthy() -> Recording:
    return run(machine(), Decentralised(), sway(SECONDS), seed=1)


def with_fault(name: str, joint: int, strength: float) -> Fault:
    peak = tuple(np.abs(healthy().tau).max(axis=0).tolist())
    return make(
        name, machine(), joint, seed=4, strength=strength, peak_torque=peak, duration=SECONDS
    )


def moved(name: str, joint: int, strength: float) -> np.ndarray:
    """Rms change of q [rad] and tau [N m] against the healthy run of the same noise, (2,)."""
    sick = run(
        machine(), Decentralised(), sway(SECONDS), [with_fault(name, joint, strength)], seed=1
    )
    return np.array(
        [
            np.sqrt(np.mean((a - b) ** 2))
            for a, b in ((sick.q, healthy().q), (sick.tau, healthy().tau))
        ]
    )


@pytest.mark.parametrize("joint", [1, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "name", usually(fault_names(), *(name for name in fault_names() if name != "backlash"))
)
def test_no_jump_at_zero(name: str, joint: int) -> None:
    """A thousandth of the strength moves positions and torques by at most two thousandths of what
    the whole does.
    """
    if find_fault(name).scope == "arm" and joint != 1:
        joint = 2  # the same fault again, for the joint says nothing
    whole, little = moved(name, joint, 1.0), moved(name, joint, 1e-3)
    assert whole.max() > 1e-6
    assert (little <= 2e-3 * whole).all(), little / whole

"""The torque boundary on random machines whose torque is Pinocchio's: each field is right."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.other_plants.drawn import drawn
from benchmarks.torque_boundary import KINDS, judged
from pipelines.estimation.checks.boundary import torque_boundary, touches_of_zero
from pipelines.estimation.config import BoundaryConfig
from tests.seeds import rarely, usually

SEEDS = (pytest.param(103, marks=pytest.mark.slow), 108)


@pytest.mark.parametrize(
    "kind", usually(KINDS, "wall", "no gravity", "magnitude")
)
@pytest.mark.parametrize("seed", SEEDS)
def test_no_field_is_wrong_and_what_is_told_is_what_was_logged(seed: int, kind: str) -> None:
    """Sign, gravity, friction, direction and order; the gate closes where the description is
    mistaken, and nowhere else.
    """
    found = judged(seed, kind)
    assert [
        field
        for field in ("gravity", "friction", "sign", "direction", "order")
        if found.get(field) == "wrong"
    ] == []
    assert found["sign"] == "right"
    assert found["alarms"] == []
    assert found.get("gate", True)


@pytest.mark.parametrize(
    "fault",
    [
        *("payload", "tilt"),
        *rarely("spring", "longer link", "cogging", "offset", "gain", "encoder"),
    ],
)
def test_a_fault_of_the_arm_is_no_mistake_of_its_description(fault: str) -> None:
    assert judged(108, "whole", fault)["alarms"] == []


@pytest.mark.slow
def test_a_torque_that_dithers_is_no_magnitude() -> None:
    """A drive at 2 kHz answers its coarse encoder by a fifth of a torque that is rarely negative."""
    found = torque_boundary(list(drawn(6, 46)[-1].logs()))
    assert found is not None
    assert found.sign == "signed"


@pytest.mark.parametrize("least", [9.0, 15.0])
def test_a_weight_that_is_lowered_fast_is_no_magnitude(least: float) -> None:
    """Its torque comes down to a few deviations of its noise, and not to zero; a magnitude is reflected there."""
    rng, t = np.random.default_rng(1), np.arange(12_000) * 1e-3
    course, q, noise = np.cos(2.0 * np.pi * t), np.sin(2.0 * np.pi * t), 2.0 * rng.standard_normal(len(t))
    config = BoundaryConfig()
    weight = 30.0 + least + 30.0 * course + noise
    assert (touches_of_zero([(weight, q)], config) or 0) < config.touches
    reflected = touches_of_zero([(np.abs(30.0 * course + noise), q)], config)
    assert reflected is not None
    assert reflected >= config.touches

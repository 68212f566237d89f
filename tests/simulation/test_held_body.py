"""Inertia, Coriolis forces and weight held over a step: Pinocchio's arm, which holds nothing, says what that costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.body import Array
from pipelines.simulation.integrate import RungeKutta
from pipelines.simulation.plant import Plant
from tests.simulation.arms import TS, serial
from tests.simulation.pinocchio_loop import Loop
from tests.simulation.test_forward_dynamics import follow, offsets

SAMPLES = 120


def missed(name: str, shared: Path, folder: Path, torque: Array, *steps: int) -> list[float]:
    """[rad] root mean square over a quarter of a second in open loop, with so many steps a sample."""
    case = serial(name, shared, folder)
    start = np.linspace(-0.5, 0.5, case.n)
    judge, _, _ = Loop(case.model, steps=4).run(start + offsets(case.arm), np.zeros(case.n), lambda k, q: torque[k], SAMPLES)
    own = [follow(RungeKutta(Plant.of(case.arm).prepared(1), TS, count, held=True), start, torque, 1)[:, 0] for count in steps]
    return [float(np.sqrt(np.mean(np.square(found + offsets(case.arm) - judge)))) for found in own]


@pytest.mark.parametrize("name", ["tx40", "puma-mdh"])
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_what_it_costs_in_open_loop_falls_with_the_square_of_the_step(name: str, noise: float, shared: Path,
                                                                      tmp_path: Path) -> None:
    """Less than a micrometre at a metre of an arm that falls for a quarter of a second, where torque jumps at every sample too;
    a quarter of that with two steps a sample."""
    torque = 3.0 * np.sin(np.arange(SAMPLES)[:, None] * np.linspace(0.005, 0.02, 6))
    torque = torque + noise * np.random.default_rng(5).standard_normal(torque.shape)
    one, two = missed(name, shared, tmp_path, torque, 1, 2)
    assert one < 1e-6
    assert two < 0.3 * one

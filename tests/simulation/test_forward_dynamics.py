"""The accelerations of simulated arms, judged by Pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Array
from pipelines.effects.bodies import RotorInertia
from pipelines.simulation.integrate import OneArm, RungeKutta
from pipelines.simulation.plant import Plant
from tests.dynamics.serial_arms import ARMS
from tests.seeds import rarely
from tests.simulation.arms import TS, Case, rrr, serial
from tests.simulation.pinocchio_loop import Loop

CHAINS = tuple(name for name in ARMS if name != "rrr")


def accelerations(plant: Plant, q: Array, dq: Array, torque: Array) -> Array:
    """(states, joints) of as many replicas at once."""
    moving = plant.prepared(len(q))
    found, _ = moving.accelerations(np.zeros(len(q)), *(np.ascontiguousarray(x.T) for x in (q, dq)), np.zeros((len(q), 0)),
                                    np.ascontiguousarray(torque.T))
    return found.T


def offsets(arm: Arm) -> Array:
    return np.array([joint.offset for joint in arm.robot.joints])


def states(case: Case, count: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(11)
    return (rng.uniform(-3.0, 3.0, (count, case.n)), rng.uniform(-6.0, 6.0, (count, case.n)),
            rng.uniform(-30.0, 30.0, (count, case.n)))


def theirs(case: Case, q: Array, dq: Array, torque: Array) -> Array:
    data = case.model.createData()
    return np.array([pin.aba(case.model, data, *row) for row in zip(q + offsets(case.arm), dq, torque, strict=True)])


@pytest.mark.parametrize("name", ["rrr", *CHAINS])
def test_accelerations_are_pinocchios(name: str, shared: Path, tmp_path: Path) -> None:
    """D⁻¹ (τ - c - h) of revolute and prismatic arms in every convention, offsets and slanted gravity included."""
    case = rrr(friction=False) if name == "rrr" else serial(name, shared, tmp_path)
    q, dq, torque = states(case, 50)
    judge = theirs(case, q, dq, torque)
    np.testing.assert_allclose(accelerations(Plant.of(case.arm), q, dq, torque), judge, atol=1e-10 * np.abs(judge).max())


@pytest.mark.parametrize("name", ["rrr", "tx40"])
def test_a_rotor_is_pinocchios_armature(name: str, shared: Path, tmp_path: Path) -> None:
    """The inertia hook adds to the diagonal of D."""
    case = rrr(friction=False) if name == "rrr" else serial(name, shared, tmp_path)
    rotors = np.linspace(0.05, 0.2, case.n)
    arm = case.arm.extended(*(Acting.of(RotorInertia(j + 1), {"inertia": float(x)}) for j, x in enumerate(rotors)))
    case.model.armature = rotors
    q, dq, torque = states(case, 20)
    judge = theirs(case, q, dq, torque)
    np.testing.assert_allclose(accelerations(Plant.of(arm), q, dq, torque), judge, atol=1e-10 * np.abs(judge).max())


def test_one_second_open_loop_of_six_joints(shared: Path, tmp_path: Path) -> None:
    """The general arm too: the TX40's geometry, links that could exist."""
    case = serial("tx40", shared, tmp_path)
    torque = np.sin(np.arange(1000)[:, None] * np.linspace(0.005, 0.02, 6)) * 3.0
    start = np.linspace(-0.5, 0.5, 6)
    judge, _, _ = Loop(case.model, steps=2).run(start + offsets(case.arm), np.zeros(6), lambda k, q: torque[k], 1000)
    found = follow(RungeKutta(Plant.of(case.arm).prepared(1), TS, 2), start, torque, 1)
    assert np.abs(found[:, 0] + offsets(case.arm) - judge).max() < 1e-9 * max(1.0, np.abs(judge).max())


def follow(integrator: OneArm | RungeKutta, start: Array, torque: Array, replicas: int) -> Array:
    """q (samples, replicas, joints) from rest."""
    n = len(start)
    state = np.zeros((2 * n, replicas))
    state[:n] = start[:, None]
    rows = []
    for k, row in enumerate(torque):
        rows.append(state[:n].T.copy())
        if isinstance(integrator, OneArm):
            state[:, 0] = integrator.moved(state[:, 0].tolist(), row.tolist())
            continue
        integrator.advance(np.full(replicas, TS * k), state, np.zeros((replicas, 0)), np.repeat(row[:, None], replicas, axis=1))
    return np.array(rows)


@pytest.mark.parametrize("name", ["rrr", *rarely("puma-mdh")])
def test_without_friction_and_torque_energy_stays(name: str, shared: Path, tmp_path: Path) -> None:
    """Kinetic and potential energy, by Pinocchio, over 1 s of free swinging."""
    case = rrr(friction=False) if name == "rrr" else serial(name, shared, tmp_path)
    data, plant = case.model.createData(), Plant.of(case.arm)
    state = np.concatenate([np.full(case.n, 0.3), np.linspace(-1.0, 1.0, case.n)])[:, None].copy()

    def energy() -> tuple[float, float]:
        q, dq = state[:case.n, 0] + offsets(case.arm), state[case.n:, 0].copy()
        return pin.computeKineticEnergy(case.model, data, q, dq), pin.computePotentialEnergy(case.model, data, q)

    integrator = RungeKutta(plant.prepared(1), TS, 2)
    first, kinetic = sum(energy()), []
    for k in range(1000):
        integrator.advance(np.array([TS * k]), state, np.zeros((1, 0)), np.zeros((case.n, 1)))
        kinetic.append(energy()[0])
    assert abs(sum(energy()) - first) < 1e-8 * np.ptp(kinetic)

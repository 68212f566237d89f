"""The bench moves as the laws of mechanics say: Pinocchio is the judge."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from bench.config import SAMPLE_TIME
from bench.control import OpenLoop
from bench.draw import draw_machine, machine_of
from bench.dynamics import RigidDynamics
from bench.machine import Machine
from bench.motions import at_rest
from bench.plant import run
from tests.bench.machines import frictionless
from tests.dynamics.serial_arms import ARMS, Arm, by_hand
from tests.seeds import seeds

INNER = 2.5e-4  # [s]


def standard_parameters(machine: Machine) -> np.ndarray:
    """(n * 10,): m, m c, inertia about the frame's origin with positive products, as the
    description has them.
    """
    links = [joint.link for joint in machine.robot.joints]
    return np.concatenate(
        [
            [link.mass, *(link.mass * np.array(link.com)), *link.inertia]
            for link in links
            if link is not None
        ]
    )


def runge_kutta(arm: Arm, q: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Positions (samples, n) under held torque by Pinocchio's articulated-body algorithm."""
    data, v, path = arm.model.createData(), np.zeros(arm.n), []
    for tau in torque:
        path.append(q)
        for _ in range(round(SAMPLE_TIME / INNER)):

            def rate(x: np.ndarray, y: np.ndarray, tau: np.ndarray = tau) -> np.ndarray:
                return np.array(pin.aba(arm.model, data, arm.offset(x), y, tau))

            k1 = rate(q, v)
            k2 = rate(q + INNER / 2 * v, v + INNER / 2 * k1)
            k3 = rate(q + INNER / 2 * (v + INNER / 2 * k1), v + INNER / 2 * k2)
            k4 = rate(q + INNER * (v + INNER / 2 * k2), v + INNER * k3)
            q, v = (
                q + INNER * v + INNER**2 / 6 * (k1 + k2 + k3),
                v + INNER / 6 * (k1 + 2 * k2 + 2 * k3 + k4),
            )
    return np.array(path)


def worst_difference(machine: Machine, arm: Arm, seed: int, duration: float = 1.0) -> float:
    """Largest |q_bench - q_Pinocchio| [rad] under random torque held for 50 ms each."""
    rng = np.random.default_rng(seed)
    arm.load(standard_parameters(machine))
    start = rng.uniform(-1.0, 1.0, machine.n) * [
        1.0 if joint.revolute else 0.2 for joint in machine.robot.joints
    ]
    reference = at_rest(start, duration)
    torque = (
        np.repeat(rng.uniform(-0.3, 0.3, (reference.samples // 50, machine.n)), 50, axis=0)
        * machine.torque_limit
    )
    recording = run(frictionless(machine.ideal), OpenLoop(torque, (True,) * machine.n), reference)
    return float(np.abs(recording.true_q - runge_kutta(arm, start, torque)).max())


@pytest.mark.parametrize("seed", seeds(20, 2))
def test_free_motion_is_pinocchios(seed: int) -> None:
    """20 machines drawn at random, no friction, open loop, 1 s: within 1e-8 rad of `aba` with
    RK4.
    """
    machine = draw_machine(seed)
    assert worst_difference(machine, by_hand(machine.robot), seed) < 1e-8


@pytest.mark.parametrize("name", ["tx40", "stanford", "puma-mdh", "gantry-mdh", "skew-urdf"])
def test_any_serial_arm_moves_as_pinocchio_says(name: str, shared: Path, tmp_path: Path) -> None:
    """DH, modified DH and URDF, with slides and offsets: within 1e-8 after 0.3 s."""
    arm = ARMS[name](shared, tmp_path)
    machine = machine_of(arm.robot, seed=3)
    assert worst_difference(machine, replace(arm, robot=machine.robot), 5, 0.3) < 1e-8


def test_parts_of_the_torque_are_pinocchios() -> None:
    """Inertia, Coriolis and gravity of the feed-forward model, each against rnea."""
    machine = draw_machine(4)
    arm = by_hand(machine.robot)
    arm.load(standard_parameters(machine))
    data, still, rigid = arm.model.createData(), np.zeros(3), RigidDynamics(machine.robot)
    for q, dq, ddq in zip(*arm.states(20, 8), strict=True):
        gravity = pin.rnea(arm.model, data, q, still, still)
        bias = pin.rnea(arm.model, data, q, dq, still)
        whole = pin.rnea(arm.model, data, q, dq, ddq)
        for ours, theirs in zip(
            rigid.parts(q.tolist(), dq.tolist(), ddq.tolist()),
            (whole - bias, bias - gravity, gravity),
            strict=True,
        ):
            np.testing.assert_allclose(ours, theirs, atol=1e-11)

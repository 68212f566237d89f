"""Energy against Pinocchio, and its rate against power."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.energy import energy, kinetic_energy, potential_energy, work
from pipelines.dynamics.rrr import RRR, rigid_body
from pipelines.io.robot_files import load_robot
from tests.dynamics.serial_arms import Arm, physical_links


def bodies() -> list[RigidBody]:
    robot = load_robot("rrr")
    return [RRR(robot), BaseArm(robot)]


def test_kinetic_and_potential_energy_are_pinocchios(arm: Arm) -> None:
    """For every kind of arm, both energies of known links; potential energy up to a constant."""
    body = BaseArm(arm.robot)
    phi = physical_links(arm.n, np.random.default_rng(0))
    arm.load(phi)
    p, (q, dq, _) = body.base.combine @ phi, arm.states(50, 1)
    data = arm.model.createData()
    theirs = np.array([(pin.computeKineticEnergy(arm.model, data, a, v), pin.computePotentialEnergy(arm.model, data, a))
                       for a, v in zip(arm.offset(q), dq, strict=True)])
    np.testing.assert_allclose(kinetic_energy(body, q, dq) @ p, theirs[:, 0], rtol=1e-10)
    constant = potential_energy(body, q) @ p - theirs[:, 1]
    assert np.ptp(constant) < 1e-10 * np.ptp(theirs[:, 1])


def test_rate_of_energy_is_power(arm: Arm) -> None:
    """d/dt (e p) = dq · (Y p) for every base parameter alone, along a smooth path, by differences of fourth order."""
    body = rigid_body(arm.robot)
    n, h = arm.n, 1e-4
    rng = np.random.default_rng(2)
    amplitude, rate, phase = rng.uniform(0.2, 0.8, n), rng.uniform(1.0, 3.0, n), rng.uniform(0, 6, n)

    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angle = np.outer(t, rate) + phase
        return amplitude * np.sin(angle), amplitude * rate * np.cos(angle), -amplitude * rate**2 * np.sin(angle)

    t = np.linspace(0.0, 5.0, 40)
    e = {k: energy(body, *at(t + k * h)[:2]) for k in (-2, -1, 1, 2)}
    slope = (8 * (e[1] - e[-1]) - (e[2] - e[-2])) / (12 * h)
    q, dq, ddq = at(t)
    power = np.einsum("sj,sjk->sk", dq, body.regressor(q, dq, ddq))
    assert np.abs(slope - power).max() < 1e-8 * np.abs(power).max()


def test_work_done_is_energy_gained() -> None:
    """The work of the torque over a motion is the energy at its end less that at its start, for any part of it."""
    body = bodies()[0]
    p = body.known_parameters()
    assert p is not None
    t = np.linspace(0.0, 4.0, 8001)[:, None]
    rate = np.array([1.3, 2.1, 3.7])
    q, dq, ddq = np.sin(rate * t), rate * np.cos(rate * t), -rate**2 * np.sin(rate * t)
    gained = energy(body, q, dq) @ p
    done = work(q, body.torque(q, dq, ddq, p))
    assert np.abs(done - (gained - gained[0])).max() < 1e-5 * np.ptp(gained)

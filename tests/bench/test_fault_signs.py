"""A fault's answer means what causes.md says: measured torque = model torque + the fault's load, by
Pinocchio.

The load is the logged torque less Pinocchio's inverse dynamics of the true motion and less the
machine's own friction. The column of causes.md, at the parameters of the answer, has to be found in
it with a coefficient near one: exactly where the fault is done as the column has it, roughly where
it is done otherwise on purpose. Other faults are those of tests/effects/test_against_bench.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from types import SimpleNamespace as Answer

import numpy as np
import pinocchio as pin
import pytest

from bench.config import SAMPLE_TIME
from bench.control import Decentralised
from bench.draw import paper_machine
from bench.faults import make
from bench.machine import Fault, Machine, coulomb_viscous
from bench.plant import Recording, run
from tests.bench.machines import sway
from tests.bench.test_rigid import standard_parameters
from tests.dynamics.serial_arms import Arm, by_hand

SHARPNESS = 100.0  # [s/rad]
FC, FV = (4.5, 2.4, 0.9), (0.6, 0.3, 0.12)


@lru_cache
def machine() -> Machine:
    """Coulomb and viscous friction, neither noise nor quantisation."""
    friction = tuple(coulomb_viscous(c, v, SHARPNESS) for c, v in zip(FC, FV, strict=True))
    return replace(paper_machine(), friction=friction).ideal


@dataclass(frozen=True, eq=False)
class Measured:
    """Means over each sample, (samples,) or (samples, 3)."""

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    rigid: np.ndarray  # Pinocchio's torque
    load: np.ndarray  # torque that neither the rigid arm nor its friction explains


def arm_of(robot: object) -> Arm:
    arm = by_hand(robot)  # type: ignore[arg-type]
    arm.load(standard_parameters(replace(machine(), robot=robot)))  # type: ignore[arg-type]
    return arm


def explained(recording: Recording, arm: Arm) -> Measured:
    """States in the middle of each sample, by the cubic through its ends."""
    (q0, q1), (v0, v1) = ((x[:-1], x[1:]) for x in (recording.true_q, recording.true_dq))
    q, ddq = 0.5 * (q0 + q1) + SAMPLE_TIME / 8.0 * (v0 - v1), (v1 - v0) / SAMPLE_TIME
    v = 1.5 * (q1 - q0) / SAMPLE_TIME - 0.25 * (v0 + v1)
    data = arm.model.createData()
    rigid = np.array(
        [pin.rnea(arm.model, data, arm.offset(a), b, c) for a, b, c in zip(q, v, ddq, strict=True)]
    )
    friction = np.array(FC) * np.tanh(SHARPNESS * v) + np.array(FV) * v
    tau = recording.tau[:-1]
    return Measured(
        recording.t[:-1] + 0.5 * SAMPLE_TIME, q, v, ddq, tau, rigid, tau - rigid - friction
    )


SWAY = sway(2.0, hz=0.6, amplitude=0.7)  # to and fro at up to 3 rad/s


def measured(*faults: Fault) -> Measured:
    return explained(run(machine(), Decentralised(), SWAY, faults), arm_of(machine().robot))


def turned(v: np.ndarray) -> np.ndarray:
    return np.tanh(SHARPNESS * v)


def dahl(m: Measured, j: int, distance: float) -> np.ndarray:
    """du/dq = (sign v - u)/x_c, exactly from sample to sample."""
    u, path = 0.0, []
    for way in np.diff(m.q[:, j], prepend=m.q[0, j]):
        u = np.sign(way) + (u - np.sign(way)) * np.exp(-abs(way) / distance)
        path.append(u)
    return np.array(path)


Column = Callable[[Measured, int, Answer], np.ndarray]
# The load of causes.md on the fault's own row, and by how much its coefficient may differ from one.
COLUMNS: dict[str, tuple[Column, float]] = {
    "stribeck": (
        lambda m, j, p: p.amplitude * np.exp(-((m.dq[:, j] / p.speed) ** 2)) * turned(m.dq[:, j]),
        0.15,
    ),
    "concave_friction": (lambda m, j, p: p.amplitude * np.tanh(m.dq[:, j] / p.speed), 0.35),
    "asymmetric_friction": (
        lambda m, j, p: (
            0.5 * p.coulomb_difference * np.abs(turned(m.dq[:, j]))
            + 0.5 * p.viscous_difference * np.abs(m.dq[:, j])
        ),
        0.05,
    ),
    "presliding": (lambda m, j, p: p.amplitude * dahl(m, j, p.distance), 0.25),
}


def coefficient(load: np.ndarray, column: np.ndarray, nuisance: np.ndarray) -> float:
    """Of the column in the load, after Coulomb and viscous friction have been fitted to both."""
    basis, _ = np.linalg.qr(nuisance)
    left, inside = (x - basis @ (basis.T @ x) for x in (load, column))
    return float(left @ inside / (inside @ inside))


@pytest.mark.parametrize("joint", [2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", COLUMNS)
def test_a_law_of_friction_has_the_sign_and_the_size_of_its_answer(name: str, joint: int) -> None:
    """The column of causes.md at the answer's parameters, coefficient near one."""
    fault = make(name, machine(), joint, seed=2, duration=2.0)
    m, (column, within) = measured(fault), COLUMNS[name]
    j, settled = joint - 1, slice(50, None)
    nuisance = np.column_stack([turned(m.dq[:, j]), m.dq[:, j]])[settled]
    found = coefficient(
        m.load[settled, j], column(m, j, Answer(**fault.parameters()))[settled], nuisance
    )
    assert abs(found - 1.0) < within, found

"""Recorded data of a Stäubli TX40 with joint-side friction: the answer of a program that shares nothing with this one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.signal import butter, sosfiltfilt

from pipelines.dynamics.body import Motion
from pipelines.dynamics.rrr import rigid_body
from pipelines.estimation.estimate import (
    Estimate,
    Fitted,
    Recipe,
    equations_of,
    fit_logs,
)
from pipelines.estimation.motion import Reconstructed, Reconstruction
from pipelines.estimation.nominal import nominal_columns
from pipelines.import_log import STAGE, Settings
from pipelines.io.files import open_log
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.segments import usable
from pipelines.stage import Request, run_stage

CUTOFF, EVERY = 20.0, 100  # [Hz] of the decimation from 5 kHz to 50 Hz
SLOW = (0.05, 0.05, 0.05, 0.08, 0.08, 0.12)  # [rad/s] as published
PUBLISHED = Recipe(Reconstruction(), CUTOFF, EVERY, SLOW)


@pytest.fixture(scope="module")
def tx40(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> ExperimentLog:
    out = tmp_path_factory.mktemp("tx40") / "out"
    made = run_stage(STAGE, Request((), out, no_report=True), Settings(recipe="tx40", source=shared / "real/tx40"))
    return open_log(next((made.folder / "logs").glob("*.h5"))).log


def filtered(log: ExperimentLog) -> Reconstructed:
    """Motion as published: positions through a zero-phase low-pass of 100 Hz, then central differences."""
    good, step = usable(log), log.sample_time
    q = sosfiltfilt(butter(4, 100.0, fs=1.0 / step, output="sos"), good.log.q, axis=0)
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    dq[1:-1], ddq[1:-1] = (q[2:] - q[:-2]) / (2.0 * step), np.diff(q, 2, axis=0) / step**2
    none = np.zeros_like(q)
    return Reconstructed(Motion(log.t, q, dq, ddq), (none, none, none), None, good, False)


def fitted(log: ExperimentLog, recipe: Recipe, *, rotor: bool, weighted: bool = False) -> Fitted:
    return fit_logs(((log, filtered(log)),), nominal_columns(log.robot, rotor_inertia=rotor), recipe, weighted)


@dataclass(frozen=True)
class Independent:
    """Pinocchio's regressor on the URDF, sample by sample, through scipy's filter."""

    A: Array  # (rows, joints, 60 + friction)
    y: Array  # (rows, joints)


@pytest.fixture(scope="module")
def published(tx40: ExperimentLog) -> Fitted:
    return fitted(tx40, PUBLISHED, rotor=False)


@pytest.fixture(scope="module")
def independent(tx40: ExperimentLog, published: Fitted, shared: Path) -> Independent:
    """The same motion, filter, samples and speed limits; everything behind them built anew."""
    model = pin.buildModelFromUrdf(str(shared / "real/tx40/tx40.urdf"))
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    data, ((_, found),) = model.createData(), published.motions
    motion, joints = found.motion, np.arange(6)
    table = np.zeros((len(motion.t), 6, 78))
    for k, state in enumerate(zip(motion.q, motion.dq, motion.ddq, strict=True)):
        table[k, :, :60] = pin.computeJointTorqueRegressor(model, data, *state)
    table[:, joints, 60 + joints] = np.tanh(100.0 * motion.dq)
    table[:, joints, 66 + joints] = motion.dq
    table[:, joints, 72 + joints] = 1.0
    sos = butter(4, CUTOFF, fs=5000.0, output="sos")
    equations = equations_of(((tx40, found),), published.recipe, published.estimate.columns)[0]
    at = equations.moments()
    A, y = (sosfiltfilt(sos, x, axis=0)[at] for x in (table, tx40.tau))
    slow = np.abs(motion.dq[at]) < SLOW
    return Independent(np.where(slow[:, :, None], 0.0, A), np.where(slow, 0.0, y))


def in_base_parameters(estimate: Estimate, beta: Array, shared: Path) -> Array:
    """What the columns of Pinocchio's 60 + 18 parameters come to in ours: the same torque in 300 random states."""
    model = pin.buildModelFromUrdf(str(shared / "real/tx40/tx40.urdf"))
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    rng, body = np.random.default_rng(0), estimate.columns.body
    q, dq, ddq = (rng.uniform(-scale, scale, (300, 6)) for scale in (3.0, 2.0, 10.0))
    torque = np.concatenate([pin.computeJointTorqueRegressor(model, model.createData(), *state) @ beta[:60]
                             for state in zip(q, dq, ddq, strict=True)])
    rigid = np.linalg.lstsq(body.regressor(q, dq, ddq).reshape(1800, -1), torque, rcond=None)[0]
    friction = beta[60:].reshape(3, 6).T.ravel()  # ours are joint by joint
    return np.concatenate([rigid, friction])


@pytest.mark.parametrize("weighted", [False, True])
def test_least_squares_are_those_of_pinocchio(weighted: bool, tx40: ExperimentLog, published: Fitted, independent: Independent,
                                              shared: Path) -> None:
    """Every parameter to 1e-6 of the largest of its kind, with the joints alike and weighted."""
    ours = fitted(tx40, published.recipe, rotor=False, weighted=weighted).estimate
    root = np.sqrt(ours.solution.weights)[None, :]
    A, y = (independent.A * root[:, :, None]).reshape(-1, 78), (independent.y * root).ravel()
    unit = np.linalg.norm(A, axis=0)
    unit[unit < 1e-9 * unit.max()] = 1.0  # columns of rounding alone
    beta = np.linalg.lstsq(A / unit, y, rcond=1e-10)[0] / unit
    theirs = in_base_parameters(ours, beta, shared)
    for name in sorted({column.unit for column in ours.columns.names}):
        of_kind = [k for k, column in enumerate(ours.columns.names) if column.unit == name]
        np.testing.assert_allclose(ours.beta[of_kind], theirs[of_kind], rtol=1e-6, atol=1e-6 * np.abs(theirs[of_kind]).max())
    assert ours.solution.errors.relative_error == pytest.approx(
        np.linalg.norm(independent.y - np.einsum("kjp,p->kj", independent.A, beta)) / np.linalg.norm(independent.y), rel=1e-6)


def test_the_published_errors(tx40: ExperimentLog) -> None:
    """About 10.6 % with friction alone, 10.4 % with the rotors' inertia, joints alike, published filter and speed limits."""
    without, with_rotors = (fitted(tx40, PUBLISHED, rotor=rotor).estimate for rotor in (False, True))
    assert 100 * without.solution.errors.relative_error == pytest.approx(10.6, abs=0.15)
    assert 100 * with_rotors.solution.errors.relative_error == pytest.approx(10.4, abs=0.1)


def test_a_rotor_has_a_column_only_where_it_shows(tx40: ExperimentLog, shared: Path) -> None:
    """The first joints' rotors turn about the axes of their links, whose inertia takes theirs up: rank by Pinocchio's columns."""
    robot = tx40.robot
    rotors = [law.joint for law in nominal_columns(robot).laws if law.name == "rotor_inertia"]
    model = pin.buildModelFromUrdf(str(shared / "real/tx40/tx40.urdf"))
    rng = np.random.default_rng(1)
    q, dq, ddq = (rng.uniform(-1.0, 1.0, (200, 6)) for _ in range(3))
    rigid = np.concatenate([pin.computeJointTorqueRegressor(model, model.createData(), *s) for s in zip(q, dq, ddq, strict=True)])
    rank = np.linalg.matrix_rank(rigid)
    assert rank == len(rigid_body(robot).parameters)
    seen = []
    for j in range(6):
        column = np.zeros((200, 6))
        column[:, j] = ddq[:, j]
        if np.linalg.matrix_rank(np.column_stack([rigid, column.ravel()])) > rank:
            seen.append(j + 1)
    assert rotors == seen

"""The streamed equations are the regressor's, and what a motion does not show is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.fit.equations import Array, Block
from pipelines.fit.identifiability import _resolved, unresolved
from pipelines.fit.least_squares import fit
from pipelines.io.robot_files import load_robot
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import RigidBody
from pipelines.model.rigid.equations import RigidEquations
from pipelines.model.rigid.rrr import RRR
from tests.model.rigid.rrr_arms import random_states


def dense(block: Block) -> Array:
    """(samples, joints, parameters), zeros put back."""
    out = np.zeros((block.channels, block.width, block.samples))
    for row, index, values in zip(out, block.columns, block.values, strict=True):
        row[index] = values
    return out.transpose(2, 0, 1)


@pytest.fixture(params=[RRR, BaseArm])
def body(request: pytest.FixtureRequest) -> RigidBody:
    arm: RigidBody = request.param(load_robot("rrr"))
    return arm


@pytest.mark.parametrize("size", [1, 999, 1000, 4096])
def test_blocks_are_the_regressor(body: RigidBody, size: int) -> None:
    """However long the blocks, together and again on a second reading they hold R(q, dq, ddq) and τ."""
    q, dq, ddq = random_states(np.random.default_rng(0), 1000 if size > 1 else 20)
    tau = np.random.default_rng(1).standard_normal(q.shape)
    equations = RigidEquations(body, q, dq, ddq, tau, size)
    for _ in range(2):
        read = [(dense(block), np.array(block.y).T.copy()) for block in equations]
        assert max(len(y) for _, y in read) <= size
        np.testing.assert_allclose(np.concatenate([a for a, _ in read]), body.regressor(q, dq, ddq), rtol=1e-13, atol=1e-13)
        np.testing.assert_array_equal(np.concatenate([y for _, y in read]), tau)


def test_parameters_come_back(body: RigidBody, tmp_path: Path) -> None:
    """Torques of the known arm give its parameters back to 1e-12, also from memory maps."""
    motion = random_states(np.random.default_rng(2), 20_000)
    p = body.known_parameters()
    assert p is not None
    files = []
    for k, values in enumerate((*motion, body.torque(*motion, p))):
        np.save(tmp_path / f"{k}.npy", values)
        files.append(np.load(tmp_path / f"{k}.npy", mmap_mode="r"))
    found = fit(RigidEquations(body, *files)).solution
    assert np.abs(found.beta - p).max() <= 1e-12 * np.abs(p).max()
    assert found.rank == 15


def test_what_a_poor_motion_cannot_show_is_named() -> None:
    """Joint 3 alone, slowly and weakly: ten and more of the fifteen parameters are named as unseen, and p3 is not."""
    body = RRR(load_robot("rrr"))
    names = [known.name for known in body.parameters]
    t = np.linspace(0.0, 10.0, 5000)
    q, dq, ddq = (np.zeros((len(t), 3)) for _ in range(3))
    q[:, 2], dq[:, 2], ddq[:, 2] = np.sin(2 * t), 2 * np.cos(2 * t), -4 * np.sin(2 * t)
    p = body.known_parameters()
    assert p is not None
    tau = body.torque(q, dq, ddq, p) + 0.01 * np.random.default_rng(0).standard_normal(q.shape)
    found = fit(RigidEquations(body, q, dq, ddq, tau)).solution
    named = unresolved(found, names)
    # the first axis is vertical and at rest: nothing turns with it
    assert set(named.never_moved) == {"p1", "p2", "p5", "p6", "p7", "p10", "p11", "p12", "p15"}
    assert {"p3", "p4"}.isdisjoint(named.parameters)
    assert _resolved(found, 1.0).sum() <= 15 - 9
    assert not np.isfinite(found.std[6])

"""The closed forms of the diagnosis, against the same done by brute force with numpy."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.diagnosis.candidates import Group
from pipelines.diagnosis.prior import Belief
from pipelines.diagnosis.score import Blocks
from pipelines.diagnosis.screening import screen
from pipelines.estimation.joint_table import (
    Array,
    Arrow,
    Structure,
    Table,
    by_joint,
)

_ROWS, _JOINTS, _KNOWN, _MORE = 240, 3, 5, 2


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260)


def _problem(rng: np.random.Generator) -> tuple[Array, Array, Array, Array, np.ndarray]:
    """Known columns, a candidate's, torque, prior information, and the joint of each row."""
    joint = np.repeat(np.arange(_JOINTS), _ROWS // _JOINTS)
    base = rng.normal(size=(_KNOWN, _ROWS))
    base[3, joint != 1] = 0.0  # acts on one joint
    more = rng.normal(size=(_MORE, _ROWS)) * (joint == 2)
    y = rng.normal(size=_ROWS) + 0.3 * more[0]
    return base, more, y, np.diag(rng.uniform(0.5, 2.0, _KNOWN)), joint


def _least_cost(columns: Array, y: Array, info: Array) -> tuple[float, Array]:
    """Return the least ‖y - Cᵀθ‖² + θᵀAθ and where it is."""
    theta: Array = np.asarray(
        np.linalg.solve(columns @ columns.T + info, columns @ y), dtype=np.float64
    )
    left = y - columns.T @ theta
    return float(left @ left + theta @ info @ theta), theta


def test_screening_is_what_an_exact_refit_with_the_candidate_gains(
    rng: np.random.Generator,
) -> None:
    base, more, y, info, joint = _problem(rng)
    cost, theta = _least_cost(base, y, info)
    wide = np.zeros((_KNOWN + _MORE,) * 2)
    wide[:_KNOWN, :_KNOWN] = info
    together, both = _least_cost(np.concatenate([base, more]), y, wide)
    b, c = (Table.of(x, joint, _JOINTS) for x in (base, more))
    residual = by_joint(y - base.T @ theta, joint, _JOINTS)
    (found,) = screen(
        [Group(("spring", 3), 0, 0, _MORE, True, "named")],
        Arrow.of(info + b.gram(b), Structure.of(b)),
        b.gram(c),
        [c.gram(c)],
        c.moments(residual),
    )
    assert found.gain == pytest.approx(cost - together)
    assert found.amplitudes == pytest.approx(both[_KNOWN:])
    assert found.freedom == _MORE


def test_a_block_is_predicted_as_by_a_fit_without_it(rng: np.random.Generator) -> None:
    base, _, y, info, joint = _problem(rng)
    block = np.tile(np.repeat(np.arange(4), _ROWS // _JOINTS // 4), _JOINTS)
    _, theta = _least_cost(base, y, info)
    table = Table.of(base, joint, _JOINTS)
    factor = Arrow.of(info + table.gram(table), Structure.of(table))
    blocks = Blocks.of(table, factor, [block[joint == j] for j in range(_JOINTS)])
    losses = blocks.losses(by_joint(y - base.T @ theta, joint, _JOINTS))
    for b in range(4):
        _, without = _least_cost(base[:, block != b], y[block != b], info)
        left = y[block == b] - base[:, block == b].T @ without
        assert losses[b] == pytest.approx(left @ left)


def test_a_block_is_predicted_beside_effects_as_by_a_fit_of_all_numbers_without_it(
    rng: np.random.Generator,
) -> None:
    base, more, y, info, joint = _problem(rng)
    block = np.tile(np.repeat(np.arange(4), _ROWS // _JOINTS // 4), _JOINTS)
    every = np.concatenate([base, more])
    wide = np.zeros((_KNOWN + _MORE,) * 2)
    wide[:_KNOWN, :_KNOWN] = info
    _, theta = _least_cost(every, y, wide)
    table, effects = (Table.of(x, joint, _JOINTS) for x in (base, more))
    blocks = tuple(block[joint == j] for j in range(_JOINTS))
    belief = Belief(info, np.zeros(_KNOWN), table, table.gram(table), Structure.of(table), blocks)
    losses = belief.losses(effects, by_joint(y - every.T @ theta, joint, _JOINTS))
    assert belief.beside(effects).solve(every @ y) == pytest.approx(theta, rel=1e-6)
    for b in range(4):
        _, without = _least_cost(every[:, block != b], y[block != b], wide)
        left = y[block == b] - every[:, block == b].T @ without
        assert losses[b] == pytest.approx(left @ left, rel=1e-6)


def test_arrow_shaped_information_is_solved_as_a_dense_matrix(rng: np.random.Generator) -> None:
    base, more, y, _, joint = _problem(rng)
    columns = np.concatenate([base, more])
    table = Table.of(columns, joint, _JOINTS)
    dense = columns @ columns.T + np.eye(_KNOWN + _MORE)
    arrow = Arrow.of(dense, Structure.of(table))
    assert [len(own) for own in arrow.structure.own] == [0, 1, 2]
    assert arrow.solve(columns @ y) == pytest.approx(np.linalg.solve(dense, columns @ y))
    assert arrow.inverse_diagonal == pytest.approx(np.diag(np.linalg.inv(dense)))
    own, shared = arrow.whitened(table, 2)
    there = columns[:, joint == 2]
    gram = there.T @ np.linalg.solve(dense, there)
    assert own.T @ own + shared.T @ shared == pytest.approx(gram)

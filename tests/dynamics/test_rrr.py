"""The closed-form RRR arm against independent programs and against the Euler-Lagrange form of the paper."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.rrr import RRR, fits, rigid_body
from pipelines.dynamics.rrr_kinematics import inverse
from pipelines.io.robot_files import load_robot
from tests.dynamics.rrr_arms import column, random_states, robot_with

BAR = 1e-12


@pytest.fixture(params=[0, 1], ids=["random", "table-v"])
def case(request: pytest.FixtureRequest, vectors: dict[str, Any]) -> dict[str, Any]:
    return dict(vectors["dynamics"][request.param])


@pytest.fixture
def body(case: dict[str, Any]) -> RRR:
    return RRR(robot_with(case["links"]))


def worst(ours: Array, theirs: Array) -> float:
    """Largest difference, relative to the largest value."""
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


def test_torque_and_its_parts(case: dict[str, Any], body: RRR) -> None:
    """Torque, D, c, h and the tip agree with Pinocchio to 1e-12 of the largest value."""
    q, dq, ddq, p = column(case, "q"), column(case, "dq"), column(case, "ddq"), np.array(case["p"])
    tau = column(case, "tau")
    parts = body.torque_parts(q, dq, ddq, p)
    assert worst(body.torque(q, dq, ddq, p), tau) <= BAR
    assert worst(body.regressor(q, dq, ddq) @ p, tau) <= BAR
    assert worst(body.mass_matrix(q, p), column(case, "D")) <= BAR
    assert worst(parts.coriolis, column(case, "coriolis")) <= BAR
    assert worst(parts.gravity, column(case, "gravity")) <= BAR
    assert worst(parts.inertia, np.einsum("sij,sj->si", column(case, "D"), ddq)) <= BAR
    assert worst(body.tip(q), column(case, "tip")) <= BAR


def test_one_regressor_entry_by_entry(vectors: dict[str, Any]) -> None:
    """All 45 entries of (A5), r34 corrected."""
    example = vectors["regressor_example"]
    q, dq, ddq = (np.array([example[key]]) for key in ("q", "dq", "ddq"))
    ours = RRR(load_robot("rrr")).regressor(q, dq, ddq)[0]
    assert np.abs(ours - np.array(example["R"])).max() <= BAR * np.abs(example["R"]).max()


@pytest.mark.parametrize("seed", [1, 2])
def test_torque_is_the_sum_of_its_parts_for_any_parameters(seed: int) -> None:
    """D ddq + c + h, for parameters that no link could have."""
    rng = np.random.default_rng(seed)
    body, (q, dq, ddq) = RRR(load_robot("rrr")), random_states(rng, 500)
    p = rng.normal(size=15)
    torque, parts = body.torque(q, dq, ddq, p), body.torque_parts(q, dq, ddq, p)
    assert worst(parts.inertia + parts.coriolis + parts.gravity, torque) <= BAR
    moved = np.einsum("sjk,sk->sj", body.mass_matrix(q, p), ddq)
    assert worst(moved + parts.coriolis + parts.gravity, torque) <= BAR


def test_offsets_shift_the_zero() -> None:
    """q_model = q_log + offset, in torque, tip and inverse kinematics."""
    robot = load_robot("rrr")
    shift = np.array([0.3, -0.7, 1.1])
    moved = replace(robot, joints=tuple(replace(joint, offset=float(offset))
                                        for joint, offset in zip(robot.joints, shift, strict=True)))
    plain, shifted = RRR(robot), RRR(moved)
    q, dq, ddq = random_states(np.random.default_rng(7), 50)
    p = plain.known_parameters()
    assert p is not None
    assert worst(shifted.torque(q - shift, dq, ddq, p), plain.torque(q, dq, ddq, p)) <= BAR
    assert worst(shifted.tip(q - shift), plain.tip(q)) <= BAR
    answer = inverse(shifted.geometry, plain.tip(q))
    assert np.abs(answer.q).max() <= np.pi
    assert worst(shifted.tip(answer.q[2]), plain.tip(q)) <= BAR


def test_which_robots_are_rrr_arms() -> None:
    """The closed form is taken where, and only where, its geometry is there."""
    robot = load_robot("rrr")
    one, two, three = robot.joints
    other = [replace(robot, convention="mdh"), replace(robot, gravity=(0.1, 0.0, -9.8)),
             replace(robot, tool=(0.1, 0.0, 0.0)), replace(robot, gravity=(0.0, 0.0, 0.0)),
             replace(robot, joints=(one, two)),
             replace(robot, joints=(replace(one, a=0.01), two, three)),
             replace(robot, joints=(replace(one, alpha=-one.alpha), two, three)),
             replace(robot, joints=(one, replace(two, alpha=1e-3), three)),
             replace(robot, joints=(one, replace(two, type="prismatic"), three))]
    assert fits(robot)
    assert not any(fits(arm) for arm in other)
    chosen: RigidBody = rigid_body(robot)
    assert isinstance(chosen, RRR)
    assert [parameter.name for parameter in chosen.parameters] == [f"p{k}" for k in range(1, 16)]
    with pytest.raises(ValueError, match="not an RRR arm"):
        RRR(other[0])


# --- the other programs --------------------------------------------------------------------------------

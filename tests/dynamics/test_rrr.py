"""The closed-form RRR arm against independent programs and against the Euler-Lagrange form of the paper."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio
import pytest

from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.rrr import RRR, fits, rigid_body
from pipelines.dynamics.rrr_kinematics import inverse
from pipelines.io.robot import RobotDescription
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


def test_links_that_no_body_could_have_against_pinocchio() -> None:
    """Thirty random link parameters, masses of either sign: (A4) and (A5) agree with Pinocchio's linear regressor."""
    robot = load_robot("rrr")
    rng = np.random.default_rng(4)
    q, dq, ddq = random_states(rng, 300)
    model, data = pinocchio_model(robot)
    links = [rng.normal(size=10) for _ in range(3)]
    body = RRR(robot_with([as_link(*pi) for pi in links]))
    p = body.known_parameters()
    assert p is not None
    standard = np.concatenate([pinocchio_parameters(pi, joint.alpha, (joint.a, 0.0, joint.d))
                               for pi, joint in zip(links, robot.joints, strict=True)])
    theirs = np.array([pinocchio.computeJointTorqueRegressor(model, data, *state) @ standard
                       for state in zip(q, dq, ddq, strict=True)])
    assert worst(body.torque(q, dq, ddq, p), theirs) <= BAR


def test_mass_matrix_against_crba() -> None:
    """D(q) of the shipped arm is Pinocchio's composite-rigid-body D, symmetric and positive definite."""
    robot = load_robot("rrr")
    body = RRR(robot)
    p = body.known_parameters()
    assert p is not None
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (300, 3))
    model, data = pinocchio_model(robot)
    upper = np.array([np.triu(pinocchio.crba(model, data, one)) for one in q])
    theirs = upper + np.triu(upper, 1).transpose(0, 2, 1)
    ours = body.mass_matrix(q, p)
    assert worst(ours, theirs) <= BAR
    assert np.linalg.eigvalsh(ours).min() > 0


def test_euler_lagrange(case: dict[str, Any], body: RRR) -> None:
    """The trace formula (5)-(7) with 4x4 transforms equals (A4)-(A5)."""
    q, dq, ddq, p = (column(case, "q")[:25], column(case, "dq")[:25], column(case, "ddq")[:25], np.array(case["p"]))
    theirs = np.array([euler_lagrange(body.robot, *state) for state in zip(q, dq, ddq, strict=True)])
    assert worst(body.torque(q, dq, ddq, p), theirs) <= 1e-11


def test_power_balance(body: RRR) -> None:
    """The Coriolis torque does the work of the changing mass matrix: dq.c = dq.(dD/dt).dq / 2."""
    q, dq, ddq = random_states(np.random.default_rng(6), 200)
    p = body.known_parameters()
    assert p is not None
    step = 1e-6
    rate = (body.mass_matrix(q + step * dq, p) - body.mass_matrix(q - step * dq, p)) / (2 * step)
    power = 0.5 * np.einsum("si,sij,sj->s", dq, rate, dq)
    ours = np.sum(dq * body.torque_parts(q, dq, ddq, p).coriolis, axis=1)
    assert np.abs(ours - power).max() <= 1e-7 * np.abs(power).max()


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

def as_link(m: float, x: float, y: float, z: float, *inertia: float) -> dict[str, float]:
    keys = ("m", "x", "y", "z", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
    return dict(zip(keys, (m, x, y, z, *inertia), strict=True))


def pinocchio_model(robot: RobotDescription) -> tuple[Any, Any]:
    """The arm in Pinocchio: joint frame i stands before Tz Tx Rx of the DH row."""
    model = pinocchio.Model()
    model.gravity.linear = np.array(robot.gravity)
    place, parent = pinocchio.SE3.Identity(), 0
    for k, joint in enumerate(robot.joints):
        parent = model.addJoint(parent, pinocchio.JointModelRZ(), place, f"j{k}")
        place = pinocchio.SE3(rotation_x(joint.alpha), np.array([joint.a, 0.0, joint.d]))
        if joint.link is not None:
            com = np.array(joint.link.com)
            tensor = origin_tensor(joint.link.inertia) - joint.link.mass * (com @ com * np.eye(3) - np.outer(com, com))
            model.appendBodyToJoint(parent, pinocchio.Inertia(joint.link.mass, com, tensor), place)
    return model, model.createData()


def pinocchio_parameters(pi: Array, alpha: float, shift: tuple[float, float, float]) -> Array:
    """Standard parameters m, m c, I (about the joint frame) in Pinocchio's order, from those in the DH frame."""
    m, c, tensor = pi[0], pi[1:4], origin_tensor(pi[4:])
    turn, r = rotation_x(alpha), np.array(shift)
    Ic = turn @ (tensor - m * (c @ c * np.eye(3) - np.outer(c, c))) @ turn.T
    c = turn @ c + r
    Io = Ic + m * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([m, *(m * c), Io[0, 0], Io[0, 1], Io[1, 1], Io[0, 2], Io[1, 2], Io[2, 2]])


def rotation_x(alpha: float) -> Array:
    c, s = np.cos(alpha), np.sin(alpha)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def origin_tensor(inertia: Any) -> Array:
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]])


def dh(a: float, alpha: float, d: float, q: float) -> tuple[Array, Array, Array]:
    """Eq. (1)'s transform of one joint with its first and second derivative by q."""
    ca, sa = np.cos(alpha), np.sin(alpha)

    def rows(c: float, s: float) -> Array:
        return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, 0, 0, 0], [0, 0, 0, 0]])

    constant = np.array([[0, 0, 0, 0], [0, 0, 0, 0], [0, sa, ca, d], [0, 0, 0, 1]])
    c, s = np.cos(q), np.sin(q)
    return rows(c, s) + constant, rows(-s, c), -rows(c, s)


def euler_lagrange(robot: RobotDescription, q: Array, dq: Array, ddq: Array) -> Array:
    """τ by Kostić et al. 2004, eq. (5)-(7): traces of derivatives of the transforms with the pseudo-inertias J_i."""
    n = robot.n_joints
    steps = [dh(j.a, j.alpha, j.d, q[k]) for k, j in enumerate(robot.joints)]

    def transform(i: int, *by: int) -> Array:
        """0_iT, differentiated by the joints in `by`."""
        T = np.eye(4)
        for k in range(i + 1):
            T = T @ steps[k][by.count(k)]
        return T if all(k <= i for k in by) else np.zeros((4, 4))

    tau = np.zeros(n)
    gravity = np.array([*robot.gravity, 0.0])
    for k in range(n):
        for i in range(k, n):
            link = robot.joints[i].link
            assert link is not None
            J, first = pseudo_inertia(link.mass, link.com, link.inertia), transform(i, k).T
            for j in range(i + 1):
                tau[k] += np.trace(transform(i, j) @ J @ first) * ddq[j]
                for m in range(i + 1):
                    tau[k] += np.trace(transform(i, j, m) @ J @ first) * dq[j] * dq[m]
            tau[k] -= link.mass * gravity @ transform(i, k) @ np.array([*link.com, 1.0])
    return tau


def pseudo_inertia(m: float, com: tuple[float, ...], inertia: tuple[float, ...]) -> Array:
    """J_i of eq. (7): ∫ [r; 1][r; 1]ᵀ dm."""
    xx, yy, zz, xy, xz, yz = inertia
    x, y, z = (m * c for c in com)
    return np.array([[(-xx + yy + zz) / 2, xy, xz, x], [xy, (xx - yy + zz) / 2, yz, y],
                     [xz, yz, (xx + yy - zz) / 2, z], [x, y, z, m]])

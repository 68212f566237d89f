"""A design keeps its limits between samples, reaches what it aims at, and is found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.rrr_kinematics import rrr_geometry, tip
from pipelines.errors import UsageError
from pipelines.excitation.optimise import Design, Effort, design, landscape
from pipelines.excitation.regressor import grams_of
from pipelines.excitation.result import judged as judged_found
from pipelines.excitation.task import Task, Wishes, plan_task
from pipelines.io.robot import RobotDescription
from tests.excitation.arms import described, rrr, six_axes

GRID = 1e-4  # [s]


def _task(wishes: Wishes, robot: RobotDescription | None = None) -> Task:
    robot = robot or rrr()
    return plan_task(robot, described(robot), wishes)


@pytest.fixture(scope="module")
def default() -> tuple[Task, Design]:
    task = _task(Wishes())
    return task, design(task, Effort(evaluations=1200), 1)


def test_the_default_design(default: tuple[Task, Design]) -> None:
    """A-optimal with a condition number of 3 at most, by NumPy on its own regressor; from rest at the hanging home."""
    task, found = default
    q, dq, ddq = found.trajectory.at(np.linspace(0.0, 10.0, 5001))
    y = BaseArm(task.robot)  # spans the same columns, found numerically
    assert len(y.parameters) == 15
    phi = landscape(task).arm.columns.rigid
    rows = [row.copy() for row in phi.rows(np.stack([q, dq, ddq]))]
    whole = np.zeros((3, q.shape[1], 15))
    for j, (own, row) in enumerate(zip(phi.columns, rows, strict=True)):
        whole[j][:, own] = row.T
    assert np.linalg.cond(whole.reshape(-1, 15)) <= 3.0
    assert found.reached
    for t in (0.0, found.trajectory.duration):
        ends = found.trajectory.at(np.array([t]))[:, :, 0]
        np.testing.assert_allclose(ends[0], [0.0, -np.pi / 2, 0.0], atol=1e-9)
        np.testing.assert_allclose(ends[1:], 0.0, atol=1e-7)


def test_limits_hold_on_a_fine_grid(default: tuple[Task, Design]) -> None:
    """Eq. (22) summed harmonic by harmonic every 0.1 ms, torque by Newton and Euler: nothing exceeds its limit."""
    task, found = default
    series = found.trajectory.series
    t = np.arange(0.0, 10.0, GRID)
    q, dq, ddq = (np.zeros((3, len(t))) for _ in range(3))
    q += series.offset[:, None]
    for j in range(series.harmonics):
        w, a, b = 2 * np.pi * (j + 1) / 10.0, series.cosine[:, j, None], series.sine[:, j, None]
        c, s = np.cos(w * t), np.sin(w * t)
        q += (a * s - b * c) / w
        dq += a * c + b * s
        ddq += w * (b * c - a * s)
    general = BaseArm(task.robot)
    p = general.known_parameters()
    assert p is not None
    tau = general.torque(q.T, dq.T, ddq.T, p).T
    for j, joint in enumerate(task.robot.joints):
        assert np.abs(dq[j]).max() <= joint.velocity
        assert np.abs(ddq[j]).max() <= joint.acceleration
        assert np.abs(tau[j]).max() <= 0.9 * joint.torque
    stated = {(peak.quantity, peak.joint): abs(peak.peak) for peak in found.peaks}
    assert stated["speed", 1] == pytest.approx(np.abs(dq[0]).max(), rel=1e-4)
    assert stated["torque", 2] == pytest.approx(np.abs(tau[1]).max(), rel=1e-3)


def test_a_box_for_the_tip() -> None:
    """The tip, by the closed form (A2), stays in its box."""
    box = (-0.65, 0.65, -0.65, 0.65, 0.2, 1.1)
    task = _task(replace(Wishes(), harmonics=(20,), tip_box=box, home=(0.0, 0.6, 0.4)))
    found = design(task, Effort(evaluations=600), 2)
    t = np.arange(0.0, 10.0, GRID)
    place = tip(rrr_geometry(task.robot), found.trajectory.at(t)[0].T)
    for k in range(3):
        assert box[2 * k] <= place[:, k].min()
        assert place[:, k].max() <= box[2 * k + 1]


def test_a_run_in_keeps_the_limits() -> None:
    """Not at rest at the ends: it is reached and left by polynomials, continuous to the acceleration, within the limits."""
    task = _task(replace(Wishes(), criterion="condition", rest=False, harmonics=(20,)))
    found = design(task, Effort(evaluations=400), 3)
    one = found.trajectory
    assert 0.1 < one.run_in < 2.0
    t = np.arange(round(one.duration / GRID) + 1) * GRID
    q, dq, ddq = one.at(t)
    limits = task.robot.joints
    assert all(np.abs(dq[j]).max() <= limits[j].velocity and np.abs(ddq[j]).max() <= limits[j].acceleration for j in range(3))
    np.testing.assert_allclose(dq[:, [0, -1]], 0.0, atol=1e-9)
    step = GRID * (dq[:, 1:] + dq[:, :-1]) / 2
    np.testing.assert_allclose(np.diff(q, axis=1), step, atol=1e-8)
    assert np.abs(np.diff(ddq, axis=1)).max() < 0.5  # no jump: 60 rad/s² turn over within 10 ms at most


@pytest.mark.parametrize(("changes", "wishes", "named"), [
    ({"torque": 0.5}, {"home": (0.0, 0.0, 0.0)}, r"torque limit of joint 2.* at home \(0, 0, 0\)"),
    ({}, {"tip_box": (2.0, 3.0, 2.0, 3.0, 2.0, 3.0)}, r"tip.* at home \(0, -1.571, "),
    ({"position": (1.0, 2.0)}, {"home": (0.0, 1.5, 1.5)}, "home of joint 1"),
    ({}, {"cond_max": 1.2}, "below 1.22474"),
    ({}, {"criterion": "best"}, "no criterion"),
])
def test_what_is_impossible_is_named(changes: dict[str, float], wishes: dict[str, object], named: str) -> None:
    """Limits that no motion keeps end in an error that says which one it is."""
    with pytest.raises(UsageError, match=named) as told:
        design(_task(replace(Wishes(), **wishes), rrr(**changes)), Effort(evaluations=50), 1)  # type: ignore[arg-type]
    assert told.value.code in ("RRID-C02", "RRID-C08")


def test_earlier_information_is_added() -> None:
    """Predicted deviations are those of one least-squares fit to both experiments, noise by joint: (Σ AᵀA/σ²)⁻¹ by NumPy."""
    rng = np.random.default_rng(0)
    wishes = replace(Wishes(), criterion="A", harmonics=(8,))
    columns = _task(wishes).problem.columns
    old, new = (rng.normal(size=(3, 3, 500)) * np.array([2.0, 3.0, 20.0])[:, None, None] for _ in range(2))
    known = 500.0 * grams_of(columns, old)
    goal = plan_task(rrr(), described(rrr()), wishes, known).problem.goal
    mine = goal.std(grams_of(columns, new))
    normal = np.zeros((15, 15))
    for motion, weight in ((old, 1.0), (new, 10000 / 500)):  # an experiment of 10 s at 1 kHz
        whole = np.zeros((500, 3, 15))
        for j, (own, row) in enumerate(zip(columns.columns, columns.rows(motion), strict=True)):
            whole[:, j, own] = row.T
        for j, sigma in enumerate((0.6, 0.3, 0.15)):
            normal += weight * whole[:, j].T @ whole[:, j] / sigma**2
    np.testing.assert_allclose(mine, np.sqrt(np.diag(np.linalg.inv(normal))), rtol=1e-8)


def test_the_certificate_holds_for_random_motions() -> None:
    """No motion whatever has a condition number below √(3/2): 200 random sets of states of many shapes."""
    rng, columns = np.random.default_rng(1), _task(Wishes()).problem.columns
    for _ in range(200):
        scale = 10.0 ** rng.uniform(-1.5, 1.5, (3, 3, 1))
        motion = rng.normal(size=(3, 3, 300)) * scale
        gram = grams_of(columns, motion).sum(axis=0)
        for kept in (np.arange(15), np.delete(np.arange(15), [3, 14])):
            values = np.linalg.eigvalsh(gram[np.ix_(kept, kept)])
            assert np.sqrt(values[-1] / values[0]) >= np.sqrt(1.5)


@pytest.mark.slow
def test_any_serial_arm() -> None:
    """Six axes with friction: better than random motions within the same limits, which hold by an arm of Pinocchio's kind."""
    task = _task(replace(Wishes(), criterion="condition", harmonics=(5,)), six_axes())
    found = design(task, Effort(evaluations=300), 1)
    number = judged_found(task, found, None, 1).condition_number
    problem, rng = landscape(task), np.random.default_rng([1, 1])
    for _ in range(20):
        motion = problem.space.motion(problem.start(rng, 0.999), problem.samples)
        assert number < task.problem.goal.figures(grams_of(task.problem.columns, motion)).condition_number
    t = np.arange(0.0, 10.0, 5e-4)
    q, dq, ddq = found.trajectory.at(t)
    for j, joint in enumerate(task.robot.joints):
        assert joint.position[0] <= q[j].min()
        assert q[j].max() <= joint.position[1]
        assert np.abs(dq[j]).max() <= joint.velocity
        assert np.abs(ddq[j]).max() <= joint.acceleration

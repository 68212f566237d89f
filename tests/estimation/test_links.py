"""Links that could exist, behind base parameters."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.estimation.consistency import (
    consistent_links,
    physical_consistency,
    prior_links,
    pseudo_inertia,
)
from pipelines.io.robot import Joint, LinkParameters, RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.io.urdf import import_urdf
from sample_logs.make_model import synthetic_arm
from tests.dynamics.serial_arms import physical_links
from tests.export.exported import arm_of


def drawn(seed: int) -> tuple[Arm, RobotDescription]:
    """A random arm of 3 to 7 joints, and its description: every number of its links off by 30 %."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 8))
    phi = physical_links(n, rng)
    joints = []
    for k in range(n):
        m, *rest = phi[10 * k:10 * k + 10]
        wrong = rng.uniform(0.7, 1.3, 10)
        com = np.array(rest[:3]) / m * wrong[1:4]
        body = np.array(rest[3:]) * wrong[4]
        kind = "prismatic" if rng.random() < 0.1 else "revolute"
        link = LinkParameters(float(m * wrong[0]), tuple(com.tolist()), tuple(body.tolist()))
        joints.append(Joint(f"j{k}", kind, a=float(rng.uniform(0, 0.5)), alpha=float(rng.choice([0, 1.5707963, -1.5707963, 0.4])),
                            d=float(rng.uniform(0, 0.3)), link=link))
    robot = RobotDescription(f"arm-{seed}", (0.0, 0.0, -9.81), "mdh", tuple(joints))
    return arm_of(robot, phi), robot


def feasible(seed: int) -> float:
    """How long one arm takes, whose links exist and have its base parameters."""
    arm, _ = drawn(seed)
    start = time.perf_counter()
    links = consistent_links(arm.body, arm.p, np.full((len(arm.p),) * 2, np.nan))
    taken = time.perf_counter() - start
    assert links.exact, seed
    assert np.linalg.eigvalsh(pseudo_inertia(links.phi)).min() > 0.0
    assert np.abs(links.base @ links.phi.ravel() - arm.p).max() <= 1e-10 * np.abs(arm.p).max()
    return taken


def test_links_that_exist_have_the_base_parameters_of_any_arm() -> None:
    """Whatever CAD says, in half a second."""
    assert np.median([feasible(seed) for seed in range(20)]) < 0.5


def test_a_singular_covariance_has_a_root() -> None:
    """Of fewer directions than base parameters: the distance is that of the directions that it has."""
    arm, rng = synthetic_arm(), np.random.default_rng(0)
    wrong = arm.p * np.where(np.arange(len(arm.p)) == 0, -1.0, 1.0)
    for rank in (len(wrong) - 1, len(wrong) // 2):
        spread = 0.01 * rng.normal(size=(len(wrong), rank))
        links = consistent_links(arm.body, wrong, spread @ spread.T)
        std = np.linalg.norm(spread, axis=1)
        off = np.linalg.pinv(spread / std[:, None]) @ ((links.base @ links.phi.ravel() - wrong) / std)
        assert links.distance == pytest.approx(np.linalg.norm(off))


@pytest.mark.slow
def test_a_thousand_arms_are_feasible() -> None:
    """Arms of 3 to 7 joints, CAD wrong by 30 %."""
    assert np.median([feasible(seed) for seed in range(1000)]) < 0.5


def test_links_that_were_described_right_come_back() -> None:
    """Nothing is changed where nothing needs to be."""
    arm = synthetic_arm()
    links = consistent_links(arm.body, arm.p, np.full((15, 15), np.nan))
    masses = [joint.link.mass for joint in arm.robot.joints if joint.link]
    assert links.exact
    assert np.allclose(links.phi[:, 0], masses, rtol=1e-9)


def test_what_torque_does_not_tell_stays_as_described() -> None:
    """The mass of the first link is no part of any torque: it and its std are those of the description."""
    arm = synthetic_arm()
    links = consistent_links(arm.body, 1.1 * arm.p, np.diag(np.full(15, 1e-4)))
    assert links.origin[0] == "description"
    assert links.phi[0, 0] == pytest.approx(12.0)
    assert links.std[0] == pytest.approx(0.0, abs=1e-9)
    assert set(links.origin) == {"description", "logs", "logs and description"}
    known = [k for k, origin in enumerate(links.origin) if origin == "logs"]
    spread = links.base @ links.covariance @ links.base.T
    assert known
    assert np.allclose(spread, np.diag(np.full(15, 1e-4)), atol=1e-12)


def test_a_link_that_would_need_negative_mass_is_named() -> None:
    """They are hardly farther off than what is possible at all, and the joint is told."""
    arm = synthetic_arm()
    phi = np.array([v for j in arm.robot.joints for v in (
        j.link.mass, *(j.link.mass * c for c in j.link.com), *j.link.inertia)])
    phi[24:27] *= 0.2  # the elbow's moments: far too small for its mass and centre
    p = arm.body.combine @ phi
    covariance = np.diag((0.02 * np.abs(p) + 1e-3) ** 2)
    links = consistent_links(arm.body, p, covariance)
    known = physical_consistency(p, covariance, arm.body.combine)
    assert not links.exact
    assert links.conflicts == ("elbow",)
    assert known.distance <= links.distance <= 1.1 * known.distance
    assert np.linalg.eigvalsh(pseudo_inertia(links.phi)).min() > 0.0
    away = (links.base @ links.phi.ravel() - p) / np.sqrt(np.diag(covariance))
    assert np.linalg.norm(away) == pytest.approx(links.distance)


def test_a_described_link_that_cannot_exist_is_named(shared: Path) -> None:
    """`cases/41`: one moment of inertia above the sum of the others."""
    robot = import_urdf(shared / "cases/41-impossible-inertia/badtri.urdf")
    inertias, assumed, impossible = prior_links(robot)
    assert impossible
    assert not assumed
    assert np.linalg.eigvalsh(inertias).min() > 0.0


def test_a_link_that_nothing_describes_is_assumed() -> None:
    """Its torque is that of the logs all the same."""
    robot = load_robot("rrr")
    bare = replace(robot, joints=tuple(replace(j, link=None) for j in robot.joints))
    arm = arm_of(bare, physical_links(3, np.random.default_rng(2)))
    links = consistent_links(arm.body, arm.p, np.full((15, 15), np.nan))
    assert links.exact
    assert links.origin[0] == "assumed"
    assert prior_links(bare)[1] == ("waist", "shoulder", "elbow")

"""The inequalities of the RRR arm hold for every arm made of mass, and each can be broken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.body import standard_parameters
from pipelines.dynamics.consistency import rrr_inequalities
from pipelines.dynamics.rrr import RRR, combined
from pipelines.estimation.consistency import physical_consistency
from pipelines.io.robot import LinkParameters
from pipelines.io.robot_files import load_robot
from tests.dynamics.serial_arms import physical_links

ZERO = np.zeros((15, 15))


def made_of_mass(seed: int) -> tuple[RRR, np.ndarray]:
    """An RRR arm whose links are clouds of points, and its standard parameters."""
    phi = physical_links(3, np.random.default_rng(seed))
    robot = load_robot("rrr")
    links = [LinkParameters(v[0], tuple(v[1:4] / v[0]), tuple(v[4:])) for v in phi.reshape(3, 10)]
    joints = tuple(replace(joint, link=link) for joint, link in zip(robot.joints, links, strict=True))
    return RRR(replace(robot, joints=joints)), phi


@pytest.mark.parametrize("seed", range(20))
def test_arms_of_mass_satisfy_them(seed: int) -> None:
    """Whatever the cloud of masses, all four hold without any allowance, and (A4) is L φ."""
    body, phi = made_of_mass(seed)
    p = body.known_parameters()
    assert p is not None
    np.testing.assert_allclose(combined(body.robot) @ phi, p, rtol=1e-12, atol=1e-12)
    found = rrr_inequalities(p, ZERO)
    assert len(found) == 4
    assert all(one.value > 0.0 and one.satisfied for one in found)


@pytest.mark.parametrize(("element", "value", "broken"), [
    (12, 0.07, {0, 2, 3}),  # p13 below p5 and p6
    (11, 0.2, {1}),  # p12 below p1 + p13
    (5, 0.3, {0, 3}),  # p6 too large for p13 and p5
])
def test_an_impossible_arm_breaks_them(element: int, value: float, broken: set[int]) -> None:
    """One parameter out of bounds breaks the inequalities that it stands in, and no other."""
    body = RRR(load_robot("rrr"))
    p = body.known_parameters()
    assert p is not None
    p = p.copy()
    p[element] = value
    found = rrr_inequalities(p, ZERO)
    assert {k for k, one in enumerate(found) if not one.satisfied} == broken
    assert all(one.satisfied for one in rrr_inequalities(p, np.eye(15)))  # ± 1 allows anything


def test_their_uncertainty_is_that_of_many_draws() -> None:
    """The std of each value to first order is the spread over parameters drawn from the covariance."""
    body = RRR(load_robot("rrr"))
    p = body.known_parameters()
    assert p is not None
    rng = np.random.default_rng(0)
    root = 1e-3 * rng.standard_normal((15, 15))
    stated = [one.std for one in rrr_inequalities(p, root @ root.T)]
    draws = p + rng.standard_normal((4000, 15)) @ root.T
    spread = np.std([[one.value for one in rrr_inequalities(draw, ZERO)] for draw in draws], axis=0)
    np.testing.assert_allclose(stated, spread, rtol=0.05)
    assert rrr_inequalities(p, np.full((15, 15), np.inf))[0].std == np.inf


@pytest.mark.parametrize(("element", "change", "link"), [(12, -0.05, 2), (11, -0.3, 1)])
def test_the_violated_link_is_named(element: int, change: float, link: int) -> None:
    """With its links as they are the arm is consistent; less p13 is impossible for link 3, less p12 for link 2."""
    body = RRR(load_robot("rrr"))
    p = body.known_parameters()
    assert p is not None
    links = [joint.link for joint in body.robot.joints if joint.link is not None]
    combine, covariance = combined(body.robot), 1e-6 * np.eye(15)
    np.testing.assert_allclose(combine @ standard_parameters(links), p, rtol=1e-12, atol=1e-12)
    assert physical_consistency(p, covariance, combine).consistent
    worse = p.copy()
    worse[element] += change
    found = physical_consistency(worse, covariance, combine)
    assert not found.consistent
    assert found.violating == (link,)

"""Every effect on arms of other kinds: a URDF of six joints, a gantry with slides in modified DH, a single joint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.effects import all_effects
from pipelines.effects.base import Effect, Event, everywhere
from pipelines.effects.bodies import TransmissionCoupling
from pipelines.effects.encoders import EncoderEccentricity
from pipelines.effects.friction import Coulomb, Viscous
from pipelines.io.robot import Drive, Joint, LinkParameters, RobotDescription
from pipelines.io.urdf import import_urdf
from pipelines.simulation import Plant
from tests.dynamics.serial_arms import GANTRY, TX40, physical_links, table

ROBOTS: dict[str, Callable[[Path], RobotDescription]] = {
    "urdf": lambda shared: import_urdf(shared / TX40),
    "gantry": lambda shared: table("gantry", "mdh", GANTRY),
    "one-joint": lambda shared: RobotDescription("one", (0.0, 0.0, -9.81), "dh", (Joint("a", a=0.3),)),
}
every_effect = pytest.mark.parametrize("kind", all_effects(), ids=lambda kind: kind.name)


@pytest.fixture(scope="module", params=list(ROBOTS))
def arm(request: pytest.FixtureRequest, shared: Path) -> Arm:
    """With links and friction."""
    robot = ROBOTS[request.param](shared)
    links = [LinkParameters(float(v[0]), tuple(v[1:4] / v[0]), tuple(v[4:]))
             for v in physical_links(robot.n_joints, np.random.default_rng(1)).reshape(-1, 10)]
    rigid = Arm.from_links(replace(robot, joints=tuple(replace(j, link=k) for j, k in zip(robot.joints, links, strict=True))))
    laws = [Acting.of(law, values, revolute=turning) for k, turning in enumerate(robot.revolute, start=1)
            for law, values in ((Coulomb(k), {"level": 2.0, "sharpness": 50.0}), (Viscous(k), {"coefficient": 1.5}))]
    return replace(rigid, friction=tuple(laws))


@pytest.fixture(scope="module")
def motion(arm: Arm) -> Motion:
    t = np.arange(400.0) * 2e-3
    w = 2.0 * np.pi * (0.5 + 0.3 * np.arange(float(arm.n_joints)))
    s, c = (np.asarray(f(t[:, None] * w), dtype=np.float64) for f in (np.sin, np.cos))
    return Motion(t, 0.3 + 0.7 * s, 0.7 * w * c, -0.7 * w**2 * s)


@every_effect
def test_an_effect_works_on_it(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """At every place: shapes, columns, the exact form, which for a weak effect is of first order, and the simulation."""
    for effect in everywhere(kind, arm.robot.revolute):
        shapes = tuple(effect.shapes(motion, arm))
        assert shapes
        for shape in {shapes[0], shapes[0].forms()[0]}:
            columns = shape.columns(motion, arm)
            assert np.isfinite(columns).all()
            values = shape.values(weak(shape, columns))
            change = shape.apply(motion, arm, values) - arm.torque(motion)
            first = columns @ shape.amplitudes(values)
            assert np.isfinite(change).all()
            if kind.evidence in ("residual", "base parameters"):
                assert np.abs(change - first).max() <= 0.06 * np.abs(first).max() + 1e-6
            Plant.of(arm.extended(Acting.of(shape, values))).prepared(2)
        if isinstance(effect, Event):
            assert all(type(one) is kind for one in effect.promising(motion, arm, 0.01 * arm.torque(motion)))


def weak(shape: Effect, columns: Array) -> Array:
    if shape.parameters.fixed is not None:
        return np.array(shape.parameters.fixed)
    return np.full(columns.shape[2], 1e-5)


def test_an_encoder_is_eccentric_where_a_joint_turns() -> None:
    """Its error goes once a turn; of a slide's metres a sine says nothing."""
    assert [one.joint for one in everywhere(EncoderEccentricity, (True, False, True))] == [1, 3]
    assert [one.joint for one in everywhere(Coulomb, (True, False, True))] == [1, 2, 3]


def test_a_shared_motor_turns_as_the_transmission_says() -> None:
    """Motor 2 turns with q2 - 3 q1 (N = [[50, 0], [-30, 10]]): friction follows v2 - 3 v1, and joint 1 feels it -3 times."""
    joints = (Joint("a", a=0.3, link=LinkParameters(1.0, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1, 0.0, 0.0, 0.0))),) * 2
    robot = RobotDescription("two", (0.0, 0.0, -9.81), "dh", joints, drive=Drive(((50.0, 0.0), (-30.0, 10.0))))
    arm, rng = Arm.from_links(robot), np.random.default_rng(4)
    motion = Motion(np.arange(5.0), *rng.normal(size=(3, 5, 2)))
    (effect,) = everywhere(TransmissionCoupling, (True, True))
    shape = next(iter(effect.shapes(motion, arm)))
    torque = shape.torque(motion, arm, {"with_joint": 1.0, "inertia": 0.0, "viscous": 2.0, "coulomb": 0.0, "sharpness": 100.0})
    speed = motion.dq[:, 1] - 3.0 * motion.dq[:, 0]
    np.testing.assert_allclose(torque, 2.0 * speed[:, None] * [-3.0, 1.0], atol=1e-12)

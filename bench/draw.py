"""Draw machines: bodies, friction, drives, encoders and gains, all of them known to the bench only.

paper_machine()                    the RRR arm of Kostić et al. 2004, with synthetic links and
friction draw_machine(seed, "fault")        another of its kind: links ±10 %, Coulomb and viscous
friction ±20 % machine_of(robot, seed)            any serial arm of which there is a description
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from bench.config import CONFIG, SAMPLE_TIME
from bench.control import observer_gain
from bench.dynamics import typical_inertia, typical_torque
from bench.faults.drive import Cogging, ColouredNoise, GainRipple
from bench.machine import Fault, Friction, Machine, coulomb_viscous
from bench.plan import Solid
from pipelines.io.robot import Joint, LinkParameters, RobotDescription


def paper_machine() -> Machine:
    """Return the machine of Kostić et al. 2004: Table II, Section IV.C.3, three sigmoids.

    Its links are synthetic: they have the base parameters p1, p2, p3, p5, p6, p7, p8 that Table V
    prints.
    """
    links = (
        LinkParameters(12.0, (0.0, -0.10, 0.0), (0.42, 0.437229, 0.42, 0.0, 0.0, 0.0)),
        LinkParameters(9.0, (-0.06, 0.0, -0.03), (0.0781, 0.1462, 0.1481, 0.0071, 0.0202, 0.002)),
        LinkParameters(
            2.0, (-0.32847, 0.0, -0.03), (0.0338, 0.3091302, 0.2993302, -0.00395, 0.0217082, 0.0116)
        ),
    )
    limits = (60.0, 30.0, 15.0)
    kinematics = (
        Joint("waist", alpha=math.pi / 2, d=0.56, velocity=2.0 * math.pi),
        Joint("shoulder", a=0.2, d=0.169, velocity=3.0 * math.pi),
        Joint("elbow", a=0.415, d=0.09, velocity=3.0 * math.pi),
    )
    joints = tuple(
        replace(joint, acceleration=60.0, torque=limit, encoder_resolution=1e-5, link=link)
        for joint, limit, link in zip(kinematics, limits, links, strict=True)
    )
    sharpnesses = (60.0, 120.0, 12.0)  # [s/rad]
    return Machine(
        robot=RobotDescription("rrr-tue", (0.0, 0.0, -9.8062), "dh", joints),
        friction=(
            Friction((4.8, 1.5, -1.5), sharpnesses, 0.60),
            Friction((2.4, 0.8, -0.8), sharpnesses, 0.30),
            Friction((1.2, 0.4, -0.4), sharpnesses, 0.12),
        ),
        torque_limit=limits,
        kp=(1500.0, 1100.0, 140.0),
        kd=(45.0, 32.0, 3.2),
        encoder_resolution=(1e-5,) * 3,
        amplifier_noise=(0.020, 0.010, 0.005),
        observer_gain=(_observer_gain(),) * 3,
        joint_factor=(1.0, 0.7, 0.25),
    )


def _observer_gain() -> tuple[float, float, float]:
    return observer_gain(SAMPLE_TIME, CONFIG.observer_noise, CONFIG.observer_jerk)


def draw_machine(
    seed: int, around: Literal["paper", "fault"] = "paper", nuisances: bool = True
) -> Machine:
    """Draw a machine of the same kind: links within ±10 %, friction within ±20 %.

    Args:
        seed: of all that is drawn.
        around: "paper" has friction of three sigmoids, "fault" Coulomb and viscous friction, as
            scored cases do.
        nuisances: with the small imperfections that a healthy arm has too.
    """
    rng = np.random.default_rng([2004, seed])
    machine = paper_machine()
    links = [
        Solid.of_link(joint.link).drawn(rng, 0.10).as_link()
        for joint in machine.robot.joints
        if joint.link
    ]
    friction = machine.friction
    if around == "fault":
        friction = tuple(
            coulomb_viscous(law.coulomb, law.viscous, float(rng.uniform(80.0, 120.0)))
            for law in friction
        )
    friction = tuple(law.drawn(rng, 0.20) for law in friction)
    machine = replace(machine, robot=with_links(machine.robot, links), friction=friction)
    return _with_nuisances(machine, rng) if nuisances else machine


def with_links(robot: RobotDescription, links: list[LinkParameters]) -> RobotDescription:
    """Return the robot with a link a joint."""
    pairs = zip(robot.joints, links, strict=True)
    return replace(robot, joints=tuple(replace(joint, link=link) for joint, link in pairs))


def machine_of(robot: RobotDescription, seed: int = 0, nuisances: bool = True) -> Machine:
    """Return a machine of any serial arm; links that are missing or cannot exist are drawn.

    Gains and friction follow from the inertia: each loop gets a natural frequency of 35 rad/s and
    half of critical damping, as the paper's machine has; friction is 8 % of the torque limit, which
    is three times the torque of gravity and of 10 rad/s² where the description has none.
    """
    rng = np.random.default_rng([2005, seed])
    links = [
        _link_of(joint, rng, 1.0 - 0.8 * i / robot.n_joints) for i, joint in enumerate(robot.joints)
    ]
    whole = with_links(robot, links)
    inertia, needed = typical_inertia(whole), typical_torque(whole, acceleration=10.0)
    limit = tuple(
        joint.torque if math.isfinite(joint.torque) else 3.0 * torque
        for joint, torque in zip(robot.joints, needed, strict=True)
    )
    machine = Machine(
        robot=whole,
        friction=tuple(coulomb_viscous(0.08 * top, 0.01 * top).drawn(rng, 0.20) for top in limit),
        torque_limit=limit,
        kp=tuple(35.0**2 * m for m in inertia),
        kd=tuple(35.0 * m for m in inertia),
        encoder_resolution=tuple(joint.encoder_resolution or 1e-5 for joint in robot.joints),
        amplifier_noise=tuple(3e-4 * top for top in limit),
        observer_gain=(_observer_gain(),) * robot.n_joints,
        joint_factor=tuple(top / max(limit) for top in limit),
    )
    return _with_nuisances(machine, rng) if nuisances else machine


def _link_of(joint: Joint, rng: np.random.Generator, lightness: float) -> LinkParameters:
    """Draw a link within 10 % of the described one, or eight point masses times `lightness`."""
    if joint.link and Solid.of_link(joint.link).exists:
        return Solid.of_link(joint.link).drawn(rng, 0.10).as_link()
    mass = rng.uniform(0.5, 1.0, 8) * lightness
    points = rng.uniform(-0.15, 0.15, (8, 3))
    com = mass @ points / mass.sum()
    moments = (points - com).T @ ((points - com) * mass[:, None])
    return Solid(float(mass.sum()), com, np.trace(moments) * np.eye(3) - moments).as_link()


def _with_nuisances(machine: Machine, rng: np.random.Generator) -> Machine:
    small = [
        fault for joint in range(1, machine.n + 1) for fault in _nuisances_at(machine, joint, rng)
    ]
    return replace(machine, standing=(*machine.standing, *small))


def _nuisances_at(machine: Machine, joint: int, rng: np.random.Generator) -> tuple[Fault, ...]:
    """Draw the imperfections of a healthy joint (1-based).

    1 mN m of cogging, 0.1 % of gain ripple, and coloured noise of half the amplifier's.

    Cogging grows with the machine up to a share of the amplifier's noise: at a wrist of a twentieth
    of the largest torque it would be no small imperfection. Along a slide orders are those of a
    linear motor, and as its weight is the same everywhere, a ripple of the gain is cogging there.
    """
    phase = rng.uniform(0.0, 2.0 * np.pi, 3).tolist()
    turning = machine.robot.joints[joint - 1].revolute
    orders = [float(order) * (1.0 if turning else 10.0) for order in rng.integers(8, 37, 2)]
    noise = machine.amplifier_noise[joint - 1]
    cogging = min(1e-3 * max(machine.torque_limit) / 60.0, CONFIG.healthy_cogging * noise)
    ripple = 1e-3
    if not turning:
        weight = typical_torque(machine.robot, acceleration=0.0)[joint - 1]
        ripple = min(ripple, CONFIG.healthy_ripple * noise / weight) if weight else ripple
    return (
        Cogging(joint, orders[0], cogging, phase[0], phase[1]),
        GainRipple(joint, ripple, orders[1], phase[2]),
        ColouredNoise(joint, 0.5 * noise, float(rng.uniform(1.0, 5.0))),
    )

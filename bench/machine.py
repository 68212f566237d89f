"""The machine that is recorded: bodies, friction, drives, encoders and gains, all of them known to the bench only.

    paper_machine()                    the RRR arm of Kostić et al. 2004 with the synthetic links and friction
    draw_machine(seed, "fault")        another of its kind: links ±10 %, Coulomb and viscous friction ±20 %
    machine_of(robot, seed)            any serial arm that a description places
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from bench.friction import CoulombViscous, Friction, ThreeSigmoid
from bench.observer import Gain, observer_gain
from bench.solid import Solid
from pipelines.io.robot import Joint, LinkParameters, RobotDescription

if TYPE_CHECKING:
    from bench.fault import Fault

__all__ = ["SAMPLE_TIME", "Machine", "draw_machine", "machine_of", "paper_machine"]

SAMPLE_TIME = 1e-3  # [s] of the controller
BITS = 12  # of the torque command, over twice the limit
OBSERVER_NOISE, OBSERVER_JERK = 3e-6, 4000.0  # [rad], [rad/s^3]

# Synthetic links: they reproduce the printed base parameters p1, p2, p3, p5, p6, p7, p8 of Kostić et al. 2004, Table V.
_LINKS = (
    LinkParameters(12.0, (0.0, -0.10, 0.0), (0.42, 0.437229, 0.42, 0.0, 0.0, 0.0)),
    LinkParameters(9.0, (-0.06, 0.0, -0.03), (0.0781, 0.1462, 0.1481, 0.0071, 0.0202, 0.002)),
    LinkParameters(2.0, (-0.32847, 0.0, -0.03), (0.0338, 0.3091302, 0.2993302, -0.00395, 0.0217082, 0.0116)),
)
_SHARPNESSES = (60.0, 120.0, 12.0)  # [s/rad]
_SIGMOIDS = (((4.8, 1.5, -1.5), 0.60), ((2.4, 0.8, -0.8), 0.30), ((1.2, 0.4, -0.4), 0.12))  # [N m], [N m s/rad]


@dataclass(frozen=True)
class Machine:
    """One robot as it truly is. Units are those of revolute joints; a prismatic one has m and N."""

    robot: RobotDescription  # every joint with its link
    friction: tuple[Friction, ...]
    torque_limit: tuple[float, ...]  # [N m]
    kp: tuple[float, ...]  # [N m/rad]
    kd: tuple[float, ...]  # [N m s/rad]
    encoder_resolution: tuple[float, ...]  # [rad], 0: none
    amplifier_noise: tuple[float, ...]  # [N m] rms, white, held over a sample
    observer_gain: tuple[Gain, ...]
    joint_factor: tuple[float, ...]  # strength of a fault here against the first joint ("s")
    quantised_torque: bool = True
    delay: int = 0  # samples between q[k] and the tau it leads to, 0 or 1
    standing: tuple[Fault, ...] = ()  # what this machine had from its first day: nuisances, a soft base

    @property
    def n(self) -> int:
        return self.robot.n_joints

    @property
    def torque_resolution(self) -> tuple[float, ...]:
        """[N m] of one bit of the torque command."""
        return tuple(2.0 * limit / 2**BITS for limit in self.torque_limit)

    @property
    def described(self) -> RobotDescription:
        """What a log says of the robot: its kinematics and limits, never its links."""
        joints = tuple(replace(joint, link=None, torque=limit, encoder_resolution=resolution or None)
                       for joint, limit, resolution in zip(self.robot.joints, self.torque_limit, self.encoder_resolution,
                                                           strict=True))
        return replace(self.robot, joints=joints)

    @property
    def ideal(self) -> Machine:
        """The same bodies and friction without quantisation, noise and nuisances."""
        still = (0.0,) * self.n
        return replace(self, encoder_resolution=still, amplifier_noise=still, quantised_torque=False, standing=())

    def with_friction(self, *friction: Friction) -> Machine:
        return replace(self, friction=friction)


def _paper_robot() -> RobotDescription:
    """Kostić et al. 2004, Table II, and the limits of Section IV.C.3."""
    rows = (("waist", 0.0, math.pi / 2, 0.56, 2.0, 60.0), ("shoulder", 0.2, 0.0, 0.169, 3.0, 30.0),
            ("elbow", 0.415, 0.0, 0.09, 3.0, 15.0))
    joints = tuple(Joint(name, a=a, alpha=alpha, d=d, velocity=turns * math.pi, acceleration=60.0, torque=torque,
                         encoder_resolution=1e-5, link=link)
                   for (name, a, alpha, d, turns, torque), link in zip(rows, _LINKS, strict=True))
    return RobotDescription("rrr-tue", (0.0, 0.0, -9.8062), "dh", joints)


def paper_machine() -> Machine:
    """The machine of Kostić et al. 2004: synthetic links, friction of three sigmoids."""
    robot = _paper_robot()
    friction = tuple(ThreeSigmoid(heights, _SHARPNESSES, viscous) for heights, viscous in _SIGMOIDS)
    gain = observer_gain(SAMPLE_TIME, OBSERVER_NOISE, OBSERVER_JERK)
    return Machine(robot, friction, (60.0, 30.0, 15.0), (1500.0, 1100.0, 140.0), (45.0, 32.0, 3.2), (1e-5,) * 3,
                   (0.020, 0.010, 0.005), (gain,) * 3, (1.0, 0.7, 0.25))


def draw_machine(seed: int, around: Literal["paper", "fault"] = "paper", nuisances: bool = True) -> Machine:
    """A machine of the same kind: links within ±10 %, friction within ±20 %.

    Args:
        around: "paper" has friction of three sigmoids, "fault" Coulomb and viscous friction, as scored cases do.
        nuisances: with the small imperfections that a healthy arm has too.
    """
    rng = np.random.default_rng([2004, seed])
    machine = paper_machine()
    links = [Solid.of_link(link).drawn(rng, 0.10).as_link() for link in _LINKS]
    friction: tuple[Friction, ...] = machine.friction
    if around == "fault":
        friction = tuple(CoulombViscous(law.coulomb, law.viscous, float(rng.uniform(80.0, 120.0))) for law in friction)
    machine = replace(machine, robot=with_links(machine.robot, links), friction=tuple(law.drawn(rng, 0.20) for law in friction))
    return with_nuisances(machine, rng) if nuisances else machine


def with_nuisances(machine: Machine, rng: np.random.Generator) -> Machine:
    """The same machine with 1 mN m of cogging, 0.1 % of gain ripple and a little coloured noise at each joint."""
    from bench.nuisances import nuisances_at

    small = tuple(fault for joint in range(1, machine.n + 1) for fault in nuisances_at(machine, joint, rng))
    return replace(machine, standing=(*machine.standing, *small))


def with_links(robot: RobotDescription, links: list[LinkParameters]) -> RobotDescription:
    return replace(robot, joints=tuple(replace(joint, link=link) for joint, link in zip(robot.joints, links, strict=True)))


def machine_of(robot: RobotDescription, seed: int = 0, nuisances: bool = True) -> Machine:
    """A machine of any serial arm. Links that its description lacks, or that cannot exist, are drawn.

    Gains and friction follow from the inertia: each loop gets a natural frequency of 35 rad/s and half of critical damping,
    as the paper's machine has; friction is 8 % of the torque limit, which is three times the torque of gravity and of
    10 rad/s² where the description has none.
    """
    from bench.rigid import typical_inertia, typical_torque

    rng = np.random.default_rng([2005, seed])
    links = [Solid.of_link(joint.link).drawn(rng, 0.10).as_link() if joint.link and Solid.of_link(joint.link).exists
             else _random_link(rng, place, robot.n_joints) for place, joint in enumerate(robot.joints)]
    whole = with_links(robot, links)
    inertia, needed = typical_inertia(whole), typical_torque(whole, acceleration=10.0)
    limit = tuple(joint.torque if math.isfinite(joint.torque) else 3.0 * t
                  for joint, t in zip(robot.joints, needed, strict=True))
    friction = tuple(CoulombViscous(0.08 * top, 0.01 * top).drawn(rng, 0.20) for top in limit)
    gain = observer_gain(SAMPLE_TIME, OBSERVER_NOISE, OBSERVER_JERK)
    machine = Machine(whole, friction, limit, tuple(35.0**2 * m for m in inertia), tuple(35.0 * m for m in inertia),
                      tuple(joint.encoder_resolution or 1e-5 for joint in robot.joints), tuple(3e-4 * top for top in limit),
                      (gain,) * robot.n_joints, tuple(top / max(limit) for top in limit))
    return with_nuisances(machine, rng) if nuisances else machine


def _random_link(rng: np.random.Generator, place: int, n: int) -> LinkParameters:
    """A body of eight random point masses, lighter towards the tip."""
    mass = rng.uniform(0.5, 1.0, 8) * (1.0 - 0.8 * place / n)
    points = rng.uniform(-0.15, 0.15, (8, 3))
    com = mass @ points / mass.sum()
    moments = (points - com).T @ ((points - com) * mass[:, None])
    return Solid(float(mass.sum()), com, np.trace(moments) * np.eye(3) - moments).as_link()

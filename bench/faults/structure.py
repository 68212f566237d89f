"""Faults of the structure: what gives, has play, or is not as the drawing says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, pi, radians, sin, sqrt, tanh
from typing import ClassVar, Self

import numpy as np

from bench.dynamics import motor_share, typical_inertia
from bench.filters import wall
from bench.machine import Case, Fault, Floats, Hooks, Machine, Run
from bench.plan import Base, Plan, Shaft, Twist, plan_of
from pipelines.io.log import Array


def _motor_and_link(case: Case) -> tuple[float, float]:
    """Return the inertia [kg m^2] on the motor's side and on the link's, averaged over postures."""
    motor = motor_share(case.machine.robot, case.index)
    return motor, typical_inertia(case.machine.robot)[case.index] - motor


@dataclass(frozen=True)
class Backlash(Fault):
    """Motor and link with a gap between them, x the angle of the link against its motor:

        τ = -k (|x| - gap/2) sign x - d ẋ, never pulling, on a flank: |x| > gap/2
        τ = -c ẋ of a film of lubricant, everywhere

    Strength is the gap. The flank's compliance shrinks with it and the film thickens as 1/gap, or
    the speed of impact, which goes as the root of the gap, would rule the torque of small gaps.
    """

    gap: float  # [rad]
    stiffness: float  # [N m/rad] k
    damping: float  # [N m s/rad] d
    film: float  # [N m s/rad] c
    motor_inertia: float  # [kg m^2]
    link_inertia: float  # [kg m^2]

    name = "backlash"
    reported = ("gap",)
    frequency: ClassVar[float] = 150.0  # [Hz] of the link on a closed flank, the motor locked
    damping_ratio: ClassVar[float] = 0.3
    film_rate: ClassVar[float] = 100.0
    """[1/s] at which lubricant in the open gap would slow the motor; a crossing takes some 5 to 10
    ms.
    """

    @classmethod
    def full(cls, case: Case) -> Self:
        motor, link = _motor_and_link(case)
        stiffness = link * (2.0 * pi * cls.frequency) ** 2
        reduced = motor * link / (motor + link)
        damping = 2.0 * cls.damping_ratio * sqrt(stiffness * reduced)
        film = cls.film_rate * motor
        return cls(case.joint, 4e-3 * case.angle, stiffness, damping, film, motor, link)

    def scaled(self, factor: float) -> Self:
        """Return it with a gap smaller by `factor`, a stiffer flank and a thicker film."""
        return replace(
            self,
            gap=factor * self.gap,
            stiffness=self.stiffness / factor,
            damping=self.damping / sqrt(factor),
            film=self.film / factor,
        )

    def build(self, plan: Plan, machine: Machine) -> Plan:
        fastest = sqrt(self.stiffness * (1.0 / self.motor_inertia + 2.0 / self.link_inertia))
        plan = plan.with_twist(self.index, Twist(self.motor_inertia))
        return plan.fast_enough_for(max(fastest, 2.0 * self.film / self.motor_inertia))

    def start(self, run: Run) -> Hooks:
        dof, half, film = run.names[f"twist {self.joint}"], 0.5 * self.gap, self.film

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= film * v[dof]
            force[dof] -= wall(q[dof], v[dof], half, self.stiffness, self.damping)

        return Hooks(load=load)


@dataclass(frozen=True)
class BaseResonance(Fault):
    """A soft table: I ẍ = -k x - d ẋ - τ1 about the first joint's axis.

    It has a pole at √(k/I), and a zero below at √(k/(I + J)).

    Strength is 1/I, the frequency stays: 8, 27 and 80 kg m² at ×1, ×0.3 and ×0.1.
    """

    frequency: float  # [Hz] of the pole
    damping_ratio: float  # [1]
    inertia: float  # [kg m^2] I

    name = "base_resonance"
    scope = "arm"
    reported = ("frequency", "damping_ratio", "inertia")

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(None, float(case.rng.uniform(24.0, 32.0)), 0.04, 8.0 * case.size)

    def scaled(self, factor: float) -> Self:
        """Return it heavier by 1/`factor`."""
        return replace(self, inertia=self.inertia / factor)

    def build(self, plan: Plan, machine: Machine) -> Plan:
        first, w = plan.joints[0], 2.0 * pi * self.frequency
        axis = first.rotation @ first.axis if first.revolute else np.array([0.0, 0.0, 1.0])
        damping = 2.0 * self.damping_ratio * w * self.inertia
        base = Base(self.inertia, self.inertia * w**2, damping, axis)
        return replace(plan, bases=(base, *plan.bases))


@dataclass(frozen=True)
class GravityTilt(Fault):
    """A base that is not level: gravity turned by `angle` to `direction`, from the x axis."""

    angle: float  # [rad]
    direction: float  # [rad]

    name = "gravity_tilt"
    scope = "arm"
    scales = ("angle",)
    reported = ("angle", "direction")

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(None, radians(5.0), case.phase())

    def build(self, plan: Plan, machine: Machine) -> Plan:
        size = float(np.linalg.norm(plan.gravity))
        down = plan.gravity / size
        towards = np.array([cos(self.direction), sin(self.direction), 0.0])
        towards = towards - (towards @ down) * down
        towards /= np.linalg.norm(towards)
        return replace(plan, gravity=size * (cos(self.angle) * down + sin(self.angle) * towards))


@dataclass(frozen=True)
class JointElasticity(Fault):
    """Motor and encoder on one side of a spring, the link on the other:

        J_m q̈ = τ - k (q - q_l) - d (q̇ - q̇_l)

    The motor's inertia is taken out of the link: infinitely stiff, it is the healthy machine again.
    Strength is the compliance 1/k. `frequency` is √(k/J)/2π, the motor locked and J the joint's
    inertia averaged over postures.
    """

    stiffness: float  # [N m/rad] k
    damping: float  # [N m s/rad] d
    motor_inertia: float  # [kg m^2] J_m
    link_inertia: float  # [kg m^2] J
    strength: float = 1.0

    name = "joint_elasticity"
    reported = ("stiffness", "damping", "motor_inertia", "frequency")
    damping_ratio: ClassVar[float] = 0.03

    @property
    def frequency(self) -> float:
        """[Hz] of the link, the motor locked."""
        return sqrt(self.stiffness / self.link_inertia) / (2.0 * pi)

    @classmethod
    def full(cls, case: Case) -> Self:
        motor, link = _motor_and_link(case)
        stiffness = link * (2.0 * pi * 30.0) ** 2
        return cls(
            case.joint, stiffness, 2.0 * cls.damping_ratio * sqrt(stiffness * link), motor, link
        )

    def scaled(self, factor: float) -> Self:
        """Return it stiffer: 80 and 50 Hz at ×0.1 and ×0.3, in proportion below ×0.03."""
        strengths = (0.0, 0.03, 0.1, 0.3, 1.0)
        compliances = (0.0, 0.03, (30.0 / 80.0) ** 2, (30.0 / 50.0) ** 2, 1.0)
        now, then = np.interp(
            [self.strength, factor * self.strength], strengths, compliances
        ).tolist()
        softer = then / now
        return replace(
            self,
            stiffness=self.stiffness / softer,
            damping=self.damping / sqrt(softer),
            strength=factor * self.strength,
        )

    def build(self, plan: Plan, machine: Machine) -> Plan:
        fastest = sqrt(self.stiffness * (1.0 / self.motor_inertia + 2.0 / self.link_inertia))
        twist = Twist(self.motor_inertia, self.stiffness, self.damping)
        return plan.with_twist(self.index, twist).fast_enough_for(fastest)


@dataclass(frozen=True)
class LinkLength(Fault):
    """A link not as long as drawn: all that hangs on link k sits `error` further along it.

    Along x of its frame, or in a URDF towards the next joint. The link's own body stays where it is
    on its axis.
    """

    error: float  # [m] true minus nominal
    link: int  # k, 1-based: from joint k to joint k + 1

    name = "link_length"
    scope = "arm"
    scales = ("error",)
    reported = ("error", "link")

    @classmethod
    def full(cls, case: Case) -> Self:
        """Return it at the longest link between joints: the last one's shows in no torque."""
        joints = plan_of(case.machine.robot).joints
        between = range(1, len(joints) - 1) or range(len(joints) - 1)

        def length(k: int) -> float:
            position = joints[k + 1].position
            return float(np.abs(_along(position, case.machine) @ position))

        return cls(None, 0.012 * case.sign(), max(between, key=length) + 1)

    def build(self, plan: Plan, machine: Machine) -> Plan:
        beyond = plan.joints[self.link]
        moved = beyond.position + self.error * _along(beyond.position, machine)
        return plan.with_joint(self.link, replace(beyond, position=moved))


def _along(position: Array, machine: Machine) -> Array:
    """Return the unit vector (3,) along a link whose next joint is at `position` (3,)."""
    length = float(np.linalg.norm(position))
    if machine.robot.convention != "urdf" or length == 0.0:
        return np.array([1.0, 0.0, 0.0])
    return position / length


@dataclass(frozen=True)
class RotorInertia(Fault):
    """A motor behind a gear: its inertia J on the diagonal of the mass matrix.

    It takes no part in the motion of the links before.
    """

    inertia: float  # [kg m^2] J

    name = "rotor_inertia"
    scales = reported = ("inertia",)
    pinion: ClassVar[float] = 0.05  # [m] radius, where the joint is a slide

    @classmethod
    def full(cls, case: Case) -> Self:
        inertia = 6e-3 * case.size
        return cls(case.joint, inertia if case.revolute else inertia / cls.pinion**2)

    def build(self, plan: Plan, machine: Machine) -> Plan:
        joint = plan.joints[self.index]
        return plan.with_joint(self.index, replace(joint, armature=joint.armature + self.inertia))


@dataclass(frozen=True)
class TransmissionCoupling(Fault):
    """A rotor geared to q_i + q_j, a load on both joints with s = v_i + v_j:

        J (q̈_i + q̈_j) + B s + C tanh(w s)

    The inertia is a body to MuJoCo, not a torque. causes.md gives no strength: J is 6 % of what
    joint j moves, B and C are 30 % of its own friction.
    """

    with_joint: int  # i, 1-based
    inertia: float  # [kg m^2] J
    viscous: float  # [N m s/rad] B
    coulomb: float  # [N m] C
    sharpness: float  # [s/rad] w

    name = "transmission_coupling"
    scales = ("inertia", "viscous", "coulomb")
    reported = ("with_joint", "inertia", "viscous", "coulomb")

    @classmethod
    def full(cls, case: Case) -> Self:
        moved, law = typical_inertia(case.machine.robot)[case.index], case.friction
        friction = 0.3 * law.viscous, 0.3 * law.coulomb, law.sharpness
        return cls(case.joint, case.neighbour, 0.06 * moved, *friction)

    def build(self, plan: Plan, machine: Machine) -> Plan:
        shaft = Shaft((self.with_joint - 1, self.index), self.inertia)
        return replace(plan, shafts=(*plan.shafts, shaft))

    def start(self, run: Run) -> Hooks:
        j, i, b, c, w = (
            run.dofs[self.index],
            run.dofs[self.with_joint - 1],
            self.viscous,
            self.coulomb,
            self.sharpness,
        )

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            s = v[i] + v[j]
            torque = b * s + c * tanh(w * s)
            force[i] -= torque
            force[j] -= torque

        return Hooks(load=load)

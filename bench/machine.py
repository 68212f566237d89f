"""The machine and the fault: what every part of the bench works on.

A fault is a frozen dataclass in `faults/`: its strength in physical units, and where it is. It acts
in one of two ways, or both:

    build(plan, machine) -> plan     another machine: bodies, joints, springs, gravity, geometry
    start(run) -> Hooks              what it does while the machine runs; its state is in closures
                                     made here, so that every run starts anew and it stays frozen

    Payload          build: one more body at the tip
    Elastic joint    build: a `Twist` between motor and link
    Backlash         build: a `Twist` without spring; start: `load` pushes where the gap is closed
    Friction         torque, of a `JointLoad`: from time and the joint's position and speed alone
    Hidden state     start: `step` moves it once per inner step, `load` reads it
    Drive            start: `drive` changes the torque on its way to the motor, once per inner step
    Encoder          start: `sense` changes what is read, in place, before it is quantised
    The record       start: `write` changes what is logged, and nothing else

`full` is the fault at the ×1 strength of causes.md at one joint of one machine, phases and the like
drawn; `scaled` makes it weaker by its fields `scales`: near zero it must do almost nothing (no
jump), so a spring's compliance or a motor's lag scales too. `parameters` are
the numbers of the sealed answer, named as in causes.md: the fields `reported`. Prismatic joints:
`case.torque` and `case.angle` fit a strength to the machine.

    @dataclass(frozen=True)
    class TorqueOffset(Fault):
        offset: float  # [N m]

        name = "torque_offset"
        scales = reported = ("offset",)

        @classmethod
        def full(cls, case):
            return cls(case.joint, case.sign() * 0.4 * case.torque)

        def start(self, run):
            def drive(t, torque, q):
                torque[self.index] -= self.offset

            return Hooks(drive=drive)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import tanh
from typing import Any, ClassVar, Self

import numpy as np

from bench.config import CONFIG
from bench.plan import Plan
from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription

Floats = list[float]
Parameters = dict[str, float | tuple[float, ...]]


@dataclass(frozen=True)
class Friction:
    """A torque against the speed, Σ_k f_k tanh(w_k v) + b v: Kostić et al. 2004, eq. (10)."""

    heights: tuple[float, ...]  # [N m] f_k
    sharpnesses: tuple[float, ...]  # [s/rad] w_k, that of the highest term first
    viscous: float  # [N m s/rad] b

    @property
    def coulomb(self) -> float:
        """[N m] its dry part at high speed."""
        return sum(self.heights)

    @property
    def sharpness(self) -> float:
        """[s/rad] inverse of the speed over which its dry part changes sign."""
        return self.sharpnesses[0]

    def law(self) -> Callable[[float], float]:
        """Return the torque [N m] as a function of speed [rad/s], for every stage of RK4."""
        (f0, w0), *others = zip(self.heights, self.sharpnesses, strict=True)
        viscous = self.viscous

        def torque(v: float) -> float:
            dry = f0 * tanh(w0 * v)
            for f, w in others:
                dry += f * tanh(w * v)
            return dry + viscous * v

        return torque

    def drawn(self, rng: np.random.Generator, share: float) -> Friction:
        """Draw a similar law, its torques each within ± `share` of these."""
        *factors, last = (1.0 + rng.uniform(-share, share, len(self.heights) + 1)).tolist()
        heights = tuple(f * factor for f, factor in zip(self.heights, factors, strict=True))
        return replace(self, heights=heights, viscous=self.viscous * last)


def coulomb_viscous(
    coulomb: float = 0.0, viscous: float = 0.0, sharpness: float = 100.0
) -> Friction:
    """Return τ = F_c tanh(w v) + F_v v, in [N m], [N m s/rad] and [s/rad]."""
    return Friction((coulomb,), (sharpness,), viscous)


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
    observer_gain: tuple[tuple[float, float, float], ...]
    joint_factor: tuple[float, ...]  # strength of a fault here, relative to the first joint ("s")
    quantised_torque: bool = True
    delay: int = 0  # samples between q[k] and the tau it leads to, 0 or 1
    standing: tuple[Fault, ...] = ()  # of this machine from its first day: nuisances, a soft base

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.robot.n_joints

    @property
    def torque_resolution(self) -> tuple[float, ...]:
        """[N m] of one bit of the torque command."""
        return tuple(2.0 * limit / 2**CONFIG.command_bits for limit in self.torque_limit)

    @property
    def described(self) -> RobotDescription:
        """The robot as a log describes it: its kinematics and limits, never its links."""
        rows = zip(self.robot.joints, self.torque_limit, self.encoder_resolution, strict=True)
        joints = tuple(
            replace(joint, link=None, torque=limit, encoder_resolution=resolution or None)
            for joint, limit, resolution in rows
        )
        return replace(self.robot, joints=joints)

    @property
    def ideal(self) -> Machine:
        """The same bodies and friction without quantisation, noise and nuisances."""
        none = (0.0,) * self.n
        return replace(
            self, encoder_resolution=none, amplifier_noise=none, quantised_torque=False, standing=()
        )


def listed(strength: float, *values: float) -> float:
    """Return what causes.md lists for the strengths 0, 0.1, 0.3 and 1, straight lines between."""
    return float(np.interp(strength, (0.0, 0.1, 0.3, 1.0), values))


@dataclass(frozen=True)
class Case:
    """The place of a fault: machine, joint, a source of phases, and the healthy torque."""

    machine: Machine
    joint: int | None  # 1-based
    rng: np.random.Generator
    peak_torque: tuple[float, ...]  # [N m] largest of each joint over the healthy logs
    duration: float = 10.0  # [s] of the logs, for what happens at a time of its own

    @property
    def index(self) -> int:
        """0-based joint."""
        return (self.joint or 1) - 1

    @property
    def torque(self) -> float:
        """Size of "s N m" of causes.md: the joint's factor times the machine's size."""
        return self.machine.joint_factor[self.index] * self.size

    @property
    def revolute(self) -> bool:
        """True for a joint that turns."""
        return self.machine.robot.joints[self.index].revolute

    @property
    def angle(self) -> float:
        """Size of a radian of causes.md: 0.1 m along a slide, which moves by tenths of a metre."""
        return 1.0 if self.revolute else 0.1

    @property
    def size(self) -> float:
        """Largest torque relative to the RRR arm's."""
        return max(self.machine.torque_limit) / 60.0

    @property
    def tip_size(self) -> float:
        """Load capacity of the tip relative to the RRR arm's, by the weakest joint."""
        return min(self.machine.torque_limit) / 15.0

    @property
    def friction(self) -> Friction:
        """The joint's friction."""
        return self.machine.friction[self.index]

    @property
    def neighbour(self) -> int:
        """1-based: the joint before this one, or after the first, for what two joints share.

        Raises:
            UsageError: C02, there is only one joint.
        """
        if self.machine.n == 1:
            raise UsageError(
                "C02",
                "two joints share this fault, and the machine has one",
                remedy="choose a fault of one joint, or a machine of two",
            )
        return self.index if self.index else 2

    def phase(self) -> float:
        """Draw an angle [rad]."""
        return float(self.rng.uniform(0.0, 2.0 * np.pi))

    def sign(self) -> float:
        """Draw -1 or 1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def order(self, first: int, end: int) -> float:
        """Draw a whole number of periods a turn, ten times as many a metre along a slide."""
        return float(self.rng.integers(first, end)) * (1.0 if self.revolute else 10.0)


@dataclass(frozen=True, eq=False)
class Run:
    """The running machine as a fault may see it. Lists are live: they hold what is true now."""

    machine: Machine
    model: Any  # mujoco.MjModel
    data: Any  # mujoco.MjData
    names: dict[str, int]  # degree of freedom by name: "joint 1", "twist 1", "base 1", …
    dofs: tuple[int, ...]  # of the machine's own joints
    tip_body: int
    tip: tuple[float, float, float]  # [m] in that body's frame
    substeps: int  # inner steps a sample
    inner_step: float  # [s]
    applied: Floats  # (n,) [N m] torque at the motors in this inner step
    samples: int  # of the whole run
    rng: np.random.Generator  # the fault's own, for what is random in it


@dataclass(frozen=True)
class Hooks:
    """The functions by which a fault acts while the machine runs.

    Lists are changed in place; `q` and `v` hold every degree of freedom, `torque`, `measured` and
    `tau` one number a joint.
    """

    load: Callable[[float, Floats, Floats, Floats], None] | None = None
    """t, q, v, force [N m] on each degree of freedom; every stage of RK4 calls it: fast and
    smooth.
    """
    step: Callable[[float, Floats, Floats], None] | None = None
    """t, q, v at the end of each inner step."""
    drive: Callable[[float, Floats, Floats], None] | None = None
    """t, torque [N m], q at the start of an inner step."""
    sense: Callable[[float, Floats], None] | None = None
    """t, measured [rad], which starts as the truth."""
    write: Callable[[float, Floats], None] | None = None
    """t, tau [N m] about to be logged."""


@dataclass(frozen=True)
class Fault(ABC):
    """A physical fault at one joint, or of the whole arm."""

    joint: int | None  # 1-based; None where it is of the whole arm

    name: ClassVar[str]  # identifier of causes.md; outside the library: what it is
    scope: ClassVar[str] = "joint"  # or "arm"
    known: ClassVar[bool] = (
        True  # False: no candidate of causes.md describes it, the right answer is "unknown"
    )
    scales: ClassVar[tuple[str, ...]] = ()  # fields proportional to the strength
    reported: ClassVar[tuple[str, ...]] = ()  # fields that a finding reports

    @classmethod
    @abstractmethod
    def full(cls, case: Case) -> Self:
        """Return the fault at the ×1 strength of causes.md."""

    def scaled(self, factor: float) -> Self:
        """Return the fault at `factor` times the strength."""
        return replace(self, **{field: factor * getattr(self, field) for field in self.scales})

    def parameters(self) -> Parameters:
        """Return the true values of what a finding reports."""
        return {field: getattr(self, field) for field in self.reported}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        """Return the machine with this fault in its bodies."""
        return plan

    def start(self, run: Run) -> Hooks:
        """Return what it does while the machine runs, its state made anew."""
        return Hooks()

    @property
    def index(self) -> int:
        """0-based joint.

        Raises:
            ValueError: it is of the whole arm.
        """
        if self.joint is None:
            raise ValueError(f"{self.name} has no joint of its own")
        return self.joint - 1


@dataclass(frozen=True)
class JointLoad(Fault):
    """A load without memory: a torque from time and the joint's own position and speed."""

    @abstractmethod
    def torque(self, t: float, q: float, v: float) -> float:
        """Return what the motor has to give more [N m], at `t` [s], `q` [rad] and `v` [rad/s]."""

    def start(self, run: Run) -> Hooks:
        """Return the load at the joint."""
        dof, torque = run.dofs[self.index], self.torque

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= torque(t, q[dof], v[dof])

        return Hooks(load=load)

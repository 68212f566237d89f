"""What every fault offers. One file in `faults/` is one fault; a new file is a new fault.

A fault is a frozen dataclass: its strength in physical units, and where it sits. It says how it enters in one of two
ways, or both:

    build(plan, machine) -> plan     another machine: bodies, joints, springs, gravity, geometry (see plan.py)
    start(run) -> Hooks              what it does while the machine runs; its memory lives in the closures that it
                                     makes here, so that every run starts anew and the fault itself stays frozen

    Payload          build: one more body at the tip
    Elastic joint    build: a `Twist` between motor and link
    Backlash         build: a `Twist` without spring; start: `load` pushes where the gap is closed
    Friction         start: `load`, a force from the true speed (stages of RK4 ask for it: keep it fast and smooth)
    Hidden state     start: `step` moves it once per inner step, `load` reads it
    Drive            start: `drive` changes the torque on its way to the motor, once per inner step
    Encoder          start: `sense` changes what is read, in place, before it is quantised
    The record       start: `write` changes what is logged, and nothing else

`full` is the fault at the ×1 strength of causes.md at one joint of one machine, phases and the like drawn; `scaled`
makes it weaker: at a strength near zero it must do almost nothing (no jump), so whatever comes with it (a spring's
compliance, a motor's lag) scales too. `parameters` are the numbers of the sealed answer, named as in causes.md.
Strengths that causes.md lists for ×1, ×0.3 and ×0.1 one by one follow that list (`listed`). Prismatic joints: `case.torque`
and `case.angle` fit a strength to the machine.

    @dataclass(frozen=True)
    class TorqueOffset(Fault):
        offset: float  # [N m]
        name = "torque_offset"

        @classmethod
        def full(cls, case):
            return cls(case.joint, offset=case.sign() * 0.4 * case.torque)

        def scaled(self, factor):
            return replace(self, offset=factor * self.offset)

        def parameters(self):
            return {"offset": self.offset}

        def start(self, run):
            dof, offset = run.dofs[self.index], self.offset

            def load(t, q, v, force):
                force[dof] -= offset

            return Hooks(load=load)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np

from bench.machine import Machine
from bench.plan import Plan
from pipelines.errors import UsageError

__all__ = ["Case", "Fault", "Hooks", "Parameters", "Run", "listed"]

Floats = list[float]
Parameters = dict[str, float | tuple[float, ...]]


def listed(strength: float, *values: float) -> float:
    """What causes.md lists for the strengths 0, 0.1, 0.3 and 1, straight lines between."""
    return float(np.interp(strength, (0.0, 0.1, 0.3, 1.0), values))


@dataclass(frozen=True)
class Case:
    """Where a fault is put: a machine, a joint, a source of phases, and the torque the machine needs when it is well."""

    machine: Machine
    joint: int | None  # 1-based
    rng: np.random.Generator
    peak_torque: tuple[float, ...]  # [N m] largest of each joint over the healthy logs
    duration: float = 10.0  # [s] of the logs, for what happens at a time of its own

    @property
    def index(self) -> int:
        return (self.joint or 1) - 1

    @property
    def torque(self) -> float:
        """What "s N m" of causes.md means here: the joint's factor, grown with the machine's torque; 1 at the RRR's waist."""
        return self.machine.joint_factor[self.index] * self.size

    @property
    def angle(self) -> float:
        """What a radian of causes.md means here: 1 where the joint turns, 0.1 m where it slides, for slides move by tenths of a
        metre where joints turn by radians."""
        return 1.0 if self.machine.robot.joints[self.index].revolute else 0.1

    @property
    def size(self) -> float:
        """How strong the machine is beside the RRR arm."""
        return max(self.machine.torque_limit) / 60.0

    @property
    def tip_size(self) -> float:
        """What its tip can bear beside the RRR arm's, by the weakest joint."""
        return min(self.machine.torque_limit) / 15.0

    @property
    def coulomb(self) -> float:
        """The joint's dry friction [N m]."""
        return self.machine.friction[self.index].coulomb

    @property
    def viscous(self) -> float:
        """The joint's viscous friction [N m s/rad]."""
        return self.machine.friction[self.index].viscous

    @property
    def sharpness(self) -> float:
        """Inverse of the speed over which the joint's dry friction changes sign [s/rad]."""
        return self.machine.friction[self.index].sharpness

    @property
    def neighbour(self) -> int:
        """1-based: the joint before this one, or after the first, for what two joints share.

        Raises:
            UsageError: C02, there is only one joint.
        """
        if self.machine.n < 2:
            raise UsageError("C02", "two joints share this fault, and the machine has one",
                             remedy="choose a fault of one joint, or a machine of two")
        return self.index if self.index else 2

    def phase(self) -> float:
        return float(self.rng.uniform(0.0, 2.0 * np.pi))

    def sign(self) -> float:
        return float(self.rng.choice([-1.0, 1.0]))


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
    sample_time: float  # [s] of the controller
    inner_step: float  # [s]
    applied: Floats  # (n,) [N m] torque at the motors in this inner step
    duration: float  # [s] of the whole run
    rng: np.random.Generator  # the fault's own, for what is random in it


@dataclass(frozen=True)
class Hooks:
    """What a fault does while the machine runs. Lists are changed in place; `q` and `v` hold every degree of freedom,
    `torque`, `measured` and `tau` one number a joint."""

    load: Callable[[float, Floats, Floats, Floats], None] | None = None  # t, q, v, force [N m] on each degree of freedom
    step: Callable[[float, Floats, Floats], None] | None = None  # t, q, v at the end of each inner step
    drive: Callable[[float, Floats, Floats], None] | None = None  # t, torque [N m], q at the start of an inner step
    sense: Callable[[float, Floats], None] | None = None  # t, measured [rad], which starts as the truth
    write: Callable[[float, Floats], None] | None = None  # t, tau [N m] about to be logged


@dataclass(frozen=True)
class Fault(ABC):
    """A physical fault at one joint, or of the whole arm."""

    joint: int | None  # 1-based; None where scope is "arm"

    name: ClassVar[str]  # identifier of causes.md and the file's name; outside the library: what it is
    scope: ClassVar[Literal["joint", "arm"]] = "joint"
    known: ClassVar[bool] = True  # False: no candidate of causes.md describes it, the right answer is "unknown"

    @classmethod
    @abstractmethod
    def full(cls, case: Case) -> Self:
        """Itself at the ×1 strength of causes.md."""

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Itself at `factor` times the strength."""

    @abstractmethod
    def parameters(self) -> Parameters:
        """The true values of what a finding reports."""

    def build(self, plan: Plan, machine: Machine) -> Plan:
        """The machine with this fault in its bodies."""
        return plan

    def start(self, run: Run) -> Hooks:
        """What it does while the machine runs, memory made anew."""
        return Hooks()

    @property
    def index(self) -> int:
        """0-based joint.

        Raises:
            ValueError: it belongs to the whole arm.
        """
        if self.joint is None:
            raise ValueError(f"{self.name} has no joint of its own")
        return self.joint - 1

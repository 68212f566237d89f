"""Faults of what the arm carries or what pushes at it: bodies at the tip, contacts, springs."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, pi, sin, sqrt, tanh
from typing import ClassVar, Self

import mujoco
import numpy as np

from bench.filters import wall
from bench.machine import Case, Fault, Floats, Hooks, JointLoad, Machine, Parameters, Run
from bench.plan import Mobility, Plan, Solid, ball

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Contact(Fault):
    """Something that pushes the tip for a moment: F sin(π (t - t0)/D) while 0 ≤ t - t0 ≤ D.

    Its direction is fixed; the joints feel Jᵀ F.
    """

    start_time: float  # [s] t0
    duration: float  # [s] D
    force: float  # [N] F
    direction: Vector  # unit vector in the base frame, in which the arm is pushed

    name = "contact"
    scope = "arm"
    scales = ("force",)

    @classmethod
    def full(cls, case: Case) -> Self:
        x, y, z = case.rng.normal(size=3).tolist()
        length = (x * x + y * y + z * z) ** 0.5
        begin, lasting = case.rng.uniform(0.2, 0.6) * case.duration, case.rng.uniform(0.1, 0.3)
        way = (x / length, y / length, z / length)
        return cls(None, float(begin), float(lasting), 25.0 * case.tip_size, way)

    def parameters(self) -> Parameters:
        return {"start": self.start_time, "duration": self.duration, "force": self.force}

    def start(self, run: Run) -> Hooks:
        model, data, body, tip = run.model, run.data, run.tip_body, np.array(run.tip)
        push, jacobian = self.force * np.array(self.direction), np.zeros((3, run.model.nv))

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            phase = (t - self.start_time) / self.duration
            if not 0.0 < phase < 1.0:
                return
            place = data.xpos[body] + data.xmat[body].reshape(3, 3) @ tip
            mujoco.mj_jac(model, data, jacobian, None, place, body)
            for dof, torque in enumerate((sin(pi * phase) * (push @ jacobian)).tolist()):
                force[dof] += torque

        return Hooks(load=load)


@dataclass(frozen=True)
class LeakingCounterbalance(Fault):
    """A gas strut that pushes back while its pressure escapes through an orifice: τ = k p, a load.

    dp/dt = v - c sign(p) √|p|, c = 1 √rad/s
    """

    stiffness: float  # [N m/rad] k

    name = "leaking_counterbalance"
    known = False
    scales = reported = ("stiffness",)
    leak: ClassVar[float] = 1.0  # [rad^½/s] c

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 2.5 * case.torque / case.angle)

    def start(self, run: Run) -> Hooks:
        dof, k, h = run.dofs[self.index], self.stiffness, run.inner_step
        pressure, since = 0.0, float(run.data.qpos[dof])

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal pressure, since
            pressure += q[dof] - since
            escaped = min(h * self.leak * sqrt(abs(pressure)), abs(pressure))
            pressure -= copysign(escaped, pressure)
            since = q[dof]

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= k * (pressure + q[dof] - since)

        return Hooks(load=load, step=step)


@dataclass(frozen=True)
class Payload(Fault):
    """A body at the tip that was not there before: a solid ball, its centre a little off."""

    mass: float  # [kg]
    centre: Vector  # [m] in the tool frame

    name = "payload"
    scope = "arm"
    scales = ("mass",)
    radius: ClassVar[float] = 0.04  # [m]

    @classmethod
    def full(cls, case: Case) -> Self:
        x, y, z = case.rng.uniform(-0.03, 0.03, 3).tolist()
        return cls(None, 0.5 * case.tip_size, (x, y, z))

    def parameters(self) -> Parameters:
        x, y, z = self.centre
        return {"mass": self.mass, "first_moment": (self.mass * x, self.mass * y, self.mass * z)}

    def build(self, plan: Plan, machine: Machine) -> Plan:
        centre = plan.tip + plan.joints[-1].link_rotation @ np.array(self.centre)
        return plan.with_tip_load(ball(self.mass, centre, self.radius))


@dataclass(frozen=True)
class RattlingMass(Fault):
    """A loose ball in the last link that slides across ± half a gap, from wall to wall."""

    mass: float  # [kg]
    gap: float  # [m]
    axis: Vector  # unit vector in the last body's frame

    name = "rattling_mass"
    scope = "arm"
    known = False
    scales = ("mass",)
    reported = ("mass", "gap")
    frequency: ClassVar[float] = 60.0  # [Hz] of the ball against a wall
    damping_ratio: ClassVar[float] = 0.3
    radius: ClassVar[float] = 0.02  # [m]

    @classmethod
    def full(cls, case: Case) -> Self:
        turn = case.phase()
        return cls(None, 0.4 * case.tip_size, 0.02, (float(np.cos(turn)), float(np.sin(turn)), 0.0))

    def build(self, plan: Plan, machine: Machine) -> Plan:
        free = Mobility("rattle", np.array(self.axis), revolute=False)
        return plan.with_tip_load(ball(self.mass, plan.tip, self.radius), free)

    def start(self, run: Run) -> Hooks:
        dof, half, w = run.names["rattle"], 0.5 * self.gap, 2.0 * pi * self.frequency
        k, d = self.mass * w**2, 2.0 * self.damping_ratio * w * self.mass

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= wall(q[dof], v[dof], half, k, d)

        return Hooks(load=load)


@dataclass(frozen=True)
class SloshingLoad(Fault):
    """Liquid in a vessel at the tip: the part that swings, a mass at the end of a sprung arm l.

    Its frequency √(k/(m l²)) is the same whichever way the vessel leans; the liquid at rest counts
    as payload.
    """

    mass: float  # [kg] m
    length: float  # [m] l
    axis: Vector  # unit vector in the last body's frame, about which it swings
    across: Vector  # unit vector along the arm, at right angles to it

    name = "sloshing_load"
    scope = "arm"
    known = False
    scales = ("mass",)
    reported = ("mass", "length", "frequency")
    frequency: ClassVar[float] = 2.0  # [Hz]
    damping_ratio: ClassVar[float] = 0.03

    @classmethod
    def full(cls, case: Case) -> Self:
        axis, across = np.linalg.qr(case.rng.normal(size=(3, 2)))[0].T.tolist()
        return cls(None, 0.5 * case.tip_size, 0.08, tuple(axis), tuple(across))

    def build(self, plan: Plan, machine: Machine) -> Plan:
        w, inertia = 2.0 * np.pi * self.frequency, self.mass * self.length**2
        damping = 2.0 * self.damping_ratio * w * inertia
        free = Mobility("slosh", np.array(self.axis), stiffness=inertia * w**2, damping=damping)
        centre = plan.tip + self.length * np.array(self.across)
        return plan.with_tip_load(
            Solid(self.mass, centre, 1e-2 * inertia * np.eye(3)), free, plan.tip
        )


@dataclass(frozen=True)
class Spring(JointLoad):
    """A hose that pulls the joint back, the harder the further: τ = k u (x + 0.15 y³), a load.

    x = (q - q0)/u, y = 2 tanh(x/2): a cubic spring that goes on straight after two radians, where a
    cubic would tear the hose.
    """

    stiffness: float  # [N m/rad] k, at rest
    rest_angle: float  # [rad] q0
    unit: float = 1.0  # [rad] u, or the [m] that take its place

    name = "spring"
    scales = ("stiffness",)
    reported = ("stiffness", "rest_angle")
    hardening: ClassVar[float] = 0.15  # [1]
    reach: ClassVar[float] = 2.0  # [1] over which it hardens

    @classmethod
    def full(cls, case: Case) -> Self:
        rest = case.angle * float(case.rng.uniform(-0.5, 0.5))
        return cls(case.joint, 2.5 * case.torque / case.angle, rest, case.angle)

    def torque(self, t: float, q: float, v: float) -> float:
        x = (q - self.rest_angle) / self.unit
        hard = self.hardening * (self.reach * tanh(x / self.reach)) ** 3
        return self.stiffness * self.unit * (x + hard)

"""Faults of friction, in bearings, seals, gears, lubricant and cables; torques are loads."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, copysign, cos, e, exp, expm1, log, pi, remainder, sqrt, tanh
from typing import ClassVar, Self

import mujoco
import numpy as np

from bench.machine import Case, Fault, Floats, Hooks, JointLoad, Parameters, Run, listed


@dataclass(frozen=True)
class AsymmetricFriction(JointLoad):
    """A lip that rubs in one direction of motion and lifts in the other:

        τ = ½ (1 + tanh(s w v)) (C tanh(w v) + B v), s = ±1

    Friction is larger by C and B in the direction of s, and as it was in the other.
    """

    direction: float  # s, 1 or -1
    coulomb: float  # [N m] C
    viscous: float  # [N m s/rad] B
    sharpness: float  # [s/rad] w

    name = "asymmetric_friction"
    scales = ("coulomb", "viscous")

    @classmethod
    def full(cls, case: Case) -> Self:
        law = case.friction
        return cls(case.joint, case.sign(), 0.2 * law.coulomb, 0.2 * law.viscous, law.sharpness)

    def parameters(self) -> Parameters:
        return {
            "coulomb_difference": self.direction * self.coulomb,
            "viscous_difference": self.direction * self.viscous,
        }

    def torque(self, t: float, q: float, v: float) -> float:
        side = tanh(self.sharpness * v)
        return 0.5 * (1.0 + self.direction * side) * (self.coulomb * side + self.viscous * v)


@dataclass(frozen=True)
class ConcaveFriction(JointLoad):
    """Grease that thins as it is sheared: τ = A v/(|v| + 0.549 v_0).

    Cross 1965, viscosity falling as 1/(1 + |v|/v_c).

    It levels off at A and is half of that where A tanh(v/v_0) would be.
    """

    amplitude: float  # [N m] A
    speed: float  # [rad/s] v_0

    name = "concave_friction"
    scales = ("amplitude",)
    reported = ("amplitude", "speed")
    half: ClassVar[float] = 0.5493061443340549  # tanh x = 1/2

    @classmethod
    def full(cls, case: Case) -> Self:
        speed = case.angle * float(case.rng.uniform(0.3, 0.6))
        return cls(case.joint, 0.4 * case.friction.coulomb, speed)

    def torque(self, t: float, q: float, v: float) -> float:
        return self.amplitude * v / (abs(v) + self.half * self.speed)


@dataclass(frozen=True)
class PositionFriction(JointLoad):
    """Bands of wear along the turn where the joint rubs harder, k of them:

        τ = H ¼ (1 + cos k(q - q_w))² tanh(w v)

    ¼ (1 + cos x)² = 3/8 + ½ cos x + ⅛ cos 2x, so the main harmonic is A sin(k q + φ) with A = H/2,
    φ = π/2 - k q_w; a quarter of it is in the second, and the mean adds to Coulomb friction.
    """

    amplitude: float  # [N m] A of the main harmonic
    order: float  # [1/rev] k
    centre: float  # [rad] q_w
    sharpness: float  # [s/rad] w

    name = "position_friction"
    scales = ("amplitude",)

    @classmethod
    def full(cls, case: Case) -> Self:
        law, order = case.friction, case.order(1, 4)
        return cls(case.joint, 0.4 * law.coulomb, order, case.phase(), law.sharpness)

    def parameters(self) -> Parameters:
        phase = remainder(0.5 * pi - self.order * self.centre, 2.0 * pi)
        return {"amplitude": self.amplitude, "order": self.order, "phase": phase}

    def torque(self, t: float, q: float, v: float) -> float:
        band = (1.0 + cos(self.order * (q - self.centre))) ** 2
        return 0.5 * self.amplitude * band * tanh(self.sharpness * v)


@dataclass(frozen=True)
class QuadraticDrag(JointLoad):
    """Oil that is churned: τ = c v √(v² + v_e²), in eddies above v_e and viscous below."""

    coefficient: float  # [N m s^2/rad^2] c
    eddies: float = 0.2  # [rad/s] v_e, slower flow is laminar; on a slide a tenth of it

    name = "quadratic_drag"
    scales = reported = ("coefficient",)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.08 * case.torque / case.angle**2, cls.eddies * case.angle)

    def torque(self, t: float, q: float, v: float) -> float:
        return self.coefficient * v * sqrt(v**2 + self.eddies**2)


@dataclass(frozen=True)
class Stribeck(JointLoad):
    """A hump of dry friction without a film of lubricant: τ = A tanh(w v)/(1 + (e - 1)(v/v_s)²).

    The form of Hess & Soom 1990, with 1/e of the hump left at v_s.
    """

    amplitude: float  # [N m] A
    speed: float  # [rad/s] v_s
    sharpness: float  # [s/rad] w, of all the joint's dry friction

    name = "stribeck"
    scales = ("amplitude",)
    reported = ("amplitude", "speed")

    @classmethod
    def full(cls, case: Case) -> Self:
        law, speed = case.friction, case.angle * float(case.rng.uniform(0.1, 0.3))
        return cls(case.joint, 0.4 * law.coulomb, speed, law.sharpness)

    def torque(self, t: float, q: float, v: float) -> float:
        falling = (e - 1.0) / self.speed**2
        return self.amplitude * tanh(self.sharpness * v) / (1.0 + falling * v**2)


@dataclass(frozen=True)
class ViscousDrift(JointLoad):
    """Grease that warms up and thins while the log runs: F_v(t) = F_v (1 + r (1 - e^(-t/T))).

    It is cold at the start of every log, and settled after a few T.
    """

    relative_change: float  # [1] r
    time_constant: float  # [s] T
    viscous: float  # [N m s/rad] F_v at the start

    name = "viscous_drift"
    scales = ("relative_change",)
    reported = ("relative_change", "time_constant")

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, -0.5, 15.0, case.friction.viscous)

    def torque(self, t: float, q: float, v: float) -> float:
        change, rate = self.relative_change * self.viscous, 1.0 / self.time_constant
        return -(change * expm1(-rate * t) * v)


@dataclass(frozen=True)
class LoadFriction(Fault):
    """Teeth and bearings that rub with the torque that passes them: τ = µ |τ_l| tanh(w v).

    τ_l is the torque that truly reached the bodies beyond in the inner step before, MuJoCo's
    inverse dynamics at the motion that came about: noise, cogging and every other fault are in it.
    """

    mu: float  # [1] µ
    sharpness: float  # [s/rad] w

    name = "load_friction"
    scales = reported = ("mu",)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.06, case.friction.sharpness)

    def start(self, run: Run) -> Hooks:
        dof, w, model, data = run.dofs[self.index], self.sharpness, run.model, run.data
        demanded, pressed = np.zeros(run.model.nv), 0.0

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal pressed
            mujoco.mj_rne(model, data, 1, demanded)
            pressed = self.mu * abs(float(demanded[dof]))

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= pressed * tanh(w * v[dof])

        return Hooks(load=load, step=step)


@dataclass(frozen=True)
class Presliding(Fault):
    """Bristles that bend before the joint slides, instead of a part F of dry friction:

        τ = F (z + T_d ż)/z_s - F tanh(w v),  ż = v (1 - α(z, v) |z|/z_s),  T_d = z_s/(10 rad/s)
        α = 0 for |z| < z_s/2 or z v ≤ 0;  ½ (1 - cos 2π(|z|/z_s - ½)) up to |z| = z_s

    LuGre's, which do not creep (Dupont, Hayward, Armstrong & Altpeter 2002). After a reversal the
    force is zero when the joint has moved by z_s = x_c ln 2, as with Dahl's model of distance x_c.
    F/F_c = x_c/(x_c + 6 mrad): where contacts hardly bend, a film keeps dry friction what it was.
    On a slide all lengths and speeds are those of its unit.
    """

    strength: float  # [1]
    dry: float  # [N m] the joint's whole dry friction F_c
    sharpness: float  # [s/rad] w
    unit: float = 1.0  # [rad], or the [m] that take its place

    name = "presliding"
    scales = ("strength",)
    reported = ("distance", "amplitude")
    film: ClassVar[float] = (
        6e-3  # [rad] presliding distance at which bristles bear half of the dry friction
    )
    fast: ClassVar[float] = 10.0  # [rad/s] at which damping would equal the bristles' force
    elastic: ClassVar[float] = 0.5  # of z_s, up to which nothing slides
    far: ClassVar[float] = 8.0  # times z_s, after which it slides

    @property
    def distance(self) -> float:
        """[rad] x_c."""
        return self.unit * listed(self.strength, 0.0, 3e-3, 10e-3, 30e-3)

    @property
    def amplitude(self) -> float:
        """[N m] F."""
        return self.dry * self.distance / (self.distance + self.unit * self.film)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 1.0, case.friction.coulomb, case.friction.sharpness, case.angle)

    def start(self, run: Run) -> Hooks:
        dof, f, w = run.dofs[self.index], self.amplitude, self.sharpness
        largest, damping = self.distance * log(2.0), f / (self.unit * self.fast)
        # z/z_s and q at the end of the last inner step, and dz/dq from there.
        bent, since, free = 0.0, float(run.data.qpos[dof]), 1.0

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal bent, since, free
            bent = _travelled(bent, (q[dof] - since) / largest)
            since, free = q[dof], _bending(bent, v[dof])

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            # Within the inner step the bristles go on bending with the position that each stage of
            # RK4 tries.
            now = max(-1.0, min(1.0, bent + free * (q[dof] - since) / largest))
            force[dof] -= f * (now - tanh(w * v[dof])) + damping * free * v[dof]

        return Hooks(load=load, step=step)


def _bending(z: float, way: float) -> float:
    """Return dz/dq, z in units of z_s, when moving to the side of `way`."""
    size, elastic = abs(z), Presliding.elastic
    if size < elastic or z * way <= 0.0:
        return 1.0
    return 1.0 - size * 0.5 * (1.0 - cos(pi * (min(size, 1.0) - elastic) / (1.0 - elastic)))


def _travelled(z: float, way: float) -> float:
    """Return z after a travel `way`, both in units of z_s, by the midpoint rule in tenths of it."""
    if abs(way) > Presliding.far:
        return copysign(1.0, way)
    parts = ceil(abs(way) / 0.1)
    for _ in range(parts):
        z += way / parts * _bending(z + 0.5 * way / parts * _bending(z, way), way)
    return max(-1.0, min(1.0, z))


@dataclass(frozen=True)
class SelfHeating(Fault):
    """Dry friction that falls with the warmth of the joint's own losses:

    τ = -γ F_c (1 - e^-θ) tanh(w v),  dθ/dt = (|v|/v_w - θ)/T
    """

    share: float  # [1] γ of the dry friction that heat takes away
    dry: float  # [N m] F_c
    warming: float  # [rad/s] v_w at which θ = 1 in the long run
    sharpness: float  # [s/rad] w

    name = "self_heating"
    known = False
    scales = ("share",)
    reported = ("share", "time_constant")
    time_constant: ClassVar[float] = 3.0  # [s] T

    @classmethod
    def full(cls, case: Case) -> Self:
        law = case.friction
        return cls(case.joint, 0.8, law.coulomb, 0.5 * case.angle, law.sharpness)

    def start(self, run: Run) -> Hooks:
        dof, gone, w = run.dofs[self.index], self.share * self.dry, self.sharpness
        rate, warmth = run.inner_step / self.time_constant, 0.0

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal warmth
            warmth += rate * (abs(v[dof]) / self.warming - warmth)

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] += gone * (1.0 - exp(-warmth)) * tanh(w * v[dof])

        return Hooks(load=load, step=step)


@dataclass(frozen=True)
class StickingSeal(Fault):
    """A seal that sticks the longer it has rested: τ = A s tanh(w v), with the bond s of 0 to 1:

    ds/dt = (1 - s)/T_d /(1 + (v/v_s)⁴) - s |v|/x_t
    """

    torque: float  # [N m] A
    sharpness: float  # [s/rad] w

    name = "sticking_seal"
    known = False
    scales = reported = ("torque",)
    slow: ClassVar[float] = 0.05  # [rad/s] v_s, below which the seal bonds
    dwell: ClassVar[float] = 0.1  # [s] T_d in which it bonds
    tear: ClassVar[float] = 0.2  # [rad] x_t of travel that tears it loose again

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 1.0 * case.friction.coulomb, case.friction.sharpness)

    def start(self, run: Run) -> Hooks:
        dof, a, w, h, bond = run.dofs[self.index], self.torque, self.sharpness, run.inner_step, 0.0

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal bond
            bonding = (1.0 - bond) / self.dwell / (1.0 + (v[dof] / self.slow) ** 4)
            bond += h * (bonding - bond * abs(v[dof]) / self.tear)

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[dof] -= a * bond * tanh(w * v[dof])

        return Hooks(load=load, step=step)


@dataclass(frozen=True)
class RelativeDamper(Fault):
    """A strut between two links that drags with the root of their relative speed s = v_j - v_i:

        τ = c s/(s² + v_n²)^¼

    It loads joint j, and joint i with its opposite; at speed it is c √|s| sign s.
    """

    with_joint: int  # i, 1-based
    coefficient: float  # [N m √(s/rad)] c

    name = "relative_damper"
    known = False
    scales = ("coefficient",)
    reported = ("with_joint", "coefficient")
    slow: ClassVar[float] = 0.02  # [rad/s] v_n, below which the fluid is Newtonian

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, case.neighbour, 0.6 * case.torque / case.angle**0.5)

    def start(self, run: Run) -> Hooks:
        i, j, c = run.dofs[self.with_joint - 1], run.dofs[self.index], self.coefficient
        newtonian = self.slow * self.slow

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            s = v[j] - v[i]
            torque = c * s / (s * s + newtonian) ** 0.25
            force[j] -= torque
            force[i] += torque

        return Hooks(load=load)


@dataclass(frozen=True)
class CableHysteresis(Fault):
    """Cables over two joints that rub as they bend: A z on both, z of Bouc & Wen 1976, exponent 2:

    dz/dx = (1 - (β sgn(z ẋ) + γ) z²)/x_y,  x = q_i + q_j,  β = 0.7, γ = 1 - β, so that the loop
    closes at z = ±1
    """

    with_joint: int  # i, 1-based
    torque: float  # [N m] A
    bend: float  # [rad] x_y

    name = "cable_hysteresis"
    known = False
    scales = ("torque",)
    reported = ("with_joint", "torque", "bend")
    beta: ClassVar[float] = 0.7

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, case.neighbour, 0.6 * case.torque, 0.4 * case.angle)

    def start(self, run: Run) -> Hooks:
        i, j, a, bend = run.dofs[self.with_joint - 1], run.dofs[self.index], self.torque, self.bend
        z, since = 0.0, float(run.data.qpos[i] + run.data.qpos[j])

        def step(t: float, q: Floats, v: Floats) -> None:
            nonlocal z, since
            bent = q[i] + q[j] - since
            halfway = z + 0.5 * bent * self._slope(z, bent) / bend
            z += bent * self._slope(halfway, bent) / bend
            since = q[i] + q[j]

        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            force[i] -= a * z
            force[j] -= a * z

        return Hooks(load=load, step=step)

    def _slope(self, z: float, way: float) -> float:
        """Return x_y dz/dx."""
        beta = self.beta if z * way > 0.0 else -self.beta
        return 1.0 - (beta + 1.0 - self.beta) * z * z

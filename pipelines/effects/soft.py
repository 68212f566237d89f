"""What gives way like a spring: a joint between its motor and its link, and the base of the arm."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isfinite, pi, sqrt
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion, RigidBody
from pipelines.dynamics.perturbation import (
    perturbed_by,
    rate_of,
    rigid_slopes,
    rigid_torque,
    shifted,
    torque_slopes,
)
from pipelines.effects.base import ArmModel, Effect, Hooks, Values, friction_at
from pipelines.effects.hooks import DriveApart

__all__ = ["BaseResonance", "JointElasticity", "deflection", "oscillation"]

_FIRST = 0  # numerics: the joint whose axis the base turns about
_ROUNDS = 3  # numerics: each leaves what is of higher order in the deflection
_SETTLED = 1e-6  # numerics: of the deflection: less is no correction
_LEAST = 0.1  # numerics: of the inertia that a joint feels: what stays beyond its spring at least


@dataclass(frozen=True)
class JointElasticity(Effect):
    """k x + d ẋ + τ_link(q + x) = 0, x = q_link - q.

    Torque, friction and encoder sit on the motor's side. τ_link is the rigid torque of the joint
    without its motor, τ_j - J_m q̈_j. To first order

        x = -(τ_j - J_m q̈_j)/k,    τ = 1/k (P_j(-τ_j) + J_m P_j(q̈_j) - J_m ẍ k)

    Exactly, x is solved from sample to sample. The frequency is √(k/J)/2π, J the link's inertia
    averaged over the motion, the motor locked.
    """

    damping: float = 0.0  # d [N m s/rad]
    motor_inertia: float = 0.0  # J_m [kg m^2]
    # J [kg m^2]; what the frequency follows from
    link_inertia: float = field(default=1.0, compare=False)

    name = "joint_elasticity"
    evidence = "frequency responses"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.several([self], motion, arm)[0]

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """All springs feel the same torque, which has the same slopes for all; d = x k [N m]."""
        force, found = self.own(rigid_torque(arm.body, arm.p, motion)), []
        slopes = rigid_slopes(arm.body, arm.p, motion, self.index)
        for shape in shapes:
            d = shape.motor_inertia * self.own(motion.ddq) - force
            rate = rate_of(d, motion.t)
            second = rate_of(rate, motion.t)
            tau = perturbed_by(slopes, d, rate, second)
            tau[:, self.index] -= shape.motor_inertia * second
            found.append(tau[..., None])
        return found

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """No motor, a light one and one of a third of what the joint feels; lightly damped."""
        felt = _felt(arm, motion.q, self.index)
        for share in (0.0, 0.1, 0.3):
            yield replace(self, motor_inertia=share * felt, link_inertia=(1.0 - share) * felt)

    def amplitudes(self, values: Values) -> Array:
        return np.array([1.0 / values["stiffness"]])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        compliance = float(amplitudes[0])
        stiffness = 1.0 / compliance if compliance else inf
        frequency = sqrt(max(stiffness / self.link_inertia, 0.0)) / (2.0 * pi)
        return {
            "stiffness": stiffness,
            "damping": self.damping,
            "frequency": frequency,
            "motor_inertia": self.motor_inertia,
        }

    def at(self, values: Values) -> Self:
        k, f = values["stiffness"], values["frequency"]
        known = 0.0 < k < inf and 0.0 < f < inf
        link = k / (2.0 * pi * f) ** 2 if known else self.link_inertia
        return replace(
            self,
            damping=values["damping"],
            motor_inertia=values["motor_inertia"],
            link_inertia=link,
        )

    def torque(self, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Return τ(q + x) - τ(q) of the rigid arm; the motor does not follow x."""
        if not isfinite(values["stiffness"]):
            return np.zeros_like(motion.q)
        motor, spring = values["motor_inertia"], (values["stiffness"], values["damping"])
        x = deflection(arm.body, arm.p, motion, self.index, *spring, -motor)
        more = _moved_by(arm, motion, self.index, x)
        more[:, self.index] -= motor * x[2]
        return more

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the hooks of an arm that is the links; the motor is two states, with friction."""
        k, d = values["stiffness"], values["damping"]
        # of a motor without inertia nothing can be integrated
        light = 0.01 * _felt(arm, np.zeros((1, arm.n_joints)), self.index)
        drive = DriveApart(
            self.index,
            max(values["motor_inertia"], light),
            friction_at(arm, self.index + 1),
            lambda angle, speed: k * angle + d * speed,
            lambda tau: tau / k,
        )
        return drive.hooks(arm.n_joints)


@dataclass(frozen=True)
class BaseResonance(Effect):
    """I (ẍ + 2 ζ w ẋ + w² x) = -τ_1, w = 2πf: the base turns by x about the first joint's axis.

    τ_1 is the rigid arm's torque on that joint; its encoder and its friction turn with the base. To
    first order τ = 1/I P_1(x I) with τ_1 of the arm on a firm base.
    """

    frequency: float = 28.0  # f [Hz]
    damping_ratio: float = 0.05  # ζ

    name = "base_resonance"
    scope = "arm"
    evidence = "frequency responses"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.several([self], motion, arm)[0]

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """All bases are swung by the same torque, which has the same slopes for all."""
        force = -rigid_torque(arm.body, arm.p, motion)[:, _FIRST]
        slopes, one, found = rigid_slopes(arm.body, arm.p, motion, _FIRST), np.ones_like(force), []
        for shape in shapes:
            w = 2.0 * pi * shape.frequency
            x = oscillation(motion.t, one, 2.0 * shape.damping_ratio * w * one, w * w * one, force)
            found.append(perturbed_by(slopes, *x)[..., None])
        return found

    def amplitudes(self, values: Values) -> Array:
        return np.array([1.0 / values["inertia"]])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        mobility = float(amplitudes[0])
        return {
            "frequency": self.frequency,
            "damping_ratio": self.damping_ratio,
            "inertia": 1.0 / mobility if mobility else inf,
        }

    def torque(self, motion: Motion, arm: ArmModel, values: Values) -> Array:
        inertia, w = values["inertia"], 2.0 * pi * values["frequency"]
        if not isfinite(inertia):
            return np.zeros_like(motion.q)
        damping = 2.0 * values["damping_ratio"] * w * inertia
        x = deflection(arm.body, arm.p, motion, _FIRST, inertia * w * w, damping, inertia)
        return _moved_by(arm, motion, _FIRST, x)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the hooks: the arm's first angle is against the ground, the base two states."""
        inertia, ratio = values["inertia"], values["damping_ratio"]
        w = 2.0 * pi * values["frequency"]
        friction = friction_at(arm, _FIRST + 1)

        def actuator(command: Array, motion: Motion, states: Array) -> Array:
            """Friction is that of the speed against the base."""
            passed, speed = command.copy(), motion.dq[:, _FIRST]
            passed[:, _FIRST] += friction(motion, speed) - friction(motion, speed - states[:, 1])
            return passed

        def rate(motion: Motion, command: Array, states: Array) -> Array:
            x, v = states.T
            reaction = command[:, _FIRST] - friction(motion, motion.dq[:, _FIRST] - v)
            return np.stack([v, -w * w * x - 2.0 * ratio * w * v - reaction / inertia], axis=-1)

        def sensor(q: Array, states: Array) -> Array:
            seen = q.copy()
            seen[:, _FIRST] -= states[:, 0]
            return seen

        def rests(motion: Motion, tau: Array) -> Array:
            lost = friction(motion, motion.dq[:, _FIRST])
            return np.asarray((lost - tau[:, _FIRST]) / (inertia * w * w))

        def settled(motion: Motion, tau: Array) -> Motion:
            q = motion.q.copy()
            q[:, _FIRST] += rests(motion, tau)
            return replace(motion, q=q)

        def start(motion: Motion, tau: Array) -> Array:
            return np.stack([rests(motion, tau), np.zeros(len(tau))], axis=-1)

        return Hooks(
            actuator=actuator, sensor=sensor, states=2, settled=settled, start=start, rate=rate
        )


def _moved_by(arm: ArmModel, motion: Motion, index: int, x: tuple[Array, Array, Array]) -> Array:
    """Return τ(q + x) - τ(q) of the rigid arm (samples, joints), of x, ẋ, ẍ at one joint."""
    there = rigid_torque(arm.body, arm.p, shifted(motion, index, *x))
    return np.asarray(there - rigid_torque(arm.body, arm.p, motion))


def _felt(arm: ArmModel, q: Array, index: int) -> float:
    """Inertia [kg m^2] that the joint feels, the others held, averaged over q (samples, joints)."""
    some = q[:: max(1, len(q) // 200)]
    return float(np.mean(arm.body.mass_matrix(some, arm.p)[:, index, index]))


def deflection(
    body: RigidBody,
    p: Array,
    motion: Motion,
    index: int,
    stiffness: float,
    damping: float,
    inertia: float,
) -> tuple[Array, Array, Array]:
    """Return x, ẋ, ẍ (samples,) of the deflection of a joint of the rigid arm on a spring.

        k x + d ẋ + I (q̈ + ẍ) + τ_j(q + x) = 0    for I < 0: a motor counted with its link
        k x + d ẋ + I ẍ + τ_j(q + x) = 0          for I > 0: a base below the joint

    That is exact, with what the arm then needs, by Newton's method: what is linear in x has
    coefficients that vary with time and is solved from sample to sample.
    """

    def by_parameters(there: Motion) -> Array:
        return np.ascontiguousarray(body.regressor(there.q, there.dq, there.ddq)[:, index])

    # the slopes of τ_j are linear in p: what multiplies it is kept with the motion
    key = ("slopes of the regressor", body, index)
    slopes = motion.kept(key, lambda: torque_slopes(by_parameters, motion, index))
    spring, drag, mass = slopes @ p
    mass = np.maximum(mass + inertia, _LEAST * mass)
    drag, spring = drag + damping, np.maximum(spring + stiffness, 0.5 * stiffness)
    oscillator = _Oscillator(motion.t, mass, drag, spring)
    x, rate, second = np.zeros((3, len(motion.t)))
    tau = rigid_torque(body, p, motion)[:, index]
    for _ in range(_ROUNDS):
        load = tau + inertia * (second if inertia > 0.0 else motion.ddq[:, index] + second)
        more = oscillator.response(-(stiffness * x + damping * rate + load))
        x, rate, second = (a + b for a, b in zip((x, rate, second), more, strict=True))
        if np.abs(more[0]).max(initial=0.0) < _SETTLED * np.abs(x).max(initial=0.0):
            break
        there = shifted(motion, index, x, rate, second)
        tau = body.torque(there.q, there.dq, there.ddq, p)[:, index]
    return x, rate, second


def oscillation(
    t: Array, mass: Array, drag: Array, spring: Array, force: Array
) -> tuple[Array, Array, Array]:
    """Return x, ẋ, ẍ (samples,) of m ẍ + c ẋ + k x = f, settled at the first sample."""
    return _Oscillator(t, mass, drag, spring).response(force)


@dataclass(frozen=True, eq=False)
class _Oscillator:
    """m ẍ + c ẋ + k x = f with coefficients (samples,) that vary with time.

    Within a sample coefficients are held and the force is a straight line of slope s: exact for
    that, however stiff.

        x = (f + s t)/k - c s/k² + e^(-at) (A cos wt + B sin wt),    a = c/2m,    w² = k/m - a²
    """

    t: Array  # [s]
    mass: Array
    drag: Array
    spring: Array

    def response(self, force: Array) -> tuple[Array, Array, Array]:
        """Return x, ẋ, ẍ (samples,), settled at the first sample.

        x = f/k + y: what remains for y is small where the spring is stiff, so that no digits are
        lost there.
        """
        still = force / self.spring
        rate = rate_of(still, self.t)
        second = rate_of(rate, self.t)
        rest = -(self.mass * second + self.drag * rate)
        y, dy = self._propagated(rest)
        return still + y, rate + dy, second + (rest - self.drag * dy - self.spring * y) / self.mass

    @cached_property
    def _held(self) -> tuple[Array, ...]:
        """The intervals h, and m, c, k in them (samples - 1,)."""
        each = self.mass, self.drag, self.spring
        return np.diff(self.t), *(0.5 * (z[1:] + z[:-1]) for z in each)

    @cached_property
    def _along(self) -> Array:
        """A (2, 2, intervals): y and ẏ at the end of an interval by those at its start."""
        h, m, c, k = self._held
        a = 0.5 * c / m
        w = np.sqrt((k / m - a * a).astype(complex))
        one, other = np.exp((1j * w - a) * h), np.exp((-1j * w - a) * h)
        cos = 0.5 * (one + other).real  # e^(-at) cos wt
        sinc = ((one - other) / np.where(w == 0.0, 1.0, 2j * w)).real  # e^(-at) sin wt / w
        sinc = np.where(w == 0.0, h * one.real, sinc)
        return np.array([[cos + a * sinc, sinc], [-sinc * k / m, cos - a * sinc]])

    def _propagated(self, f: Array) -> tuple[Array, Array]:
        """Return y and ẏ (samples,) of m ÿ + c ẏ + k y = f.

        z' = A z + b from interval to interval is a banded triangular system, solved forwards.
        """
        from scipy.linalg.blas import dtbsv

        h, _, c, k = self._held
        s = np.diff(f) / h
        lag = c * s / k**2
        before, after, speed = f[:-1] / k - lag, f[1:] / k - lag, s / k
        moved = np.einsum("ijn,jn->in", self._along, np.array([before, speed]))
        z = np.zeros((len(f), 2))
        z[1:] = (np.array([after, speed]) - moved).T
        if len(h):
            z[0] = before[0], speed[0]  # it does not ring
        band = np.zeros((4, z.size), order="F")
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            band[2 + i - j, j:-2:2] = -self._along[i, j]
        y, dy = dtbsv(3, band, z.ravel(), lower=1, diag=1).reshape(z.shape).T
        return y, dy

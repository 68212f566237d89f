"""Gravity, geometry, loads and motors that the rigid body was not described with."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.altered import (
    carry_over,
    chain_of,
    gravity_torque,
    masses_beyond,
    standard_of,
    tip_parameters,
    with_gravity,
    with_longer_link,
)
from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import ArmModel, Effect, Hooks, Values

__all__ = ["GravityTilt", "LinkLength", "Payload", "RotorInertia", "TransmissionCoupling"]

_ROUNDING = 1e-9  # numerics: of the torque by the other axis
_UPRIGHT = 1e-6  # numerics: sine of the angle between gravity and the first axis
_STEP = 1e-3  # numerics: [m] of the difference: torque is close to quadratic in a length


@dataclass(frozen=True)
class _Altering(Effect):
    """An effect on the rigid body itself, by `altered`."""

    scope = "arm"

    def passed(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        return Hooks(arm=self.altered(arm, values))


@dataclass(frozen=True)
class GravityTilt(_Altering):
    """g = |g| (cos θ down + sin θ (cos δ e_x + sin δ e_y)), e_x and e_y across nominal gravity.

    A joint 1 that stands upright then feels the weight of what it carries: where its centre of mass
    lies no level arm tells, so that S sin q1 + C cos q1 on it are two more amplitudes.
    """

    name = "gravity_tilt"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        size, _, *across = _axes(arm)
        phi = standard_of(arm.body, arm.p)
        table = np.zeros((*motion.q.shape, 4))
        for k, axis in enumerate(across):
            table[:, :, k] = gravity_torque(arm.body, motion.q, phi, size * axis)
        felt = np.abs(table[:, :, :2]).max(axis=(0, 1), initial=0.0)
        # an arm in one plane feels no weight across it
        table[:, :, :2] *= felt > _ROUNDING * felt.max()
        if _upright(arm):
            table[:, 0, 2], table[:, 0, 3] = np.sin(motion.q[:, 0]), np.cos(motion.q[:, 0])
        return table

    def amplitudes(self, values: Values) -> Array:
        angle, direction, sine, cosine = (values[q.name] for q in self.parameters)
        return np.array([angle * math.cos(direction), angle * math.sin(direction), sine, cosine])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        x, y, sine, cosine = map(float, amplitudes)
        return {
            "angle": math.hypot(x, y),
            "direction": math.atan2(y, x),
            "waist_sine": sine,
            "waist_cosine": cosine,
        }

    def altered(self, arm: ArmModel, values: Values) -> ArmModel:
        angle, direction = values["angle"], values["direction"]
        if not angle:
            return arm
        size, down, first, second = _axes(arm)
        towards = math.cos(direction) * first + math.sin(direction) * second
        body = with_gravity(arm.body, size * (math.cos(angle) * down + math.sin(angle) * towards))
        return arm.with_body(body, carry_over(arm.body, body) @ arm.p)

    def passed(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        if _upright(arm):
            tau[:, 0] += _waist(motion, values)
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        def load(motion: Motion, _: Array) -> Array:
            torque = np.zeros_like(motion.q)
            torque[:, 0] = _waist(motion, values)
            return torque

        return Hooks(load=load if _upright(arm) else None, arm=self.altered(arm, values))


def _waist(motion: Motion, values: Values) -> Array:
    """Return S sin q1 + C cos q1 (samples,)."""
    q1 = motion.q[:, 0]
    return np.asarray(values["waist_sine"] * np.sin(q1) + values["waist_cosine"] * np.cos(q1))


def _axes(arm: ArmModel) -> tuple[float, Array, Array, Array]:
    """Return |g|, down, and two base axes without their part along it, e_x and e_y."""
    gravity = chain_of(arm.body).gravity
    size = float(np.linalg.norm(gravity))
    basis = [gravity / size] if size else [np.array([0.0, 0.0, -1.0])]
    for axis in np.eye(3):
        across = axis - sum((axis @ known) * known for known in basis)
        length = float(np.linalg.norm(across))
        if length > _UPRIGHT and len(basis) < len(axis):
            basis.append(across / length)
    return size, *basis


def _upright(arm: ArmModel) -> bool:
    """Return whether joint 1 does not feel gravity on a level base."""
    chain = chain_of(arm.body)
    leaning = float(np.linalg.norm(np.cross(chain.before[0].rotation[:, 2], _axes(arm)[1])))
    return chain.revolute[0] and leaning <= _UPRIGHT


@dataclass(frozen=True)
class LinkLength(_Altering):
    """τ = Y(a + e) p': all beyond link k sits e further along it, along x of its frame.

    In a URDF towards the next joint. p' are the base parameters of the same links there.
    """

    link: float = 1.0  # k, 1-based: from joint k to joint k + 1

    name = "link_length"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        longer, shorter = (
            one.body.torque(motion.q, motion.dq, motion.ddq, one.p)
            for one in (self._longer(arm, _STEP), self._longer(arm, -_STEP))
        )
        return np.asarray(longer - shorter)[..., None] / (2.0 * _STEP)

    def nuisance(self, arm: ArmModel) -> Array:
        """Masses beyond the link turn on a longer lever; base parameters do not tell them."""
        return masses_beyond(arm.body, int(self.link))

    def altered(self, arm: ArmModel, values: Values) -> ArmModel:
        return self.at(values)._longer(arm, values["error"]) if values["error"] else arm

    def _longer(self, arm: ArmModel, by: float) -> ArmModel:
        body = with_longer_link(arm.body, int(self.link), by)
        return arm.with_body(body, carry_over(arm.body, body) @ arm.p)


@dataclass(frozen=True)
class Payload(_Altering):
    """p + B φ: the base parameters with one more body at the tip, φ = (m, m c, I) about the tip.

    In axes of the last frame, products with positive sign. A search takes I = 0.
    """

    extended: bool = True  # with its six moments of inertia

    name = "payload"
    evidence = "base parameters"

    @property
    def _count(self) -> int:
        return 10 if self.extended else 4

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        regressor = arm.body.regressor(motion.q, motion.dq, motion.ddq)
        return np.asarray(regressor @ tip_parameters(arm.body)[:, : self._count])

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        yield replace(self, extended=False)

    def forms(self) -> tuple[Self, ...]:
        return (replace(self, extended=True),)

    def amplitudes(self, values: Values) -> Array:
        return super().amplitudes(values)[: self._count]

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        return super().values([*map(float, amplitudes), *[0.0] * (10 - self._count)])

    def reported(self, values: Values) -> dict[str, float | tuple[float, ...]]:
        found = super().reported(values)
        moment = tuple(values[f"first_moment_{axis}"] for axis in "xyz")
        inertia = {name: x for name, x in found.items() if name.startswith("inertia")}
        return {"mass": found["mass"], "first_moment": moment, **inertia}

    def altered(self, arm: ArmModel, values: Values) -> ArmModel:
        ten = super().amplitudes(values)
        return arm.with_body(arm.body, arm.p + tip_parameters(arm.body) @ ten)


@dataclass(frozen=True)
class RotorInertia(Effect):
    """τ = I ddq, on its own joint only, at joint side: a rotor turns with its joint in any
    posture."""

    name = "rotor_inertia"
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self.own(motion.ddq))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        own = np.eye(arm.n_joints)[self.index]
        return Hooks(inertia=values["inertia"] * np.outer(own, own))


@dataclass(frozen=True)
class TransmissionCoupling(Effect):
    """τ_s = J ds/dt + B s + C tanh(w s), s = v_j + ρ v_i: τ_s on joint j, ρ τ_s on joint i.

    ρ = N_ki/N_kj by the robot's transmission matrix N, k one of the two; 1 without one. Of the two
    joints j is the later, for s does not tell them apart.
    """

    with_joint: float = 0.0  # i, 1-based; the joint before, if none is given
    sharpness: float = 100.0  # w [s/rad]

    name = "transmission_coupling"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        other, ratio = int(self.with_joint) - 1, self._ratio(arm)
        speed, acceleration = (self.own(x) + ratio * x[..., other] for x in (motion.dq, motion.ddq))
        table = self.on_own_row(arm, acceleration, speed, np.tanh(self.sharpness * speed))
        table[:, other] = ratio * table[:, self.index]
        return table

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Return the joints that share a motor by the transmission matrix, or the one before."""
        matrix = arm.robot.drive.transmission if arm.robot.drive is not None else None
        own, earlier = self.index, range(self.index)
        shared = [i for i in earlier if matrix is not None and (matrix[own][i] or matrix[i][own])]
        for other in shared or [own - 1 if own else 1]:
            for sharpness in (20.0, 100.0, 500.0):
                yield replace(self, with_joint=other + 1.0, sharpness=sharpness)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Its inertia belongs to the arm's: J (1, ρ)ᵀ (1, ρ)."""
        shaped = self.at(values)
        own = np.eye(arm.n_joints)[self.index]
        own[int(shaped.with_joint) - 1] = shaped._ratio(arm)
        b, c, w = values["viscous"], values["coulomb"], values["sharpness"]

        def load(motion: Motion, _: Array) -> Array:
            speed = motion.dq @ own
            return np.asarray((b * speed + c * np.tanh(w * speed))[:, None] * own)

        return Hooks(load=load, inertia=values["inertia"] * np.outer(own, own))

    def _ratio(self, arm: ArmModel) -> float:
        matrix = arm.robot.drive.transmission if arm.robot.drive is not None else None
        j, i = self.index, int(self.with_joint) - 1
        for motor in (matrix[i], matrix[j]) if matrix is not None else ():
            if motor[i] and motor[j]:
                return motor[i] / motor[j]
        return 1.0

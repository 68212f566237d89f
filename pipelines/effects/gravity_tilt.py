"""A base that does not stand level."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.altered import (
    carry_over,
    chain_of,
    gravity_torque,
    standard_of,
    with_gravity,
)
from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import ArmModel, Effect, Hooks, Parameters, Predict, Quantity, Values

__all__ = ["GravityTilt"]

_ROUNDING = 1e-9  # numerics: of the torque by the other axis
_UPRIGHT = 1e-6  # numerics: sine of the angle between gravity and the first axis


@dataclass(frozen=True)
class GravityTilt(Effect):
    """g = |g| (cos θ down + sin θ (cos δ e_x + sin δ e_y)).

    With e_x and e_y the base axes across nominal gravity. A joint 1 that stands upright then feels
    the weight of what it carries. Where its centre of mass lies no level arm tells: two more
    amplitudes, S sin q1 + C cos q1 on joint 1.
    """

    name = "gravity_tilt"
    scope = "arm"
    parameters = Parameters(
        Quantity("angle", "rad", 0.0, 1.5, "between true and nominal gravity"),
        Quantity("direction", "rad", -math.pi, math.pi,
                 "of the horizontal part of true gravity, from the base's x axis",
                 period=2.0 * math.pi),
        Quantity("waist_sine", "N m", -1e4, 1e4,
                 "S: weight of what joint 1 carries, as far as a level arm does not tell"),
        Quantity("waist_cosine", "N m", -1e4, 1e4, "C: the same, a quarter of a turn on"))

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        size, _, first, second = _axes(arm)
        phi = standard_of(arm.body, arm.p)
        table = np.zeros((*motion.q.shape, 4))
        for k, axis in enumerate((first, second)):
            table[:, :, k] = gravity_torque(arm.body, motion.q, phi, size * axis)
        felt = np.abs(table[:, :, :2]).max(axis=(0, 1), initial=0.0)
        # an arm in one plane feels no weight across it
        table[:, :, :2] *= felt > _ROUNDING * felt.max()
        if _upright(arm):
            table[:, 0, 2:] = _waist(motion)
        return table

    def amplitudes(self, values: Values) -> Array:
        angle, direction, sine, cosine = (values[q.name] for q in self.parameters)
        return np.array([angle * math.cos(direction), angle * math.sin(direction), sine, cosine])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        x, y, sine, cosine = map(float, amplitudes)
        return {
            "angle": math.hypot(x, y), "direction": math.atan2(y, x), "waist_sine": sine,
            "waist_cosine": cosine
        }

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        tilted = _tilted(arm, values["angle"], values["direction"]) if values["angle"] else arm
        tau = predict(motion, tilted) if predict is not None else tilted.torque(motion)
        if _upright(arm):
            tau[:, 0] += _waist(motion) @ [values["waist_sine"], values["waist_cosine"]]
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        def load(motion: Motion, _: Array) -> Array:
            torque = np.zeros_like(motion.q)
            torque[:, 0] = _waist(motion) @ [values["waist_sine"], values["waist_cosine"]]
            return torque

        return Hooks(load=load if _upright(arm) else None,
                     arm=_tilted(arm, values["angle"], values["direction"]))


def _axes(arm: ArmModel) -> tuple[float, Array, Array, Array]:
    """|g|, down, and e_x, e_y.

    The base's x and y (z, where one of them lies along gravity) without their part along it.
    """
    gravity = chain_of(arm.body).gravity
    size = float(np.linalg.norm(gravity))
    basis = [gravity / size] if size else [np.array([0.0, 0.0, -1.0])]
    for axis in np.eye(3):
        across = axis - sum((axis @ known) * known for known in basis)
        length = float(np.linalg.norm(across))
        if length > _UPRIGHT and len(basis) < len(axis):
            basis.append(across / length)
    return size, *basis


def _tilted(arm: ArmModel, angle: float, direction: float) -> ArmModel:
    size, down, first, second = _axes(arm)
    towards = math.cos(direction) * first + math.sin(direction) * second
    body = with_gravity(arm.body, size * (math.cos(angle) * down + math.sin(angle) * towards))
    return arm.with_body(body, carry_over(arm.body, body) @ arm.p)


def _upright(arm: ArmModel) -> bool:
    """Return whether joint 1 does not feel gravity on a level base.

    Elsewhere a fit of the arm tells S and C.
    """
    chain = chain_of(arm.body)
    leaning = float(np.linalg.norm(np.cross(chain.before[0].rotation[:, 2], _axes(arm)[1])))
    return chain.revolute[0] and leaning <= _UPRIGHT


def _waist(motion: Motion) -> Array:
    """Return (samples, 2)."""
    return np.stack([np.sin(motion.q[:, 0]), np.cos(motion.q[:, 0])], axis=1)

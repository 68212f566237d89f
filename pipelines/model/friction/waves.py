"""Sines and cosines of a joint's angle, order by order: what any torque that depends on the angle alone is made of.

    a sin kq + b cos kq        k waves in a turn; of a slide, in 2π m
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.model.effects.base import ArmModel, Parameters, Quantity
from pipelines.model.effects.fast import Fast
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Wave", "Waves"]

_FINEST = 1000.0  # order that a wave may have


@dataclass(frozen=True)
class Wave(Fast):
    """a sin kq + b cos kq at one joint, beside the laws of an arm."""

    order: float = 1.0  # k [1/rev]

    name = "wave"
    parameters = Parameters(Quantity("order", "1/rev", 0.0, _FINEST, "waves in one turn of the joint", shape=True),
                  Quantity("sine", "N m", -np.inf, np.inf, "of the sine of the angle"),
                  Quantity("cosine", "N m", -np.inf, np.inf, "of its cosine"))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        angle = self.order * self.own(motion.q)
        return self.on_own_row(arm, np.sin(angle), np.cos(angle))


@dataclass(frozen=True)
class Waves:
    """Of several orders, as columns of one joint: the sine and the cosine of each in turn."""

    orders: tuple[float, ...]  # [1/rev]
    pointwise: bool = True

    def columns(self, motion: Motion, arm: OneJoint, theta: Array) -> Array:
        """(samples, 2 × orders)"""
        return self.at(motion.q[:, 0])

    def at(self, angle: Array) -> Array:
        """(points, 2 × orders) at angles [rad]."""
        wave = np.exp(1j * angle[:, None] * np.array(self.orders))
        return np.stack([wave.imag, wave.real], axis=2).reshape(len(angle), -1)

    def alone(self, joint: int) -> tuple[Wave, ...]:
        """One by one, at joint `joint` of an arm, counted from 1."""
        return tuple(Wave(joint=joint, order=order) for order in self.orders)

    def some(self, chosen: Sequence[int]) -> Waves:
        return Waves(tuple(self.orders[k] for k in chosen))

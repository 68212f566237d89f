"""Evaluate a motion for the search: criterion, gradient and distance to its limits.

    x → motion → signals within limits, rows of the equations → Gram matrices → criterion

and back. One pass there and back costs about three evaluations, for any number of harmonics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.dynamics.kinematics import SerialChain, jacobian, tip_position
from pipelines.excitation.config import CONFIG
from pipelines.excitation.constraints import Limit, barrier, middle_and_half
from pipelines.excitation.criteria import Goal
from pipelines.excitation.fourier import MotionSpace
from pipelines.excitation.regressor import ArmColumns, grams_of_rows

__all__ = ["ArmProblem", "DesignProblem"]

INSIDE = 0.999  # numerics: of the limits, below which a motion that is drawn back stays
BISECTIONS = 12  # numerics: of the size of a motion, to a thousandth


@dataclass(frozen=True, eq=False)
class ArmProblem:
    """The part of the problem that does not depend on the harmonics."""

    columns: ArmColumns
    chain: SerialChain
    limits: tuple[Limit, ...]
    beta: Array | None  # (columns,) of the model: predicts torque
    goal: Goal
    drag: Array | None = None  # (joints, 2) Coulomb and viscous friction without columns

    @cached_property
    def limited(self) -> tuple[Array, ...]:
        """Joints with a limit of position, speed, acceleration and torque."""
        return tuple(np.array([one.joint - 1 for one in self.limits
                               if one.quantity == name and one.joint], dtype=np.intp)
                     for name in ("position", "speed", "acceleration", "torque"))

    def torque(self, rows: Sequence[Array], dq: Array) -> Array:
        """Return τ (joints, samples) of the model."""
        assert self.beta is not None
        tau = np.stack([self.beta[own] @ row
                        for own, row in zip(self.columns.columns, rows, strict=True)])
        if self.drag is None:
            return tau
        return tau + self.drag[:, :1] * np.tanh(CONFIG.sharpness * dq) + self.drag[:, 1:] * dq

    @property
    def boxed(self) -> bool:
        """Return whether the tip has a box."""
        return any(one.joint is None for one in self.limits)

    def signals(self, motion: Array, rows: Sequence[Array]) -> Array:
        """Return the limited signals (limits, samples)."""
        *moving, torque = self.limited
        parts = [signal[own] for signal, own in zip(motion, moving, strict=True)]
        if len(torque):
            parts.append(self.torque(rows, motion[1])[torque])
        if self.boxed:
            parts.append(tip_position(self.chain, motion[0].T).T)
        return np.concatenate(parts)

    def adjoint(self, motion: Array, bars: Array, on_rows: Sequence[Array]) -> Array:
        """Return the derivative by the motion (3, joints, samples), adding torque to `on_rows`."""
        out, on_torque = np.zeros_like(motion), np.zeros_like(motion[0])
        first = 0
        for target, own in zip((*out, on_torque), self.limited, strict=True):
            target[own] += bars[first:first + len(own)]
            first += len(own)
        if self.drag is not None:
            level = np.tanh(CONFIG.sharpness * motion[1])
            slope = self.drag[:, :1] * CONFIG.sharpness * (1.0 - level * level) + self.drag[:, 1:]
            out[1] += on_torque * slope
        if self.beta is not None:
            for own, bar, row in zip(self.columns.columns, on_torque, on_rows, strict=True):
                row += self.beta[own, None] * bar
        if self.boxed:
            linear = jacobian(self.chain, motion[0].T)[:, :3]
            out[0] += np.einsum("saj,as->js", linear, bars[first:])
        return np.asarray(out + self.columns.adjoint(motion, on_rows))


class DesignProblem:
    """The problem on one space of motions, sampled `samples` times a period."""

    def __init__(self, arm: ArmProblem, space: MotionSpace, samples: int,
                 around: tuple[Array, Array], room: float = 1.0) -> None:
        """Centre random motions between the postures `around`, within `room` of the limits."""
        self.arm, self.space, self.samples, self.around = arm, space, samples, around
        self.middle, half = middle_and_half(arm.limits)
        # the other end of a range of position may be far away
        position = np.array([one.quantity == "position" for one in arm.limits], dtype=bool)
        self.half = half - (1.0 - room) * np.where(position, np.minimum(half, 1.0), half)

    def value(self, x: Array, sharpness: float, weight: float) -> tuple[float, Array, float]:
        """Return the criterion with its barrier, the gradient, and the figure, infinite outside
        limits."""
        arm = self.arm
        motion, rows, signals = self._evaluated(x)
        wall, on_signals, inside = barrier(signals, self.middle, self.half)
        grams = grams_of_rows(arm.columns, rows)
        value, on_grams, score = arm.goal.value(grams, sharpness)
        bars = [(2.0 / self.samples) * (on_grams[j][np.ix_(own, own)] @ row)
                for j, (own, row) in enumerate(zip(arm.columns.columns, rows, strict=True))]
        gradient = self.space.gradient(arm.adjoint(motion, weight * on_signals, bars))
        return value + weight * wall, gradient, score if inside else np.inf

    def _evaluated(self, x: Array) -> tuple[Array, tuple[Array, ...], Array]:
        motion = self.space.motion(x, self.samples)
        rows = self.arm.columns.rows(motion)
        return motion, rows, self.arm.signals(motion, rows)

    def nearness(self, x: Array) -> Array:
        """Return how near each limit is approached (limits,): 1 is the limit."""
        g = np.abs(self._evaluated(x)[2] - self.middle[:, None]) / self.half[:, None]
        return np.asarray(g.max(axis=1, initial=0.0))

    def start(self, rng: np.random.Generator, reach: float = CONFIG.roomy) -> Array:
        """Return a random motion that approaches its limits to `reach`."""
        return self.sized(self.space.random(rng, *self.around), reach, 64.0)

    def disturbed(self, x: Array, size: float, rng: np.random.Generator) -> Array:
        """Return x with noise of `size` times its coefficients, within the limits."""
        noise = rng.normal(size=x.shape) * (3.0 * size * float(np.abs(x).mean()))
        return self.inside(self.space.project(x + noise))

    def inside(self, x: Array) -> Array:
        """Return x drawn back until it keeps its limits."""
        return self.sized(x, INSIDE, 1.0)

    def sized(self, x: Array, reach: float, largest: float) -> Array:
        """Return x up to `largest` times as large, with its limits approached to below `reach`.

        Where not even a standstill keeps them, it is the standstill.
        """
        good, bad, factor = 0.0, largest, 1.0
        for _ in range(BISECTIONS):
            if float(self.nearness(self.space.shrunk(x, factor)).max(initial=0.0)) < reach:
                good = factor
                if factor >= largest:
                    break
                factor = min(2.0 * factor, largest) if bad >= largest else 0.5 * (good + bad)
            else:
                bad = min(bad, factor)
                factor = 0.5 * (good + bad)
        return self.space.shrunk(x, good)

"""The design problem: from a point of the space of motions to its value, its gradient, and how near it comes to its limits.

    x → motion → signals within limits, rows of the equations → Gram matrices → goal

and back: the derivative by the Gram matrices becomes one by the rows, 2/n A S̄, that one by the motion (the rows' adjoint),
that one by x (the series' adjoint). One pass there and back costs about three evaluations, whatever the number of harmonics.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.fit.design.barrier import barrier, cost_of_bounds
from pipelines.fit.design.goal import Goal
from pipelines.model.excitation.bounds import spread_of_torque
from pipelines.model.excitation.columns import SHARPNESS, ArmColumns
from pipelines.model.excitation.limits import Limit, Limits, middle_and_half
from pipelines.model.excitation.space import MotionSpace
from pipelines.model.excitation.tip import TipMotion, tip_motion
from pipelines.model.rigid.body import Array
from pipelines.model.rigid.geometry import SerialChain

__all__ = ["ROOMY", "ArmProblem", "DesignProblem", "grams_of"]

ROOMY = 0.7  # of the limits: where a start begins
_INSIDE = 0.999  # of the limits: a motion that is drawn back keeps them
_STEPS = 12  # of bisection
_PROJECTIONS = 400  # at most: a motion that is a little beyond its limits takes some ten
_PAST = 0.9998  # of the room: peaks side by side are then not touched in turn for ever


def _sign(tau: Array) -> Array:
    return np.where(tau < 0.0, -1.0, 1.0)


def grams_of(columns: tuple[np.ndarray, ...], rows: tuple[Array, ...], count: int) -> Array:
    """S_j = A_jᵀ A_j / samples of every joint (joints, count, count)."""
    grams = np.zeros((len(rows), count, count))
    for gram, own, row in zip(grams, columns, rows, strict=True):
        gram[np.ix_(own, own)] = row @ row.T / row.shape[1]
    return grams


@dataclass(frozen=True, eq=False)
class ArmProblem:
    """What does not depend on the harmonics."""

    columns: ArmColumns
    chain: SerialChain
    limits: Limits
    beta: Array | None  # (all columns,) what is believed of the parameters: predicts torque
    goal: Goal
    drag: Array | None = None  # (joints, 2) Coulomb [N m] and viscous friction [N m s/rad] that no column stands for
    spread: Array | None = None  # (all columns,) how far each parameter may lie from what is believed

    @cached_property
    def listed(self) -> tuple[Limit, ...]:
        return self.limits.listed(self.beta is not None)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        return middle_and_half(self.listed)

    @cached_property
    def watched(self) -> tuple[Array, Array, Array, Array]:
        """Which joints have a limit of position, speed, acceleration and torque."""
        def of(quantity: str) -> Array:
            return np.array([one.joint - 1 for one in self.listed if one.quantity == quantity and one.joint], dtype=np.intp)

        return of("position"), of("speed"), of("acceleration"), of("torque")

    @property
    def tip_limited(self) -> bool:
        return self.limits.tip_speed is not None or self.limits.tip_box is not None

    def torque(self, rows: tuple[Array, ...], dq: Array) -> Array:
        """τ (joints, samples) of what is believed."""
        beta = self.beta if self.beta is not None else np.zeros(len(self.columns.names))
        tau = np.stack([beta[own] @ row for own, row in zip(self.columns.columns, rows, strict=True)])
        return tau if self.drag is None else tau + self.drag[:, :1] * np.tanh(SHARPNESS * dq) + self.drag[:, 1:] * dq

    def torque_range(self, motion: Array) -> tuple[Array, Array]:
        """Lowest and highest τ (joints, samples) of a motion (3, joints, samples), whatever the parameters within their spread."""
        rows = self.columns.rows(motion)
        tau = self.torque(rows, motion[1])
        wide = 0.0 if self.spread is None else spread_of_torque(self.columns, self.spread, rows)
        return tau - wide, tau + wide

    def _widest(self, rows: tuple[Array, ...], dq: Array) -> Array:
        """τ (joints, samples), made larger by its spread."""
        tau = self.torque(rows, dq)
        return tau if self.spread is None else tau + _sign(tau) * spread_of_torque(self.columns, self.spread, rows)

    def torque_adjoint(self, rows: tuple[Array, ...], dq: Array, bars: Array) -> tuple[Array, ...]:
        """Derivatives by each row from those by the torque that is limited (joints, samples)."""
        beta = self.beta if self.beta is not None else np.zeros(len(self.columns.names))
        own = self.columns.columns
        if self.spread is None:
            return tuple(beta[k, None] * bar for k, bar in zip(own, bars, strict=True))
        side = _sign(self.torque(rows, dq))
        return tuple((beta[k, None] + s * self.spread[k, None] * np.sign(row)) * bar
                     for k, row, s, bar in zip(own, rows, side, bars, strict=True))

    def signals(self, motion: Array, rows: tuple[Array, ...]) -> tuple[Array, TipMotion | None]:
        """What the limits are about, (limits, samples), in their order; of the tip's speed its square."""
        position, speed, acceleration, torque = self.watched
        parts = [motion[0, position], motion[1, speed], motion[2, acceleration]]
        if len(torque):
            parts.append(self._widest(rows, motion[1])[torque])
        tip = tip_motion(self.chain, motion[0], motion[1]) if self.tip_limited else None
        if tip is not None and self.limits.tip_speed is not None:
            parts.append((tip.velocity**2).sum(axis=0)[None])
        if tip is not None and self.limits.tip_box is not None:
            parts.append(tip.position)
        return np.concatenate(parts), tip

    def signals_adjoint(self, motion: Array, tip: TipMotion | None, bars: Array) -> tuple[Array, Array]:
        """Derivatives by the motion (3, joints, samples) and by the torque (joints, samples) from those by the signals."""
        out, on_torque = np.zeros_like(motion), np.zeros_like(motion[0])
        first = 0
        for target, own in zip((out[0], out[1], out[2], on_torque), self.watched, strict=True):
            target[own] += bars[first:first + len(own)]
            first += len(own)
        if self.drag is not None:
            level = np.tanh(SHARPNESS * motion[1])
            out[1] += on_torque * (self.drag[:, :1] * SHARPNESS * (1.0 - level * level) + self.drag[:, 1:])
        if tip is not None:
            on_speed = np.zeros_like(tip.velocity)
            if self.limits.tip_speed is not None:
                on_speed = 2.0 * bars[first] * tip.velocity
                first += 1
            on_place = bars[first:first + 3] if self.limits.tip_box is not None else np.zeros_like(tip.position)
            by_q, by_dq = tip.adjoint(motion[1], on_place, on_speed)
            out[0] += by_q
            out[1] += by_dq
        return out, on_torque


class DesignProblem:
    """The problem on one space of motions, sampled `samples` times a period: a landscape to search."""

    def __init__(self, arm: ArmProblem, space: MotionSpace, samples: int, around: tuple[Array, Array]) -> None:
        """`around`: postures (joints,) [rad] between which random motions are centred."""
        self.arm, self.space, self.samples, self.around = arm, space, samples, around

    def value(self, x: Array, sharpness: float, weight: float) -> tuple[float, Array, float]:
        """What is minimised, its gradient, and the exact figure; infinite outside the limits."""
        arm = self.arm
        motion = self.space.motion(x, self.samples)
        # the limits of the motion itself cost nothing to look at: no torque is computed for a motion that breaks them
        if not self._moves_within(motion):
            return np.inf, x, np.inf
        rows = arm.columns.rows(motion)
        signals, tip = arm.signals(motion, rows)
        walls = barrier(signals, *arm.bounds)
        if walls is None:
            return np.inf, x, np.inf
        value, on_grams, score = arm.goal.value(grams_of(arm.columns.columns, rows, len(arm.columns.names)), sharpness)
        bars = [(2.0 / self.samples) * (on_grams[j][np.ix_(own, own)] @ row)
                for j, (own, row) in enumerate(zip(arm.columns.columns, rows, strict=True))]
        return value + weight * walls[0], self._gradient(motion, rows, tip, weight * walls[1], bars), score

    def _gradient(self, motion: Array, rows: tuple[Array, ...], tip: TipMotion | None, on_signals: Array, on_rows: list[Array],
                  ) -> Array:
        """Derivative by x from those by the signals (limits, samples) and by the rows of every joint, which it adds to."""
        arm = self.arm
        by_motion, on_torque = arm.signals_adjoint(motion, tip, on_signals)
        if len(arm.watched[3]):
            for bar, more in zip(on_rows, arm.torque_adjoint(rows, motion[1], on_torque), strict=True):
                bar += more
        return self.space.gradient(by_motion + arm.columns.adjoint(motion, tuple(on_rows)))

    def _moves_within(self, motion: Array) -> bool:
        middle, half = self.arm.bounds
        first = 0
        for signal, own in zip(motion, self.arm.watched[:3], strict=True):
            part = slice(first, first + len(own))
            first += len(own)
            if not (np.abs(signal[own] - middle[part, None]) < half[part, None]).all():
                return False
        return True

    def nearness(self, x: Array) -> Array:
        """How near each limit is approached, (limits,): 1 is the limit."""
        motion = self.space.motion(x, self.samples)
        middle, half = self.arm.bounds
        signals, _ = self.arm.signals(motion, self.arm.columns.rows(motion))
        return np.asarray((np.abs(signals - middle[:, None]) / half[:, None]).max(axis=1, initial=0.0))

    def moved_within(self, x: Array, room: Array) -> Array | None:
        """x moved as little as keeps its signals below `room` (limits,) of their limits; None where that does not end.

        Each step goes to the plane s(x) + ∇sᵀ Δx = room of the sample that is farthest beyond: Kaczmarz' projections, on
        signals that are nearly linear over so small a way.
        """
        middle, half = (each[:, None] for each in self.arm.bounds)
        for _ in range(_PROJECTIONS):
            motion = self.space.motion(x, self.samples)
            rows = self.arm.columns.rows(motion)
            signals, tip = self.arm.signals(motion, rows)
            share = (signals - middle) / half
            beyond = np.abs(share) / room[:, None]
            at = np.unravel_index(int(beyond.argmax()), beyond.shape)
            if beyond[at] <= 1.0:
                return x
            bars = np.zeros_like(share)
            bars[at] = np.sign(share[at]) / half[at[0], 0]
            slope = self._gradient(motion, rows, tip, bars, [np.zeros_like(row) for row in rows])
            steep = float(slope @ slope)
            if steep == 0.0:  # a standstill, or a signal that nothing here changes
                return None
            x = self.space.project(x - (np.abs(share[at]) - _PAST * room[at[0]]) / steep * slope)
        return None

    def cost(self, x: Array) -> Array:
        """What each limit costs, (limits,), as a share of what all of them cost."""
        motion = self.space.motion(x, self.samples)
        signals, _ = self.arm.signals(motion, self.arm.columns.rows(motion))
        found = cost_of_bounds(signals, *self.arm.bounds)
        return np.asarray(found / max(float(found.sum()), 1e-300))

    def start(self, rng: np.random.Generator, reach: float = ROOMY) -> Array:
        """A random motion as large as leaves each limit approached to less than `reach`."""
        return self.sized(self.space.random(rng, *self.around), reach, 64.0)

    def disturbed(self, x: Array, size: float, rng: np.random.Generator) -> Array:
        """x with noise of `size` times what its coefficients are worth, within the limits."""
        if size > 0.0:
            x = self.space.project(x + rng.normal(size=x.shape) * (3.0 * size * float(np.abs(x).mean())))
        return self.sized(x, _INSIDE, 1.0)

    def sized(self, x: Array, reach: float, largest: float) -> Array:
        """x made smaller, or up to `largest` times as large, as long as its limits are approached to less than `reach`.

        Where not even a standstill keeps them, the standstill.
        """
        good, bad = 0.0, largest
        factor = 1.0
        for _ in range(_STEPS):
            if float(self.nearness(self.space.shrunk(x, factor)).max(initial=0.0)) < reach:
                good = factor
                if factor >= largest:
                    break
                factor = min(2.0 * factor, largest) if bad >= largest else 0.5 * (good + bad)
            else:
                bad = min(bad, factor)
                factor = 0.5 * (good + bad)
        return self.space.shrunk(x, good)

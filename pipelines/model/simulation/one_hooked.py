"""One RRR arm with effects that take arrays: its rigid body, its friction and the loads of single joints are plain numbers.

    OneHooked(moving, sample_time, steps).advance(t, state, states, command)       as `RungeKutta` does it

For a single robot arrays of three cost several times more than the arithmetic. What an effect does to torque and motion it does to
arrays all the same: each is one file that knows nothing of this.
"""

from __future__ import annotations

from math import nan

import numpy as np

from pipelines.model.rigid.body import Array, Motion
from pipelines.model.rigid.rrr import RRR
from pipelines.model.simulation.one_rrr import acceleration_of
from pipelines.model.simulation.plant import MovingPlant, Plant

__all__ = ["OneHooked"]

_N = 3  # joints


class OneHooked:
    """The integrator of one arm: k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3); Kutta 1901."""

    def __init__(self, moving: MovingPlant, sample_time: float, steps: int) -> None:
        """`moving`, one replica, as `fits` it; `steps` of equal size make one control sample."""
        self._acceleration = acceleration_of(moving.plant)
        self._moving, self._h, self._steps = moving, sample_time / steps, steps
        self._still = np.zeros((1, _N))

    @staticmethod
    def fits(plant: Plant) -> bool:
        """Return whether its body is in closed form, with one set of parameters."""
        return isinstance(plant.body, RRR) and plant.p.size == 15

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Move `state` (6, 1) on by one sample, in place, from t (1,); returns the memories' new states."""
        now, torque = state[:, 0].tolist(), command.T
        try:
            for k in range(self._steps):
                now, states = self._step(t + k * self._h, now, states, torque)
        except (ValueError, OverflowError):  # of an infinite number there is no sine
            now = [nan] * len(now)
        state[:, 0] = now
        return states

    def _step(self, t: Array, x: list[float], states: Array, command: Array) -> tuple[list[float], Array]:
        h, half = self._h, 0.5 * self._h
        k, dk = self._slope(t, x, states, command)
        middle = t + half
        m, dm = self._slope(middle, [a + half * b for a, b in zip(x, k, strict=True)], states + half * dk, command)
        n, dn = self._slope(middle, [a + half * b for a, b in zip(x, m, strict=True)], states + half * dm, command)
        o, do = self._slope(t + h, [a + h * b for a, b in zip(x, n, strict=True)], states + h * dn, command)
        sixth = h / 6.0
        after = [a + sixth * (b + 2.0 * (c + d) + e) for a, b, c, d, e in zip(x, k, m, n, o, strict=True)]
        return after, states + sixth * (dk + 2.0 * (dm + dn) + do) if states.size else states

    def _slope(self, t: Array, x: list[float], states: Array, command: Array) -> tuple[list[float], Array | float]:
        """dx/dt and d(states)/dt where the torque `command` (1, joints) is on its way to the joints."""
        there = np.array([x])
        torque, rates = self._moving.through(Motion(t, there[:, :_N], there[:, _N:], self._still), states, command)
        return [*x[_N:], *self._acceleration(*x, *torque[0].tolist())], rates

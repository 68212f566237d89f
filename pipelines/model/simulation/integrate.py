"""Move the arm through one control sample, the torque held: Runge-Kutta steps of equal size.

    RungeKutta(moving, sample_time, steps).advance(t, state, states, command)
    HeldBody(moving, sample_time, steps).advance(…)       the same, faster, for serial arms of any kind

    k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3),   x += h/6 (k1 + 2 k2 + 2 k3 + k4)

Kutta 1901. The torque is constant within a sample, so nothing in f jumps but what friction does at rest. A linearly implicit
method (Rang & Angermann 2005, ROS34PW2, friction's slope implicit) was tried: it costs more and is mostly 1.5 to 4 times less
exact at the same step, for what costs accuracy is the passage through zero speed and not the slope at rest.

That passage is over in a fraction of a step, while inertia, Coriolis forces and weight change with the posture: a thousandth of
them in a millisecond. `HeldBody` works them out once a step, in its middle, where `RungeKutta` does so four times.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.model.simulation.chain import ManyChains
from pipelines.model.simulation.plant import MovingPlant

__all__ = ["HeldBody", "RungeKutta"]

_NODES = (0.0, 0.5, 0.5, 1.0)
_WEIGHTS = (1.0, 2.0, 2.0, 1.0)
_LONGEST = 5e-4  # [s] over which several steps share one rigid body


class RungeKutta:
    """The classical method for q and dq (joints, replicas) and the memories of effects (replicas, states), in place."""

    def __init__(self, plant: MovingPlant, sample_time: float, steps: int) -> None:
        """`steps` of equal size make one control sample."""
        n, replicas = plant.plant.n_joints, plant.replicas
        self._plant, self._h, self._steps = plant, sample_time / steps, steps
        self._point, self._slope, self._sum, self._work = np.empty((4, 2 * n, replicas))
        self._n = n
        self._held: ManyChains | None = None

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Move `state` (2 joints, replicas) on by one sample, in place, from t (replicas,); returns the memories' new states."""
        for k in range(self._steps):
            states = self._step(t + k * self._h, state, states, command)
        return states

    def _step(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        n, h, plant = self._n, self._h, self._plant
        point, slope, total, work = self._point, self._slope, self._sum, self._work
        here, memory, rates, memory_slope = state, states, np.zeros_like(states), np.zeros(0)
        for i, (node, weight) in enumerate(zip(_NODES, _WEIGHTS, strict=True)):
            if i:
                np.multiply(slope, node * h, out=work)
                here = np.add(state, work, out=point)
                memory = states + (node * h) * memory_slope if plant.n_states else states
            slope[:n] = here[n:]
            now = t + node * h
            plant.accelerations(now, here[:n], here[n:], memory, command, slope[n:], self._held)
            if plant.n_states:
                memory_slope = plant.rates(now, here[:n], here[n:], memory, command)
                rates = rates + weight * memory_slope
            if i == 0:
                total[:] = slope
            elif weight == 1.0:
                total += slope
            else:
                total += np.multiply(slope, weight, out=work)
        state += np.multiply(total, h / 6.0, out=work)
        return states + (h / 6.0) * rates if plant.n_states else states


class HeldBody(RungeKutta):
    """The same with D, c and h of D(q) a = τ - τ_f - c - h held at the middle of each step, or of steps that are short together.

    Of second order in the length over which they are held, whose error is (h²/24) d²/dt² of what they do. The state in the middle
    is told from the last acceleration, and what the change of the command adds to it.
    """

    def __init__(self, plant: MovingPlant, sample_time: float, steps: int) -> None:
        """`steps` of equal size make one control sample; `plant` as it `fits`."""
        super().__init__(plant, sample_time, steps)
        if not isinstance(plant.rigid, ManyChains):
            raise TypeError("the rigid body of this arm is not held")
        self._held = self._body = plant.rigid
        self._together = self.together(sample_time, steps)
        self._last: tuple[Array, Array] | None = None  # acceleration and command

    @staticmethod
    def together(sample_time: float, steps: int) -> int:
        """How many of the steps of a sample share one rigid body."""
        return next(count for count in range(steps, 0, -1)
                    if steps % count == 0 and (count == 1 or count * sample_time / steps <= _LONGEST))

    @staticmethod
    def fits(plant: MovingPlant) -> bool:
        return isinstance(plant.rigid, ManyChains)

    def go_on_from(self, before: HeldBody) -> None:
        """Remember what `before`, of these replicas and others behind them, has last done."""
        if before._last is not None:
            ddq, command = (x[:, :self._plant.replicas].copy() for x in before._last)
            self._last = ddq, command
            self._body.take_held(before._body)

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        n, half = self._n, 0.5 * self._h * self._together
        for k in range(self._steps):
            if k % self._together == 0:
                q, dq, ddq = state[:n], state[n:], self._acceleration(t + k * self._h, state, states, command)
                self._body.hold(q + half * dq + 0.5 * half**2 * ddq, dq + half * ddq)
            states = self._step(t + k * self._h, state, states, command)
            self._last = self._slope[n:].copy(), command.copy()
        return states

    def _acceleration(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """(joints, replicas) that begins a step."""
        if self._last is None:
            out, n = np.empty_like(command), self._n
            self._plant.accelerations(t, state[:n], state[n:], states, command, out)
            return out
        ddq, before = self._last
        return ddq + self._body.gained(command - before)

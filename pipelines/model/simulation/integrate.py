"""Move the arm through one control sample, the torque held: Runge-Kutta steps of equal size.

    k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3),   x += h/6 (k1 + 2 k2 + 2 k3 + k4)

Kutta 1901. The torque is constant within a sample, so nothing in f jumps but what friction does at rest. A linearly implicit
method (Rang & Angermann 2005, ROS34PW2, friction's slope implicit) was tried: it costs more and is mostly 1.5 to 4 times less
exact at the same step, for what costs accuracy is the passage through zero speed and not the slope at rest.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.model.simulation.plant import MovingPlant

__all__ = ["RungeKutta"]

_NODES = (0.0, 0.5, 0.5, 1.0)
_WEIGHTS = (1.0, 2.0, 2.0, 1.0)


class RungeKutta:
    """The classical method for q and dq (joints, replicas) and the memories of effects (replicas, states), in place."""

    def __init__(self, plant: MovingPlant, sample_time: float, steps: int) -> None:
        """`steps` of equal size make one control sample."""
        n, replicas = plant.plant.n_joints, plant.replicas
        self._plant, self._h, self._steps = plant, sample_time / steps, steps
        self._point, self._slope, self._sum, self._work = np.empty((4, 2 * n, replicas))
        self._n = n

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
            plant.accelerations(now, here[:n], here[n:], memory, command, slope[n:])
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

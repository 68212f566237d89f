"""Move arms through one control sample, the torque held: Runge-Kutta steps of equal size.

    RungeKutta(moving, sample_time, steps).advance(t, state, states, command)
    HeldBody(moving, sample_time, steps).advance(…)     the same, faster, for arms of any kind

    k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3)
    x += h/6 (k1 + 2 k2 + 2 k3 + k4)                                            Kutta 1901

The torque is constant within a sample, so nothing in f jumps but what friction does at rest. A
linearly implicit method (Rang & Angermann 2005, ROS34PW2, friction's slope implicit) costs more and
is mostly 1.5 to 4 times less exact at the same step: what costs accuracy is the passage through
zero speed, not the slope at rest.

That passage is over in a fraction of a step, while inertia, Coriolis forces and weight change with
the posture: a thousandth of them in a millisecond. `HeldBody` works them out once a step.
"""

from __future__ import annotations

import numpy as np

from pipelines.io.log import Array
from pipelines.simulation.bodies import ManyChains
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.plant import MovingPlant

__all__ = ["HeldBody", "RungeKutta"]

_NODES = (0.0, 0.5, 0.5, 1.0)  # numerics: Kutta 1901
_WEIGHTS = (1.0, 2.0, 2.0, 1.0)  # numerics: Kutta 1901


class RungeKutta:
    """The classical method for q and dq (joints, replicas) and memories (replicas, states)."""

    def __init__(self, plant: MovingPlant, sample_time: float, steps: int) -> None:
        """Take `steps` of equal size as one control sample."""
        n, replicas = plant.plant.n_joints, plant.replicas
        self._plant, self._h, self._steps = plant, sample_time / steps, steps
        self._point, self._slope, self._sum, self._work = np.empty((4, 2 * n, replicas))
        self._n = n
        self._held: ManyChains | None = None

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Move `state` on by one sample, in place, from t (replicas,); return new memories."""
        for k in range(self._steps):
            states = self._step(t + k * self._h, state, states, command)
        return states

    def _step(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        n, h, plant = self._n, self._h, self._plant
        point, slope, total, work = self._point, self._slope, self._sum, self._work
        here, memory, rates = state, states, states
        moved = np.zeros_like(states)
        for i, (node, weight) in enumerate(zip(_NODES, _WEIGHTS, strict=True)):
            if i:
                np.multiply(slope, node * h, out=work)
                here = np.add(state, work, out=point)
                memory = states + (node * h) * rates if plant.n_states else states
            slope[:n] = here[n:]
            rates = plant.accelerations(t + node * h, here[:n], here[n:], memory, command,
                                        slope[n:], self._held)
            if plant.n_states:
                moved += weight * rates
            if i == 0:
                total[:] = slope
            else:
                total += np.multiply(slope, weight, out=work)
        state += np.multiply(total, h / 6.0, out=work)
        return states + (h / 6.0) * moved


class HeldBody(RungeKutta):
    """The same with D, c and h of D(q) a = τ - τ_f - c - h held at the middle of each step.

    Of second order in the length over which they are held, whose error is (h²/24) d²/dt² of what
    they do; steps that are short share one body. The state in the middle is told from the last
    acceleration, and what the change of the command adds to it.
    """

    def __init__(self, plant: MovingPlant, sample_time: float, steps: int) -> None:
        """Take a `plant` as it `fits`, and `steps` of equal size as one control sample."""
        super().__init__(plant, sample_time, steps)
        if not isinstance(plant.rigid, ManyChains):
            raise TypeError("the rigid body of this arm is not held")
        self._held = self._body = plant.rigid
        self._together = next(count for count in range(steps, 0, -1)
                              if steps % count == 0 and (count == 1 or count * sample_time
                                                         / steps <= SIMULATION.held))
        self._last: tuple[Array, Array] | None = None  # acceleration and command

    @staticmethod
    def fits(plant: MovingPlant) -> bool:
        return isinstance(plant.rigid, ManyChains)

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        n, half = self._n, 0.5 * self._h * self._together
        for k in range(self._steps):
            if k % self._together == 0:
                q, dq = state[:n], state[n:]
                ddq = self._acceleration(t + k * self._h, state, states, command)
                self._body.hold(q + half * dq + 0.5 * half**2 * ddq, dq + half * ddq)
            states = self._step(t + k * self._h, state, states, command)
            self._last = self._slope[n:].copy(), command.copy()
        return states

    def _acceleration(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Return the acceleration (joints, replicas) that begins a step."""
        if self._last is None:
            out, n = np.empty_like(command), self._n
            self._plant.accelerations(t, state[:n], state[n:], states, command, out)
            return out
        ddq, before = self._last
        return ddq + self._body.gained(command - before)

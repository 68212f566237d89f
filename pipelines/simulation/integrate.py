"""Move arms through one control sample, the torque held: Runge-Kutta steps of equal size.

    RungeKutta(moving, sample_time, steps).advance(t, state, states, command)
    OneArm(plant, sample_time, steps).moved(x, torque)      one RRR arm, in plain numbers

    k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3)
    x += h/6 (k1 + 2 k2 + 2 k3 + k4)                                            Kutta 1901

The torque is constant within a sample. What costs accuracy is friction's passage through zero
speed, over in a fraction of a step, while the posture changes inertia, Coriolis forces and weight
by a thousandth in a millisecond. A body that is `held` is that of the middle of a step, or of the
short steps that share it: of second order in the time for which it is held.
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan, tanh

import numpy as np

from pipelines.dynamics.functions import NUMBERS
from pipelines.dynamics.rrr import RRR
from pipelines.effects.base import Hooks, SpeedCurve
from pipelines.io.log import Array
from pipelines.simulation.bodies import Held, closed_form
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.plant import MovingPlant, Plant

__all__ = ["OneArm", "RungeKutta"]

Numbers = list[float]
Slope = Callable[..., tuple[float, float, float, Numbers]]


def _together(sample_time: float, steps: int) -> int:
    """Return how many steps share one body that is held."""
    most = max(1, int(SIMULATION.held * steps / sample_time * (1.0 + 1e-9)))  # numerics: rounding
    return max(count for count in range(1, min(most, steps) + 1) if steps % count == 0)


class RungeKutta:
    """The classical method for q and dq (joints, replicas) and memories (replicas, states)."""

    def __init__(
        self, plant: MovingPlant, sample_time: float, steps: int, held: bool = False
    ) -> None:
        """Take `steps` of equal size as one control sample."""
        self._plant, self._h, self._steps = plant, sample_time / steps, steps
        self._together = _together(sample_time, steps) if held else 0
        self._held: Held | None = None

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Move `state` on by one sample, in place, from t (replicas,); return new memories."""
        for k in range(self._steps):
            now = t + k * self._h
            if self._together and k % self._together == 0:
                n, half = len(command), 0.5 * self._h * self._together
                q, dq = state[:n], state[n:]
                ddq, _ = self._plant.accelerations(now, q, dq, states, command, self._held)
                middle = q + half * (dq + 0.5 * half * ddq), dq + half * ddq
                self._held = self._plant.rigid.hold(*middle)
            states = self._step(now, state, states, command)
        return states

    def _step(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        n, h = len(command), self._h
        slope, total, moved = np.zeros_like(state), np.zeros_like(state), np.zeros_like(states)
        rates = moved
        for node, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            here = state + (node * h) * slope
            memory = states + (node * h) * rates
            slope[n:], rates = self._plant.accelerations(
                t + node * h, here[:n], here[n:], memory, command, self._held
            )
            slope[:n] = here[n:]
            total += weight * slope
            moved += weight * rates
        state += (h / 6.0) * total
        return np.asarray(states + (h / 6.0) * moved)


class OneArm:
    """One RRR arm in plain numbers: for a single robot arrays cost ten times more.

    Functions of effects are the same that arrays are handed to.
    """

    def __init__(self, plant: Plant, sample_time: float, steps: int, held: bool = False) -> None:
        """Take a `plant` as it `fits`; `steps` of equal size make one control sample."""
        assert isinstance(plant.body, RRR)
        self.equations = closed_form(plant.body, plant.p, plant.added, NUMBERS)
        self.slope, self.steps, self.h = self._slope_of(plant), steps, sample_time / steps
        self.together = _together(sample_time, steps) if held else 0
        self.held: tuple[float, ...] | None = None

    @staticmethod
    def fits(plant: Plant) -> bool:
        """Return whether nothing moves it but what is known in plain numbers."""
        return isinstance(plant.body, RRR) and all(map(_in_numbers, plant.hooks))

    def moved(self, x: Numbers, torque: Numbers) -> Numbers:
        """Return the state after one control sample, not numbers where the arm ran away."""
        try:
            for k in range(self.steps):
                if self.together and k % self.together == 0:
                    self.held = self._ahead(x, torque)
                x = self._step(x, torque)
        except (ValueError, OverflowError, ZeroDivisionError):  # infinity has no sine
            return [nan] * len(x)
        return x

    def _ahead(self, x: Numbers, torque: Numbers) -> tuple[float, ...]:
        """Return the body in the middle of the steps that share it."""
        half = 0.5 * self.h * self.together
        a1, a2, a3, _ = self.slope(*x[:6], x[6:], torque, self.held)
        _, q2, q3, v1, v2, v3 = x[:6]
        q2, q3 = q2 + half * (v2 + 0.5 * half * a2), q3 + half * (v3 + 0.5 * half * a3)
        return self.equations(q2, q3, v1 + half * a1, v2 + half * a2, v3 + half * a3)

    def _step(self, x: Numbers, torque: Numbers) -> Numbers:
        """Return the state after a step: stages k, m, n, o of dq/dt, dv/dt and memories db/dt.

        Written out for three joints, which takes half the time of loops over them.
        """
        q1, q2, q3, v1, v2, v3, *b = x
        slope, held, h, half, sixth = self.slope, self.held, self.h, 0.5 * self.h, self.h / 6.0
        k1, k2, k3, kb = slope(q1, q2, q3, v1, v2, v3, b, torque, held)
        w1, w2, w3 = v1 + half * k1, v2 + half * k2, v3 + half * k3
        p1, p2, p3, bent = q1 + half * v1, q2 + half * v2, q3 + half * v3, _further(b, half, kb)
        m1, m2, m3, mb = slope(p1, p2, p3, w1, w2, w3, bent, torque, held)
        y1, y2, y3 = v1 + half * m1, v2 + half * m2, v3 + half * m3
        p1, p2, p3, bent = q1 + half * w1, q2 + half * w2, q3 + half * w3, _further(b, half, mb)
        n1, n2, n3, nb = slope(p1, p2, p3, y1, y2, y3, bent, torque, held)
        z1, z2, z3 = v1 + h * n1, v2 + h * n2, v3 + h * n3
        p1, p2, p3, bent = q1 + h * y1, q2 + h * y2, q3 + h * y3, _further(b, h, nb)
        o1, o2, o3, ob = slope(p1, p2, p3, z1, z2, z3, bent, torque, held)
        memories = zip(b, kb, mb, nb, ob, strict=True)
        return [
            q1 + sixth * (v1 + 2.0 * (w1 + y1) + z1),
            q2 + sixth * (v2 + 2.0 * (w2 + y2) + z2),
            q3 + sixth * (v3 + 2.0 * (w3 + y3) + z3),
            v1 + sixth * (k1 + 2.0 * (m1 + n1) + o1),
            v2 + sixth * (k2 + 2.0 * (m2 + n2) + o2),
            v3 + sixth * (k3 + 2.0 * (m3 + n3) + o3),
            *[a + sixth * (k + 2.0 * (m + n) + o) for a, k, m, n, o in memories],
        ]

    def _slope_of(self, plant: Plant) -> Slope:
        """Return q, dq, memories, command, held body -> ddq and the memories' rates."""
        equations, hooks = self.equations, plant.hooks
        first, second, third = (_curve(curve) for curve in plant.curves)
        drives = [hook.drive for hook in reversed(hooks) if hook.drive is not None]
        loads = [hook.alone for hook in hooks if hook.alone is not None]
        memories = [hook.remembering for hook in hooks if hook.remembering is not None]

        def effects(
            q: Numbers, v: Numbers, bent: Numbers, command: Numbers
        ) -> tuple[Numbers, Numbers]:
            command, rates = command.copy(), []
            for joint, drive in drives:
                command[joint] = drive(command, v, NUMBERS)
            for joint, load in loads:
                command[joint] -= load(q[joint], v[joint], NUMBERS)
            for b, (joint, memory) in zip(bent, memories, strict=True):
                rates.append(memory.rate(b, v[joint], NUMBERS))
                command[joint] -= memory.load(b, rates[-1])
            return command, rates

        def slope(  # noqa: PLR0913
            q1: float,
            q2: float,
            q3: float,
            v1: float,
            v2: float,
            v3: float,
            bent: Numbers,
            command: Numbers,
            held: tuple[float, ...] | None,
        ) -> tuple[float, float, float, Numbers]:
            rates = bent
            if hooks:
                command, rates = effects([q1, q2, q3], [v1, v2, v3], bent, command)
            u1, u2, u3 = command
            i11, i12, i13, i22, i23, i33, b1, b2, b3 = held or equations(q2, q3, v1, v2, v3)
            u1, u2, u3 = u1 - first(v1) - b1, u2 - second(v2) - b2, u3 - third(v3) - b3
            return (
                i11 * u1 + i12 * u2 + i13 * u3,
                i12 * u1 + i22 * u2 + i23 * u3,
                i13 * u1 + i23 * u2 + i33 * u3,
                rates,
            )

        return slope


def _further(b: Numbers, h: float, rates: Numbers) -> Numbers:
    return [a + h * rate for a, rate in zip(b, rates, strict=True)] if b else b


def _in_numbers(hook: Hooks) -> bool:
    if hook.actuator or hook.sensor or hook.load or hook.rate or hook.update or hook.settled:
        return False
    return not hook.states or hook.remembering is not None


def _curve(form: SpeedCurve) -> Callable[[float], float]:
    """τ(v) = constant + viscous v + Σ height tanh(sharpness v), most often of one or three."""
    constant, viscous = form.constant, form.viscous
    pairs = list(zip(form.heights, form.sharpnesses, strict=True))
    if len(pairs) == 1:
        ((f, w),) = pairs
        return lambda v: constant + viscous * v + f * tanh(w * v)
    if len(pairs) == 3:  # noqa: PLR2004
        (f1, w1), (f2, w2), (f3, w3) = pairs
        return lambda v: (
            constant + viscous * v + f1 * tanh(w1 * v) + f2 * tanh(w2 * v) + f3 * tanh(w3 * v)
        )
    return lambda v: form.of(v, NUMBERS)

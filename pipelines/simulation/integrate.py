"""Move arms through one control sample, the torque held: Runge-Kutta steps of equal size.

    RungeKutta(moving, sample_time, steps).advance(t, state, states, command)
    OneArm(plant, sample_time, steps).moved(x, torque)      one RRR arm, in plain numbers

    k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3)
    x += h/6 (k1 + 2 k2 + 2 k3 + k4)                                            Kutta 1901

The torque is constant within a sample, so nothing in f jumps but what friction does at rest. A
linearly implicit method (Rang & Angermann 2005, ROS34PW2, friction's slope implicit) costs more and
is mostly 1.5 to 4 times less exact at the same step: what costs accuracy is the passage through
zero speed, not the slope at rest.

That passage is over in a fraction of a step, while inertia, Coriolis forces and weight change with
the posture: a thousandth of them in a millisecond. A body that is `held` is worked out once a step
at the middle of it, told from the last acceleration and what the change of the command adds: of
second order in the length over which it is held, whose error is (h²/24) d²/dt² of what D, c and h
do. Steps that are short share one body.
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan, tanh

import numpy as np

from pipelines.dynamics.functions import NUMBERS
from pipelines.dynamics.rrr import RRR
from pipelines.effects.base import Hooks, SpeedCurve
from pipelines.io.log import Array
from pipelines.simulation.bodies import Held, closed_form, gained
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.plant import MovingPlant, Plant

__all__ = ["OneArm", "RungeKutta"]

_NODES = (0.0, 0.5, 0.5, 1.0)  # numerics: Kutta 1901
_WEIGHTS = (1.0, 2.0, 2.0, 1.0)  # numerics: Kutta 1901

Numbers = list[float]
Slope = Callable[..., tuple[float, float, float, Numbers]]


def _together(sample_time: float, steps: int) -> int:
    """Return how many steps share one body that is held."""
    return next(
        count
        for count in range(steps, 0, -1)
        if steps % count == 0 and (count == 1 or count * sample_time / steps <= SIMULATION.held)
    )


class RungeKutta:
    """The classical method for q and dq (joints, replicas) and memories (replicas, states)."""

    def __init__(
        self, plant: MovingPlant, sample_time: float, steps: int, held: bool = False
    ) -> None:
        """Take `steps` of equal size as one control sample."""
        self._plant, self._h, self._steps = plant, sample_time / steps, steps
        self._together = _together(sample_time, steps) if held else 0
        self._held: Held | None = None
        self._last: tuple[Array, Array] | None = None  # acceleration and command

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Move `state` on by one sample, in place, from t (replicas,); return new memories."""
        for k in range(self._steps):
            now = t + k * self._h
            if self._together and k % self._together == 0:
                self._held = self._ahead(now, state, states, command)
            states = self._step(now, state, states, command)
        return states

    def _step(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        n, h, plant = len(command), self._h, self._plant
        slope, total, moved = np.zeros_like(state), np.zeros_like(state), np.zeros_like(states)
        rates = moved
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            here = state + (node * h) * slope
            memory = states + (node * h) * rates
            ddq, rates = plant.accelerations(
                t + node * h, here[:n], here[n:], memory, command, self._held
            )
            slope[:n], slope[n:] = here[n:], ddq
            total += weight * slope
            moved += weight * rates
        state += (h / 6.0) * total
        self._last = ddq, command.copy()
        return np.asarray(states + (h / 6.0) * moved)

    def _ahead(self, t: Array, state: Array, states: Array, command: Array) -> Held:
        """Return the body in the middle of the steps that share it."""
        n, half = len(command), 0.5 * self._h * self._together
        q, dq = state[:n], state[n:]
        if self._held is None or self._last is None:
            ddq, _ = self._plant.accelerations(t, q, dq, states, command)
        else:
            ddq, before = self._last
            ddq = ddq + gained(self._held[0], command - before)
        return self._plant.rigid.hold(q + half * dq + 0.5 * half**2 * ddq, dq + half * ddq)


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
        self.last: tuple[Numbers, Numbers] | None = None  # acceleration and command

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
        if self.held is None or self.last is None:
            a1, a2, a3, _ = self.slope(*x[:6], x[6:], torque, None)
        else:
            i11, i12, i13, i22, i23, i33, *_ = self.held
            (a1, a2, a3), before = self.last
            u1, u2, u3 = (now - then for now, then in zip(torque, before, strict=True))
            a1 += i11 * u1 + i12 * u2 + i13 * u3
            a2 += i12 * u1 + i22 * u2 + i23 * u3
            a3 += i13 * u1 + i23 * u2 + i33 * u3
        _, q2, q3, v1, v2, v3 = x[:6]
        ahead = 0.5 * half**2
        return self.equations(
            q2 + half * v2 + ahead * a2,
            q3 + half * v3 + ahead * a3,
            v1 + half * a1,
            v2 + half * a2,
            v3 + half * a3,
        )

    def _step(self, x: Numbers, torque: Numbers) -> Numbers:
        """Return the state after a step: stages k, m, n, o of dq/dt, dv/dt and memories db/dt.

        Written out for three joints, which takes half the time of loops over them.
        """
        q1, q2, q3, v1, v2, v3, *b = x
        slope, held, h, half, sixth = self.slope, self.held, self.h, 0.5 * self.h, self.h / 6.0
        k1, k2, k3, kb = slope(q1, q2, q3, v1, v2, v3, b, torque, held)
        w1, w2, w3 = v1 + half * k1, v2 + half * k2, v3 + half * k3
        m1, m2, m3, mb = slope(
            q1 + half * v1,
            q2 + half * v2,
            q3 + half * v3,
            w1,
            w2,
            w3,
            _further(b, half, kb),
            torque,
            held,
        )
        y1, y2, y3 = v1 + half * m1, v2 + half * m2, v3 + half * m3
        n1, n2, n3, nb = slope(
            q1 + half * w1,
            q2 + half * w2,
            q3 + half * w3,
            y1,
            y2,
            y3,
            _further(b, half, mb),
            torque,
            held,
        )
        z1, z2, z3 = v1 + h * n1, v2 + h * n2, v3 + h * n3
        o1, o2, o3, ob = slope(
            q1 + h * y1, q2 + h * y2, q3 + h * y3, z1, z2, z3, _further(b, h, nb), torque, held
        )
        self.last = [o1, o2, o3], torque
        bent = zip(b, kb, mb, nb, ob, strict=True)
        return [
            q1 + sixth * (v1 + 2.0 * (w1 + y1) + z1),
            q2 + sixth * (v2 + 2.0 * (w2 + y2) + z2),
            q3 + sixth * (v3 + 2.0 * (w3 + y3) + z3),
            v1 + sixth * (k1 + 2.0 * (m1 + n1) + o1),
            v2 + sixth * (k2 + 2.0 * (m2 + n2) + o2),
            v3 + sixth * (k3 + 2.0 * (m3 + n3) + o3),
            *[a + sixth * (k + 2.0 * (m + n) + o) for a, k, m, n, o in bent],
        ]

    def _slope_of(self, plant: Plant) -> Slope:
        """Return q, dq, memories, command, held body -> ddq and the memories' rates."""
        equations, hooks = self.equations, plant.hooks
        first, second, third = (_curve(curve) for curve in plant.curves)
        drives = [hook.drive for hook in reversed(hooks) if hook.drive is not None]
        loads = [hook.alone for hook in hooks if hook.alone is not None]
        memories = [hook.remembering for hook in hooks if hook.remembering is not None]

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
                q, v, command, rates = (q1, q2, q3), (v1, v2, v3), command.copy(), []
                for joint, drive in drives:
                    command[joint] = drive(command, v, NUMBERS)
                for joint, load in loads:
                    command[joint] -= load(q[joint], v[joint], NUMBERS)
                for b, (joint, memory) in zip(bent, memories, strict=True):
                    rates.append(memory.rate(b, v[joint], NUMBERS))
                    command[joint] -= memory.load(b, rates[-1])
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

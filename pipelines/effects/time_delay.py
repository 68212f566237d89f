"""A measured position that is older than its time stamp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import arm_slopes, perturbed_by, rate_of, shifted
from pipelines.effects.base import ArmModel, Effect, Hooks, Parameters, Predict, Quantity, Values

__all__ = ["TimeDelay"]

Indices = npt.NDArray[np.intp]

# Kept positions lie at least a 32nd of the delay apart, so that they reach back far enough at any
# rate.
_ROWS = 36  # numerics: positions kept, a few more than 32
_CLOSEST = 1.0 / 32.0  # numerics: of the delay


@dataclass(frozen=True)
class TimeDelay(Effect):
    """q_measured(t) = q(t - Δ) at one joint.

    The arm is where it will be measured to be, q(t) = q_measured(t + Δ).

    To first order τ = Δ P_j(q̇_j). Exactly: q_j, its speed and its acceleration, each moved by Δ
    along its cubic spline.
    """

    name = "time_delay"
    parameters = Parameters(
        Quantity("delay", "s", 0.0, 0.05,
                 "measured position is this much older than its time stamp",
                 healthy=1e-4))  # a control program under Linux stamps its samples no better
    acts_on = "encoder"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        dq, ddq = self.own(motion.dq), self.own(motion.ddq)
        return perturbed_by(arm_slopes(arm, motion, self._index), dq, ddq,
                            rate_of(ddq, motion.t))[..., None]

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        true = self._moved(motion, values["delay"]) if values["delay"] else motion
        return predict(true, arm) if predict is not None else arm.torque(true)

    def _moved(self, motion: Motion, by: float) -> Motion:
        """Joint j at t + `by`; past an end of the log by its last known derivatives."""
        t = motion.t
        q, dq, ddq = (self.own(x) for x in (motion.q, motion.dq, motion.ddq))
        jerk = rate_of(ddq, t)
        at = np.clip(t + by, t[0], t[-1])
        over = t + by - at
        k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, max(len(t) - 2, 0))
        here = [_cubic(t, x, slope, k, at) for x, slope in ((q, dq), (dq, ddq), (ddq, jerk))]
        past = np.where(over < 0.0, jerk[0], jerk[-1])
        a = here[2] + over * past
        v = here[1] + over * (here[2] + 0.5 * over * past)
        x = here[0] + over * (here[1] + over * (0.5 * here[2] + over * past / 6.0))
        return shifted(motion, self._index, x - q, v - dq, a - ddq)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the hooks of an encoder that reads from a record of past positions and speeds.

        States: time since the start and q now, then time, q, q̇ of each kept sample, the newest
        first. Between the newest and now, whose speed an encoder does not know, a parabola. What
        other sensors add stays.
        """
        j, delay = self._index, values["delay"]
        if not delay:
            return Hooks(sensor=lambda q, states: q)

        def settled(motion: Motion, tau: Array) -> Motion:
            v, a = motion.dq[:, j], motion.ddq[:, j]
            return shifted(motion, j, delay * (v + 0.5 * delay * a), delay * a, 0.0 * a)

        def start(motion: Motion, tau: Array) -> Array:
            """Before the first sample it moved with the same acceleration."""
            ago = np.arange(1, _ROWS + 1) * delay * _CLOSEST
            q, v, a = motion.q[:, j], motion.dq[:, j], motion.ddq[:, j]
            rows = [
                np.stack([0.0 * q - back, q - back * (v - 0.5 * back * a), v - back * a], axis=-1)
                for back in ago
            ]
            return np.concatenate([0.0 * q[:, None], q[:, None], *rows], axis=1)

        def update(motion: Motion, command: Array, states: Array) -> Array:
            if states[0, 0] - states[0, 2] < 0.999 * _CLOSEST * delay:
                return states
            now = np.stack([states[:, 0], motion.q[:, j], motion.dq[:, j]], axis=-1)
            return np.concatenate([states[:, :2], now, states[:, 2:-3]], axis=1)

        def rate(motion: Motion, command: Array, states: Array) -> Array:
            running = np.zeros_like(states)
            running[:, 0], running[:, 1] = 1.0, motion.dq[:, j]
            return running

        def sensor(q: Array, states: Array) -> Array:
            seen = q.copy()
            seen[:, j] += _read(states, delay) - states[:, 1]
            return seen

        return Hooks(sensor=sensor, states=2 + 3 * _ROWS, settled=settled, start=start, rate=rate,
                     update=update)


def _cubic(t: Array, x: Array, slope: Array, k: Indices, at: Array) -> Array:
    """x at the times `at`, in the intervals k.

    The cubic goes through values and slopes at both ends.
    """
    if len(t) < 2:  # noqa: PLR2004
        return x
    h = t[k + 1] - t[k]
    u = (at - t[k]) / h
    return np.asarray((1 + 2 * u) * (1 - u) ** 2 * x[k] + u * (1 - u) ** 2 * h * slope[k]
                      + u * u * (3 - 2 * u) * x[k + 1] - u * u * (1 - u) * h * slope[k + 1])


def _read(states: Array, delay: float) -> Array:
    """Return the position (replicas,) that is `delay` old; the clocks of all replicas run alike."""
    now, q = states[:, 0], states[:, 1]
    t, x, v = (states[:, k::3].T[::-1] for k in (2, 3, 4))  # (rows, replicas), the oldest first
    wanted = float(now[0]) - delay
    k = int(np.searchsorted(t[:, 0], wanted, side="right")) - 1
    if k < len(t) - 1:
        return np.asarray(_cubic(t[:, 0], x, v, np.array([max(k, 0)]), np.array([wanted]))[0])
    since, back = now - delay - t[-1], now - t[-1]
    return np.asarray(x[-1] + since * v[-1]
                      + (since / back)**2 * (q - x[-1] - back * v[-1]) if back[0] > 0.0 else q)

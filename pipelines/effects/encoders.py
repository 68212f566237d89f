"""Encoders that misread their joint."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import arm_slopes, perturbed_by, rate_of, shifted
from pipelines.effects.base import ArmModel, Effect, Hooks, Values

__all__ = ["EncoderCrosstalk", "EncoderEccentricity", "TimeDelay"]

Deviation = tuple[Array, Array, Array]  # of an angle (samples,), and its derivatives

_ROUNDS = 6  # numerics: each leaves A times the error before
# Kept positions lie at least a 32nd of the delay apart, so that they reach back far enough at any
# rate.
_ROWS = 36  # numerics: positions kept, a few more than 32
_CLOSEST = 1.0 / 32.0  # numerics: of the delay


@dataclass(frozen=True)
class _Misreading(Effect):
    """An encoder whose reading differs from the true angle."""

    acts_on = "encoder"

    @abstractmethod
    def deviations(self, motion: Motion) -> Sequence[Deviation]:
        """Return by how much the true angle differs per unit of each amplitude."""

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        """Return P_j of each deviation, of the arm as its joint feels it."""
        slopes = arm_slopes(arm, motion, self.index)
        return np.stack([perturbed_by(slopes, *d) for d in self.deviations(motion)], axis=-1)

    def passed(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        return tau

    def reading(self, values: Values, error: Callable[[Array], Array]) -> Hooks:
        """Return the hooks of an encoder that reads `error` (replicas,) more at the true q."""

        def sensor(q: Array, _: Array) -> Array:
            seen = q.copy()
            seen[:, self.index] += error(q)
            return seen

        return Hooks(sensor=sensor, settled=lambda motion, _: self.corrected(motion, values))


@dataclass(frozen=True)
class EncoderCrosstalk(_Misreading):
    """q_measured,j = q_j + c q_i: to first order τ = c P_j(-q_i), joint i being read well."""

    from_joint: float = 0.0  # i, 1-based

    name = "encoder_crosstalk"

    def deviations(self, motion: Motion) -> Sequence[Deviation]:
        other = int(self.from_joint) - 1
        return ((-motion.q[:, other], -motion.dq[:, other], -motion.ddq[:, other]),)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        c, other = values["coefficient"], int(values["from_joint"]) - 1
        return self.reading(values, lambda q: c * q[:, other])

    def corrected(self, motion: Motion, values: Values) -> Motion:
        c, ((d, rate, second),) = values["coefficient"], self.at(values).deviations(motion)
        return shifted(motion, self.index, c * d, c * rate, c * second) if c else motion


@dataclass(frozen=True)
class EncoderEccentricity(_Misreading):
    """q_measured = q + A sin(q + φ), once a turn.

    To first order τ = A cos φ P_j(-sin q_j) + A sin φ P_j(-cos q_j). Exactly, of the motion

        q̇ = q̇_m/(1 + e'),  q̈ = (q̈_m + e q̇²)/(1 + e'),  e = A sin(q + φ), e' = A cos(q + φ)
    """

    name = "encoder_eccentricity"

    def deviations(self, motion: Motion) -> Sequence[Deviation]:
        q, v, u = (self.own(x) for x in (motion.q, motion.dq, motion.ddq))
        s, c = np.sin(q), np.cos(q)
        return (-s, -c * v, s * v * v - c * u), (-c, s * v, c * v * v + s * u)

    def amplitudes(self, values: Values) -> Array:
        return values["amplitude"] * np.array([np.cos(values["phase"]), np.sin(values["phase"])])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        sine, cosine = amplitudes
        return {
            "amplitude": float(np.hypot(sine, cosine)),
            "phase": float(np.arctan2(cosine, sine)),
        }

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        size, phase = values["amplitude"], values["phase"]
        return self.reading(values, lambda q: size * np.sin(self.own(q) + phase))

    def corrected(self, motion: Motion, values: Values) -> Motion:
        size, phase = values["amplitude"], values["phase"]
        if not size:
            return motion
        measured, v, u = (self.own(x) for x in (motion.q, motion.dq, motion.ddq))
        q = measured
        for _ in range(_ROUNDS):
            q = measured - size * np.sin(q + phase)
        error, slope = size * np.sin(q + phase), size * np.cos(q + phase)
        speed = v / (1.0 + slope)
        acceleration = (u + error * speed * speed) / (1.0 + slope)
        return shifted(motion, self.index, q - measured, speed - v, acceleration - u)


@dataclass(frozen=True)
class TimeDelay(_Misreading):
    """q_measured(t) = q(t - Δ) at one joint: the arm is where it will be measured to be.

    To first order τ = Δ P_j(q̇_j). Exactly: q_j, its speed and its acceleration along their
    splines.
    """

    name = "time_delay"

    def deviations(self, motion: Motion) -> Sequence[Deviation]:
        dq, ddq = self.own(motion.dq), self.own(motion.ddq)
        return ((dq, ddq, rate_of(ddq, motion.t)),)

    def corrected(self, motion: Motion, values: Values) -> Motion:
        """Return joint j at t + Δ; past an end of the log by its last known derivatives."""
        t, by = motion.t, values["delay"]
        if not by:
            return motion
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
        return shifted(motion, self.index, x - q, v - dq, a - ddq)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the hooks of an encoder that reads from a record of past positions and speeds.

        States: time since the start and q now, then time, q, q̇ of each kept sample, the newest
        first. Between the newest and now, whose speed an encoder does not know, a parabola.
        """
        j, delay = self.index, values["delay"]
        if not delay:
            return Hooks(sensor=lambda q, states: q)

        def settled(motion: Motion, tau: Array) -> Motion:
            v, a = motion.dq[:, j], motion.ddq[:, j]
            return shifted(motion, j, delay * (v + 0.5 * delay * a), delay * a, 0.0 * a)

        def start(motion: Motion, tau: Array) -> Array:
            """Before the first sample it moved with the same acceleration."""
            q, v, a = motion.q[:, j], motion.dq[:, j], motion.ddq[:, j]
            rows = [0.0 * q, q]
            for back in np.arange(1, _ROWS + 1) * delay * _CLOSEST:
                rows += [0.0 * q - back, q - back * (v - 0.5 * back * a), v - back * a]
            return np.stack(rows, axis=1)

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

        return Hooks(
            sensor=sensor,
            states=2 + 3 * _ROWS,
            settled=settled,
            start=start,
            rate=rate,
            update=update,
        )


def _cubic(t: Array, x: Array, slope: Array, k: npt.NDArray[np.intp], at: Array) -> Array:
    """Return x at the times `at`, in the intervals k: a cubic by values and slopes at both ends."""
    if len(t) < 2:  # noqa: PLR2004
        return x
    h = t[k + 1] - t[k]
    u = (at - t[k]) / h
    return np.asarray(
        (1 + 2 * u) * (1 - u) ** 2 * x[k]
        + u * (1 - u) ** 2 * h * slope[k]
        + u * u * (3 - 2 * u) * x[k + 1]
        - u * u * (1 - u) * h * slope[k + 1]
    )


def _read(states: Array, delay: float) -> Array:
    """Return the position (replicas,) that is `delay` old; the clocks of all replicas run alike."""
    now, q = states[:, 0], states[:, 1]
    t, x, v = (states[:, k::3].T[::-1] for k in (2, 3, 4))  # (rows, replicas), the oldest first
    wanted = float(now[0]) - delay
    k = int(np.searchsorted(t[:, 0], wanted, side="right")) - 1
    if k < len(t) - 1:
        return np.asarray(_cubic(t[:, 0], x, v, np.array([max(k, 0)]), np.array([wanted]))[0])
    since, back = now - delay - t[-1], now - t[-1]
    if back[0] <= 0.0:
        return q
    return np.asarray(x[-1] + since * v[-1] + (since / back) ** 2 * (q - x[-1] - back * v[-1]))

"""Motions that an arm follows, and the loops that make it follow them; none of them is the bench's.

q, dq, ddq = motion("fourier", arm, t, rng)        (samples, joints) each
loop = Loop("cascade", arm, sample_time, inertia, bandwidth_hz, counts, limit)
command = loop(q_ref, dq_ref, ddq_ref, q)          (joints,) at each sample
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from benchmarks.other_plants.arms import Arm
from pipelines.io.log import Array, Controller

Path = tuple[Array, Array, Array]
_DAMPING = 0.8
_FILTER_HZ = 60.0  # of the cascade's speed


def motion(kind: str, arm: Arm, t: Array, rng: np.random.Generator) -> Path:
    """Position, speed and acceleration (samples, joints) of "fourier", "moves" or "ramps"."""
    made = {"fourier": _fourier, "moves": _moves, "ramps": _ramps}[kind]
    home, reach, speed = (
        np.array([getattr(axis, name) for axis in arm.axes]) for name in ("home", "reach", "speed")
    )
    q, dq, ddq = made(t, reach, speed, rng)
    return home + q, dq, ddq


def _fourier(t: Array, reach: Array, speed: Array, rng: np.random.Generator) -> Path:
    """Nine harmonics of a tenth of a Hertz or a bit more, within 90 % of the reach and 70 % of the
    speed.
    """
    w = 2.0 * np.pi * rng.choice([0.1, 0.125]) * np.arange(1, 10)[:, None]
    a, b = rng.standard_normal((2, 9, len(reach))) / w
    s, c = np.sin(t[:, None] * w.T), np.cos(t[:, None] * w.T)
    q, dq, ddq = s @ a + c @ b, c @ (w * a) - s @ (w * b), -s @ (w**2 * a) - c @ (w**2 * b)
    by = np.minimum(0.9 * reach / np.abs(q).max(axis=0), 0.7 * speed / np.abs(dq).max(axis=0))
    return by * q, by * dq, by * ddq


def _moves(t: Array, reach: Array, speed: Array, rng: np.random.Generator) -> Path:
    """Point to point with quintics at 80 % of the speed at most, and rests of 0.3 s."""
    goals, starts, lasting = [np.zeros(len(reach))], [0.0], []
    while starts[-1] <= t[-1]:
        goals.append(rng.uniform(-0.9, 0.9, len(reach)) * reach)
        lasting.append(
            max(float(np.max(1.875 * np.abs(goals[-1] - goals[-2]) / (0.8 * speed))), 0.4)
        )
        starts.append(starts[-1] + lasting[-1] + 0.3)
    place = np.searchsorted(starts, t, side="right") - 1
    long = np.array(lasting)[place][:, None]
    s = np.clip((t - np.array(starts)[place])[:, None] / long, 0.0, 1.0)
    first, step = np.array(goals)[place], np.diff(goals, axis=0)[place]
    return (
        first + step * (10 * s**3 - 15 * s**4 + 6 * s**5),
        step * (30 * s**2 - 60 * s**3 + 30 * s**4) / long,
        step * (60 * s - 180 * s**2 + 120 * s**3) / long**2,
    )


def _ramps(t: Array, reach: Array, speed: Array, rng: np.random.Generator) -> Path:
    """Back and forth at a speed that is nearly constant, a tenth to a third of the largest: arcsine
    of a sine.
    """
    k, far = 0.99, 0.8 * reach
    w = 0.5 * np.pi * rng.uniform(0.1, 0.33, len(reach)) * speed / far
    x = t[:, None] * w
    inner = 1.0 - (k * np.sin(x)) ** 2
    by = far * 2.0 / np.pi
    bend = by * k * w**2 * (k * k - 1.0) * np.sin(x) / inner**1.5
    return by * np.arcsin(k * np.sin(x)), by * k * w * np.cos(x) / np.sqrt(inner), bend


class Loop:
    """A controller with its memory: "pd", "pid", "pd+gravity", "cascade" or "computed torque". Of
    the first two a log can tell. Its own model, where it has one, is a tenth too heavy.
    """

    def __init__(
        self,
        kind: str,
        arm: Arm,
        sample_time: float,
        inertia: Array,
        bandwidth_hz: float,
        counts: Array,
        limit: Array,
    ) -> None:
        w = 2.0 * np.pi * bandwidth_hz
        self.kind, self.step, self.counts, self.limit = kind, sample_time, counts, limit
        self.kp, self.kd = inertia * w**2, 2.0 * _DAMPING * inertia * w
        self.ki = 0.3 * w * self.kp if kind == "pid" else 0.0 * self.kp
        self.inertia, self.rate = inertia, w
        self._model = arm.model(sample_time, scale=1.1)
        self._data = mujoco.MjData(self._model)
        self._last: Array | None = None
        self._speed, self._sum = np.zeros(len(inertia)), np.zeros(len(inertia))

    def told(self) -> Controller | None:
        """Return the description that a log has of the loop; None of those that it cannot
        describe.
        """
        if self.kind not in ("pd", "pid"):
            return None
        return Controller(
            "pd",
            kp=self.kp,
            kd=self.kd,
            ki=self.ki,
            velocity="backward-difference",
            torque_resolution=self.counts,
        )

    def __call__(self, q_ref: Array, dq_ref: Array, ddq_ref: Array, q: Array) -> Array:
        e = q - q_ref
        change = np.zeros(len(e)) if self._last is None else (e - self._last) / self.step
        self._last, before = e, self._sum
        torque = getattr(self, "_" + self.kind.replace("+", "_").replace(" ", "_"))(
            q_ref, dq_ref, ddq_ref, q, e, change
        )
        self._sum = np.where(
            np.abs(torque) > self.limit, before, self._sum
        )  # no more than the drives have, and no wind-up
        return np.asarray(
            np.rint(np.clip(torque, -self.limit, self.limit) / self.counts) * self.counts
        )

    def _pd(
        self, q_ref: Array, dq_ref: Array, ddq_ref: Array, q: Array, e: Array, change: Array
    ) -> Any:
        return -self.kp * e - self.kd * change

    def _pid(
        self, q_ref: Array, dq_ref: Array, ddq_ref: Array, q: Array, e: Array, change: Array
    ) -> Any:
        self._sum = self._sum + self.step * e
        return -self.kp * e - self.kd * change - self.ki * self._sum

    def _pd_gravity(
        self, q_ref: Array, dq_ref: Array, ddq_ref: Array, q: Array, e: Array, change: Array
    ) -> Any:
        return self._pd(q_ref, dq_ref, ddq_ref, q, e, change) + self._bias(q, np.zeros(len(e)))

    def _cascade(
        self, q_ref: Array, dq_ref: Array, ddq_ref: Array, q: Array, e: Array, change: Array
    ) -> Any:
        share = 1.0 - np.exp(-2.0 * np.pi * _FILTER_HZ * self.step)
        self._speed = self._speed + share * (change - self._speed)
        wanted = -0.3 * self.rate * e - self._speed
        self._sum = self._sum + self.step * wanted
        return self.kd * (wanted + 0.3 * self.rate * self._sum)

    def _computed_torque(
        self, q_ref: Array, dq_ref: Array, ddq_ref: Array, q: Array, e: Array, change: Array
    ) -> Any:
        bias, mass = self._bias(q, dq_ref), np.zeros((len(e), len(e)))
        mujoco.mj_fullM(self._model, self._data, mass)
        return mass @ (ddq_ref - self.rate**2 * e - 2.0 * _DAMPING * self.rate * change) + bias

    def _bias(self, q: Array, dq: Array) -> Array:
        self._data.qpos[:], self._data.qvel[:] = q, dq
        mujoco.mj_forward(self._model, self._data)
        return np.array(self._data.qfrc_bias)

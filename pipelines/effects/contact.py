"""Something that pushes against the tip for a moment."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.altered import chain_of
from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.kinematics import SerialChain, jacobian
from pipelines.effects.base import ArmModel, Event, Hooks, Values
from pipelines.effects.config import EFFECTS

__all__ = ["Contact"]


@dataclass(frozen=True)
class Contact(Event):
    """τ = -Jᵀ F sin(π (t - t0)/D) while 0 < t - t0 < D: a push F on the tip, in the base frame.

    t counts from the start of its log, to which it belongs: a fit should leave out its samples.
    """

    start: float = 0.0  # t0 [s]
    duration: float = 0.2  # D [s]

    name = "contact"
    scope = "arm"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self._columns(motion.q, motion.t - motion.t[0], chain_of(arm.body))

    def _columns(self, q: Array, t: Array, chain: SerialChain) -> Array:
        """Return (samples, joints, 3) at q (samples, joints), t (samples,) since the log began."""
        table = np.zeros((3, *q.shape[::-1])).transpose(2, 1, 0)  # samples side by side
        during = np.flatnonzero(self._acting(t))
        if len(during):
            linear = jacobian(chain, q[during])[:, :3].transpose(0, 2, 1)
            table[during] = -self.course(t)[during, None, None] * linear
        return table

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Its memory is when the log began."""
        shaped, chain, force = self.at(values), chain_of(arm.body), self.amplitudes(values)

        def load(motion: Motion, states: Array) -> Array:
            return np.asarray(shaped._columns(motion.q, motion.t - states[:, 0], chain) @ force)

        return Hooks(
            load=load,
            states=1,
            start=lambda motion, _: motion.t[:, None],
            update=lambda motion, _, states: states,
        )

    def _acting(self, t: Array) -> npt.NDArray[np.bool_]:
        return np.asarray((t > self.start) & (t < self.start + self.duration))

    def course(self, t: Array) -> Array:
        return np.where(self._acting(t), np.sin(math.pi * (t - self.start) / self.duration), 0.0)

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Windows of 0.2 s that overlap by half."""
        for start in np.arange(0.0, np.ptp(motion.t) - 0.1, 0.1).tolist():
            yield replace(self, start=start, duration=0.2)

    def promising(self, motion: Motion, arm: ArmModel, residual: Array) -> Iterator[Self]:
        """Where the residual, every joint by its own median size, is largest over 0.15 s."""
        size = np.median(np.abs(residual), axis=0)
        power = np.sum(np.square(residual / np.where(size > 0.0, size, 1.0)), axis=1)
        width = max(1, int(np.searchsorted(motion.t, motion.t[0] + 0.15)))
        mean = np.convolve(power, np.ones(width) / width, mode="same")
        for _ in range(EFFECTS.contacts):
            centre = int(np.argmax(mean))
            mean[max(0, centre - 2 * width) : centre + 2 * width] = -1.0
            for duration in (0.1, 0.2, 0.3):
                start = float(motion.t[centre] - motion.t[0]) - 0.5 * duration
                yield replace(self, start=start, duration=duration)

    def amplitudes(self, values: Values) -> Array:
        return np.array([values[f"force_{axis}"] for axis in "xyz"])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        x, y, z = map(float, amplitudes)
        return {
            "start": self.start,
            "duration": self.duration,
            "force": math.hypot(x, y, z),
            "force_x": x,
            "force_y": y,
            "force_z": z,
        }

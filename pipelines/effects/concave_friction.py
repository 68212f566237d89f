"""Concave friction: it rises with speed and levels off."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import (
    LARGE,
    ArmModel,
    OwnLoad,
    Parameters,
    Quantity,
    SpeedCurve,
    Values,
)
from pipelines.effects.config import EFFECTS
from pipelines.effects.kinds import FrictionLaw

__all__ = ["ConcaveFriction"]

_NONE = 1e-6  # numerics: of a knee


@dataclass(frozen=True)
class ConcaveFriction(FrictionLaw):
    """τ = A tanh(v/v_0), or A x (1 + |x|^a)^(-1/a), x = v/v_0, beside Coulomb and viscous friction.

    The second is the shear of a lubricant whose viscosity falls as 1/|v| far above v_0: Yasuda,
    Armstrong & Cohen 1981, with the knee a; a = 2 is Carreau 1972, and the smaller a, the more
    gradually it levels off. v_0 lies well above the speeds at which Coulomb friction turns.
    """

    speed: float = 1.0  # v_0 [rad/s]
    knee: float = 0.0  # a, held where it is 0: tanh

    name = "concave_friction"
    parameters = Parameters(
        Quantity("amplitude", "N m", 0.0, LARGE, "torque at which it levels off", healthy=np.inf),
        Quantity("speed", "rad/s", 0.01, 20.0, "speed at which it levels off", shape=True),
        Quantity("knee", "1", 0.0, 6.0, "how abruptly it levels off; 0: as tanh does", shape=True,
                 unsaid=0.0, held=0.0))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        x = self.own(motion.dq) / self.speed
        return self.on_own_row(
            arm,
            np.tanh(x) if self.knee < _NONE else x *
            (1.0 + np.abs(x)**self.knee)**(-1.0 / self.knee))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """v_0 over a decade and a half below the fastest speed: beyond it is viscous friction."""
        fast = float(np.abs(self.own(motion.dq)).max(initial=0.0)) or 1.0
        for speed in np.geomspace(fast / 30.0, fast, 8).tolist():
            yield replace(self, speed=float(np.clip(speed, 0.01, 20.0)))

    def possible(self, values: Values) -> bool:
        return super().possible(values) and not _NONE <= values["knee"] < EFFECTS.bluntest

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, knee=EFFECTS.carreau)

    def own_load(self, values: Values) -> OwnLoad | None:
        amplitude, slow = self.amplitudes(values).item(), 1.0 / values["speed"]
        knee = values["knee"]
        if knee < _NONE:
            return None
        return lambda q, v, m: amplitude * slow * v * (1.0 + abs(slow * v) ** knee) ** (-1.0 / knee)

    def speed_curve(self, values: Values) -> SpeedCurve | None:
        if values["knee"] >= _NONE:
            return None
        return SpeedCurve(heights=(self.amplitudes(values).item(),),
                          sharpnesses=(1.0 / values["speed"],))

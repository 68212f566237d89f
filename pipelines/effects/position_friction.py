"""Friction that depends on the angle of the joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import (
    LARGE,
    ArmModel,
    Effect,
    OwnLoad,
    Parameters,
    Quantity,
    Values,
    waves,
)
from pipelines.effects.config import EFFECTS
from pipelines.effects.kinds import sign_curve

__all__ = ["PositionFriction"]

_TAILS = ("", "_2", "_3")


@dataclass(frozen=True)
class PositionFriction(Effect):
    """τ = Σ A_m sin(m k q + φ_m) c(v), m = 1, 2, 3.

    Coulomb friction that varies along the turn, c(v) its sign as in `Coulomb`.

    Where it rubs in bands a wave is no sine, and its harmonics carry over to where one alone would
    not. The columns are sin(m k q) c(v) and cos(m k q) c(v); their amplitudes A_m cos φ_m and A_m
    sin φ_m. A search looks for m = 1 alone. What turns with the joint repeats with it, so that k is
    whole; what turns behind a gear has a k of its own, and on a prismatic joint k counts waves in
    2π metres.
    """

    order: float = 1.0  # k [1/rev of the joint]
    sharpness: float = 100.0  # w [s/rad]
    roundness: float = 1.0  # of c
    harmonics: int = 3  # how many m there are
    most: int = 3  # how many a refit takes
    whole: bool = False  # whether k is held as it is

    name = "position_friction"
    parameters = Parameters(
        Quantity("amplitude", "N m", 0.0, LARGE,
                 "by how much friction rises and falls along the turn"),
        Quantity("order", "1/rev", 0.25, 100.0, "waves in one turn of the joint", shape=True),
        Quantity("phase", "rad", -math.pi, math.pi, "angle of the wave at the joint's zero",
                 period=2.0 * math.pi),
        Quantity("sharpness", "s/rad", 5.0, 2000.0,
                 "inverse of the speed over which it changes sign", shape=True, shared=True),
        Quantity("roundness", "1", 0.4, 3.5,
                 "how gradually it changes sign; 1: as tanh, 3: as arctan", shape=True, unsaid=1.0,
                 held=1.0, shared=True),
        Quantity("amplitude_2", "N m", 0.0, LARGE, "of the second harmonic", unsaid=0.0),
        Quantity("phase_2", "rad", -math.pi, math.pi, "of the second harmonic", unsaid=0.0,
                 period=2.0 * math.pi),
        Quantity("amplitude_3", "N m", 0.0, LARGE, "of the third harmonic", unsaid=0.0),
        Quantity("phase_3", "rad", -math.pi, math.pi, "of the third harmonic", unsaid=0.0,
                 period=2.0 * math.pi))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        wave = sign_curve(1.0, self.sharpness, self.roundness).torque(self.own(motion.dq))
        once = np.exp(1j * self.order * self.own(motion.q))
        parts: list[Array] = []
        for _ in range(self.harmonics):
            wave = wave * once
            parts += (wave.imag, wave.real)
        return self.on_own_row(arm, *parts)

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Whole orders; also halves where the joint moves over more than a turn.

        A slide has as many half waves in its travel.

        A refit takes no more harmonics than half waves were travelled, unless held-out motion asks
        for them: more may be any curve there, and another one beyond.
        """
        travel = float(np.ptp(self.own(motion.q))) or 1.0
        turns = arm.robot.revolute[self._index]
        step = (1.0 if travel < 2.0 * math.pi else 0.5) if turns else math.pi / travel
        first = 1.0 if turns else step
        highest = EFFECTS.highest_order
        for k in range(round((highest - 1.0) / step) + 1 if turns else int(highest)):
            order = first + k * step
            yield replace(self, order=order, harmonics=1,
                          most=int(np.clip(order * travel / math.pi, 1,
                                           3)), whole=turns and order.is_integer())

    @property
    def free(self) -> tuple[str, ...]:
        return tuple(name for name in super().free if not (self.whole and name == "order"))

    def forms(self) -> tuple[Self, ...]:
        """Return it with more harmonics than half waves were travelled, and behind a gear.

        Held-out motion decides how many harmonics it has.
        """
        full = replace(self, harmonics=self.most)
        finer = tuple(
            replace(self, harmonics=m, most=m) for m in range(self.most + 1,
                                                              len(_TAILS) + 1))
        return (full, *finer, replace(full, whole=False)) if self.whole else (full, *finer)

    def own_load(self, values: Values) -> OwnLoad:
        shaped, curve = self.at(values), sign_curve(1.0, values["sharpness"],
                                                    values.get("roundness", 1.0))
        parts = np.reshape(shaped.amplitudes(values), (-1, 2)).tolist()
        wave = waves(shaped.order, parts)
        return lambda q, v, m: curve.of(v, m) * wave(q, m)

    def amplitudes(self, values: Values) -> Array:
        each = [
            values[f"amplitude{tail}"] * np.exp(1j * values[f"phase{tail}"])
            for tail in _TAILS[:self.harmonics]
        ]
        return np.array([part for wave in each for part in (wave.real, wave.imag)])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        pairs = [
            *np.reshape(np.asarray(amplitudes, dtype=float), (-1, 2)).tolist(), *[[0.0, 0.0]] *
            (3 - self.harmonics)
        ]
        found = {"order": self.order, "sharpness": self.sharpness, "roundness": self.roundness}
        for tail, (cosine, sine) in zip(_TAILS, pairs, strict=True):
            found |= {
                f"amplitude{tail}": math.hypot(cosine, sine),
                f"phase{tail}": math.atan2(sine, cosine)
            }
        return {q.name: found[q.name] for q in self.parameters}

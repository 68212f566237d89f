"""Cogging: a torque that ripples along the turn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.config import ORDERS
from pipelines.dynamics.orders import orders_along
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

__all__ = ["Cogging"]

_ROUNDED = 1e-11  # numerics: difference of orders that is rounding
_STILL = 1e-3  # numerics: [rad or m] of travel: none


@dataclass(frozen=True)
class Cogging(Effect):
    """τ = Σ A_m sin(m k q + φ_m), m = 1, 2, 3: the same at all speeds and in both directions.

    The columns are sin mkq, cos mkq; their amplitudes A_m cos φ_m and A_m sin φ_m. A search looks
    for m = 1 alone. Magnets, slots and teeth that turn with the joint are so many a turn: k is
    whole. What turns behind a gear has a k of its own; on a prismatic joint it counts waves in 2π
    metres.
    """

    order: float = 12.0  # k [1/rev of the joint]
    harmonics: int = 3  # how many m there are
    whole: bool = False  # whether k is held as it is
    apart: float = 0.0  # how far a k that is not held is from a whole number at least
    fewest: float = 0.0  # k at least: with fewer waves in the travel it could be any curve

    name = "cogging"
    parameters = Parameters(
        Quantity("order", "1/rev", 0.25, 1000.0, "waves in one turn of the joint", shape=True,
                 several=True), Quantity("amplitude", "N m", 0.0, LARGE, "of the first wave"),
        Quantity("phase", "rad", -math.pi, math.pi, "angle of the first wave at the joint's zero",
                 period=2.0 * math.pi),
        Quantity("order_2", "1/rev", 0.5, 2000.0, "twice the order", derived=True),
        Quantity("amplitude_2", "N m", 0.0, LARGE, "of the second harmonic"),
        Quantity("phase_2", "rad", -math.pi, math.pi, "of the second harmonic",
                 period=2.0 * math.pi),
        Quantity("order_3", "1/rev", 0.75, 3000.0, "three times the order", derived=True),
        Quantity("amplitude_3", "N m", 0.0, LARGE, "of the third harmonic"),
        Quantity("phase_3", "rad", -math.pi, math.pi, "of the third harmonic",
                 period=2.0 * math.pi))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        once = np.exp(1j * self.order * self.own(motion.q))
        powers = [once**m for m in range(1, self.harmonics + 1)]
        return self.on_own_row(arm, *(part for wave in powers for part in (wave.imag, wave.real)))

    def own_columns(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> Array:
        """One wave from the one before.

        E^(i k' q) = e^(i k q) e^(i (k' - k) q), for orders come in equal steps.
        """
        if any(one.harmonics != 1 for one in shapes):
            return super().own_columns(shapes, motion, arm)
        q, order, by = self.own(motion.q), 0.0, 0.0
        wave = turn = np.ones(len(q), dtype=complex)
        table = np.empty((len(shapes), 2, len(q)))
        for k, one in enumerate(shapes):
            if abs(one.order - order - by) > _ROUNDED:
                by = one.order - order
                turn = np.exp(1j * by * q)
            wave, order = wave * turn, one.order
            table[k] = wave.imag, wave.real
        return table

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Return the orders that the travel resolves.

        Where the joint closes its circle, or nearly, whole orders are held: as long as waves of
        other orders are missing from the model, they would pull a free one off its place.
        """
        travel, turning = float(np.ptp(self.own(motion.q))), arm.robot.revolute[self._index]
        around = turning and self.goes_round(motion, ORDERS.nearly)
        fewest = EFFECTS.fewest_waves * 2.0 * math.pi / max(travel, _STILL)
        for order in orders_along(travel, turning):
            whole = around and order.is_integer()
            yield replace(self, order=order, harmonics=1, whole=whole,
                          apart=EFFECTS.apart * 2.0 * math.pi / travel if whole else 0.0,
                          fewest=0.0 if around else fewest)

    @property
    def free(self) -> tuple[str, ...]:
        return () if self.whole else super().free

    def forms(self) -> tuple[Self, ...]:
        """Behind a gear; of an order close to a whole one as well."""
        full = replace(self, harmonics=3)
        if not self.whole:
            return (full,)
        return full, replace(full, whole=False), replace(full, whole=False, apart=0.0)

    def possible(self, values: Values) -> bool:
        apart = self.whole or abs(self.order - round(self.order)) >= self.apart
        others = max(values["amplitude_2"], values["amplitude_3"])
        leads = values["amplitude"] >= EFFECTS.leads * others
        return super().possible(values) and apart and leads and values["order"] >= self.fewest

    def own_load(self, values: Values) -> OwnLoad:
        shaped = self.at(values)
        parts = np.reshape(shaped.amplitudes(values), (-1, 2)).tolist()
        wave = waves(shaped.order, parts)
        return lambda q, v, m: wave(q, m)

    def amplitudes(self, values: Values) -> Array:
        each = [
            values[f"amplitude{tail}"] * np.exp(1j * values[f"phase{tail}"])
            for tail in ("", "_2", "_3")[:self.harmonics]
        ]
        return np.array([part for wave in each for part in (wave.real, wave.imag)])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        pairs = [
            *np.reshape(np.asarray(amplitudes, dtype=float), (-1, 2)).tolist(), *[[0.0, 0.0]] *
            (3 - self.harmonics)
        ]
        found: dict[str, float] = {}
        for m, (tail, (cosine, sine)) in enumerate(zip(("", "_2", "_3"), pairs, strict=True),
                                                   start=1):
            found |= {f"order{tail}": m * self.order, f"amplitude{tail}": math.hypot(cosine, sine),
                      f"phase{tail}": math.atan2(sine, cosine)}
        return found

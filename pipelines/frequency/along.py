"""How the plant differs along the turn: its response over two periods at a time.

The inertia about a joint's own axis is the same at every angle of that joint. What couples it to the base and to the joints
before it is not: with it their modes move while the joint turns, and one number stands for all angles. Parts of two periods
under Hann's window, which keeps the lines of one period apart and the slow pull of gravity out, show how far.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.frequency.controller import Complex
from pipelines.frequency.responses import Measured
from pipelines.frequency.signals import INPUT, POSITION
from pipelines.io.log import Array

__all__ = ["AlongTurn", "along_turn"]

_FEWEST = 4  # parts whose scatter says something
_HANN = 0.75  # variance of one part over that of one period: 3/2 of that of two periods


@dataclass(frozen=True, eq=False)
class AlongTurn:
    """Responses of parts of the turn."""

    response: Complex  # u → q (parts, bins)
    noise: float  # variance of one over that of the mean, where noise is all that differs


def along_turn(measured: Measured, frequency: Array) -> AlongTurn | None:
    """At lines of the multisine `frequency` [Hz] (bins,); None of other excitations, and of too few periods."""
    period = measured.first.period
    if measured.plant.method != "multisine" or period is None:
        return None
    line = 2 * np.rint(frequency * period * measured.first.sample_time).astype(np.int64)
    window = (0.5 - 0.5 * np.cos(np.pi * np.arange(2 * period) / period))[:, None]
    parts, periods = [], 0
    for stretch in (s for one in measured.turned for s in one.stretches):
        count = len(stretch.signals) // period
        if count < 2:
            continue
        periods += count
        whole = stretch.signals[len(stretch.signals) - count * period:, [INPUT, POSITION]]
        for first in range(0, (count - 1) * period, period):
            part = whole[first:first + 2 * period]
            u, q = np.fft.rfft((part - part.mean(axis=0)) * window, axis=0)[line].T
            if (u != 0.0).all():
                parts.append(q / u)
    return AlongTurn(np.array(parts), _HANN * periods) if len(parts) >= _FEWEST else None

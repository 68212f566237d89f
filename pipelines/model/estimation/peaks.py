"""Torque that was asked for beyond the limit of a drive, and of which nobody knows whether it was given.

    mask = near_peaks(good, runs, low_pass, rows)      (samples, joints) too near to such torque to make an equation
    x = bridged(x, bad)                                straight lines where samples are bad

The samples themselves make no equations, nor do those next to them. Where a controller winds up, what was asked stands many times
above the limit, and what is put in its place differs by so much that the low-pass carries it farther than a bad sample. How far, it
says itself: rows hang on it where the torque as asked and the torque bridged differ behind the low-pass.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array
from pipelines.estimation.filters import LowPass, zero_phase
from pipelines.quality.segments import Usable

__all__ = ["bridged", "near_peaks"]

Mask = npt.NDArray[np.bool_]

_MATTERS = 1e-4  # of the joint's largest torque within its limit
_FEW = 0.1  # of a joint's rows: where no more would be left, all stay


def near_peaks(good: Usable, runs: Sequence[slice], low_pass: LowPass | None, rows: Mask) -> Mask:
    """(samples, joints) of the mended log, none where no low-pass spreads anything.

    Args:
        runs: stretches without a gap.
        rows: (samples, joints) which make equations else.
    """
    found = np.zeros_like(rows)
    if low_pass is None:
        return found
    for j in np.flatnonzero(good.saturated.any(axis=0)):
        beyond, lost = good.saturated[:, j, None], (good.missing | good.spikes)[:, j, None]
        asked = bridged(good.log.tau[:, j, None], lost)
        least = _MATTERS * float(np.where(beyond, 0.0, np.abs(asked)).max())
        differ = asked - bridged(asked, beyond | lost)
        hangs = np.zeros(len(rows), dtype=bool)
        for run in runs:
            hangs[run] = np.abs(zero_phase(differ[run], low_pass))[:, 0] > least
        if np.sum(rows[:, j] & ~hangs) > _FEW * np.sum(rows[:, j]):
            found[:, j] = hangs
    return found


def bridged(x: Array, bad: Mask) -> Array:
    """`x` (samples, joints) with straight lines where it is bad; zero where a joint has nothing good."""
    out, place = x.copy(), np.arange(len(x))
    for j in np.flatnonzero(bad.any(axis=0)):
        ill = bad[:, j]
        out[ill, j] = 0.0 if ill.all() else np.interp(place[ill], place[~ill], x[~ill, j])
    return out

"""What earlier experiments have told already: their information, and the first mode that they found."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from pipelines.errors import UsageError
from pipelines.io.log import ExperimentLog
from pipelines.model.excitation.columns import ArmColumns
from pipelines.model.motion import Reconstruction, reconstruct
from pipelines.model.rigid.body import Array

__all__ = ["USED", "first_mode", "information_of"]

USED = ("excitation", "free")  # experiments whose information is added
_BLOCK = 4096  # samples


def information_of(logs: Iterable[ExperimentLog], columns: ArmColumns) -> Array:
    """rowsᵀ rows (joints, columns, columns) summed over every sample of the logs."""
    count = len(columns.names)
    total = np.zeros((len(columns.columns), count, count))
    for log in logs:
        motion = reconstruct(log, Reconstruction()).motion
        whole = np.stack([motion.q.T, motion.dq.T, motion.ddq.T])
        for first in range(0, whole.shape[2], _BLOCK):
            rows = columns.rows(np.ascontiguousarray(whole[:, :, first:first + _BLOCK]))
            for gram, own, row in zip(total, columns.columns, rows, strict=True):
                gram[np.ix_(own, own)] += row @ row.T
    return total


def first_mode(results: Iterable[Mapping[str, Any]]) -> float | None:
    """The lowest frequency [Hz] of a mode, resonance or antiresonance, in results of `frf`; None where none was found.

    Raises:
        UsageError: C02, a result that does not hold what `frf` writes.
    """
    try:
        values = [mode["frequency"]["value"] for result in results for response in result["responses"]
                  for mode in response["modes"]]
        found = [float(value) for value in values if value is not None]
    except (KeyError, TypeError, ValueError):
        found = [math.nan]
    if not all(0.0 < value < math.inf for value in found):
        raise UsageError("C02", "a result of frf does not say the frequencies of its modes", where="--prior-logs",
                         remedy="run frf again, or leave its result out")
    return min(found, default=None)

"""Find the window in which a push on the tip explains most of a residual.

window = best_window(rows, dictionary, arm, residual, noise)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.diagnosis.candidates import Dictionary
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset, Rows
from pipelines.diagnosis.prior import Prior
from pipelines.diagnosis.table import Array, by_joint
from pipelines.model.arm import Arm
from pipelines.model.effects.base import Effect

__all__ = ["Window", "best_window", "event_threshold"]

_DIRECTIONS = 3  # components of a force


@dataclass(frozen=True)
class Window:
    """A contact: when, in which log, with which force."""

    gain: float
    effect: Effect
    amplitudes: Array
    log: int


def best_window(
    rows: Rows, dictionary: Dictionary, arm: Arm, residual: Sequence[Array]
) -> Window | None:
    """Return the best window on a residual (rows of each joint) in units of the noise."""
    data, best = rows.data, None
    if dictionary.event is None:
        return None
    weight = by_joint(rows.weight, rows.joint, rows.n_joints)
    first = 0
    for place, one in enumerate(data.logs):
        own, here = (
            np.stack([v[first : first + one.rows] for v in part]) for part in (residual, weight)
        )
        first += one.rows
        torque = own / here
        full = np.stack([np.interp(one.motion.t, one.t, v) for v in torque], axis=1)
        for shape in dictionary.event.shapes[0].promising(one.motion, arm, full):
            columns = one.lay(shape.columns(one.motion, arm)) * here
            x = columns.reshape(len(columns), -1)
            amplitudes = np.asarray(np.linalg.lstsq(x.T, own.ravel(), rcond=1e-6)[0], np.float64)
            gain = float((x @ own.ravel()) @ amplitudes)
            if best is None or gain > best.gain:
                best = Window(gain, shape, amplitudes, data.first + place)
    return best


def event_threshold(
    dataset: Dataset, dictionary: Dictionary, prior: Prior, config: DiagnosisConfig
) -> float:
    """Return the gain that a window exceeds with probability alpha where nothing touched the arm.

    The largest of m independent windows has a known law; what the reference exceeds it by is the
    over-dispersion of the rows.
    """
    from scipy.stats import chi2

    rows = dataset.known
    mean = np.linalg.solve(prior.precision + sum(prior.grams), sum(prior.moments))
    table = prior.table(rows.nominal, dictionary.known)
    residual = [y - t for y, t in zip(rows.y, table.times(np.asarray(mean)), strict=True)]
    found = best_window(rows, dictionary, dataset.arm, residual)
    usual = float(chi2.isf(-np.expm1(np.log(0.5) / config.event_candidates), _DIRECTIONS))
    dispersion = max(1.0, (found.gain if found else 0.0) / usual)
    return dispersion * float(chi2.isf(config.alpha / config.event_candidates, _DIRECTIONS))

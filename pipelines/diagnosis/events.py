"""Find the window in which a push on the tip explains most of a residual.

window = best_window(rows, dictionary, arm, residual, noise)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.diagnosis.arrow import Arrow
from pipelines.diagnosis.candidates import Dictionary
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset, Rows
from pipelines.diagnosis.prior import Prior
from pipelines.diagnosis.screening import upper_point
from pipelines.diagnosis.table import Array, Indices, by_joint
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
    touched: Indices  # of the rows of each joint, those within it


def best_window(
    rows: Rows, dictionary: Dictionary, arm: Arm, residual: Sequence[Array]
) -> Window | None:
    """Return the best window on a residual (rows of each joint) in units of the noise."""
    found = best_windows(rows, dictionary, arm, residual)
    return max(found, key=lambda one: one.gain, default=None)


def best_windows(
    rows: Rows, dictionary: Dictionary, arm: Arm, residual: Sequence[Array]
) -> list[Window]:
    """Return the best window of each log."""
    data, out = rows.data, list[Window]()
    if dictionary.event is None:
        return out
    weight = by_joint(rows.weight, rows.joint, rows.n_joints)
    first = 0
    for place, one in enumerate(data.logs):
        own, here = (
            np.stack([v[first : first + one.rows] for v in part]) for part in (residual, weight)
        )
        first += one.rows
        torque, found = own / here, list[Window]()
        full = np.stack([np.interp(one.motion.t, one.t, v) for v in torque], axis=1)
        for shape in dictionary.event.shapes[0].promising(one.motion, arm, full):
            columns = one.lay(shape.columns(one.motion, arm)) * here
            x = columns.reshape(len(columns), -1)
            amplitudes = np.asarray(np.linalg.lstsq(x.T, own.ravel(), rcond=1e-6)[0], np.float64)
            gain = float((x @ own.ravel()) @ amplitudes)
            touched = np.flatnonzero(columns.any(axis=(0, 1))) + first - one.rows
            found.append(Window(gain, shape, amplitudes, data.first + place, touched))
        out += [max(found, key=lambda window: window.gain)] if found else []
    return out


def event_threshold(
    dataset: Dataset, dictionary: Dictionary, prior: Prior, config: DiagnosisConfig
) -> float:
    """Return the gain that a window exceeds with probability alpha where nothing touched the arm.

    The largest of m independent windows has a known law; what the known logs exceed it by is the
    over-dispersion of the rows, by the largest of each half of a log (`upper_point`).
    """
    from scipy.stats import chi2

    rows = dataset.known
    info = Arrow.of(prior.precision + np.sum(prior.grams, axis=0), prior.structure)
    mean = info.solve(np.sum(prior.moments, axis=0))
    table = prior.table(rows.nominal, dictionary.known)
    residual = [y - t for y, t in zip(rows.y, table.times(mean), strict=True)]
    if dataset.reference is None:  # a contact in each log is no measure of what is usual
        for one in best_windows(rows, dictionary, dataset.arm, residual):
            for own in residual:
                own[one.touched] = 0.0
    gains = []
    for part in prior.parts:
        here = [np.where(own, r, 0.0) for own, r in zip(part, residual, strict=True)]
        found = best_window(rows, dictionary, dataset.arm, here)
        gains.append(0.0 if found is None else found.gain)
    bound = float(chi2.isf(config.alpha / config.event_candidates, _DIRECTIONS))
    return max(bound, upper_point(gains, config.alpha))

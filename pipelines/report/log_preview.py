"""Show one log in few points: the lowest and highest sample of each stretch of its signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.io.limits import GAP_TICKS
from pipelines.io.log import Array
from pipelines.quality.subject import Subject
from pipelines.report.figures import Mask, joint_signal_figure
from pipelines.report.report import Figure

_STRETCHES = 200  # numerics: of one figure


@dataclass(frozen=True)
class Preview:
    """Two points for each stretch of time, its lowest and its highest sample; NaN in gaps."""

    name: str
    units: tuple[str, str]  # of position and torque, of the first joint
    t: Array  # [s] (points,)
    q: Array  # [rad] (points, joints)
    tau: Array  # [N m] (points, joints)
    flagged_q: Array  # 1 where a sample of the stretch is missing or spiky
    flagged_tau: Array


def log_preview(subject: Subject) -> Preview:
    """Return the points of one log."""
    good, log = subject.good, subject.log
    t, lost = good.log.t, good.missing
    gaps = np.flatnonzero(np.diff(t) > GAP_TICKS * log.sample_time)[:_STRETCHES] + 1
    size = max(1, -(-t.size // _STRETCHES))
    starts = np.union1d(np.arange(0, t.size, size), gaps)
    holes = 2 * np.searchsorted(starts, gaps)  # points before which the line is broken
    middles = (starts + np.append(starts[1:], t.size)) // 2
    times = np.stack([t[starts], t[middles]], axis=1).ravel()

    def extremes(x: Array) -> Array:
        least, most = np.where(np.isnan(x), np.inf, x), np.where(np.isnan(x), -np.inf, x)
        low, high = np.minimum.reduceat(least, starts), np.maximum.reduceat(most, starts)
        both = np.stack([low, high], axis=1).reshape(-1, x.shape[1])
        return np.insert(np.where(np.isfinite(both), both, np.nan), holes, np.nan, axis=0)

    def flags(mask: Mask) -> Array:
        found = np.repeat(np.logical_or.reduceat(mask, starts), 2, axis=0)
        return np.insert(found.astype(np.float64), holes, 0.0, axis=0)

    q, tau = (np.where(lost, np.nan, x[good.kept]) for x in (log.q, log.tau))
    return Preview(
        log.name,
        (subject.unit("q", 0), subject.unit("tau", 0)),
        np.insert(times, holes, 0.5 * (t[gaps] + t[gaps - 1])),
        extremes(q),
        extremes(tau),
        flags(lost | good.position_spikes),
        flags(lost | good.torque_spikes | good.saturated),
    )


def preview_figures(preview: Preview) -> tuple[Figure, Figure]:
    """Draw position and torque over time; samples that no fit uses are marked."""
    signals = (
        ("position", preview.q, preview.flagged_q, "missing or glitch"),
        ("torque", preview.tau, preview.flagged_tau, "missing, glitch or saturated"),
    )
    position, torque = (
        joint_signal_figure(
            f"{quantity}-{preview.name}",
            f"{preview.name}: {quantity}; lowest and highest sample of each short stretch.",
            preview.t,
            values,
            f"{quantity} [{unit}]",
            flagged=flagged > 0.0,
            flag_name=marked,
        )
        for (quantity, values, flagged, marked), unit in zip(signals, preview.units, strict=True)
    )
    return position, torque

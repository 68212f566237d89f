"""Show one log in few points: envelopes of its signals, its sampling intervals, and where samples are left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pipelines.log.doctor.checks_subject import Subject
from pipelines.log.doctor.faults import Mask
from pipelines.log.doctor.segments import long_blocks
from pipelines.log.experiment import Array
from pipelines.log.limits import GAP_TICKS
from pipelines.report.report import Figure
from pipelines.report.sections import interval_figure, joint_signal_figure, timeline_figure

__all__ = ["Preview", "log_preview", "preview_figures"]

_BUCKETS, _INTERVALS = 200, 100_000


@dataclass(frozen=True)
class Preview:
    """Envelopes for the figures: lowest and highest sample of each bucket."""

    name: str
    sample_time: float  # [s]
    units: tuple[str, str]  # of position and torque, of the first joint
    t: Array  # [s] (points,)
    q: Array  # [rad] (points, joints)
    tau: Array  # [N m] (points, joints)
    flagged_q: Array  # 1 where a sample of the bucket is missing or spiky
    flagged_tau: Array
    intervals: Array  # [s]; a hundred thousand quantiles where there are more
    n_intervals: int  # how many there are
    spans: dict[str, tuple[tuple[float, float], ...]]  # [s] kind -> from, to


def log_preview(subject: Subject) -> Preview:
    """What the figures of one log show."""
    good = subject.good
    recorded = subject.log.q[good.kept], subject.log.tau[good.kept]
    size = max(1, -(-good.log.n_samples // _BUCKETS))
    lost = good.missing
    t = good.log.t
    intervals = np.diff(t)
    n_intervals = intervals.size
    if intervals.size > _INTERVALS:
        intervals = np.quantile(intervals, np.linspace(0.0, 1.0, _INTERVALS))
    gaps = np.flatnonzero(np.diff(t) > GAP_TICKS * subject.log.sample_time)
    spans = {"gap": tuple((float(t[k]), float(t[k + 1])) for k in gaps),
             "missing": _spans(t, lost.any(axis=1)), "glitch": _spans(t, good.spikes.any(axis=1)),
             "saturated": _spans(t, good.saturated.any(axis=1)), "after the stop": _spans(t, np.arange(t.size) >= good.end)}
    bounded = [np.where(lost, np.nan, values) for values in recorded]
    flags = lost | good.position_spikes, lost | good.torque_spikes | good.saturated
    # no bucket holds samples from both sides of a gap, or of a block without measurement: no curve crosses one
    blocks = long_blocks(np.asarray(lost.any(axis=1)))
    cuts = sorted({*(gaps + 1).tolist(), *(edge for block in blocks for edge in block)} - {0, t.size})
    pieces = [slice(a, b) for a, b in pairwise((0, *cuts[:_BUCKETS], t.size))]
    broken = [bool(p.start and t[p.start] - t[p.start - 1] > GAP_TICKS * subject.log.sample_time) for p in pieces]
    times = [np.concatenate([[0.5 * (t[p.start] + t[p.start - 1])] * int(gap), _bucket_times(t[p], size)])
             for p, gap in zip(pieces, broken, strict=True)]

    def joined(part: Callable[[Any, int], Array], values: Any, between: float) -> Array:
        blank = np.full((1, values.shape[1]), between)
        return np.concatenate([np.concatenate([blank[:int(gap)], part(values[p], size)])
                               for p, gap in zip(pieces, broken, strict=True)])

    return Preview(subject.log.name, subject.log.sample_time, (subject.unit("q", 0), subject.unit("tau", 0)),
                   np.concatenate(times), joined(_envelope, bounded[0], np.nan), joined(_envelope, bounded[1], np.nan),
                   joined(_any, flags[0], 0.0), joined(_any, flags[1], 0.0), intervals, n_intervals,
                   {kind: found for kind, found in spans.items() if found})


def _spans(t: Array, mask: Any) -> tuple[tuple[float, float], ...]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], np.asarray(mask, bool), [False])).astype(np.int8))).reshape(-1, 2)
    return tuple((float(t[a]), float(t[b - 1])) for a, b in edges[:200])


def _envelope(x: Array, size: int) -> Array:
    """(2 buckets, joints) lowest and highest finite sample of each bucket, the earlier first, NaN where it has none."""
    padded = np.concatenate([x, np.repeat(x[-1:], -len(x) % size, axis=0)]).reshape(-1, size, x.shape[1])
    finite = np.isfinite(padded)
    low, high = np.where(finite, padded, np.inf), np.where(finite, padded, -np.inf)
    rising = low.argmin(axis=1) <= high.argmax(axis=1)
    least, most = low.min(axis=1), high.max(axis=1)
    both = np.stack([np.where(rising, least, most), np.where(rising, most, least)], axis=1).reshape(-1, x.shape[1])
    return np.where(np.isfinite(both), both, np.nan)


def _bucket_times(t: Array, size: int) -> Array:
    """Two moments in each bucket: its beginning and its middle."""
    first = np.arange(0, t.size, size)
    return np.stack([t[first], t[np.minimum(first + size // 2, t.size - 1)]], axis=1).ravel()


def _any(mask: Mask, size: int) -> Array:
    padded = np.concatenate([mask, np.zeros((-len(mask) % size, mask.shape[1]), bool)]).reshape(-1, size, mask.shape[1])
    return np.repeat(padded.any(axis=1), 2, axis=0).astype(np.float64)


def preview_figures(preview: Preview, uneven: bool) -> tuple[Figure, ...]:
    """Position and torque over time; the sampling where it is `uneven`; where samples are left out, if any are."""
    figures: list[Figure] = [
        joint_signal_figure(f"position-{preview.name}", "Measured position; lowest and highest sample of each short stretch.",
                            preview.t, preview.q, preview.units[0], quantity="position",
                            flagged=preview.flagged_q > 0, flag_name="missing or glitch"),
        joint_signal_figure(f"torque-{preview.name}", "Torque; samples that no fit uses are marked.",
                            preview.t, preview.tau, preview.units[1], quantity="torque",
                            flagged=preview.flagged_tau > 0, flag_name="missing, glitch or saturated")]
    if uneven:
        clock = np.concatenate([[0.0], np.cumsum(preview.intervals)])
        which = "" if preview.n_intervals == preview.intervals.size else (
            f" Drawn are {preview.intervals.size} of its {preview.n_intervals} intervals, evenly chosen by length.")
        caption = f"How evenly the log was sampled; one bar would be perfect.{which}"
        figures.append(interval_figure(f"intervals-{preview.name}", caption, clock, preview.sample_time))
    if preview.spans:
        figures.append(timeline_figure(f"timeline-{preview.name}", "Where samples are missing or left out.",
                                       (float(preview.t[0]), float(preview.t[-1])),
                                       [(kind, list(found)) for kind, found in preview.spans.items()]))
    return tuple(figures)

"""Show one log in few points: envelopes of its signals, sampling, samples left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipelines.io.limits import GAP_TICKS
from pipelines.io.log import Array
from pipelines.quality.segments import long_blocks
from pipelines.quality.subject import Subject
from pipelines.report.figures import (
    Mask,
    Span,
    interval_figure,
    joint_signal_figure,
    timeline_figure,
    true_spans,
)
from pipelines.report.report import Figure

_BUCKETS, _INTERVALS, _SPANS = 200, 100_000, 200  # numerics: how it is drawn


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
    spans: dict[str, tuple[Span, ...]]  # [s] kind -> from, to


def log_preview(subject: Subject) -> Preview:
    """Return the section of the figures of one log."""
    good, log = subject.good, subject.log
    t, lost = good.log.t, good.missing
    size = max(1, -(-good.log.n_samples // _BUCKETS))
    intervals = np.diff(t)
    if intervals.size > _INTERVALS:
        intervals = np.quantile(intervals, np.linspace(0.0, 1.0, _INTERVALS))
    gaps = np.flatnonzero(np.diff(t) > GAP_TICKS * log.sample_time)
    kinds = {
        "missing": lost.any(axis=1),
        "glitch": good.spikes.any(axis=1),
        "saturated": good.saturated.any(axis=1),
        "after the stop": np.arange(t.size) >= good.end,
    }
    spans = {"gap": tuple((float(t[k]), float(t[k + 1])) for k in gaps)}
    spans |= {kind: tuple(true_spans(t, np.asarray(mask))[:_SPANS]) for kind, mask in kinds.items()}
    q, tau = (np.where(lost, np.nan, x[good.kept]) for x in (log.q, log.tau))
    flagged_q = lost | good.position_spikes
    flagged_tau = lost | good.torque_spikes | good.saturated
    # no bucket holds samples from both sides of a gap, or of a block without measurement
    blocks = long_blocks(np.asarray(lost.any(axis=1)))
    edges = {*(gaps + 1).tolist(), *(edge for block in blocks for edge in block)}
    cuts = sorted(edges - {0, t.size})
    pieces = [slice(a, b) for a, b in pairwise((0, *cuts[:_BUCKETS], t.size))]
    after_gap = [p.start > 0 and p.start - 1 in gaps for p in pieces]
    return Preview(
        log.name,
        log.sample_time,
        (subject.unit("q", 0), subject.unit("tau", 0)),
        _joined([_bucket_times(t[p], size) for p in pieces], after_gap, _middles(t, pieces)),
        _joined([_envelope(q[p], size) for p in pieces], after_gap),
        _joined([_envelope(tau[p], size) for p in pieces], after_gap),
        _joined([_any(flagged_q[p], size) for p in pieces], after_gap, [0.0] * len(pieces)),
        _joined([_any(flagged_tau[p], size) for p in pieces], after_gap, [0.0] * len(pieces)),
        intervals,
        t.size - 1,
        {kind: found for kind, found in spans.items() if found},
    )


def _middles(t: Array, pieces: Sequence[slice]) -> list[float]:
    """Between a piece and the one before it. [s]"""
    return [0.5 * float(t[p.start] + t[max(p.start - 1, 0)]) for p in pieces]


def _joined(
    parts: Sequence[Array], after_gap: Sequence[bool], between: Sequence[float] | None = None
) -> Array:
    """The parts one after the other, with a row of `between` (NaN: no line) in every gap."""
    rows = []
    for k, part in enumerate(parts):
        if after_gap[k]:
            value = np.nan if between is None else between[k]
            rows.append(np.full((1, *part.shape[1:]), value))
        rows.append(part)
    return np.concatenate(rows)


def _buckets(x: Array | Mask, size: int, fill: Array | Mask) -> Array | Mask:
    """(buckets, size, joints), the last bucket filled up with `fill`."""
    padding = np.repeat(fill, -len(x) % size, axis=0)
    return np.concatenate([x, padding]).reshape(-1, size, x.shape[1])


def _envelope(x: Array, size: int) -> Array:
    """(2 buckets, joints) lowest and highest finite sample of each, the earlier first."""
    padded = _buckets(x, size, x[-1:])
    finite = np.isfinite(padded)
    low, high = np.where(finite, padded, np.inf), np.where(finite, padded, -np.inf)
    rising = low.argmin(axis=1) <= high.argmax(axis=1)
    least, most = low.min(axis=1), high.max(axis=1)
    both = np.stack([np.where(rising, least, most), np.where(rising, most, least)], axis=1)
    both = both.reshape(-1, x.shape[1])
    return np.where(np.isfinite(both), both, np.nan)


def _bucket_times(t: Array, size: int) -> Array:
    """Two moments in each bucket: its beginning and its middle."""
    first = np.arange(0, t.size, size)
    return np.stack([t[first], t[np.minimum(first + size // 2, t.size - 1)]], axis=1).ravel()


def _any(mask: Mask, size: int) -> Array:
    padded = _buckets(mask, size, np.zeros((1, mask.shape[1]), bool))
    return np.repeat(padded.any(axis=1), 2, axis=0).astype(np.float64)


def preview_figures(preview: Preview, uneven: bool) -> tuple[Figure, ...]:
    """Draw position and torque over time; the sampling where it is `uneven`; excluded samples."""
    name, t = preview.name, preview.t
    figures = [
        joint_signal_figure(
            f"position-{name}",
            "Measured position; lowest and highest sample of each short stretch.",
            t,
            preview.q,
            preview.units[0],
            quantity="position",
            flagged=preview.flagged_q > 0,
            flag_name="missing or glitch",
        ),
        joint_signal_figure(
            f"torque-{name}",
            "Torque; samples that no fit uses are marked.",
            t,
            preview.tau,
            preview.units[1],
            quantity="torque",
            flagged=preview.flagged_tau > 0,
            flag_name="missing, glitch or saturated",
        ),
    ]
    if uneven:
        clock = np.concatenate([[0.0], np.cumsum(preview.intervals)])
        caption = "How evenly the log was sampled; one bar would be perfect."
        if preview.n_intervals != preview.intervals.size:
            caption += (
                f" Drawn are {preview.intervals.size} of its {preview.n_intervals} intervals, "
                "evenly chosen by length."
            )
        figures.append(interval_figure(f"intervals-{name}", caption, clock, preview.sample_time))
    if preview.spans:
        extent, caption = (float(t[0]), float(t[-1])), "Where samples are missing or left out."
        rows = [(kind, list(found)) for kind, found in preview.spans.items()]
        figures.append(timeline_figure(f"timeline-{name}", caption, extent, rows))
    return tuple(figures)

"""Drawings the reports share. Axes first, nothing returned; long logs are drawn by their envelopes.

Every function stands up to a damaged log: time that runs backwards, samples that are missing, names that are mark-up.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.report import style
from pipelines.report.style import format_number, format_unit, printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

__all__ = ["broken_at_gaps", "draw_intervals", "draw_joint_signals", "draw_measured", "draw_modelled", "draw_timeline", "envelope",
           "joint_axes", "joint_size", "merge_spans", "true_spans"]

Array = npt.NDArray[np.float64]
Span = tuple[float, float]

_LARGEST = 1e150  # beyond it the axis limits overflow; a damaged sample may be that large
_SCALES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))


def envelope(t: Array, x: Array, points: int = 1200) -> tuple[Array, Array]:
    """Lowest and highest sample of each stretch of a long signal: what the eye would see, in about `points` points.

    Samples that are not finite become NaN and break the line; where they do, a sample is given twice, because a line
    needs two points and a sample alone between two gaps would not be drawn.
    """
    x = np.where(np.isfinite(x), np.clip(x, -_LARGEST, _LARGEST), np.nan)
    if x.size == 0 or (x.size <= points and np.isfinite(x).all()):
        return t, x
    width = -(-x.size // max(1, points // 2))
    rows = -(-x.size // width)
    index = np.minimum(np.arange(rows * width), x.size - 1).reshape(rows, width)  # the last sample fills the last row
    part = x[index]
    bad = np.isnan(part)
    row = np.arange(rows)
    extremes = (np.where(bad, np.inf, part).argmin(axis=1), np.where(bad, -np.inf, part).argmax(axis=1))
    first, second = np.minimum(*extremes), np.maximum(*extremes)
    missing = bad.cumsum(axis=1)
    before, until, total = missing[row, first], missing[row, second], missing[:, -1]
    a, b, gap = index[row, first], index[row, second], total > 0
    hole = np.full(rows, -1)
    order = np.stack((hole, a, a, hole, b, b, hole), axis=1)
    always = np.ones(rows, bool)
    keep = np.stack((before > 0, always, gap, until > before, gap, always, total > until), axis=1)
    times = np.stack((a, a, a, a, b, b, b), axis=1)[keep]
    return t[times], np.where(order[keep] < 0, np.nan, x[order[keep]])


def true_spans(t: Array, mask: npt.NDArray[np.bool_]) -> list[Span]:
    """From-to times of the runs of samples where `mask` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(float(t[start]), float(t[stop - 1])) for start, stop in edges.reshape(-1, 2)]


def merge_spans(spans: Iterable[Span], reach: float) -> list[Span]:
    """Spans in order of time, those nearer than `reach` joined; so a thousand short ones do not make a huge figure."""
    merged: list[Span] = []
    for start, stop in sorted((min(span), max(span)) for span in spans if np.isfinite(span).all()):
        if merged and start - merged[-1][1] <= reach:
            merged[-1] = (merged[-1][0], max(merged[-1][1], stop))
        else:
            merged.append((start, stop))
    return merged


def joint_size(joints: int) -> tuple[float, float]:
    """Size of a figure with one row a joint. [inch]"""
    return 6.0, 0.65 + 0.8 * max(1, joints)


def joint_axes(figure: Figure | SubFigure, joints: int) -> list[Axes]:
    """One row of axes a joint over a common time axis."""
    return list(figure.subplots(max(1, joints), 1, sharex=True, squeeze=False)[:, 0])


def draw_joint_signals(axes: Sequence[Axes], t: Array, values: Array, unit: str, *, quantity: str = "",
                       names: Sequence[str] = (), flagged: npt.NDArray[np.bool_] | None = None,
                       flag_name: str = "flagged") -> None:
    """A signal over time, one row a joint, with the flagged samples marked.

    Args:
        axes: one a joint, from `joint_axes`.
        values: (samples,) or (samples, joints).
        quantity: what the signal is: "position"; with the unit it labels the rows.
        names: of the joints; "joint 1", "joint 2", … where empty.
        flagged: (samples,) or (samples, joints).
    """
    values = values.reshape(-1, 1) if values.ndim == 1 else values
    names = names or [f"joint {number}" for number in range(1, values.shape[1] + 1)]
    flags = np.zeros(values.shape, bool) if flagged is None else np.broadcast_to(
        flagged.reshape(-1, 1) if flagged.ndim == 1 else flagged, values.shape)
    t, label = _drawable_time(t)
    for axis, name, column, mask in zip(axes, names, values.T, flags.T, strict=True):
        _line(axis, *broken_at_gaps(t, column), color=style.BLUE, width=1.1)
        _mark(axis, t, column, mask)
        axis.set_title(printable(name, 60), pad=3.0)
        axis.margins(x=0.01, y=0.12)
        axis.locator_params(axis="y", nbins=4)
    axes[-1].set_xlabel(label)
    if figure := axes[0].get_figure():
        figure.supylabel(printable(f"{quantity} [{format_unit(unit)}]".strip(), 60), fontsize="medium")
    if flags.any():
        first = next(axis for axis, mask in zip(axes, flags.T, strict=True) if mask.any())
        first.fill_between([], [], color=style.ORANGE, alpha=0.35, label=printable(flag_name, 60))
        first.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0)


def draw_measured(axis: Axes, t: Array, x: Array) -> None:
    """What was measured, broad and light: a model that lies on it leaves its borders to be seen, and where it does not, both."""
    axis.plot(t, x, color=style.SKY, linewidth=3.0, label="measured")


def draw_modelled(axis: Axes, t: Array, x: Array, label: str) -> None:
    """What a model says of it, thin and dark, over what was measured."""
    axis.plot(t, x, color=style.VERMILLION, linewidth=0.9, label=label)


def _line(axis: Axes, t: Array, x: Array, color: str, width: float) -> None:
    t, x = envelope(t, x)
    twice = np.flatnonzero((np.diff(t) == 0.0) & (np.diff(x) == 0.0)) + 1
    if twice.size:
        t = t.copy()
        t[twice] += 2e-5 * np.ptp(t)  # a line of no length at all leaves no dot in a PNG
    axis.plot(t, x, color=color, linewidth=width)


def _mark(axis: Axes, t: Array, column: Array, mask: npt.NDArray[np.bool_]) -> None:
    """Shade where samples are flagged, and draw over the samples themselves; missing ones have only the shade."""
    if not mask.any():
        return
    reach = float(np.ptp(t)) / 500.0
    spans = merge_spans(true_spans(t, mask), reach)
    axis.broken_barh([(start, stop - start) for start, stop in spans], (0.0, 1.0), transform=axis.get_xaxis_transform(),
                     facecolor=style.ORANGE, edgecolor=style.ORANGE, linewidth=0.8, alpha=0.28, zorder=0.5)
    _line(axis, t, np.where(mask, column, np.nan), color=style.VERMILLION, width=2.6)


def _drawable_time(t: Array) -> tuple[Array, str]:
    """Time as recorded; the number of the sample where the recorded time cannot serve as an axis."""
    t = np.asarray(t, dtype=np.float64)
    usable = t.size > 0 and bool(np.isfinite(t).all()) and np.abs(t).max() < _LARGEST and np.ptp(t) > 0.0
    return (t, "time [s]") if usable else (np.arange(t.size, dtype=np.float64), "sample")


def broken_at_gaps(t: Array, x: Array) -> tuple[Array, Array]:
    """A NaN where five samples or more are missing in time: nothing was measured there, so no line is drawn."""
    step = np.diff(t)
    rising = step[step > 0.0]
    if rising.size == 0:
        return t, x
    at = np.flatnonzero(step > 5.0 * np.median(rising)) + 1
    return np.insert(t, at, t[at]), np.insert(x, at, np.nan)


def draw_intervals(axes: Axes, t: Array, nominal: float) -> None:
    """Histogram of the time between samples, as its distance from the nominal one; counts on a logarithmic scale."""
    interval = np.diff(np.asarray(t, dtype=np.float64))
    off = interval[np.isfinite(interval)] - nominal
    size = np.abs(off)
    near = size[size <= 3.0 * np.quantile(size, 0.999)] if size.size else size
    # one gap of a minute must not press all the rest into one bar
    reach = min(max(1.05 * near.max(initial=0.0), 1e-3 * nominal), 2.0 * nominal)
    factor, unit = next((pair for pair in _SCALES if reach >= pair[0]), _SCALES[-1])
    axes.hist(off / factor, bins=61, range=(-reach / factor, reach / factor), color=style.BLUE, rwidth=0.9, log=True)
    axes.axvline(0.0, color=style.BLACK, linewidth=0.9, linestyle=(0, (4, 3)))
    axes.set_xlim(-1.02 * reach / factor, 1.02 * reach / factor)
    axes.set_ylim(bottom=0.7)
    style.log_ticks(axes.yaxis)
    axes.set_xlabel(f"time between samples minus the nominal {format_number(nominal / factor)} {unit} [{unit}]")
    axes.set_ylabel("intervals")
    beyond = [(int((off < -reach).sum()), "left", 0.0), (int((off > reach).sum()), "right", 1.0)]
    for count, side, where in beyond:
        if count:
            words = f"◀ {format_number(count)} shorter" if side == "left" else f"{format_number(count)} longer ▶"
            axes.text(where, 1.0, words, transform=axes.transAxes, ha=side, va="bottom", color=style.VERMILLION)


def draw_timeline(axes: Axes, extent: Span, rows: Sequence[tuple[str, Sequence[Span]]]) -> None:
    """When something happened: one row a kind ("gap", "filled", …), a bar for every stretch of time.

    Args:
        extent: first and last time of the log. [s]
        rows: name and from-to times, in the order they are drawn from the top.
    """
    start, stop = extent
    reach = (stop - start) / 1000.0
    for place, (_, spans) in enumerate(rows):
        colour = style.COLOURS[(place + 1) % len(style.COLOURS)]
        axes.plot([start, stop], [place, place], color="#dfe4e8", linewidth=1.2, zorder=1)
        bars = [(first, last - first) for first, last in merge_spans(spans, reach)]
        # the outline keeps a gap of one millisecond in an hour visible
        axes.broken_barh(bars, (place - 0.3, 0.6), facecolor=colour, edgecolor=colour, linewidth=1.4, zorder=2)
    labels = [f"{printable(name, 40)} ({format_number(len(spans))})" for name, spans in rows]
    axes.set_yticks(range(len(rows)), labels)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(start - 5.0 * reach, stop + 5.0 * reach)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.spines["bottom"].set_color(style.GREY)
    axes.set_xlabel("time [s]")

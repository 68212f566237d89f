"""Drawings the reports share. Axes first, nothing returned; long logs are drawn by envelopes.

Every function stands up to a damaged log: time that runs backwards, samples that are missing, names
that are mark-up. What ends in `_figure` is a whole figure of a report.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pipelines.report import style
from pipelines.report.report import Figure
from pipelines.report.style import format_number, format_unit, printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing
    from matplotlib.figure import SubFigure

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Span = tuple[float, float]
Look = dict[str, Any]  # of a line or an area, as matplotlib takes it

_LARGEST = 1e150  # numerics: beyond it the axis limits overflow; a damaged sample may be that large
_SCALES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
_POINTS = 800  # numerics: of a curve among others
_ROW = 0.8  # numerics: [inch] height of the axes of one joint
_WIDE = 70  # numerics: characters of a legend that a figure is wide enough for
DASHED = (0, (5, 1.5))  # numerics: how it is drawn


def envelope(t: Array, x: Array, points: int = 1200) -> tuple[Array, Array]:
    """Lowest and highest sample of each stretch of a long signal: what the eye would see.

    Samples that are not finite become NaN and break the line; where they do, a sample is given
    twice, because a line needs two points and a sample alone between two gaps would not be drawn.
    """
    x = np.where(np.isfinite(x), np.clip(x, -_LARGEST, _LARGEST), np.nan)
    if x.size == 0 or (x.size <= points and np.isfinite(x).all()):
        return t, x
    width = -(-x.size // max(1, points // 2))
    rows = -(-x.size // width)
    samples = np.arange(rows * width)
    index = np.minimum(samples, x.size - 1).reshape(rows, width)  # the last one fills the last row
    part = x[index]
    bad = np.isnan(part)
    row = np.arange(rows)
    extremes = (
        np.where(bad, np.inf, part).argmin(axis=1),
        np.where(bad, -np.inf, part).argmax(axis=1),
    )
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


def true_spans(t: Array, mask: Mask) -> list[Span]:
    """From-to times of the runs of samples where `mask` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(float(t[start]), float(t[stop - 1])) for start, stop in edges.reshape(-1, 2)]


def merge_spans(spans: Iterable[Span], reach: float) -> list[Span]:
    """Spans in order of time, those nearer than `reach` joined: a thousand would be a huge file."""
    merged: list[Span] = []
    for start, stop in sorted((min(span), max(span)) for span in spans if np.isfinite(span).all()):
        if merged and start - merged[-1][1] <= reach:
            merged[-1] = (merged[-1][0], max(merged[-1][1], stop))
        else:
            merged.append((start, stop))
    return merged


def broken_at_gaps(t: Array, x: Array) -> tuple[Array, Array]:
    """A NaN where five samples or more are missing in time, (samples,) or (samples, joints)."""
    step = np.diff(t)
    rising = step[step > 0.0]
    if rising.size == 0:
        return t, x
    at = np.flatnonzero(step > 5.0 * np.median(rising)) + 1
    return np.insert(t, at, t[at]), np.insert(x, at, np.nan, axis=0)


def joint_axes(figure: Drawing | SubFigure, joints: int, sharey: bool = False) -> list[Axes]:
    """One row of axes a joint over a common time axis."""
    grid = figure.subplots(max(1, joints), 1, sharex=True, sharey=sharey, squeeze=False)
    return list(grid[:, 0])


def joint_names(joints: int) -> list[str]:
    """ "joint 1", "joint 2", …"""
    return [f"joint {number}" for number in range(1, joints + 1)]


def joint_colour(joint: int) -> str:
    """Of joint 0, 1, …"""
    return style.COLOURS[joint % len(style.COLOURS)]


def legend_above(axis: Axes, columns: int = 1) -> None:
    """A legend outside the axes, right of the title; in fewer columns where names are long."""
    longest = max((len(name) for name in axis.get_legend_handles_labels()[1]), default=0)
    fewer = max(1, min(columns, _WIDE // max(longest, 1)))
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0, ncols=fewer)


def label_rows(
    axes: Sequence[Axes], names: Sequence[str], quantity: str, x: str = "time [s]", legend: int = 0
) -> None:
    """Titles, margins and common labels of rows of axes; a `legend` of so many columns."""
    for axis, name in zip(axes, names, strict=True):
        axis.set_title(printable(name, 60), pad=3.0)
        axis.margins(x=0.01, y=0.1)
        axis.locator_params(axis="y", nbins=4)
    axes[-1].set_xlabel(x)
    if figure := axes[0].get_figure():
        figure.supylabel(printable(format_unit(quantity), 60), fontsize="medium")
    if legend:
        legend_above(axes[0], legend)


def rows_figure(
    name: str,
    caption: str,
    names: Sequence[str],
    draw_row: Callable[[Axes, int], None],
    quantity: str,
    *,
    x: str = "time [s]",
    legend: int = 0,
    row: float = _ROW,
    sharey: bool = False,
) -> Figure:
    """One row of axes for each of `names`, each filled by `draw_row(axes, number from 0)`.

    Args:
        quantity: with its unit, "torque [N m]": the label of all rows.
        legend: columns of the legend above the first row; none where 0.
        row: height of a row. [inch]
        sharey: all rows have one scale.
    """

    def draw(drawing: Drawing) -> None:
        axes = joint_axes(drawing, len(names), sharey)
        for k, axis in enumerate(axes):
            draw_row(axis, k)
        label_rows(axes, names, quantity, x, legend)

    return Figure(name, caption, draw, (6.0, 0.65 + row * max(1, len(names))))


def one_figure(
    name: str, caption: str, draw_axes: Callable[[Axes], None], height: float, alt: str = ""
) -> Figure:
    """A figure of one pair of axes, `height` inches high."""
    return Figure(name, caption, lambda drawing: draw_axes(drawing.subplots()), (6.0, height), alt)


def draw_measured(axis: Axes, t: Array, x: Array) -> None:
    """Draw the measurement broad and light: its borders stay visible under a model."""
    axis.plot(t, x, color=style.SKY, linewidth=3.0, label="measured")


def draw_modelled(axis: Axes, t: Array, x: Array, label: str) -> None:
    """Draw the prediction of a model thin and dark, over the measurement."""
    axis.plot(t, x, color=style.VERMILLION, linewidth=0.9, label=label)


def compared_figure(
    name: str,
    caption: str,
    t: Array,
    measured: Array,
    modelled: Array,
    quantity: str,
    label: str = "simulated",
    names: Sequence[str] = (),
    others: Sequence[tuple[str, Array, str]] = (),
) -> Figure:
    """A measured signal under that of a model, one row a joint, `others` over both.

    Args:
        measured, modelled: (samples, joints).
        quantity: with its unit: "torque [N m]".
        others: (label, (samples, joints), colour).
    """

    def draw_row(axis: Axes, j: int) -> None:
        draw_measured(axis, *envelope(t, measured[:, j], _POINTS))
        draw_modelled(axis, *envelope(t, modelled[:, j], _POINTS), label)
        for other, values, color in others:
            drawn = envelope(t, values[:, j], _POINTS)
            axis.plot(*drawn, color=color, linewidth=0.9, label=other)

    names = names or joint_names(measured.shape[1])
    return rows_figure(name, caption, names, draw_row, quantity, legend=2 + len(others))


def draw_joint_signals(
    axes: Sequence[Axes],
    t: Array,
    values: Array,
    unit: str,
    *,
    quantity: str = "",
    names: Sequence[str] = (),
    flagged: Mask | None = None,
    flag_name: str = "flagged",
) -> None:
    """A signal over time, one row a joint, with the flagged samples marked.

    Args:
        axes: one a joint, from `joint_axes`.
        values, flagged: (samples,) or (samples, joints).
        quantity: what the signal is: "position"; with the unit it labels the rows.
        names: of the joints; "joint 1", "joint 2", … where empty.
    """
    values = values.reshape(-1, 1) if values.ndim == 1 else values
    names = names or joint_names(values.shape[1])
    flags = np.zeros(values.shape, bool)
    if flagged is not None:
        columns = flagged.reshape(-1, 1) if flagged.ndim == 1 else flagged
        flags = np.broadcast_to(columns, values.shape)
    t, label = _drawable_time(t)
    for axis, column, mask in zip(axes, values.T, flags.T, strict=True):
        _line(axis, *broken_at_gaps(t, column), color=style.BLUE, width=1.1)
        _mark(axis, t, column, mask)
    label_rows(axes, names, f"{quantity} [{unit}]".strip(), label)
    if flags.any():
        first = next(axis for axis, mask in zip(axes, flags.T, strict=True) if mask.any())
        shown = printable(flag_name, 60)
        first.fill_between([], [], color=style.ORANGE, alpha=0.35, label=shown)
        legend_above(first)


def joint_signal_figure(
    name: str,
    caption: str,
    t: Array,
    values: Array,
    unit: str,
    *,
    quantity: str = "",
    names: Sequence[str] = (),
    flagged: Mask | None = None,
    flag_name: str = "flagged",
) -> Figure:
    """A signal over time, one row a joint; see `draw_joint_signals`."""
    joints = values.shape[1] if values.ndim > 1 else 1
    look: Look = {"quantity": quantity, "names": names, "flagged": flagged, "flag_name": flag_name}

    def draw(drawing: Drawing) -> None:
        draw_joint_signals(joint_axes(drawing, joints), t, values, unit, **look)

    return Figure(name, caption, draw, size=(6.0, 0.65 + _ROW * max(1, joints)))


def _line(axis: Axes, t: Array, x: Array, color: str, width: float) -> None:
    t, x = envelope(t, x)
    twice = np.flatnonzero((np.diff(t) == 0.0) & (np.diff(x) == 0.0)) + 1
    if twice.size:
        t = t.copy()
        t[twice] += 2e-5 * np.ptp(t)  # a line of no length at all leaves no dot in a PNG
    axis.plot(t, x, color=color, linewidth=width)


def _mark(axis: Axes, t: Array, column: Array, mask: Mask) -> None:
    """Shade where samples are flagged, and draw over those that are not missing."""
    if not mask.any():
        return
    spans = merge_spans(true_spans(t, mask), float(np.ptp(t)) / 500.0)
    axis.broken_barh(
        [(start, stop - start) for start, stop in spans],
        (0.0, 1.0),
        transform=axis.get_xaxis_transform(),
        color=style.ORANGE,
        linewidth=0.8,
        alpha=0.28,
        zorder=0.5,
    )
    _line(axis, t, np.where(mask, column, np.nan), color=style.VERMILLION, width=2.6)


def _drawable_time(t: Array) -> tuple[Array, str]:
    """Time as recorded; the number of the sample where that cannot serve as an axis."""
    t = np.asarray(t, dtype=np.float64)
    finite = t.size > 0 and bool(np.isfinite(t).all())
    if finite and np.abs(t).max() < _LARGEST and np.ptp(t) > 0.0:
        return t, "time [s]"
    return np.arange(t.size, dtype=np.float64), "sample"


def draw_intervals(axes: Axes, t: Array, nominal: float) -> None:
    """Histogram of the time between samples minus the nominal one, on a logarithmic scale."""
    interval = np.diff(np.asarray(t, dtype=np.float64))
    off = interval[np.isfinite(interval)] - nominal
    size = np.abs(off)
    near = size[size <= 3.0 * np.quantile(size, 0.999)] if size.size else size
    # one gap of a minute must not press all the rest into one bar
    reach = min(max(1.05 * near.max(initial=0.0), 1e-3 * nominal), 2.0 * nominal)
    factor, unit = next((pair for pair in _SCALES if reach >= pair[0]), _SCALES[-1])
    shown = reach / factor
    axes.hist(off / factor, bins=61, range=(-shown, shown), color=style.BLUE, rwidth=0.9, log=True)
    axes.axvline(0.0, color=style.BLACK, linewidth=0.9, linestyle=(0, (4, 3)))
    axes.set_xlim(-1.02 * shown, 1.02 * shown)
    axes.set_ylim(bottom=0.7)
    style.log_ticks(axes.yaxis)
    beside = f"the nominal {format_number(nominal / factor)} {unit}"
    axes.set_xlabel(f"time between samples minus {beside} [{unit}]")
    axes.set_ylabel("intervals")
    write = partial(axes.text, transform=axes.transAxes, va="bottom", color=style.VERMILLION)
    if shorter := int((off < -reach).sum()):
        write(0.0, 1.0, f"◀ {format_number(shorter)} shorter", ha="left")
    if longer := int((off > reach).sum()):
        write(1.0, 1.0, f"{format_number(longer)} longer ▶", ha="right")


def interval_figure(name: str, caption: str, t: Array, sample_time: float) -> Figure:
    """How evenly the log was sampled."""
    return one_figure(name, caption, lambda axes: draw_intervals(axes, t, sample_time), 2.6)


def draw_timeline(axes: Axes, extent: Span, rows: Sequence[tuple[str, Sequence[Span]]]) -> None:
    """When something happened: one row a kind ("gap", "filled", …), a bar for each stretch of time.

    Args:
        extent: first and last time of the log. [s]
        rows: name and from-to times, in the order they are drawn from the top.
    """
    start, stop = extent
    reach = (stop - start) / 1000.0
    for k, (_, spans) in enumerate(rows):
        colour = style.COLOURS[(k + 1) % len(style.COLOURS)]
        axes.plot([start, stop], [k, k], color="#dfe4e8", linewidth=1.2, zorder=1)
        bars = [(first, last - first) for first, last in merge_spans(spans, reach)]
        # the outline keeps a gap of one millisecond in an hour visible
        axes.broken_barh(bars, (k - 0.3, 0.6), color=colour, linewidth=1.4, zorder=2)
    labels = [f"{printable(name, 40)} ({format_number(len(spans))})" for name, spans in rows]
    axes.set_yticks(range(len(rows)), labels)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(start - 5.0 * reach, stop + 5.0 * reach)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.spines["bottom"].set_color(style.GREY)
    axes.set_xlabel("time [s]")


def timeline_figure(
    name: str, caption: str, extent: Span, rows: Sequence[tuple[str, Sequence[Span]]]
) -> Figure:
    """When gaps, repairs and limits fell, one row a kind."""
    height = 0.6 + 0.32 * max(1, len(rows))
    return one_figure(name, caption, lambda axes: draw_timeline(axes, extent, rows), height)


def density_figure(name: str, caption: str, frequency: Array, density: Array, unit: str) -> Figure:
    """Amplitude density of a difference over frequency, one line a joint."""

    def draw(axes: Axes) -> None:
        amplitude = np.sqrt(np.maximum(density[1:], 1e-300))
        for j, column in enumerate(amplitude.T):
            look: Look = {"color": joint_colour(j), "label": f"joint {j + 1}"}
            axes.loglog(frequency[1:], column, linewidth=0.9, **look)
        largest, least = amplitude.max(initial=1e-150), amplitude.min(initial=1.0)
        axes.set_ylim(max(0.5 * least, 1e-5 * largest), 2.0 * largest)
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel(f"difference [{format_unit(unit)}/√Hz]")
        style.log_ticks(axes.xaxis)
        style.log_ticks(axes.yaxis)
        axes.legend(loc="best", ncols=min(3, density.shape[1]))

    return one_figure(name, caption, draw, 2.8)

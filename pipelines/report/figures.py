"""Drawings the reports share. Axes first, nothing returned; long logs are drawn by envelopes.

Every function copes with a damaged log: time that runs backwards, samples that are missing, names
that are mark-up. What ends in `_figure` is a whole figure of a report.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pipelines.report import style
from pipelines.report.report import Figure
from pipelines.report.style import format_unit, printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Span = tuple[float, float]
Look = dict[str, Any]  # of a line or an area, as matplotlib takes it

_LARGEST = 1e150  # numerics: beyond it the axis limits overflow; a damaged sample may be that large
_POINTS = 800  # numerics: of a curve among others
_ROW = 0.8  # numerics: [inch] height of the axes of one joint
_WIDE = 80  # numerics: characters of a legend that a figure is wide enough for
DASHED = (0, (5, 1.5))  # numerics: how it is drawn
# of the curves of one signal: what was measured is broad and light, so that it is seen under others
_LOOKS: tuple[Look, ...] = (
    {"color": style.SKY, "linewidth": 3.0},
    {"color": style.VERMILLION, "linewidth": 0.9},
    {"color": style.GREEN, "linewidth": 0.9},
    {"color": style.BLACK, "linewidth": 0.9},
)


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


def true_spans(t: Array, mask: Mask, reach: float = 0.0) -> list[Span]:
    """From-to times of the runs of samples where `mask` holds, those nearer than `reach` joined."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    merged: list[Span] = []
    for start, stop in sorted((t[a], t[b - 1]) for a, b in edges.reshape(-1, 2)):
        if merged and start - merged[-1][1] <= reach:
            merged[-1] = (merged[-1][0], max(merged[-1][1], float(stop)))
        else:
            merged.append((float(start), float(stop)))
    return merged


def broken_at_gaps(t: Array, x: Array) -> tuple[Array, Array]:
    """A NaN where five samples or more are missing in time, (samples,) or (samples, joints)."""
    step = np.diff(t)
    rising = step[step > 0.0]
    if rising.size == 0:
        return t, x
    at = np.flatnonzero(step > 5.0 * np.median(rising)) + 1
    return np.insert(t, at, t[at]), np.insert(x, at, np.nan, axis=0)


def joint_names(joints: int) -> list[str]:
    """ "joint 1", "joint 2", …"""
    return [f"joint {number}" for number in range(1, joints + 1)]


def joint_colour(joint: int) -> str:
    """Of joint 0, 1, …"""
    return style.COLOURS[joint % len(style.COLOURS)]


def legend(axis: Axes) -> None:
    """A legend above the whole figure, in as many columns as its names leave room for."""
    handles, labels = axis.get_legend_handles_labels()
    longest = max(map(len, labels), default=0) + 4
    columns = max(1, min(len(labels), _WIDE // longest))
    if figure := axis.get_figure():
        figure.legend(handles, labels, loc="outside upper right", ncols=columns)  # type: ignore[call-arg]


def rows_figure(
    name: str,
    caption: str,
    names: Sequence[str],
    draw_row: Callable[[Axes, int], None],
    quantity: str,
    *,
    x: str = "time [s]",
    row: float = _ROW,
) -> Figure:
    """One row of axes for each of `names`, each filled by `draw_row(axes, number from 0)`.

    Args:
        quantity: with its unit, "torque [N m]": the label of all rows.
        row: height of a row. [inch]
    """

    def draw(drawing: Drawing) -> None:
        axes = drawing.subplots(max(1, len(names)), 1, sharex=True, squeeze=False)[:, 0]
        for k, (axis, title) in enumerate(zip(axes, names, strict=False)):
            draw_row(axis, k)
            axis.set_title(printable(title, 60), pad=3.0)
            axis.margins(x=0.01, y=0.1)
            if axis.get_yscale() == "linear":
                axis.locator_params(axis="y", nbins=4)
        axes[-1].set_xlabel(x)
        drawing.supylabel(printable(format_unit(quantity), 60), fontsize="medium")
        labelled = [axis for axis in axes if len(axis.get_legend_handles_labels()[1]) > 0]
        if labelled:
            legend(labelled[0])

    return Figure(name, caption, draw, (6.0, 0.8 + row * max(1, len(names))))


def one_figure(
    name: str, caption: str, draw_axes: Callable[[Axes], None], height: float = 2.8
) -> Figure:
    """A figure of one pair of axes, `height` inches high."""
    return Figure(name, caption, lambda drawing: draw_axes(drawing.subplots()), (6.0, height))


def signals_figure(
    name: str,
    caption: str,
    t: Array,
    signals: Mapping[str, Array],
    quantity: str,
    names: Sequence[str] = (),
) -> Figure:
    """Signals over time, the measured one first and broad, one row a joint.

    Args:
        signals: label -> (samples, joints).
        quantity: with its unit: "torque [N m]".
    """

    def draw_row(axis: Axes, j: int) -> None:
        for look, (label, values) in zip(_LOOKS, signals.items(), strict=False):
            axis.plot(*envelope(t, values[:, j], _POINTS), label=label, **look)

    joints = next(iter(signals.values())).shape[1]
    return rows_figure(name, caption, names or joint_names(joints), draw_row, quantity)


def joint_signal_figure(
    name: str,
    caption: str,
    t: Array,
    values: Array,
    quantity: str,
    *,
    names: Sequence[str] = (),
    flagged: Mask | None = None,
    flag_name: str = "flagged",
) -> Figure:
    """A signal over time, one row a joint, with the flagged samples marked.

    Args:
        values, flagged: (samples, joints).
        quantity: with its unit: "position [rad]".
    """
    time, label = _drawable_time(t)
    marked = np.zeros(values.shape, bool) if flagged is None else flagged

    def draw_row(axis: Axes, j: int) -> None:
        _line(axis, *broken_at_gaps(time, values[:, j]), style.BLUE, 1.1)
        if marked[:, j].any():
            _mark(axis, time, values[:, j], marked[:, j], printable(flag_name, 60))

    rows = names or joint_names(values.shape[1])
    return rows_figure(name, caption, rows, draw_row, quantity, x=label)


def _line(axis: Axes, t: Array, x: Array, color: str, width: float) -> None:
    t, x = envelope(t, x)
    twice = np.flatnonzero((np.diff(t) == 0.0) & (np.diff(x) == 0.0)) + 1
    if twice.size:
        t = t.copy()
        t[twice] += 2e-5 * np.ptp(t)  # a line of no length at all leaves no dot in a PNG
    axis.plot(t, x, color=color, linewidth=width)


def _mark(axis: Axes, t: Array, column: Array, mask: Mask, label: str) -> None:
    """Shade where samples are flagged, and draw over those that are not missing."""
    bars = [(a, b - a) for a, b in true_spans(t, mask, float(np.ptp(t)) / 500.0)]
    shade: Look = {"color": style.ORANGE, "linewidth": 0.8, "alpha": 0.28, "zorder": 0.5}
    across = axis.get_xaxis_transform()
    axis.broken_barh(bars, (0.0, 1.0), transform=across, label=label, **shade)
    _line(axis, t, np.where(mask, column, np.nan), style.VERMILLION, 2.6)


def _drawable_time(t: Array) -> tuple[Array, str]:
    """Time as recorded; the number of the sample where that cannot serve as an axis."""
    t = np.asarray(t, dtype=np.float64)
    finite = t.size > 0 and bool(np.isfinite(t).all())
    if finite and np.abs(t).max() < _LARGEST and np.ptp(t) > 0.0:
        return t, "time [s]"
    return np.arange(t.size, dtype=np.float64), "sample"

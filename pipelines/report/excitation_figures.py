"""Drawings of a designed experiment: its motion within limits, its spectrum, what it shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.report import style
from pipelines.report.figures import Array, envelope, one_figure, rows_figure
from pipelines.report.report import Figure
from pipelines.report.style import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDE = 30.0  # ratio from which a scale must be logarithmic
_WORTH = 0.6  # of a limit: where a signal stays farther away, drawing it would flatten the signal


def limited_figure(
    name: str,
    caption: str,
    t: Array,
    values: Array,
    ends: tuple[Sequence[float], Sequence[float]],
    label: str,
    joints: Sequence[str],
) -> Figure:
    """A signal over one period, one row a joint, with the limits (low, high) it comes near to."""

    def draw_row(axis: Axes, j: int) -> None:
        axis.plot(*envelope(t, values[:, j]), color=style.BLUE, linewidth=1.0)
        for end in (ends[0][j], ends[1][j]):
            if np.isfinite(end) and np.abs(values[:, j]).max() > _WORTH * abs(end):
                axis.axhline(end, color=style.VERMILLION, linewidth=0.9, linestyle=(0, (5, 2)))

    return rows_figure(name, caption, joints, draw_row, label)


def spectrum_figure(caption: str, hertz: Array, amplitude: Array, joints: Sequence[str]) -> Figure:
    """Amplitude of the speed at every harmonic, one row a joint."""

    def draw_row(axis: Axes, j: int) -> None:
        axis.vlines(hertz, 0.0, amplitude[:, j], color=style.BLUE, linewidth=1.2)
        axis.set_ylim(bottom=0.0)

    label, x = "amplitude of the speed [rad/s]", "frequency [Hz]"
    return rows_figure("spectrum", caption, joints, draw_row, label, x=x)


def singular_value_figure(values: Sequence[float]) -> Figure:
    """Singular values of Φ, the largest first; which parameters they belong to the table says."""

    def draw(axis: Axes) -> None:
        place = np.arange(1, len(values) + 1)
        wide = max(values) > _WIDE * min(values)
        low = 0.5 * min(values) if wide else 0.0
        axis.vlines(place, low, values, color=style.GREY, linewidth=1.0)
        axis.plot(place, values, "o", color=style.BLUE, markersize=4.5)
        if wide:
            axis.set_yscale("log")
            style.log_ticks(axis.yaxis)
        axis.set_ylim(low, (2.0 if wide else 1.1) * max(values))
        axis.set_xlabel("direction of the parameters")
        axis.set_ylabel("singular value of Φ / √n")
        axis.locator_params(axis="x", integer=True)

    caption = "Singular values of Φ: the smallest belongs to the direction known worst."
    return one_figure("singular-values", caption, draw, 2.8)


def relative_std_figure(names: Sequence[str], percent: Sequence[float]) -> Figure:
    """Predicted standard deviation of every parameter over its value, the best known on top."""
    order = np.argsort(percent)[::-1]
    values = np.array(percent)[order]
    place = np.arange(len(values))

    def draw(axis: Axes) -> None:
        axis.hlines(place, 0.3 * values.min(), values, color=style.GREY, linewidth=1.0)
        axis.plot(values, place, "o", color=style.BLUE, markersize=4.0)
        axis.set_xscale("log")
        axis.set_xlim(0.5 * values.min(), 2.0 * values.max())
        style.log_ticks(axis.xaxis)
        axis.set_yticks(place, [printable(names[k], 24) for k in order])
        axis.set_ylim(-0.7, len(values) - 0.3)
        axis.grid(axis="y", visible=False)
        axis.set_xlabel("standard deviation over value [%]")

    caption = "Predicted standard deviation of every parameter, relative to its value."
    return one_figure("relative-std", caption, draw, 0.7 + 0.19 * len(names))

"""Drawings of a designed experiment: its motion within limits, its spectrum, what it shows and how well."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.report import figures, style
from pipelines.report.figures import Array
from pipelines.report.report import Figure
from pipelines.report.style import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

__all__ = ["limited_figure", "relative_std_figure", "singular_value_figure", "spectrum_figure"]

_WIDE = 30.0  # ratio from which a scale must be logarithmic
_WORTH = 0.6  # of a limit: where a signal stays farther away, drawing the limit would flatten it


def limited_figure(name: str, caption: str, t: Array, values: Array, low: Sequence[float], high: Sequence[float], label: str,
                   joints: Sequence[str]) -> Figure:
    """A signal over one period, one row a joint, with the limits it comes near to."""

    def draw(drawing: Drawing) -> None:
        axes = figures.joint_axes(drawing, values.shape[1])
        for j, axis in enumerate(axes):
            draw_limited(axis, t, values[:, j], low[j], high[j])
            axis.set_title(printable(joints[j], 60), pad=3.0)
        axes[-1].set_xlabel("time [s]")
        drawing.supylabel(label, fontsize="medium")

    return Figure(name, caption, draw, size=figures.joint_size(values.shape[1]))


def draw_limited(axis: Axes, t: Array, values: Array, low: float, high: float) -> None:
    axis.plot(*figures.envelope(t, values, 1200), color=style.BLUE, linewidth=1.0)
    for end in (low, high):
        if np.isfinite(end) and np.abs(values).max() > _WORTH * abs(end):
            axis.axhline(end, color=style.VERMILLION, linewidth=0.9, linestyle=(0, (5, 2)))
    axis.margins(x=0.01, y=0.12)
    axis.locator_params(axis="y", nbins=4)


def spectrum_figure(name: str, caption: str, hertz: Array, amplitude: Array, joints: Sequence[str]) -> Figure:
    """Amplitude of the speed at every harmonic, one row a joint."""

    def draw(drawing: Drawing) -> None:
        axes = figures.joint_axes(drawing, amplitude.shape[1])
        for j, axis in enumerate(axes):
            axis.vlines(hertz, 0.0, amplitude[:, j], color=style.BLUE, linewidth=1.2)
            axis.set_ylim(bottom=0.0)
            axis.margins(x=0.01)
            axis.locator_params(axis="y", nbins=4)
            axis.set_title(printable(joints[j], 60), pad=3.0)
        axes[-1].set_xlabel("frequency [Hz]")
        drawing.supylabel("amplitude of the speed [rad/s]", fontsize="medium")

    return Figure(name, caption, draw, size=figures.joint_size(amplitude.shape[1]))


def singular_value_figure(name: str, caption: str, values: Sequence[float]) -> Figure:
    """Singular values, largest first; on a logarithmic scale where they differ much."""

    def draw(drawing: Drawing) -> None:
        axis = drawing.subplots()
        place = np.arange(1, len(values) + 1)
        wide = max(values) > _WIDE * min(values)
        axis.vlines(place, 0.5 * min(values) if wide else 0.0, values, color=style.GREY, linewidth=1.0)
        axis.plot(place, values, "o", color=style.BLUE, markersize=4.5)
        if wide:
            axis.set_yscale("log")
            style.log_ticks(axis.yaxis)
        axis.set_ylim(0.5 * min(values) if wide else 0.0, (2.0 if wide else 1.1) * max(values))
        axis.set_xlabel("direction of the parameters")
        axis.set_ylabel("singular value of Φ / √n")
        axis.locator_params(axis="x", integer=True)

    return Figure(name, caption, draw, size=(6.0, 2.8))


def relative_std_figure(name: str, caption: str, names: Sequence[str], percent: Sequence[float]) -> Figure:
    """Predicted standard deviation of every parameter over its value, the best known on top."""

    def draw(drawing: Drawing) -> None:
        axis = drawing.subplots()
        order = np.argsort(percent)[::-1]
        values = np.array(percent)[order]
        place = np.arange(len(values))
        axis.hlines(place, 0.3 * values.min(), values, color=style.GREY, linewidth=1.0)
        axis.plot(values, place, "o", color=style.BLUE, markersize=4.0)
        axis.set_xscale("log")
        axis.set_xlim(0.5 * values.min(), 2.0 * values.max())
        style.log_ticks(axis.xaxis)
        axis.set_yticks(place, [printable(names[k], 24) for k in order])
        axis.set_ylim(-0.7, len(values) - 0.3)
        axis.grid(axis="y", visible=False)
        axis.set_xlabel("standard deviation over value [%]")

    return Figure(name, caption, draw, size=(6.0, 0.7 + 0.19 * len(names)))

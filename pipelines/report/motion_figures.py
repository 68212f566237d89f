"""Drawings of reconstructed motion: Bode plots of the observer, what it leaves, speeds and accelerations with their bands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.report import style
from pipelines.report.figures import Array
from pipelines.report.style import format_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["colour", "draw_banded", "draw_bode", "draw_density"]

Complex = npt.NDArray[np.complex128]

_STYLES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))  # lines of joints that lie on each other stay apart


def colour(joint: int) -> str:
    """Of joint 0, 1, ..."""
    return style.COLOURS[joint % len(style.COLOURS)]


def draw_bode(axes: Sequence[Sequence[Axes]], frequency: Array, response: Sequence[Complex], names: Sequence[str],
              ideal: Sequence[Complex]) -> None:
    """Magnitude and phase over frequency, one row a channel, one line a joint.

    Args:
        axes: (channels, 2).
        response: per channel, complex (frequencies, joints).
        names: of the channels, with units.
        ideal: per channel, complex (frequencies,): what an exact differentiator would do; dotted.
    """
    for (magnitude, phase), values, name, exact in zip(axes, response, names, ideal, strict=True):
        for j in range(values.shape[1]):
            look = {"color": colour(j), "linestyle": _STYLES[j % 3], "label": f"joint {j + 1}"}
            magnitude.semilogx(frequency, np.abs(values[:, j]), **look)
            phase.semilogx(frequency, np.rad2deg(np.unwrap(np.angle(values[:, j]))), **look)
        magnitude.semilogx(frequency, np.abs(exact), color=style.GREY, linestyle=":", linewidth=1.0)
        phase.semilogx(frequency, np.rad2deg(np.angle(exact)), color=style.GREY, linestyle=":", linewidth=1.0)
        largest = np.abs(values).max()
        if np.abs(values).min() > 0.01 * largest:
            magnitude.set_ylim(0.0, 1.15 * largest)
        else:
            magnitude.set_yscale("log")
            magnitude.set_ylim(max(np.abs(values).min() * 0.5, 1e-3 * largest), 2.0 * largest)
            style.log_ticks(magnitude.yaxis)
        magnitude.set_title(f"{name}: magnitude", pad=3.0)
        phase.set_title("phase [°]", pad=3.0)
        style.log_ticks(magnitude.xaxis)
        style.log_ticks(phase.xaxis)
    for axis in axes[-1]:
        axis.set_xlabel("frequency [Hz]")
    axes[0][1].legend(loc="lower left", fontsize="small")


def draw_density(axes: Axes, frequency: Array, density: Array, unit: str) -> None:
    """Amplitude density over frequency, one line a joint."""
    for j, column in enumerate(density.T):
        axes.loglog(frequency[1:], np.sqrt(np.maximum(column[1:], 1e-300)), color=colour(j), linewidth=0.9, label=f"joint {j + 1}")
    largest = np.sqrt(density[1:].max(initial=1e-300))
    axes.set_ylim(max(np.sqrt(max(density[1:].min(initial=1.0), 1e-300)) * 0.5, 1e-5 * largest), 2.0 * largest)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"difference [{format_unit(unit)}/√Hz]")
    style.log_ticks(axes.xaxis)
    style.log_ticks(axes.yaxis)
    axes.legend(loc="best", ncols=min(3, density.shape[1]))


def draw_banded(axes: Sequence[Axes], t: Array, values: Array, std: Array, unit: str, quantity: str) -> None:
    """A signal over time with a band of two standard deviations, one row a joint; `values` and `std` are envelopes."""
    for j, axis in enumerate(axes):
        x, band = values[:, j], 2.0 * np.nan_to_num(std[:, j])
        low, high = np.minimum(x[::2], x[1::2]) - band[1::2], np.maximum(x[::2], x[1::2]) + band[1::2]
        axis.fill_between(t[::2], low, high, color=style.SKY, alpha=0.5, linewidth=0.0, label="± 2 std")
        axis.plot(t, x, color=style.BLUE, linewidth=0.9)
        axis.set_title(f"joint {j + 1}", pad=3.0)
        axis.margins(x=0.01, y=0.1)
        axis.locator_params(axis="y", nbins=4)
    axes[-1].set_xlabel("time [s]")
    if figure := axes[0].get_figure():
        figure.supylabel(f"{quantity} [{format_unit(unit)}]", fontsize="medium")

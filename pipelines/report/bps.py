"""Figures of an estimate: torque along the experiment (Figs. 9 and 11 of the paper), and how it settles (Fig. 12)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.report import figures, style
from pipelines.report.report import Figure
from pipelines.report.style import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

__all__ = ["convergence_figure", "torque_figure"]

Array = npt.NDArray[np.float64]

_SHOWN = 8  # curves in one axes


def torque_figure(name: str, caption: str, t: Array, measured: Array, model: Array, friction: Array, left: Array,
                  joints: Sequence[str], unit: str = "N m") -> Figure:
    """Measured and modelled torque, the friction in it, and what is left, one row a joint. All (points, joints) [`unit`]."""

    def draw(drawing: Drawing) -> None:
        axes = figures.joint_axes(drawing, measured.shape[1])
        for j, axis in enumerate(axes):
            draw_torques(axis, t, measured[:, j], model[:, j], friction[:, j], left[:, j])
            axis.set_title(printable(joints[j], 60), pad=3.0)
        axes[-1].set_xlabel("time [s]")
        axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderpad=0.0)
        drawing.supylabel(f"torque [{unit}]", fontsize="medium")

    return Figure(name, caption, draw, size=figures.joint_size(measured.shape[1]))


def draw_torques(axis: Axes, t: Array, measured: Array, model: Array, friction: Array, left: Array) -> None:
    figures.draw_measured(axis, *figures.envelope(t, measured, 800))
    figures.draw_modelled(axis, *figures.envelope(t, model, 800), "model")
    for values, label, color in ((friction, "friction", style.GREEN), (left, "left", style.BLACK)):
        axis.plot(*figures.envelope(t, values, 800), color=color, linewidth=0.9, label=label)
    axis.margins(x=0.01, y=0.08)
    axis.locator_params(axis="y", nbins=4)


def convergence_figure(name: str, caption: str, samples: Sequence[int], beta: Array, std: Array, names: Sequence[str]) -> Figure:
    """Each estimate over its last value while samples come in; those that move most are named."""

    def draw(drawing: Drawing) -> None:
        axis = drawing.subplots()
        draw_convergence(axis, np.array(samples, dtype=np.float64), beta, std, names)

    return Figure(name, caption, draw, size=(6.0, 3.8))


def draw_convergence(axis: Axes, samples: Array, beta: Array, std: Array, names: Sequence[str]) -> None:
    """Estimates in units of their final value; only parameters that stand out of their noise have one."""
    last, sigma = beta[-1], std[-1]
    shown = np.flatnonzero(np.isfinite(last) & (np.abs(last) > 5.0 * sigma))
    ratio = beta[:, shown] / last[shown]
    half = ratio[len(ratio) // 2:]
    travel = np.nan_to_num(np.nanmax(half, axis=0, initial=0.0) - np.nanmin(half, axis=0, initial=2.0))
    loud = set(np.argsort(-travel)[:_SHOWN].tolist())
    colors = [style.BLUE, style.ORANGE, style.GREEN, style.VERMILLION, style.SKY, style.PURPLE, style.GREY, style.BLACK]
    for k in range(len(shown)):
        if k not in loud:
            axis.plot(samples, ratio[:, k], color=style.GREY, linewidth=0.6, alpha=0.5)
    for color, k in zip(colors, sorted(loud), strict=False):
        axis.plot(samples, ratio[:, k], color=color, linewidth=1.2, label=printable(names[shown[k]], 40))
    reach = np.clip(1.5 * np.nanmax(np.abs(half - 1.0), initial=0.0), 0.01, 1.0)  # earlier parts may leave the frame
    axis.set_ylim(1.0 - reach, 1.0 + reach)
    axis.axvline(samples[len(samples) // 2], color=style.GREY, linewidth=0.8, linestyle=(0, (4, 3)))
    axis.set_xlabel("equations a joint")
    axis.set_ylabel("estimate / final estimate")
    if len(shown):
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderpad=0.0)

"""Figures of a friction fit: the curve with band and map, torque and its fractions, simulation beside measurement, ripple."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipelines.model.friction.result import Series
from pipelines.model.friction.ripple import Along
from pipelines.report import figures, style
from pipelines.report.report import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

__all__ = ["curve_figure", "fraction_figure", "ripple_figure", "simulation_figure"]

_NEAR = 0.04  # of the fastest speed: the part of the curve where the sign of friction turns


def curve_figure(name: str, caption: str, series: Series, revolute: bool) -> Figure:
    """Friction torque against speed: all of it, and the part about zero."""

    def draw(drawing: Drawing) -> None:
        whole, near = drawing.subplots(1, 2, sharey=True, width_ratios=(3, 2))
        fastest = float(series.speed.max())
        for axis, reach in ((whole, fastest), (near, _NEAR * fastest)):
            draw_curve(axis, series, reach)
        units = ("rad/s", "N m") if revolute else ("m/s", "N")
        whole.set_ylabel(f"friction [{units[1]}]")
        drawing.supxlabel(f"speed [{units[0]}]", fontsize="medium")
        whole.legend(loc="upper left", borderpad=0.2)
        near.set_title("about zero", pad=3.0)

    return Figure(name, caption, draw, size=(6.0, 3.2))


def draw_curve(axis: Axes, series: Series, reach: float) -> None:
    inside = np.abs(series.speed) <= 1.05 * reach
    v, curve, band = series.speed[inside], series.curve[inside], 2.0 * series.band[inside]
    axis.fill_between(v, curve - band, curve + band, color=style.BLUE, alpha=0.25, linewidth=0.0, label="± 2 std")
    axis.plot(v, curve, color=style.BLUE, linewidth=1.2, label="fitted law")
    points = series.map_speed <= 1.05 * reach
    for side in (1.0, -1.0) if len(series.map_speed) else ():
        axis.errorbar(side * series.map_speed[points], side * series.map_odd[points], 2.0 * series.map_std[points], fmt="o",
                      markersize=3.0, color=style.VERMILLION, elinewidth=0.8, label="± v in pairs" if side > 0 else None)
    axis.axhline(0.0, color=style.GREY, linewidth=0.6)
    axis.axvline(0.0, color=style.GREY, linewidth=0.6)
    axis.set_xlim(-1.03 * reach, 1.03 * reach)
    axis.locator_params(axis="x", nbins=5)


def fraction_figure(name: str, caption: str, series: Series, revolute: bool) -> Figure:
    """Torque and its friction, gravity and inertial fractions, Fig. 5."""

    def draw(drawing: Drawing) -> None:
        axes = drawing.subplots(4, 1, sharex=True, sharey=True)
        rows = (("torque", series.torque, style.BLACK), ("friction", series.friction, style.GREEN),
                ("gravity", series.gravity, style.PURPLE), ("inertia", series.inertial, style.BLUE))
        for axis, (label, values, color) in zip(axes, rows, strict=True):
            axis.plot(*figures.envelope(series.t, values, 800), color=color, linewidth=0.9)
            axis.set_title(label, pad=2.0)
            axis.margins(x=0.01, y=0.1)
            axis.locator_params(axis="y", nbins=4)
        axes[-1].set_xlabel("time [s]")
        drawing.supylabel("torque [N m]" if revolute else "force [N]", fontsize="medium")

    return Figure(name, caption, draw, size=(6.0, 5.2))


def simulation_figure(name: str, caption: str, series: Series, revolute: bool) -> Figure:
    """Measured over simulated position and speed, friction left out and taken into account, Fig. 6."""

    def draw(drawing: Drawing) -> None:
        grid = drawing.subplots(2, 2, sharex=True)
        columns = (("friction left out", series.q_without, series.dq_without), ("with friction", series.q_with, series.dq_with))
        units = ("rad", "rad/s") if revolute else ("m", "m/s")
        for k, (title, q, dq) in enumerate(columns):
            for axis, measured, simulated, label in zip(grid[:, k], (series.q, series.dq), (q, dq), ("position", "speed"),
                                                        strict=True):
                figures.draw_measured(axis, *figures.envelope(series.t, measured, 800))
                figures.draw_modelled(axis, *figures.envelope(series.t, simulated, 800), "simulated")
                axis.margins(x=0.01, y=0.08)
                axis.locator_params(axis="y", nbins=5)
                if k == 0:
                    axis.set_ylabel(f"{label} [{units[0 if label == 'position' else 1]}]")
            grid[0, k].set_title(title, pad=3.0)
            grid[1, k].set_xlabel("time [s]")
        grid[0, 1].legend(loc="best", borderpad=0.2)

    return Figure(name, caption, draw, size=(6.0, 4.0))


def ripple_figure(name: str, caption: str, along: Along, revolute: bool) -> Figure:
    """Residual of the law against the angle: forth, back, and the fitted waves."""

    def draw(drawing: Drawing) -> None:
        axis = drawing.subplots()
        for values, color, label in ((along.forth, style.VERMILLION, "forth"), (along.back, style.GREEN, "back")):
            axis.plot(along.angle, values, ".", markersize=3.5, color=color, label=label)
        axis.plot(along.angle, along.waves, color=style.BLUE, linewidth=1.0, label="fitted waves")
        axis.set_xlabel("angle [rad]" if revolute else "position [m]")
        axis.set_ylabel("torque left [N m]" if revolute else "force left [N]")
        axis.margins(x=0.01)
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderpad=0.2)

    return Figure(name, caption, draw, size=(6.0, 3.0))

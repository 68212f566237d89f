"""Figures of the writing task: letters as wanted and executed (Fig. 16), torque and its split (Fig. 14), where it is missed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.model.simulation.course import Course as SimulatedCourse
from pipelines.model.writing.cases import Case
from pipelines.model.writing.design import Designed
from pipelines.model.writing.first_validation import FirstValidation
from pipelines.report import figures, style
from pipelines.report.figures import Array
from pipelines.report.joint_units import each, joined
from pipelines.report.report import Figure
from pipelines.report.simulation_report import draw_compared
from pipelines.report.style import format_unit, printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

__all__ = ["error_map_figure", "executed_figure", "simulated_figures", "split_figure", "task_figures"]

_AXES = ("x", "y", "z")
_SEGMENTS = 600  # of a coloured path
_FAINT = 0.6  # [pt] of a line on the way between strokes
_LEFT = (1, 2, 3, 4)  # Fig. 16 has the first four cases on one side
_PARTS = (("inertia", style.BLUE), ("coriolis", style.PURPLE), ("gravity", style.ORANGE), ("friction", style.GREEN),
          ("left", style.VERMILLION))


def plane(tip: Array) -> tuple[int, int]:
    """The two axes in which a path (points, 3) is widest, the wider names first as x, y, z go."""
    first, second = sorted(np.argsort(-np.ptp(tip, axis=0), kind="stable")[:2].tolist())
    return int(first), int(second)


def split_figure(found: FirstValidation, joints: Sequence[str]) -> Figure | None:
    """Inertial, Coriolis, gravity and friction torque of the model over time, and what is left of the measured one."""
    course = found.course
    if course is None:
        return None

    def draw(drawing: Drawing) -> None:
        axes = figures.joint_axes(drawing, course.model.shape[1])
        for j, axis in enumerate(axes):
            for name, color in _PARTS:
                axis.plot(*figures.envelope(course.t, getattr(course, name)[:, j], 800), color=color, linewidth=0.9,
                          label=name.capitalize() if name == "coriolis" else name)
            axis.set_title(printable(joints[j], 60), pad=3.0)
            axis.margins(x=0.01, y=0.08)
            axis.locator_params(axis="y", nbins=4)
        axes[-1].set_xlabel("time [s]")
        axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, borderpad=0.0)
        drawing.supylabel(f"torque [{joined(found.torque_units)}]", fontsize="medium")

    return Figure(f"split-{found.name}", "Parts of the model's torque, and the residual of the measured one.", draw,
                  figures.joint_size(len(joints)))


def error_map_figure(found: FirstValidation, joints: Sequence[str]) -> Figure | None:
    """The path of the tip, darker where the model leaves more torque, one picture a joint."""
    course = found.course
    if course is None or found.marks == "time":
        return None
    a, b = plane(course.tip)
    every = max(1, -(-len(course.t) // _SEGMENTS))
    missed = course.left if course.missed is None else course.missed  # none: a result of an earlier version
    filtered = "" if course.missed is None or found.low_pass_hz is None else ", after the low-pass as in the text above"

    def draw(drawing: Drawing) -> None:
        from matplotlib.collections import LineCollection

        axes = drawing.subplots(len(joints), 1, sharex=True, squeeze=False)[:, 0]
        points = course.tip[::every, [a, b]]
        lines = np.stack([points[:-1], points[1:]], axis=1)
        down = (np.ones(len(course.tip)) if course.drawn is None else course.drawn)[::every][:len(lines)] > 0.0
        for j, axis in enumerate(axes):
            size = _largest_of(np.nan_to_num(np.abs(missed[:, j])), every)
            top = float(size.max()) or 1.0  # the largest sample that the text names
            drawn = LineCollection(list(lines), cmap="magma_r", linewidths=np.where(down, 2.0, _FAINT).tolist())
            drawn.set_array(size[:len(lines)])
            drawn.set_clim(-0.15 * top, top)  # the lightest colour is no colour on white
            axis.add_collection(drawn)
            axis.set_xlim(points[:, 0].min() - 0.01, points[:, 0].max() + 0.01)
            axis.set_ylim(points[:, 1].min() - 0.01, points[:, 1].max() + 0.01)
            axis.set_aspect("equal")
            axis.set_title(printable(joints[j], 60), pad=3.0)
            axis.locator_params(axis="y", nbins=3)
            axis.set_ylabel(f"{_AXES[b]} [m]")
            bar = drawing.colorbar(drawn, ax=axis, pad=0.02)
            bar.ax.set_ylim(0.0, top)
            bar.set_label(f"|left| [{found.torque_units[j]}]")
        axes[-1].set_xlabel(f"{_AXES[a]} [m]")

    return Figure(f"where-{found.name}",
                  f"Where on its way the tip is when the model misses torque{filtered}{_ways(course.drawn, 'thin')}.", draw,
                  (6.0, 0.7 + 1.35 * len(joints)))


def _ways(drawn: Array | None, how: str) -> str:
    """What a caption says of ways between strokes, where the reference tells them."""
    return "" if drawn is None or drawn.all() else f"; {how} on the way between strokes, where a pen would be up"


def _largest_of(size: Array, every: int) -> Array:
    """The largest of every so many samples: a peak of one sample would not be seen."""
    return np.maximum.reduceat(size, np.arange(0, len(size), every))


def executed_figure(cases: Sequence[Case]) -> Figure | None:
    """The letters as executed in the control cases, cases 1 to 4 above, 5 and 6 below. Fig. 16."""
    shown = [one for one in cases if one.track is not None]
    panels = [part for part in ([c for c in shown if c.case in _LEFT], [c for c in shown if c.case not in _LEFT]) if part]
    if not panels or shown[0].track is None:
        return None
    wanted, drawn = shown[0].track.wanted, shown[0].track.drawn
    a, b = plane(wanted)

    def draw(drawing: Drawing) -> None:
        for axis, part in zip(drawing.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0], panels, strict=True):
            draw_strokes(axis, wanted[:, [a, b]], drawn, style.BLACK, 2.6, "wanted", 0.25)
            for one in part:
                assert one.track is not None
                draw_strokes(axis, one.track.executed[:, [a, b]], one.track.drawn, style.COLOURS[(one.case - 1) % 6], 0.8,
                             f"case {one.case}")
            axis.set_aspect("equal")
            axis.margins(0.03)
            axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, borderpad=0.0)
            axis.set_ylabel(f"{_AXES[b]} [m]")
            axis.set_xlabel(f"{_AXES[a]} [m]")

    width, height = float(np.ptp(wanted[:, a])), float(np.ptp(wanted[:, b]))
    return Figure("executed", f"The letters as executed, on the wanted ones{_ways(drawn, 'dashed')}.{_simulated(shown)}", draw,
                  (6.0, min(len(panels) * (0.9 + 5.2 * height / max(width, 1e-9)), 9.0)))


def _simulated(shown: Sequence[Case]) -> str:
    """Which of the drawn cases no arm has written."""
    which = [str(one.case) for one in shown if one.origin == "simulated"]
    if not which or len(which) == len(shown):
        return " All of them are simulated." if which else ""
    return f" Simulated: case{'s' if len(which) > 1 else ''} {', '.join(which)}; measured: the others."


def draw_strokes(axis: Axes, path: Array, drawn: Array | None, color: str, width: float, label: str, alpha: float = 1.0) -> None:
    """A path (points, 2): strokes as they are written, ways between them dashed and faint; all of it alike where nobody knows."""
    if drawn is not None:
        for first, last in figures.true_spans(np.arange(len(path), dtype=np.float64), drawn <= 0.0):
            part = path[max(0, int(first) - 1):int(last) + 2]  # from stroke to stroke
            axis.plot(part[:, 0], part[:, 1], color=color, linewidth=min(width, _FAINT), alpha=0.5 * alpha, linestyle=(0, (4, 3)))
        path = np.where(drawn[:, None] > 0.0, path, np.nan)
    axis.plot(path[:, 0], path[:, 1], color=color, linewidth=width, alpha=alpha, label=label)


def simulated_figures(name: str, course: SimulatedCourse, unit: str, torque_unit: str) -> list[Figure]:
    """Position, speed and torque, measured and simulated."""
    signals = [("position", course.position, course.position_simulated, unit),
               ("speed", course.speed, course.speed_simulated, each(unit, "/s"))]
    if course.torque is not None and course.torque_simulated is not None:
        signals.append(("torque", course.torque, course.torque_simulated, torque_unit))
    return [_compared(f"simulated-{quantity}-{name}", f"{quantity.capitalize()}, measured and simulated.", course.t, one, two, own,
                      quantity) for quantity, one, two, own in signals]


def _compared(name: str, caption: str, t: Array, measured: Array, simulated: Array, unit: str, quantity: str) -> Figure:
    joints = measured.shape[1]
    return Figure(name, caption, lambda drawing: draw_compared(figures.joint_axes(drawing, joints), t, measured, simulated, unit,
                                                               quantity), figures.joint_size(joints))


def task_figures(task: Designed, joints: Sequence[str]) -> list[Figure]:
    """The path and the speed of the tip (Fig. 2), position, speed and acceleration of the joints (Fig. 3)."""
    a, b = plane(task.tip)
    size = (6.0, min(1.0 + 5.2 * float(np.ptp(task.tip[:, b])) / max(float(np.ptp(task.tip[:, a])), 1e-9), 6.0))
    found = [Figure("path", "The path of the tip; grey on the way between strokes.",
                    lambda drawing: draw_path(drawing.subplots(), task, a, b), size),
             Figure("tip-speed", "The speed of the tip: fast within a stroke, at rest in corners.",
                    lambda drawing: draw_speed(drawing.subplots(), task), (6.0, 2.2))]
    for name, values, power in (("position", task.q, ""), ("speed", task.dq, "/s"), ("acceleration", task.ddq, "/s^2")):
        found.append(_signal(f"joint-{name}", f"{name.capitalize()} of the joints.", task.t, values,
                             each(joined(task.units), power), name,
                             joints))
    return found


def _signal(name: str, caption: str, t: Array, values: Array, unit: str, quantity: str, joints: Sequence[str]) -> Figure:
    return Figure(name, caption, lambda drawing: figures.draw_joint_signals(
        figures.joint_axes(drawing, len(joints)), t, values, unit, quantity=quantity, names=joints),
        figures.joint_size(len(joints)))


def draw_path(axes: Axes, task: Designed, a: int, b: int) -> None:
    writing = task.drawn > 0.0
    axes.plot(task.tip[:, a], task.tip[:, b], color=style.GREY, linewidth=0.7, alpha=0.6)
    axes.plot(np.where(writing, task.tip[:, a], np.nan), np.where(writing, task.tip[:, b], np.nan), color=style.BLUE, linewidth=1.6)
    axes.set_aspect("equal")
    axes.margins(0.03)
    axes.set_xlabel(f"{_AXES[a]} [m]")
    axes.set_ylabel(f"{_AXES[b]} [m]")


def draw_speed(axes: Axes, task: Designed) -> None:
    axes.plot(*figures.envelope(task.t, task.tip_speed), color=style.BLUE)
    axes.margins(x=0.01, y=0.08)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"speed of the tip [{format_unit('m/s')}]")

"""Figures of the writing task: letters (Fig. 16), parts of the torque (Fig. 14), errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.report import style
from pipelines.report.figures import (
    Array,
    Look,
    compared_figure,
    envelope,
    joint_axes,
    joint_signal_figure,
    legend_above,
    one_figure,
    rows_figure,
)
from pipelines.report.report import Figure
from pipelines.report.sentences import sentence
from pipelines.report.style import format_unit
from pipelines.report.words import each, joined
from pipelines.simulation.course import Course as SimulatedCourse
from pipelines.writing.control_cases import Case
from pipelines.writing.task import Designed
from pipelines.writing.validation import Course, TorqueValidation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_AXES = ("x", "y", "z")
_SEGMENTS = 600  # numerics: of a coloured path
_WIDTH = 5.2  # numerics: [inch] of a path in a figure
_LEFT = (1, 2, 3, 4)  # numerics: Fig. 16 has the first four cases on one side
_PARTS = {
    "inertia": style.BLUE,
    "coriolis": style.PURPLE,
    "gravity": style.ORANGE,
    "friction": style.GREEN,
    "residual": style.VERMILLION,
}


def part_name(part: str) -> str:
    """Of the model's torque: "Coriolis" and "gravity"."""
    return part.capitalize() if part == "coriolis" else part


def plane(tip: Array) -> tuple[int, int]:
    """The two axes in which a path (points, 3) is widest, as x, y, z go."""
    first, second = sorted(np.argsort(-np.ptp(tip, axis=0), kind="stable")[:2].tolist())
    return int(first), int(second)


def split_figure(found: TorqueValidation, course: Course, joints: Sequence[str]) -> Figure:
    """Inertial, Coriolis, gravity and friction torque of the model, and the residual."""

    def draw_row(axis: Axes, j: int) -> None:
        for name, color in _PARTS.items():
            t, part = envelope(course.t, getattr(course, name)[:, j], 800)
            axis.plot(t, part, color=color, linewidth=0.9, label=part_name(name))

    return rows_figure(
        f"split-{found.name}",
        "Parts of the model's torque, and the residual of the measured one.",
        joints,
        draw_row,
        f"torque [{joined(found.torque_units)}]",
        legend=len(_PARTS),
    )


def executed_figure(cases: Sequence[Case]) -> Figure | None:
    """The letters as executed in the control cases, 1 to 4 above, 5 and 6 below. Fig. 16."""
    shown = [(one, one.track) for one in cases if one.track is not None]
    both = [[s for s in shown if (s[0].case in _LEFT) is left] for left in (True, False)]
    panels = [part for part in both if part]
    if not panels:
        return None
    wanted = shown[0][1].wanted
    a, b = plane(wanted)

    def draw(drawing: Drawing) -> None:
        for axis, part in zip(joint_axes(drawing, len(panels)), panels, strict=True):
            look: Look = {"color": style.BLACK, "alpha": 0.25, "label": "wanted"}
            axis.plot(*wanted[:, [a, b]].T, linewidth=2.6, **look)
            for one, track in part:
                color, path = style.COLOURS[(one.case - 1) % 6], track.executed[:, [a, b]]
                axis.plot(*path.T, color=color, linewidth=0.8, label=f"case {one.case}")
            legend_above(axis, 5)
            _finish_path(axis, a, b)

    width, height = float(np.ptp(wanted[:, a])), float(np.ptp(wanted[:, b]))
    simulated = [str(one.case) for one, _ in shown if one.origin == "simulated"]
    every = bool(simulated) and len(simulated) == len(shown)
    caption = sentence("writing", "executed", simulated, every)
    high = len(panels) * (0.9 + _WIDTH * height / max(width, 1e-9))
    return Figure("executed", caption, draw, (6.0, min(high, 9.0)))


def _finish_path(axes: Axes, a: int, b: int) -> None:
    axes.set_aspect("equal")
    axes.margins(0.03)
    axes.set_xlabel(f"{_AXES[a]} [m]")
    axes.set_ylabel(f"{_AXES[b]} [m]")


def simulated_figures(
    name: str, course: SimulatedCourse, unit: str, torque_unit: str
) -> list[Figure]:
    """Position, speed and torque, measured and simulated."""
    signals = [
        ("position", course.position, course.position_simulated, unit),
        ("speed", course.speed, course.speed_simulated, each(unit, "/s")),
    ]
    if course.torque is not None and course.torque_simulated is not None:
        signals.append(("torque", course.torque, course.torque_simulated, torque_unit))
    return [
        compared_figure(
            f"simulated-{quantity}-{name}",
            f"{quantity.capitalize()}, measured and simulated.",
            course.t,
            measured,
            simulated,
            f"{quantity} [{own}]",
        )
        for quantity, measured, simulated, own in signals
    ]


def task_figures(task: Designed, joints: Sequence[str]) -> list[Figure]:
    """The path and the speed of the tip (Fig. 2), the motion of the joints (Fig. 3)."""
    a, b = plane(task.tip)
    ratio = float(np.ptp(task.tip[:, b])) / max(float(np.ptp(task.tip[:, a])), 1e-9)
    path = "The path of the tip; grey on the way between strokes."
    speed = "The speed of the tip: fast within a stroke, at rest in corners."
    height = min(1.0 + _WIDTH * ratio, 6.0)
    found = [
        one_figure("path", path, lambda axes: draw_path(axes, task, a, b), height),
        one_figure("tip-speed", speed, lambda axes: draw_speed(axes, task), 2.2),
    ]
    motions = (
        ("position", task.q, ""),
        ("speed", task.dq, "/s"),
        ("acceleration", task.ddq, "/s^2"),
    )
    for name, values, power in motions:
        caption, unit = f"{name.capitalize()} of the joints.", each(joined(task.units), power)
        look: Look = {"quantity": name, "names": joints}
        figure = joint_signal_figure(f"joint-{name}", caption, task.t, values, unit, **look)
        found.append(figure)
    return found


def draw_path(axes: Axes, task: Designed, a: int, b: int) -> None:
    path = task.tip[:, [a, b]]
    strokes = np.where((task.drawn > 0.0)[:, None], path, np.nan)
    axes.plot(*path.T, color=style.GREY, linewidth=0.7, alpha=0.6)
    axes.plot(*strokes.T, color=style.BLUE, linewidth=1.6)
    _finish_path(axes, a, b)


def draw_speed(axes: Axes, task: Designed) -> None:
    axes.plot(*envelope(task.t, task.tip_speed), color=style.BLUE)
    axes.margins(x=0.01, y=0.08)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"speed of the tip [{format_unit('m/s')}]")

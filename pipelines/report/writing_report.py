"""The report on the writing task: whether the model holds on logs it was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pipelines.report import style
from pipelines.report.document import document
from pipelines.report.figures import (
    Array,
    Look,
    joint_signal_figure,
    legend,
    one_figure,
    signals_figure,
)
from pipelines.report.report import Figure, Report, Tone
from pipelines.report.sections import NO_COLLISION_CHECK
from pipelines.report.style import format_number, with_std
from pipelines.report.words import joined
from pipelines.writing.control_cases import Case
from pipelines.writing.task import Designed
from pipelines.writing.validation import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_AXES = ("x", "y", "z")
_WIDTH = 5.2  # numerics: [inch] of a path in a figure
_LEFT = (1, 2, 3, 4)  # numerics: Fig. 16 has the first four cases on one side


def writing_report(result: Result) -> Report:
    """The torque, Table IV, the simulation; or the task that was designed."""
    if (task := result.design) is not None:
        tone: Tone = "good" if task.torque_checked else "attention"
        figures, warning = _task_figures(task, result.joints), NO_COLLISION_CHECK
        return document(
            "task", tone, task=task, joints=result.joints, figures=figures, warning=warning
        )
    gates = [result.gates.torque]
    writing = [log for log in result.logs if log.experiment == "writing"]
    if writing:  # the cases are of writing
        gates.append(result.gates.cases)
    units = next(iter(writing or result.logs), None)
    return document(
        "writing",
        "bad" if False in gates else "good" if all(gates) else "attention",
        result=result,
        logs=len(writing) or len(result.logs),
        cases={one.case: one for one in result.cases},
        unit=joined(units.torque_units) if units else "N m",
        millimetres=lambda case: ", ".join(map(_mm, case.tip_error_std.values)),
        spread=_spread,
        gain=_gain,
        torque_figures=_torque_figures(result),
        cases_figures=_executed(result.cases),
        simulated_figures=_simulated(result),
    )


def _mm(x: float) -> str:
    return f"{1e3 * x:.2f}" if x >= 1e-4 else format_number(1e3 * x, 2)


def _spread(one: Case) -> list[str]:
    """Tip error of each axis with its spread. [mm]"""
    spread = one.tip_error_std_spread
    stds = (None,) * 3 if spread is None else spread.values
    pairs = zip(one.tip_error_std.values, stds, strict=True)
    return [
        format_number(1e3 * x, 3) if std is None else with_std(1e3 * x, 1e3 * std)
        for x, std in pairs
    ]


def _gain(first: Case | None, one: Case) -> str:
    """Tip error of the first case over that of another, axis by axis."""
    if first is None or one is first:
        return ""
    pairs = zip(first.tip_error_std.values, one.tip_error_std.values, strict=True)
    return ", ".join(format_number(a / b, 2) if b > 0.0 else "∞" for a, b in pairs)


def _torque_figures(result: Result) -> list[Figure]:
    """Of the first log that has curves."""
    for log in result.logs:
        if (c := log.course) is not None:
            caption = (
                f"{log.name}: torque measured and of the model, its friction, and the residual."
            )
            signals = {"measured": c.measured, "model": c.model, "friction": c.friction}
            signals["residual"] = c.residual
            name, quantity = f"torque-{log.name}", f"torque [{joined(log.torque_units)}]"
            return [signals_figure(name, caption, c.t, signals, quantity, result.joints)]
    return []


def _simulated(result: Result) -> list[Figure]:
    found = result.simulation
    if found is None or found.course is None:
        return []
    c, caption = found.course, f"{found.name}: position, measured and simulated."
    signals = {"measured": c.position, "simulated": c.position_simulated}
    quantity = f"position [{joined(found.units)}]"
    return [
        signals_figure(f"simulated-{found.name}", caption, c.t, signals, quantity, result.joints)
    ]


def _plane(tip: Array) -> list[int]:
    """The two axes in which a path (points, 3) is widest, as x, y, z go."""
    return sorted(np.argsort(-np.ptp(tip, axis=0), kind="stable")[:2].tolist())


def _executed(cases: Sequence[Case]) -> list[Figure]:
    """The letters as executed in the control cases, 1 to 4 above, 5 and 6 below. Fig. 16."""
    shown = [(one, one.track) for one in cases if one.track is not None]
    both = [[s for s in shown if (s[0].case in _LEFT) is left] for left in (True, False)]
    panels = [part for part in both if part]
    if not panels:
        return []
    wanted = shown[0][1].wanted
    axes = _plane(wanted)

    def draw(drawing: Drawing) -> None:
        rows = drawing.subplots(len(panels), 1, squeeze=False)[:, 0]
        for axis, part in zip(rows, panels, strict=True):
            look: Look = {"color": style.BLACK, "alpha": 0.25, "label": "wanted"}
            axis.plot(*wanted[:, axes].T, linewidth=2.6, **look)
            for one, track in part:
                color, path = style.COLOURS[(one.case - 1) % 6], track.executed[:, axes]
                axis.plot(*path.T, color=color, linewidth=0.8, label=f"case {one.case}")
            _finish_path(axis, axes)
            axis.legend(loc="best", ncols=3)

    width, height = np.ptp(wanted[:, axes], axis=0)
    high = len(panels) * (0.9 + _WIDTH * height / max(width, 1e-9))
    simulated = [str(one.case) for one, _ in shown if one.origin == "simulated"]
    caption = "The path of the tip as executed, on the wanted one."
    caption += f" Simulated: case {', '.join(simulated)}." if simulated else ""
    return [Figure("executed", caption, draw, (6.0, float(min(high, 9.0))))]


def _finish_path(axis: Axes, axes: Sequence[int]) -> None:
    axis.set_aspect("equal")
    axis.margins(0.03)
    axis.set_xlabel(f"{_AXES[axes[0]]} [m]")
    axis.set_ylabel(f"{_AXES[axes[1]]} [m]")


def _task_figures(task: Designed, joints: Sequence[str]) -> list[Figure]:
    """The path and the speed of the tip (Fig. 2), the motion of the joints (Fig. 3)."""
    width, height = np.ptp(task.tip[:, _plane(task.tip)], axis=0)
    path = "The path of the tip; grey on the way between strokes."
    speed = "The speed of the tip: fast within a stroke, at rest in corners."
    size = min(1.0 + _WIDTH * float(height) / max(float(width), 1e-9), 6.0)
    unit = joined(task.units)
    tip = task.tip_speed.reshape(-1, 1)
    return [
        one_figure("path", path, partial(_draw_path, task=task), size),
        joint_signal_figure("tip-speed", speed, task.t, tip, "speed [m/s]", names=["tip"]),
        joint_signal_figure("joint-position", "Position of the joints.", task.t, task.q,
                            f"position [{unit}]", names=joints),
        joint_signal_figure("joint-speed", "Speed of the joints.", task.t, task.dq,
                            f"speed [{unit}/s]", names=joints),
    ]  # fmt: skip


def _draw_path(axis: Axes, task: Designed) -> None:
    axes = _plane(task.tip)
    path = task.tip[:, axes]
    strokes = np.where((task.drawn > 0.0)[:, None], path, np.nan)
    axis.plot(*path.T, color=style.GREY, linewidth=0.7, alpha=0.6, label="way between strokes")
    axis.plot(*strokes.T, color=style.BLUE, linewidth=1.6, label="strokes")
    _finish_path(axis, axes)
    legend(axis)

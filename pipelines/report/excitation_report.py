"""The report on a designed experiment: what it will show, how near it comes to its limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.excitation.discrimination import Apart
from pipelines.excitation.result import DrawnPlan, Result
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.document import document
from pipelines.report.figures import DASHED, Array, envelope, joint_signal_figure, rows_figure
from pipelines.report.report import Figure, Report, Tone
from pipelines.report.sections import NO_COLLISION_CHECK
from pipelines.report.words import unit_of, without_keys

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DRAWN_PLANS = 6  # numerics: how it is drawn
_SHOWN = 5e-5  # numerics: of the size of a motion: a smaller change is not shown


def excitation_report(result: Result) -> Report:
    """The motion, its limits, what it shows; of other experiments their plans."""
    if result.purpose != "excitation":
        moving = [plan for plan in result.plans if plan.speed_peak > 0.0][:_DRAWN_PLANS]
        figures = [_plan_figure(plan, result) for plan in moving]
        return document("plans", result=result, figures=figures, warning=NO_COLLISION_CHECK)
    apart, rivals = result.apart, _are_rivals(result.apart)
    open_ = not result.reached or result.interrupted or not result.torque_checked
    tone: Tone = "attention" if open_ or rivals else "good"
    less = 1.0 - result.shrunk
    return document(
        "excitation",
        tone,
        result=result,
        warning=NO_COLLISION_CHECK,
        smaller=less if less >= _SHOWN else 0.0,
        much=REPORT.much,
        apart=apart,
        causes=() if apart is None else tuple(map(without_keys, apart.causes)),
        rivals=rivals,
        alike=REPORT.alike,
        near=REPORT.near_bound,
        figures=_figures(result),
    )


def _are_rivals(found: Apart | None) -> bool:
    """Return whether a diagnosis of the log would call the two causes alternatives."""
    return found is not None and found.after.similarity > REPORT.alike


def _figures(result: Result) -> list[Figure]:
    """Positions, speeds, accelerations and torques with the limits they come near to."""
    c = result.course
    if c is None:
        return []
    kinds = {"position": c.q, "speed": c.dq, "acceleration": c.ddq}
    kinds |= {} if c.tau is None else {"torque": c.tau}
    return [_limited_figure(name, c.t, values, result) for name, values in kinds.items()]


def _limited_figure(quantity: str, t: Array, values: Array, result: Result) -> Figure:
    """A signal over one period, one row a joint, with the limits it comes near to."""
    ends: dict[int, set[float]] = {}
    for one in result.limits:
        if one.quantity == quantity and one.joint is not None and math.isfinite(one.limit):
            own = {one.limit} if quantity == "position" else {one.limit, -one.limit}
            ends.setdefault(one.joint - 1, set()).update(own)

    def draw_row(axis: Axes, j: int) -> None:
        axis.plot(*envelope(t, values[:, j]), color=style.BLUE, linewidth=1.0)
        for end in ends.get(j, ()):
            if np.abs(values[:, j]).max() > REPORT.drawn_limit * abs(end):
                axis.axhline(end, color=style.VERMILLION, linewidth=0.9, linestyle=DASHED)

    caption = f"The {quantity} of each joint over one period; dashed, limits that are near."
    label = f"{quantity} [{unit_of(result.limits, quantity)}]"
    return rows_figure(f"{quantity}s", caption, result.joints, draw_row, label)


def _plan_figure(plan: DrawnPlan, result: Result) -> Figure:
    own = np.ptp(plan.q, axis=0) > 0.0
    names: Sequence[str] = [n for n, moves in zip(result.joints, own, strict=True) if moves]
    label, caption = (
        f"position [{unit_of(result.limits, 'position')}]",
        f"{plan.name}: {plan.words}.",
    )
    return joint_signal_figure(plan.name, caption, plan.t, plan.q[:, own], label, names=names)

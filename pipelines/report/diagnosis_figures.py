"""Figures of a diagnosis: the proof of a finding, and the residual over what it may depend on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pipelines.diagnosis.result import Answer, Finding
from pipelines.estimation.residual_analysis import Curve, Evidence, Proof
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.figures import (
    DASHED,
    Look,
    broken_at_gaps,
    joint_colour,
    legend,
    one_figure,
    signals_figure,
)
from pipelines.report.frf_figures import posture_words
from pipelines.report.report import Figure
from pipelines.report.style import format_number, format_unit
from pipelines.report.words import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_ROOM = (0.5, 2.0)  # numerics: below and above what the modes reach
_COLUMNS = 3  # numerics: small figures side by side, of one joint
_SHADE: Look = {"color": style.SKY, "alpha": 0.35, "linewidth": 0.0}


def finding_figures(number: int, one: Finding, units: Units) -> list[Figure]:
    """The proof of a finding, and the frequency responses that name it."""
    figures = []
    if one.answers:
        value = one.parameters.get("frequency")
        known = value.value if value is not None and isinstance(value.value, float) else math.nan
        caption = (
            f"Joint {one.answers[0].joint}, acceleration per input in each posture: measured "
            "points, and the modes that were found over them. A rigid body is flat."
        )
        draw = partial(draw_responses, answers=one.answers, frequency=known)
        figures.append(one_figure(f"proof-{number}-response", caption, draw, 3.4))
    if one.proof is not None:
        p, torque = one.proof, units.at(one.proof.joint).torque
        # squared amplitudes add up to the mean square of the residual, squared means are averaged
        over = np.nansum if p.against == "frequency" else np.nanmean
        before, after = (
            format_number(float(np.sqrt(over(np.square(x)))), 2) for x in (p.before, p.after)
        )
        against = f"the time of {one.log}" if one.log else p.against
        caption = (
            f"Joint {p.joint}: residual torque over {against}, {before} {torque} rms without the "
            f"finding, {after} {torque} with it."
        )
        draw_it = partial(draw_proof, proof=p, torque=torque)
        figures.append(one_figure(f"proof-{number}", caption, draw_it))
    return figures


def draw_proof(axes: Axes, proof: Proof, torque: str = "N m") -> None:
    """Means in bins with their standard errors, or amplitudes over frequency."""
    band = 2.0 * proof.spread
    axes.fill_between(proof.x, proof.before - band, proof.before + band, **_SHADE)
    axes.plot(proof.x, proof.before, color=style.BLUE, linewidth=1.6, label="without the finding")
    look: Look = {"color": style.ORANGE, "linestyle": DASHED, "linewidth": 1.3}
    axes.plot(proof.x, proof.predicted, label="what the finding predicts", **look)
    axes.plot(proof.x, proof.after, color=style.VERMILLION, linewidth=1.0, label="with it")
    axes.set_xlabel(f"{proof.against} [{format_unit(proof.unit)}]")
    axes.set_ylabel(f"residual torque [{torque}]")
    axes.margins(x=0.01, y=0.1)
    legend(axes)


def draw_responses(axes: Axes, answers: Sequence[Answer], frequency: float) -> None:
    """Points that are coherent, and a line for each posture; the named frequency."""
    for k, one in enumerate(answers):
        color, good = joint_colour(k), one.coherence >= REPORT.coherent
        look: Look = {"markersize": 2.0, "color": color, "alpha": 0.5}
        axes.loglog(one.frequency[good], one.measured[good], ".", **look)
        label = posture_words(one.posture, one.joint)
        axes.loglog(one.frequency, one.fitted, color=color, label=label)
    if math.isfinite(frequency):
        axes.axvline(frequency, color=style.VERMILLION, linewidth=0.8, zorder=0.5)
    levels = np.concatenate([one.fitted for one in answers])
    levels = levels[np.isfinite(levels) & (levels > 0.0)]
    if len(levels):
        axes.set_ylim(_ROOM[0] * float(levels.min()), _ROOM[1] * float(levels.max()))
    axes.set_xlabel("frequency [Hz]")
    unit = "" if answers[0].unit == "1" else f" [{format_unit(answers[0].unit)}]"
    axes.set_ylabel(f"acceleration per input{unit}")
    legend(axes)
    for axis in (axes.xaxis, axes.yaxis):
        style.log_ticks(axis)


def evidence_figures(one: Evidence, number: int, units: Units) -> list[Figure]:
    """Torque and residual over time, simulated position, curves over signals."""
    torque, suffix = units.torque, f"-{number + 1}" if number else ""
    series = np.concatenate([one.measured, one.predicted, one.residual], axis=1)
    t, series = broken_at_gaps(one.t, series)
    names = ("measured", "predicted", "residual")
    signals = dict(zip(names, np.split(series, 3, axis=1), strict=True))
    caption = f"{one.log}: torque measured and predicted by the nominal model, and the residual."
    quantity = f"torque [{torque}]"
    figures = [signals_figure(f"residual{suffix}", caption, t, signals, quantity)]
    if one.simulated_t is not None and one.simulated_position_error is not None:
        errors = {"nominal model": 1e3 * one.simulated_position_error}
        if one.extended_position_error is not None:
            errors["with the findings"] = 1e3 * one.extended_position_error
        caption = (
            "Simulated minus measured position, in closed loop with controller and references of "
            f"{one.simulated_log}, over its first {one.simulated_t[-1]:.0f} s."
        )
        name, quantity = f"position-error{suffix}", f"simulated − measured [{units.thousandths}]"
        figures.append(signals_figure(name, caption, one.simulated_t, errors, quantity))
    if one.curves:
        figures.append(_curves_figure(f"residual-over{suffix}", one))
    return figures


def _curves_figure(name: str, one: Evidence) -> Figure:
    """The residual over the signals it follows most, mean in bins and its spread."""
    joints = sorted({curve.joint for curve in one.curves})

    def draw(drawing: Drawing) -> None:
        grid = drawing.subplots(len(joints), _COLUMNS, sharey="row", squeeze=False)
        for axes, joint in zip(grid, joints, strict=True):
            own = sorted((c for c in one.curves if c.joint == joint), key=lambda c: -c.explained)
            for axis, curve in zip(axes, own, strict=False):
                _draw_curve(axis, curve)
            for axis in axes[len(own) :]:
                axis.set_visible(False)
            axes[0].set_ylabel(f"residual of joint {joint}", fontsize="small")

    caption = (
        f"{one.log}: residual torque over the signals that it follows most, the strongest first: "
        "mean in bins, its spread shaded."
    )
    return Figure(name, caption, draw, (6.0, 0.3 + 1.6 * len(joints)))


def _draw_curve(axis: Axes, one: Curve) -> None:
    axis.fill_between(one.x, one.mean - one.spread, one.mean + one.spread, **_SHADE)
    axis.plot(one.x, one.mean, color=style.BLUE, linewidth=1.2)
    axis.set_xlabel(f"{one.against} [{format_unit(one.unit)}]", fontsize="small")
    axis.locator_params(nbins=4)

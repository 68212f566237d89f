"""The responses that name a cause: what was measured in each posture, the modes over it, and the frequency that is told."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from pipelines.diagnosis.result import Answer, Finding
from pipelines.report import style
from pipelines.report.frf_figures import posture_words
from pipelines.report.report import Figure
from pipelines.report.style import format_number, format_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["answer_figures", "draw_answers"]

_COHERENT = 0.5  # measured points that are drawn
_ROOM = (0.5, 2.0)  # below and above what the modes reach


def answer_figures(number: int, one: Finding) -> Iterator[Figure]:
    """One figure with all postures, where responses name the finding."""
    if not one.answers:
        return
    told = one.parameters.get("frequency")
    frequency = told.value if told is not None and isinstance(told.value, float) else math.nan
    said = f"; vertical line: {format_number(frequency, 3)} Hz, that of the verdict" if math.isfinite(frequency) else ""
    joint = one.answers[0].joint
    yield Figure(f"proof-{number}-response", f"How joint {joint} answers in each posture, acceleration per input: measured points, "
                 f"and the modes that were found over them{said}. A rigid body is flat.",
                 lambda drawing: draw_answers(drawing.subplots(), one.answers, frequency), (6.0, 3.4))


def draw_answers(axes: Axes, answers: tuple[Answer, ...], frequency: float) -> None:
    """Points that are coherent, and a line for each posture; the named frequency."""
    for k, one in enumerate(answers):
        color, good = style.COLOURS[k % len(style.COLOURS)], one.coherence >= _COHERENT
        axes.loglog(one.frequency[good], one.measured[good], ".", markersize=2.0, color=color, alpha=0.5)
        axes.loglog(one.frequency, one.fitted, color=color, label=posture_words(one.posture, one.joint))
    if math.isfinite(frequency):
        axes.axvline(frequency, color=style.VERMILLION, linewidth=0.8, zorder=0.5)
    levels = np.concatenate([one.fitted for one in answers])
    levels = levels[np.isfinite(levels) & (levels > 0.0)]
    if len(levels):
        axes.set_ylim(_ROOM[0] * float(levels.min()), _ROOM[1] * float(levels.max()))
    axes.set_xlabel("frequency [Hz]")
    unit = answers[0].unit
    axes.set_ylabel("acceleration per input" if unit == "1" else f"acceleration per input [{format_unit(unit)}]")
    axes.legend(loc="best", fontsize="small")
    for axis in (axes.xaxis, axes.yaxis):
        style.log_ticks(axis)

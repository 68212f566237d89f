"""Parts of a report that several stages show: checks of a log, its signals, its sampling, what happened when."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.errors import Check, Level
from pipelines.log.codes import title_of
from pipelines.report import figures
from pipelines.report.report import Figure, Table, Tone

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

__all__ = ["checks_table", "interval_figure", "joint_signal_figure", "level_tone", "timeline_figure"]

Array = npt.NDArray[np.float64]

_TONES: dict[Level, Tone] = {"ok": "good", "warn": "attention", "repair": "attention", "reject": "bad"}
_RESULTS: dict[Level, str] = {"ok": "passed", "warn": "look at it", "repair": "mended", "reject": "not usable"}
_ORDER: tuple[Level, ...] = ("reject", "repair", "warn", "ok")


def level_tone(levels: Iterable[Level]) -> Tone:
    """The tone of the worst of several checks."""
    worst: Level = min(levels, key=_ORDER.index, default="ok")
    return _TONES[worst]


def checks_table(checks: Iterable[Check], *, as_given: bool = False) -> Table:
    """What was checked and found, the worst first, or `as_given`."""
    ordered = list(checks) if as_given else sorted(checks, key=lambda check: _ORDER.index(check.level))
    return Table(columns=("result", "finding", "where", "what to do", "code"),
                 rows=tuple((_RESULTS[check.level], check.message, check.where, check.remedy,
                             f"{check.code} {title_of(check.code)}".strip())
                            for check in ordered),
                 tones=tuple(_TONES[check.level] for check in ordered))


def joint_signal_figure(name: str, caption: str, t: Array, values: Array, unit: str, *, quantity: str = "",
                        names: Sequence[str] = (), flagged: npt.NDArray[np.bool_] | None = None,
                        flag_name: str = "flagged") -> Figure:
    """A signal over time, one row a joint; see `figures.draw_joint_signals`."""
    joints = values.shape[1] if values.ndim > 1 else 1

    def draw(drawing: Drawing) -> None:
        figures.draw_joint_signals(figures.joint_axes(drawing, joints), t, values, unit, quantity=quantity, names=names,
                                   flagged=flagged, flag_name=flag_name)

    return Figure(name, caption, draw, size=figures.joint_size(joints))


def interval_figure(name: str, caption: str, t: Array, sample_time: float) -> Figure:
    """How evenly the log was sampled."""
    return Figure(name, caption, lambda drawing: figures.draw_intervals(drawing.subplots(), t, sample_time),
                  size=(6.0, 2.6))


def timeline_figure(name: str, caption: str, extent: tuple[float, float],
                    rows: Sequence[tuple[str, Sequence[tuple[float, float]]]]) -> Figure:
    """When gaps, repairs and limits fell, one row a kind."""
    return Figure(name, caption, lambda drawing: figures.draw_timeline(drawing.subplots(), extent, rows),
                  size=(6.0, 0.6 + 0.32 * max(1, len(rows))))

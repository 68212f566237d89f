"""The report on reconstructed motion: how near it is to the encoders, how well it is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.estimation.config import MotionConfig
from pipelines.estimation.motion_result import LogResult, Series
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.document import document
from pipelines.report.figures import Array, joint_names, joint_signal_figure, rows_figure
from pipelines.report.report import Cell, Figure, Report, Table, Tone, columns_table
from pipelines.report.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def motion_report(logs: Sequence[LogResult]) -> Report:
    """Verdict, key figures, one section a log."""
    far, doubtful = [log for log in logs if log.straying], [log for log in logs if log.coloured]
    units = list(dict.fromkeys(unit for log in logs for unit in log.units))
    known = [(unit, s, _worst(logs, unit, "acceleration_std"))
             for unit in units if (s := _worst(logs, unit, "speed_std")) is not None]  # fmt: skip
    tone: Tone = "attention" if far or doubtful else "good" if known else "neutral"
    return document(
        "motion",
        tone,
        logs=logs,
        known=known,
        doubtful=doubtful,
        far=far,
        strays=_strays(far),
        rules=MotionConfig(),
        words=sorted(
            {word.split(":")[0].split(",")[0] for log in logs for word in log.innovation_verdict}
        ),
        units=units,
        largest=_largest,
        observer=_observer,
        figures=_figures,
    )


def _worst(logs: Sequence[LogResult], unit: str, name: str) -> float | None:
    """The largest of a quantity of all joints with positions in `unit`; None where unknown."""
    values = [
        getattr(log, name)[j] for log in logs for j, own in enumerate(log.units) if own == unit
    ]
    return None if np.isnan(values).all() else float(np.nanmax(values))


def _largest(log: LogResult, unit: str) -> list[float | None]:
    """The key figures of the worst of the joints that share a unit."""
    names = ("reconstruction_error_max", "peak_speed", "speed_std", "peak_acceleration")
    return [_worst((log,), unit, name) for name in (*names, "acceleration_std")]


def _strays(far: Sequence[LogResult]) -> dict[str, object] | None:
    """The joint that strays farthest from what its encoder measured."""
    places = [
        (float(log.reconstruction_error_max[j - 1]), log.name, j, log)
        for log in far
        for j in log.straying
    ]
    if not places:
        return None
    error, name, joint, log = max(places, key=lambda place: place[0])
    noise = float(log.observer.measurement_std[joint - 1])
    limit = float(log.alarm[joint - 1])
    chance = error < REPORT.chance * noise
    context = {"joint": joint, "name": name, "error": error, "limit": limit, "noise": noise}
    return context | {"chance": chance, "published": limit == MotionConfig().alarm}


def _observer(log: LogResult) -> Table:
    """The observer and the motion it leads to, joint by joint."""
    o, unit = log.observer, joined(log.units)
    columns: dict[str, Sequence[Cell]] = {"joint": range(1, len(log.units) + 1)}
    for i, power in enumerate(("", "/s", "/s^2", "/s^3")[: o.order]):
        columns[f"k{i + 1} [1{power}]"] = o.gains[:, i].tolist()
    columns |= {
        "bandwidth [Hz]": o.bandwidth_hz.tolist(),
        f"encoder noise [{unit}]": o.measurement_std.tolist(),
        f"jerk σ [{unit}/s^{o.order}]": o.jerk_std.tolist(),
        "correlation": log.innovation_correlation.tolist(),
        f"error, largest [{unit}]": log.reconstruction_error_max.tolist(),
        f"std q [{unit}]": log.position_std.tolist(),
        f"std dq [{unit}/s]": log.speed_std.tolist(),
        f"std ddq [{unit}/s^2]": log.acceleration_std.tolist(),
    }
    if log.noise_floor is not None:
        columns[f"noise floor, position [{unit}]"] = log.noise_floor.position.tolist()
        columns["noise floor, torque [N m]"] = log.noise_floor.torque.tolist()
    return columns_table(columns)


def _figures(log: LogResult, s: Series) -> list[Figure]:
    """The error of the position; acceleration with a band of two standard deviations."""
    name, unit, joints = log.name, joined(log.units), joint_names(len(log.units))
    error = f"{name}: measured minus reconstructed position. It should look like the steps of the "
    error += "encoder, without a trace of the motion."
    acceleration = f"{name}: reconstructed acceleration; its band is two standard deviations."
    std = 2.0 * np.nan_to_num(s.acceleration_std)

    def draw_row(axis: Axes, j: int) -> None:
        draw_banded(axis, s.t, s.acceleration[:, j], std[:, j])

    return [
        joint_signal_figure(f"error-{name}", error, s.t, s.error, f"difference [{unit}]"),
        rows_figure(
            f"acceleration-{name}", acceleration, joints, draw_row, f"acceleration [{unit}/s^2]"
        ),
    ]


def draw_banded(axis: Axes, t: Array, x: Array, band: Array) -> None:
    """A signal over time with a band; `x` and `band` are envelopes."""
    low, high = np.minimum(x[::2], x[1::2]) - band[1::2], np.maximum(x[::2], x[1::2]) + band[1::2]
    axis.fill_between(t[::2], low, high, color=style.SKY, alpha=0.5, linewidth=0.0)
    axis.plot(t, x, color=style.BLUE, linewidth=0.9)

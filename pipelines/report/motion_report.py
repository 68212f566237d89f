"""The report on reconstructed motion: how near it is to the encoders, how well it is known."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pipelines.estimation.config import ResultConfig
from pipelines.estimation.mean_period import NoiseFloor
from pipelines.estimation.motion_result import LogResult, ObserverResult, Series
from pipelines.estimation.state_estimation import design
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.figures import (
    DASHED,
    Array,
    Look,
    density_figure,
    joint_colour,
    joint_names,
    joint_signal_figure,
    rows_figure,
)
from pipelines.report.report import Figure, Report, Section, Table, Tone, columns_table
from pipelines.report.sections import further_logs
from pipelines.report.sentences import paragraphs, sentence
from pipelines.report.style import format_number
from pipelines.report.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_STYLES: tuple[Any, ...] = ("-", DASHED, (0, (1.5, 1.2)))  # joints that lie on each other

_say, _paragraphs = partial(sentence, "motion"), partial(paragraphs, "motion")


def motion_report(logs: Sequence[LogResult]) -> Report:
    """Verdict, key figures, one section a log."""
    far, doubtful = [log for log in logs if log.straying], [log for log in logs if log.coloured]
    known = not all(np.isnan(log.speed_std).all() for log in logs)
    verdict = _say("verdict", logs, _known(logs), _whiteness(logs, doubtful), _strays(far))
    tone: Tone = "attention" if far or doubtful else "good" if known else "neutral"
    how = _paragraphs("explanation", len(logs), logs[0].smoother is not None, len(doubtful))
    sections = [Section("How it was done", how)]
    for k, log in enumerate(logs):
        if log.series is not None:
            sections.append(_log_section(log, log.series, k == 0))
    sections += further_logs(log.name for log in logs if log.series is None)
    return Report("Reconstructed motion", verdict, tone, _key_figures(logs), tuple(sections))


def _known(logs: Sequence[LogResult]) -> list[tuple[str, float, float | None]]:
    """(unit, std of speed, of acceleration) of the worst joint of each unit, where it is known."""
    found = []
    for unit in dict.fromkeys(unit for log in logs for unit in log.units):
        own = [(log, j) for log in logs for j, other in enumerate(log.units) if other == unit]
        speed = _largest(np.array([log.speed_std[j] for log, j in own]))
        if speed is not None:
            acceleration = _largest(np.array([log.acceleration_std[j] for log, j in own]))
            found.append((unit, speed, acceleration))
    return found


def _whiteness(logs: Sequence[LogResult], doubtful: Sequence[LogResult]) -> str:
    """Return whether the innovations support the standard deviations."""
    if np.isnan(np.concatenate([log.speed_std for log in logs])).all():
        return ""  # nothing is stated that whiteness could support
    if doubtful:
        name = doubtful[0].name if len(logs) > 1 else ""
        joints = doubtful[0].coloured
        return _say(
            "whiteness", "coloured", joints, name, len(doubtful) - 1, 0.0, ResultConfig().slight
        )
    correlations = [
        (text.split(":")[0].split(",")[0], text, value)
        for log in logs
        for text, value in zip(log.innovation_verdict, log.innovation_correlation, strict=True)
    ]
    words = {verdict for verdict, _, _ in correlations}
    nearly = [value for _, text, value in correlations if text.startswith("nearly")]
    kind = "nearly white" if "nearly white" in words else "white"
    kind = "at rest" if words == {"none"} else kind
    return _say("whiteness", kind, (), "", 0, max(nearly, default=0.0), ResultConfig().slight)


def _strays(far: Sequence[LogResult]) -> dict[str, object] | None:
    """The joint that strays farthest from what its encoder measured."""
    if not far:
        return None
    places = [
        (float(log.reconstruction_error_max[j - 1]), log, j) for log in far for j in log.straying
    ]
    error, log, joint = max(places, key=lambda place: place[0])
    limit, noise = log.alarm[joint - 1], float(log.observer.measurement_std[joint - 1])
    return {
        "joint": joint,
        "log": log,
        "error": error,
        "limit": float(limit),
        "published": float(limit) == ResultConfig().alarm,
        "noise": noise,
        "chance": error < REPORT.chance * noise,
        "logs": len(far),
    }


def _key_figures(logs: Sequence[LogResult]) -> Table:
    units = tuple(dict.fromkeys(unit for log in logs for unit in log.units))
    several, unit = len(units) > 1, units[0] if len(units) == 1 else "unit"
    rows = tuple(
        (f"{log.name} [{own}]" if several else log.name, log.samples, log.predicted, *figures)
        for log in logs
        for own, figures in _by_unit(log).items()
    )
    columns = (
        "log [unit]" if several else "log",
        "samples",
        "predicted",
        f"error, largest [{unit}]",
        f"speed, largest [{unit}/s]",
        f"its std [{unit}/s]",
        f"acceleration, largest [{unit}/s^2]",
        f"its std [{unit}/s^2]",
    )
    caption = "The worst joint of each log. Predicted: samples in which no position was measured."
    return Table(columns, rows, caption)


def _by_unit(log: LogResult) -> dict[str, tuple[float | None, ...]]:
    """The key figures of the worst of the joints that share a unit."""
    figures = (
        log.reconstruction_error_max,
        log.peak_speed,
        log.speed_std,
        log.peak_acceleration,
        log.acceleration_std,
    )
    found = {}
    for unit in dict.fromkeys(log.units):
        own = np.array([other == unit for other in log.units])
        found[unit] = tuple(_largest(values[own]) for values in figures)
    return found


def _unit(log: LogResult) -> str:
    """Of position: "rad", "m", or "(rad or m)" where each joint has its own."""
    units = joined(log.units)
    return f"({units})" if " or " in units else units


def _largest(values: Array) -> float | None:
    return None if np.isnan(values).all() else float(np.nanmax(values))


def _log_section(log: LogResult, series: Series, first: bool) -> Section:
    doubtful = log.coloured
    stated = not np.isnan(log.speed_std).all()
    innovations = _innovations(log) if first or doubtful else []
    text = _paragraphs("log", log, innovations, doubtful if stated else ())
    figures = _figures(log, series, first)
    return Section(f"Log {log.name}", text, tuple(_tables(log)), tuple(figures))


def _innovations(log: LogResult) -> list[tuple[list[int], str]]:
    """(joints, what their innovations say), joints that say the same together."""
    numbers = [f"{value:.2f}" for value in log.innovation_correlation]
    alike: dict[str, list[int]] = {}
    for j, words in enumerate(log.innovation_verdict):
        alike.setdefault(words.replace(numbers[j], "{}"), []).append(j)
    return [
        ([j + 1 for j in joints], words.format(", ".join(numbers[j] for j in joints)))
        for words, joints in alike.items()
    ]


def _tables(log: LogResult) -> list[Table]:
    o, unit = log.observer, _unit(log)
    joints = range(1, len(log.units) + 1)
    gain_units = ("1", "1/s", "1/s^2", "1/s^3")
    observer = {f"k{i + 1} [{gain_units[i]}]": o.gains[:, i].tolist() for i in range(o.order)} | {
        "bandwidth [Hz]": o.bandwidth_hz.tolist(),
        f"encoder noise [{unit}]": o.measurement_std.tolist(),
        f"jerk σ [{unit}/s^{o.order}]": o.jerk_std.tolist(),
        "correlation": log.innovation_correlation.tolist(),
    }
    known = {}
    if log.smoother is not None:
        known = {
            f"smoother's σ [{unit}/s^{o.order}]": log.smoother.jerk_std.tolist(),
            "its bandwidth [Hz]": log.smoother.bandwidth_hz.tolist(),
        }
    known |= {
        f"error, largest [{unit}]": log.reconstruction_error_max.tolist(),
        f"rms [{unit}]": log.reconstruction_error_rms.tolist(),
        f"std q [{unit}]": log.position_std.tolist(),
        f"std dq [{unit}/s]": log.speed_std.tolist(),
        f"std ddq [{unit}/s^2]": log.acceleration_std.tolist(),
    }
    leads_to = "The motion it leads to; std: standard deviation in the middle of all samples."
    tables = [
        columns_table({"joint": joints} | observer, _say("observer", ResultConfig().slight)),
        columns_table({"joint": joints} | known, leads_to),
    ]
    if log.noise_floor is not None:
        tables.append(_floor_table(log, log.noise_floor))
    return tables


def _floor_table(log: LogResult, noise: NoiseFloor) -> Table:
    unit, torque = _unit(log), joined("N m" if own == "rad" else "N" for own in log.units)
    floor = {
        "joint": range(1, len(log.units) + 1),
        f"position [{unit}]": noise.position.tolist(),
        f"torque [{torque}]": noise.torque.tolist(),
    }
    if noise.cutoff_hz is not None:
        below = f"below {format_number(noise.cutoff_hz, 3)} Hz"
        floor[f"position {below} [{unit}]"] = noise.position_low_pass.tolist()
        floor[f"torque {below} [{torque}]"] = noise.torque_low_pass.tolist()
    what = "standard deviation of one sample of one period, by what differs between periods"
    return columns_table(floor, f"Noise floor: {what}.")


def _figures(log: LogResult, s: Series, first: bool) -> list[Figure]:
    name, unit = log.name, _unit(log)
    stated = not np.isnan(log.speed_std).all()
    band = " The band is two standard deviations, where it is wide enough to see." if stated else ""
    largest = [f"{format_number(f[0] or 0.0, 2)} {own}" for own, f in _by_unit(log).items()]
    error, spectrum = _say("error", largest), _say("spectrum")
    joints = joint_names(len(log.units))

    def banded(quantity: str, values: Array, std: Array, unit: str) -> Figure:
        return rows_figure(
            f"{quantity}-{name}",
            f"Reconstructed {quantity}.{band}",
            joints,
            lambda axis, j: draw_banded(axis, s.t, values[:, j], std[:, j]),
            f"{quantity} [{unit}]",
        )

    figures = [_bode(log.observer, f"bode-{name}")] if first else []
    return [
        *figures,
        joint_signal_figure(f"error-{name}", error, s.t, s.error, unit, quantity="difference"),
        density_figure(f"spectrum-{name}", spectrum, s.frequency, s.error_density, unit),
        banded("speed", s.speed, s.speed_std, f"{unit}/s"),
        banded("acceleration", s.acceleration, s.acceleration_std, f"{unit}/s^2"),
    ]


def draw_banded(axis: Axes, t: Array, x: Array, std: Array) -> None:
    """A signal over time with a band of two standard deviations; `x` and `std` are envelopes."""
    band = 2.0 * np.nan_to_num(std)[1::2]
    low, high = np.minimum(x[::2], x[1::2]) - band, np.maximum(x[::2], x[1::2]) + band
    axis.fill_between(t[::2], low, high, color=style.SKY, alpha=0.5, linewidth=0.0)
    axis.plot(t, x, color=style.BLUE, linewidth=0.9)


def _bode(o: ObserverResult, name: str) -> Figure:
    """Fig. 7 of the paper, from the observer's numbers alone."""
    observer = design(o.sample_time, o.jerk_std, o.measurement_std**2, o.order)
    frequency = np.geomspace(0.5, 0.5 / o.sample_time, 200)
    response = np.moveaxis(observer.response(frequency), 2, 0)[:3]
    channels = ("position", "speed [1/s]", "acceleration [1/s²]")

    def draw(drawing: Drawing) -> None:
        axes = drawing.subplots(len(response), 2, sharex=True)
        for k, values in enumerate(response):
            draw_bode(axes[k], frequency, values, k)
            axes[k][0].set_title(f"{channels[k]}: magnitude", pad=3.0)
        for axis in axes[-1]:
            axis.set_xlabel("frequency [Hz]")
        axes[0][1].legend(loc="lower left", fontsize="small")

    caption, size = _say("bode", o.bandwidth_hz.tolist()), (6.0, 1.9 * len(response) + 0.4)
    return Figure(name, caption, draw, size, alt="Bode plot of the Kalman observer")


def draw_bode(
    axes: Sequence[Axes], frequency: Array, response: npt.NDArray[np.complex128], power: int
) -> None:
    """Magnitude and phase of `response` (frequencies, joints).

    Dotted: what an exact differentiator of that power would do.
    """
    magnitude, phase = axes
    for j, values in enumerate(response.T):
        look: Look = {
            "color": joint_colour(j),
            "linestyle": _STYLES[j % 3],
            "label": f"joint {j + 1}",
        }
        magnitude.semilogx(frequency, np.abs(values), **look)
        phase.semilogx(frequency, np.rad2deg(np.unwrap(np.angle(values))), **look)
    exact = (2j * np.pi * frequency) ** power
    dotted: Look = {"color": style.GREY, "linestyle": ":", "linewidth": 1.0}
    magnitude.semilogx(frequency, np.abs(exact), **dotted)
    phase.semilogx(frequency, np.rad2deg(np.angle(exact)), **dotted)
    least, largest = np.abs(response).min(), np.abs(response).max()
    if least > 0.01 * largest:
        magnitude.set_ylim(0.0, 1.15 * largest)
    else:
        magnitude.set_yscale("log")
        magnitude.set_ylim(max(least * 0.5, 1e-3 * largest), 2.0 * largest)
        style.log_ticks(magnitude.yaxis)
    phase.set_title("phase [°]", pad=3.0)
    for axis in axes:
        style.log_ticks(axis.xaxis)

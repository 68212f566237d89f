"""The report on reconstructed motion: how near it comes to the encoders, the observer that made it, how well it is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.model.mean_period import NoiseFloor
from pipelines.model.motion_result import ALARM, SLIGHT, LogResult, ObserverResult, Series, alarm, coloured, straying
from pipelines.report.figures import Array, joint_axes, joint_size
from pipelines.report.motion_figures import draw_banded, draw_bode, draw_density
from pipelines.report.report import Figure, Report, Section, Table, Tone
from pipelines.report.sections import joint_signal_figure
from pipelines.report.style import format_number
from pipelines.signal.observer import design

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

__all__ = ["motion_report"]

_CHANCE = 6.0  # standard deviations: noise is further off in one sample of 5e8

_METHODS = {"smoother": "the Kalman smoother",
            "observer": "the Kalman observer, as a controller could",
            "central-differences": "central differences",
            "zero-phase": "a zero-phase low-pass and central differences"}


def motion_report(logs: Sequence[LogResult]) -> Report:
    """Verdict, key figures, one section a log."""
    far, doubtful = [log for log in logs if straying(log)], [log for log in logs if coloured(log)]
    which = "The motion of the log" if len(logs) == 1 else f"The motion of {len(logs)} logs"
    said = (f"{which} is reconstructed by {_METHODS[logs[0].method]}", _known(logs), *_whiteness(logs, doubtful),
            *_alarm(logs, far))
    known = not all(np.isnan(log.speed_std).all() for log in logs)
    tone: Tone = "attention" if far or doubtful else "good" if known else "neutral"
    sections = [_explanation(logs), *(_log_section(log, log.series, i) for i, log in enumerate(logs) if log.series is not None)]
    if more := [log.name for log in logs if log.series is None]:
        sections.append(Section("Further logs", (f"Their figures are in result.json alone: {', '.join(more[:40])}.",)))
    verdict = " ".join(f"{words[0].upper()}{words[1:]}." for words in said)
    return Report("Reconstructed motion", verdict, tone, _key_figures(logs), tuple(sections))


def _known(logs: Sequence[LogResult]) -> str:
    """How well speed and acceleration are known, worst joint of each unit."""
    parts = []
    for unit in dict.fromkeys(unit for log in logs for unit in log.units):
        pairs = [(log.speed_std[j], log.acceleration_std[j]) for log in logs for j, own in enumerate(log.units) if own == unit]
        speed, acceleration = (_largest(np.array(values)) for values in zip(*pairs, strict=True))
        if speed is not None:
            parts.append(f"{format_number(speed, 2)} {unit}/s in speed and {format_number(acceleration, 2)} {unit}/s² in "
                         "acceleration")
    if not parts:
        return "how well speed and acceleration are known, this method cannot say"
    return f"its standard deviation is {', '.join(parts)} (worst joint)"


def _whiteness(logs: Sequence[LogResult], doubtful: Sequence[LogResult]) -> tuple[str, ...]:
    if np.isnan(np.concatenate([log.speed_std for log in logs])).all():
        return ()  # nothing is stated that whiteness could support
    if doubtful:
        where = f"joint {_listed(coloured(doubtful[0]))}" + ("" if len(logs) == 1 else f" of {doubtful[0].name}")
        more = f" and in {len(doubtful) - 1} more logs" if len(doubtful) > 1 else ""
        return (f"these deviations hold only where the innovations are white, and those of {where}{more} are coloured",)
    words = {text.split(":")[0].split(",")[0] for log in logs for text in log.innovation_verdict}
    if words == {"none"}:
        return ("no joint moves, so nothing tells whether these deviations hold",)
    if "nearly white" not in words:
        return ("the innovations are white, so these deviations hold",)
    largest = max(value for log in logs for value, text in zip(log.innovation_correlation, log.innovation_verdict, strict=True)
                  if text.startswith("nearly"))
    return (f"the innovations are nearly white, their correlation {largest:.2f} at most: below {SLIGHT:g} these deviations hold",)


def _alarm(logs: Sequence[LogResult], far: Sequence[LogResult]) -> tuple[str, ...]:
    if not far:
        return ()
    worst = max(far, key=lambda log: max(log.reconstruction_error_max[j - 1] for j in straying(log)))
    joint = max(straying(worst), key=lambda j: float(worst.reconstruction_error_max[j - 1]))
    limit, noise = float(alarm(worst)[joint - 1]), float(worst.observer.measurement_std[joint - 1])
    allowed = "Kostić et al. 2004 stay below" if limit == ALARM else "its steps allow for"
    chance = float(worst.reconstruction_error_max[joint - 1]) < _CHANCE * noise
    why = f", as an encoder with noise of {format_number(noise, 2)} rad does" if chance else ""
    more = f"; in {len(far)} of {len(logs)} logs a joint strays" if len(far) > 1 else ""
    return (f"the position of joint {joint}{'' if len(logs) == 1 else f' of {worst.name}'} strays "
            f"{format_number(float(worst.reconstruction_error_max[joint - 1]), 2)} rad from what its encoder measured, more than "
            f"the {format_number(limit, 2)} rad that {allowed}{why}{more}",)


def _listed(joints: Sequence[int]) -> str:
    return ", ".join(map(str, joints))


def _key_figures(logs: Sequence[LogResult]) -> Table:
    several = len(units := tuple(dict.fromkeys(unit for log in logs for unit in log.units))) > 1
    unit = "unit" if several else units[0]
    rows = tuple((f"{log.name} [{own}]" if several else log.name, log.samples, log.predicted, *figures)
                 for log in logs for own, figures in _by_unit(log).items())
    return Table(("log [unit]" if several else "log", "samples", "predicted", f"error, largest [{unit}]",
                  f"speed, largest [{unit}/s]", f"its std [{unit}/s]", f"acceleration, largest [{unit}/s^2]",
                  f"its std [{unit}/s^2]"), rows,
                 "The worst joint of each log. Predicted: samples in which a position was not measured.")


def _by_unit(log: LogResult) -> dict[str, tuple[float | None, ...]]:
    """The key figures of the worst of the joints that share a unit: a slide's metres are no radians."""
    found = {}
    for unit in dict.fromkeys(log.units):
        own = np.array([other == unit for other in log.units])
        found[unit] = tuple(_largest(values[own]) for values in (
            log.reconstruction_error_max, log.peak_speed, log.speed_std, log.peak_acceleration, log.acceleration_std))
    return found


def _unit(log: LogResult) -> str:
    """Of position: "rad", "m", or "(rad or m)" where each joint has its own."""
    units = tuple(dict.fromkeys(log.units))
    return units[0] if len(units) == 1 else f"({' or '.join(units)})"


def _largest(values: Array) -> float | None:
    return None if np.isnan(values).all() else float(np.nanmax(values))


def _explanation(logs: Sequence[LogResult]) -> Section:
    doubtful = sum(bool(coloured(log)) for log in logs)
    text = ["The observer takes each joint for a chain of integrators that random jerk drives. The encoder's resolution and its "
            "samples say how noisy it is; the jerk is the one that predicts the next sample best, unless it was asked for. The "
            "rule of Kostić et al. 2004, the largest jerk of the reference, is a first guess and filters hardly at all. Positions "
            "alone are asked: whether the torque belongs to them is for inspect and estimate-bps to say."]
    if logs[0].smoother is not None:
        text.append("The smoother sees both sides of a sample and needs far less jerk. Near the ends of a log and over long gaps "
                    "it takes the observer's, because there it has to look ahead as well.")
    if doubtful:
        text.append(f"In {doubtful} of {len(logs)} logs the observer's innovations, what each sample adds to its prediction, are "
                    "coloured: the sections below say of which joints. The standard deviations stated hold only where they are "
                    "white.")
    return Section("How it was done", tuple(text))


def _log_section(log: LogResult, series: Series, number: int) -> Section:
    floor = log.noise_floor
    text = _innovations(log) if number == 0 or coloured(log) else []
    if (doubtful := coloured(log)) and not np.isnan(log.speed_std).all():
        text.append("A stated standard deviation holds only where the innovations are white: do not rely on those of joint "
                    f"{_listed(doubtful)}.")
    if floor is not None:
        without = [f"period {', '.join(map(str, floor.left_out))}"] if floor.left_out else []
        without += [f"the first {floor.settling_time:.2g} s, in which the motion settled"] if floor.settling_time else []
        left_out = f" (left out: {'; '.join(without)})" if without else ""
        mean = ("The motion in the derived log is that of every sample; an estimate takes its equations from the mean of the "
                "periods, whose deviations are in the table as well." if log.mean is not None else
                f"They are not averaged: {floor.unlike}." if floor.unlike else "They are not averaged, as asked for.")
        compared = f"{floor.periods} periods were compared: their scatter is the noise floor in the table{left_out}. "
        text.append(f"{compared if floor.periods else ''}{mean}"
                    f"{' How long the motion took to settle is not known.' if floor.settling_time is None else ''}")
    return Section(f"Log {log.name}", tuple(text), _tables(log), tuple(_figures(log, series, number == 0)))


def _innovations(log: LogResult) -> list[str]:
    """What the innovations of each joint say, joints that say the same together."""
    numbers, found = [f"{value:.2f}" for value in log.innovation_correlation], dict[str, list[int]]()
    for j, words in enumerate(log.innovation_verdict):
        found.setdefault(words.replace(numbers[j], "{}"), []).append(j)
    return [f"Innovations of joint {_listed([j + 1 for j in joints])}: {words.format(', '.join(numbers[j] for j in joints))}."
            for words, joints in found.items()]


def _tables(log: LogResult) -> tuple[Table, ...]:
    o, unit = log.observer, _unit(log)
    columns: dict[str, Sequence[float]] = {"joint": range(1, len(log.units) + 1)}
    columns |= {f"k{i + 1} [{('1', '1/s', '1/s^2', '1/s^3')[i]}]": o.gains[:, i].tolist() for i in range(o.order)}
    columns |= {"bandwidth [Hz]": o.bandwidth_hz.tolist(), f"encoder noise [{unit}]": o.measurement_std.tolist(),
                f"jerk σ [{unit}/s^{o.order}]": o.jerk_std.tolist(),
                f"largest jerk [{unit}/s^{o.order}]": o.jerk_std_paper.tolist(), "correlation": log.innovation_correlation.tolist()}
    known: dict[str, Sequence[float]] = {"joint": range(1, len(log.units) + 1)}
    if log.smoother is not None:
        known |= {f"smoother's σ [{unit}/s^{o.order}]": log.smoother.jerk_std.tolist(),
                  "its bandwidth [Hz]": log.smoother.bandwidth_hz.tolist()}
    known |= {f"error, largest [{unit}]": log.reconstruction_error_max.tolist(),
              f"rms [{unit}]": log.reconstruction_error_rms.tolist(), f"std q [{unit}]": log.position_std.tolist(),
              f"std dq [{unit}/s]": log.speed_std.tolist(), f"std ddq [{unit}/s^2]": log.acceleration_std.tolist()}
    tables = (_table(columns, "The observer of Kostić et al. 2004, eq. (20). Correlation: of an innovation with the 30 before it, "
                     f"rms; 0 where they are white. Below {SLIGHT:g} it changes a variance by less than a tenth, and the standard "
                     "deviations hold; a short log shows some by chance."),
              _table(known, "The motion it leads to; std: standard deviation in the middle of all samples."))
    return tables if log.noise_floor is None else (*tables, _floor_table(log, log.noise_floor))


def _floor_table(log: LogResult, noise: NoiseFloor) -> Table:
    unit, torque = _unit(log), " or ".join(dict.fromkeys("N m" if own == "rad" else "N" for own in log.units))
    floor: dict[str, Sequence[float]] = {"joint": range(1, len(log.units) + 1)}
    floor |= {f"position [{unit}]": noise.position.tolist(), f"torque [{torque}]": noise.torque.tolist()}
    passed = "" if noise.cutoff_hz is None else f" below {format_number(noise.cutoff_hz, 3)} Hz"
    if noise.cutoff_hz is not None:
        floor |= {f"position{passed} [{unit}]": noise.position_low_pass.tolist(),
                  f"torque{passed} [{torque}]": noise.torque_low_pass.tolist()}
    if log.mean is not None:
        floor |= {f"std dq of the mean [{unit}/s]": log.mean.speed_std.tolist(),
                  f"std ddq of the mean [{unit}/s^2]": log.mean.acceleration_std.tolist()}
    return _table(floor, "Noise floor: standard deviation of one sample of one period, by what differs between periods.")


def _table(columns: dict[str, Sequence[float]], caption: str) -> Table:
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), caption)


def _figures(log: LogResult, s: Series, first: bool) -> list[Figure]:
    joints, unit = len(log.units), _unit(log)
    band = " The band is two standard deviations, where it is wide enough to see." if not np.isnan(log.speed_std).all() else ""
    largest = " and ".join(f"{format_number(figures[0] or 0.0, 2)} {own}" for own, figures in _by_unit(log).items())
    error = (f"Measured minus reconstructed position: {largest} at most. "
             "It should look like the steps of the encoder, without a trace of the motion.")
    spectrum = ("Spectrum of that difference: flat above the bandwidth, where it is the encoder's noise. A peak would be an error "
                "of the encoder, or a vibration that the reconstruction does not follow.")
    figures = [_bode(log.observer, f"bode-{log.name}")] if first else []
    return [
        *figures,
        joint_signal_figure(f"error-{log.name}", error, s.t, s.error, unit, quantity="difference"),
        Figure(f"spectrum-{log.name}", spectrum,
               lambda drawing: draw_density(drawing.subplots(), s.frequency, s.error_density, unit), (6.0, 2.8)),
        Figure(f"speed-{log.name}", f"Reconstructed speed.{band}",
               _banded(joints, s.t, s.speed, s.speed_std, f"{unit}/s", "speed"), joint_size(joints)),
        Figure(f"acceleration-{log.name}", f"Reconstructed acceleration.{band}",
               _banded(joints, s.t, s.acceleration, s.acceleration_std, f"{unit}/s^2", "acceleration"), joint_size(joints))]


def _banded(joints: int, t: Array, values: Array, std: Array, unit: str, quantity: str) -> Callable[[Drawing], None]:
    return lambda drawing: draw_banded(joint_axes(drawing, joints), t, values, std, unit, quantity)


def _bode(o: ObserverResult, name: str) -> Figure:
    """Fig. 7 of the paper, from the observer's numbers alone."""
    observer = design(o.sample_time, o.jerk_std, o.measurement_std**2, o.order)
    frequency = np.geomspace(0.5, 0.5 / o.sample_time, 200)
    response = np.moveaxis(observer.response(frequency), 2, 0)[:3]
    s = 2j * np.pi * frequency
    names = ("position", "speed [1/s]", "acceleration [1/s²]")[:len(response)]

    def draw(drawing: Drawing) -> None:
        draw_bode(drawing.subplots(len(response), 2, sharex=True), frequency, list(response), names,
                  [np.asarray(s**i) for i in range(len(response))])

    widths = ", ".join(f"{format_number(hz, 3)}" for hz in o.bandwidth_hz)
    return Figure(name, f"What the observer does to a measured position: it passes it up to {widths} Hz (-3 dB, joint by "
                  "joint), and differentiates below that like the dotted line; above, noise is held back instead of amplified.",
                  draw, (6.0, 1.9 * len(response) + 0.4), alt="Bode plot of the Kalman observer")

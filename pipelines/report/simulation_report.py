"""The report on a simulation: how far it is from what was measured, when, at which frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pipelines.report.figures import (
    Array,
    compared_figure,
    joint_signal_figure,
)
from pipelines.report.report import Figure, Report, Section, Table
from pipelines.report.sections import further_logs
from pipelines.report.sentences import paragraphs, sentence
from pipelines.report.style import format_number, three_digits
from pipelines.simulation.course import Course
from pipelines.simulation.imitate import Imitation

if TYPE_CHECKING:
    pass

_say, _paragraphs = partial(sentence, "simulation"), partial(paragraphs, "simulation")


def simulation_report(
    model: str, faults: Sequence[str], logs: Sequence[Imitation], tracking: Sequence[Array | None]
) -> Report:
    """Verdict, key figures, one section a log.

    Args:
        tracking: (joints,) the measured tracking error of each log. [rad]
    """
    worst = _worst(logs, tracking)
    sections = [_section(one, one.course) for one in logs if one.course is not None]
    sections += further_logs(one.name for one in logs if one.course is None)
    verdict = _say("verdict", model, faults, len(logs), worst)
    return Report("Simulation", verdict, "neutral", _key_figures(logs, tracking), tuple(sections))


def _worst(logs: Sequence[Imitation], tracking: Sequence[Array | None]) -> dict[str, object] | None:
    """The log whose simulation is farthest off; one without feedback only where all are so."""
    compared = [(one, error) for one, error in zip(logs, tracking, strict=True) if _rms(one).size]
    if not compared:
        return None
    kept = [pair for pair in compared if _how(pair[0]) == "closed loop"] or compared
    log, error = max(kept, key=lambda pair: float(_rms(pair[0]).max()))
    joint = int(np.argmax(_rms(log)))
    off = float(_rms(log)[joint])
    beside = []
    if error is not None and error[joint] > 0.0:
        beside.append(
            f"{format_number(100.0 * off / float(error[joint]), 2)} % of the tracking error"
        )
    if log.noise_rms is not None and log.noise_rms[joint] > 0.0:
        times = format_number(off / float(log.noise_rms[joint]), 2)
        beside.append(f"{times} times what other noise makes")
    return {
        "log": log,
        "how": _how(log),
        "alike": sum(_how(one) == _how(log) for one, _ in compared),
        "compared": len(compared),
        "off": off,
        "unit": log.units[joint],
        "joint": joint + 1,
        "beside": beside,
    }


def _rms(one: Imitation) -> Array:
    return np.zeros(0) if one.position_rms is None else one.position_rms


def _how(one: Imitation) -> str:
    return "windows" if one.simulation == "windowed" else "closed loop"


def _key_figures(logs: Sequence[Imitation], tracking: Sequence[Array | None]) -> Table:
    rows = []
    for one, error in zip(logs, tracking, strict=True):
        figures = (one.position_rms, one.position_max, error, one.speed_rms, one.torque_rms)
        for j, unit in enumerate(one.units):
            values = [None if x is None else three_digits(x[j]) for x in figures]
            rows.append((one.name, j + 1, unit, *values, _how(one)))
    columns = (
        "log",
        "joint",
        "unit",
        "position, rms",
        "position, largest",
        "tracking error, rms",
        "speed, rms [unit/s]",
        "torque, rms [N m]",
        "simulated in",
    )
    caption = (
        "Simulated minus measured, joint by joint. Tracking error: measured minus reference, by "
        "which feedback hides what a model gets wrong."
    )
    return Table(columns, tuple(rows), caption)


def _section(one: Imitation, course: Course) -> Section:
    noise = None if one.noise_rms is None else one.noise_rms.tolist()
    step = None if one.step_error is None else float(np.max(one.step_error))
    text = _paragraphs("log", one, noise, step)
    return Section(f"Log {one.name}", text, (), tuple(_figures(one, course)))


def _figures(one: Imitation, s: Course) -> list[Figure]:
    unit, name = one.units[0], one.name
    position = (s.position, s.position_simulated, s.position_difference)
    figures = _signal_figures(name, "position", unit, s, *position)
    caption, speed = _say("measured", "speed"), (s.speed, s.speed_simulated)
    figures.append(compared_figure(f"speed-{name}", caption, s.t, *speed, f"speed [{unit}/s]"))
    if s.torque is not None and s.torque_simulated is not None and s.torque_difference is not None:
        torque = (s.torque, s.torque_simulated, s.torque_difference)
        figures += _signal_figures(name, "torque", one.torque_units[0], s, *torque)
    return figures


def _signal_figures(
    log: str,
    name: str,
    unit: str,
    s: Course,
    measured: Array,
    simulated: Array,
    difference: Array,
) -> list[Figure]:
    """A signal measured and simulated, and the difference over time."""
    caption, quantity = _say("measured", name), f"{name} [{unit}]"
    both = compared_figure(f"{name}-{log}", caption, s.t, measured, simulated, quantity)
    caption, quantity = _say("difference", name), "simulated − measured"
    figure_name = f"{name}-difference-{log}"
    error = joint_signal_figure(figure_name, caption, s.t, difference, unit, quantity=quantity)
    return [both, error]

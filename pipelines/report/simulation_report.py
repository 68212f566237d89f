"""The report on a simulation: how far it stays from what was measured, when, and at which frequencies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.model.simulation.course import Course
from pipelines.model.simulation.imitate import Imitation
from pipelines.report.figures import Array, draw_measured, draw_modelled, joint_axes, joint_size
from pipelines.report.motion_figures import colour, draw_density
from pipelines.report.report import Figure, Report, Section, Table
from pipelines.report.sections import joint_signal_figure
from pipelines.report.style import format_number, format_unit, three_digits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

__all__ = ["draw_compared", "draw_drift", "simulation_report"]


def simulation_report(model: str, faults: Sequence[str], logs: Sequence[Imitation],
                      tracking: Sequence[Array | None]) -> Report:
    """Verdict, key figures, one section a log. `tracking` [rad] is the measured tracking error of each log (joints,)."""
    ailing = f" with {', '.join(faults)}" if faults else ""
    compared = [one for one in logs if one.position_rms is not None]
    if not compared:
        said = f"The model {model}{ailing} was simulated in {_many(logs, 'planned experiment')}; nothing was measured to compare"
    else:
        worst = _worst(compared)
        reference = next(error for one, error in zip(logs, tracking, strict=True) if one is worst)
        which = "" if len(logs) == 1 else f" ({worst.name}, {_rank(worst, compared)})"
        said = (f"The simulation of {model}{ailing} differs from the measured position{which} {_by(worst, reference)}, "
                f"{_way(worst)}")
    sections = [_section(one, one.course) for one in logs if one.course is not None]
    if more := [one.name for one in logs if one.course is None]:
        sections.append(Section("Further logs", (f"Their figures are in result.json alone: {', '.join(more[:40])}.",)))
    return Report("Simulation", f"{said}.", "neutral", _key_figures(logs, tracking), tuple(sections))


def _worst(compared: Sequence[Imitation]) -> Imitation:
    """The log that is imitated worst. What nothing corrects drifts away whatever the model: it counts where all do so."""
    kept = [one for one in compared if _how(one) == "closed loop"] or compared
    return max(kept, key=lambda one: float(np.max(one.position_rms if one.position_rms is not None else 0.0)))


def _rank(worst: Imitation, compared: Sequence[Imitation]) -> str:
    alike = sum(_how(one) == _how(worst) for one in compared)
    kind = "" if alike == len(compared) else f" in {_how(worst)}"
    return f"the only log{kind}" if alike == 1 else f"the worst of {alike} logs{kind}"


def _how(one: Imitation) -> str:
    if one.simulation == "windowed":
        return "windows"
    return "open loop" if one.law == "open-loop" else "closed loop"


def _many(logs: Sequence[Imitation], what: str) -> str:
    return f"one {what}" if len(logs) == 1 else f"{len(logs)} {what}s"


def _by(one: Imitation, tracking: Array | None) -> str:
    """The largest difference, beside what the controller leaves of the reference and what noise alone makes."""
    assert one.position_rms is not None
    joint = int(np.argmax(one.position_rms))
    off = float(one.position_rms[joint])
    beside = []
    if tracking is not None and tracking[joint] > 0.0:
        beside.append(f"{format_number(100.0 * off / float(tracking[joint]), 2)} % of the tracking error")
    if one.noise_rms is not None and one.noise_rms[joint] > 0.0:
        beside.append(f"{format_number(off / float(one.noise_rms[joint]), 2)} times what other noise makes")
    place = f"joint {joint + 1}{': ' if beside else ''}{', '.join(beside)}"
    return f"by {format_number(off, 2)} {one.units[joint]} rms ({place})"


def _way(one: Imitation) -> str:
    if one.window is not None:
        return f"in windows of {format_number(one.window * 1e3, 3)} ms that each start where the arm was"
    if one.law == "open-loop":
        return "under the logged torque, without feedback: the smallest error grows with time (--windowed compares over short ones)"
    return "in closed loop"


def _key_figures(logs: Sequence[Imitation], tracking: Sequence[Array | None]) -> Table:
    rows = []
    for one, reference in zip(logs, tracking, strict=True):
        for j, unit in enumerate(one.units):
            figures = (one.position_rms, one.position_max, reference, one.speed_rms, one.torque_rms)
            values = [None if x is None else three_digits(x[j]) for x in figures]
            rows.append((one.name, j + 1, unit, *values, _how(one)))
    return Table(("log", "joint", "unit", "position, rms", "position, largest", "tracking error, rms", "speed, rms [unit/s]",
                  "torque, rms [N m]", "simulated in"), tuple(rows),
                 "Simulated minus measured, joint by joint. Tracking error: measured minus reference, by which feedback hides what "
                 "a model gets wrong.")


def _section(one: Imitation, s: Course) -> Section:
    return Section(f"Log {one.name}", tuple(_words(one)), (), tuple(_figures(one, s)))


def _words(one: Imitation) -> list[str]:
    text = []
    if one.simulation == "windowed":
        text.append(f"Simulated in windows of {format_number((one.window or 0.0) * 1e3, 3)} ms ({one.reason}): each starts at the "
                    "reconstructed position and speed and follows the logged torque without feedback. Its error grows with time; "
                    "it is no tracking error.")
    elif one.law == "open-loop":
        text.append("Driven open loop: the moving joint follows the logged torque, the others are held as the log says. Nothing "
                    "corrects the moving joint, so that noise and the smallest error of the model grow with time; a torque that "
                    "was fed back from the position (a compensation of gravity) is replayed as it was.")
    else:
        text.append("Simulated in closed loop: the controller, the references and the encoders are those of the log.")
    if one.replicas > 1 and one.noise_rms is not None:
        levels = ", ".join(format_number(float(x), 2) for x in one.noise_rms)
        text.append(f"{one.replicas} replicas with different noise were simulated; the figures show the first. Two of them are "
                    f"{levels} {one.units[0]} rms apart, joint by joint.")
    if one.step_error is not None:
        largest = format_number(float(np.max(one.step_error)), 2)
        text.append(f"The integrator took {one.steps} step{'s' * (one.steps > 1)} a sample; twice as many change no joint's "
                    f"position by more than {largest} {one.units[0]} rms.")
    return text


def _figures(one: Imitation, s: Course) -> list[Figure]:
    unit, torque_unit = one.units[0], one.torque_units[0]
    figures = [
        _compared(f"position-{one.name}", "Position, measured and simulated.", s.t, s.position, s.position_simulated, unit,
                  "position"),
        joint_signal_figure(f"position-difference-{one.name}", "What the simulation gets wrong: simulated minus measured position.",
                            s.t, s.position_difference, unit, quantity="simulated − measured")]
    if s.frequency is not None and s.position_density is not None and one.law != "open-loop":  # of a drift it tells nothing
        figures.append(_density(f"position-spectrum-{one.name}", "Spectrum of that difference. Low frequencies are model errors, "
                                "peaks are vibrations or ripples that the model lacks.", s.frequency, s.position_density, unit))
    if s.elapsed is not None and s.drift is not None:
        elapsed, drift = s.elapsed, s.drift
        figures.append(Figure(f"drift-{one.name}", "How the difference grows from the start of a window, over all windows.",
                              lambda drawing: draw_drift(drawing.subplots(), elapsed, drift, unit), (6.0, 2.6)))
    figures.append(_compared(f"speed-{one.name}", "Speed, reconstructed from the measurement and simulated.", s.t, s.speed,
                             s.speed_simulated, f"{unit}/s", "speed"))
    if s.torque is None or s.torque_simulated is None or s.torque_difference is None:
        return figures
    figures += [_compared(f"torque-{one.name}", "Torque that the controller commanded, measured and simulated.", s.t, s.torque,
                          s.torque_simulated, torque_unit, "torque"),
                joint_signal_figure(f"torque-difference-{one.name}", "Simulated minus measured torque. A controller turns encoder "
                                    "steps and noise into torque, which no model repeats sample by sample.", s.t,
                                    s.torque_difference, torque_unit, quantity="simulated − measured")]
    if s.frequency is not None and s.torque_density is not None:
        figures.append(_density(f"torque-spectrum-{one.name}", "Spectrum of that difference. At high frequencies it is "
                                "what the controller makes of encoder steps and noise.", s.frequency, s.torque_density,
                                torque_unit))
    return figures


def _density(name: str, caption: str, frequency: Array, density: Array, unit: str) -> Figure:
    return Figure(name, caption, lambda drawing: draw_density(drawing.subplots(), frequency, density, unit), (6.0, 2.8))


def _compared(name: str, caption: str, t: Array, measured: Array, simulated: Array, unit: str, quantity: str) -> Figure:
    joints = measured.shape[1]
    return Figure(name, caption, _drawn(joints, t, measured, simulated, unit, quantity), joint_size(joints))


def _drawn(joints: int, t: Array, measured: Array, simulated: Array, unit: str, quantity: str) -> Callable[[Drawing], None]:
    return lambda drawing: draw_compared(joint_axes(drawing, joints), t, measured, simulated, unit, quantity)


def draw_compared(axes: Sequence[Axes], t: Array, measured: Array, simulated: Array, unit: str, quantity: str) -> None:
    """Measured (broad) under simulated (thin), one row a joint; both are envelopes (points, joints)."""
    for j, axis in enumerate(axes):
        draw_measured(axis, t, measured[:, j])
        draw_modelled(axis, t, simulated[:, j], "simulated")
        axis.set_title(f"joint {j + 1}", pad=3.0)
        axis.margins(x=0.01, y=0.1)
        axis.locator_params(axis="y", nbins=4)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0, ncols=2)
    axes[-1].set_xlabel("time [s]")
    if figure := axes[0].get_figure():
        figure.supylabel(f"{quantity} [{format_unit(unit)}]", fontsize="medium")


def draw_drift(axes: Axes, elapsed: Array, drift: Array, unit: str) -> None:
    """Rms difference over the time since a window began, one line a joint."""
    for j, column in enumerate(drift.T):
        axes.plot(1e3 * elapsed, column, color=colour(j), label=f"joint {j + 1}")
    axes.set_xlabel("time since the window began [ms]")
    axes.set_ylabel(f"rms difference [{format_unit(unit)}]")
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="upper left")

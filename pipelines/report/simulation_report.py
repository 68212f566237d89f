"""The report on a simulation: how far it is from what was measured, and when."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.report.document import document
from pipelines.report.figures import Array, joint_signal_figure, signals_figure
from pipelines.report.report import Figure, Report
from pipelines.report.style import format_number
from pipelines.simulation.imitate import Course, Imitation


def simulation_report(
    model: str, faults: Sequence[str], logs: Sequence[Imitation], tracking: Sequence[Array | None]
) -> Report:
    """Verdict, key figures, one section a log.

    Args:
        tracking: (joints,) the measured tracking error of each log. [rad]
    """
    return document(
        "simulation",
        "neutral",
        model=model,
        faults=faults,
        logs=logs,
        pairs=list(zip(logs, tracking, strict=True)),
        how=_how,
        worst=_worst(logs, tracking),
        figures=_figures,
    )


def _how(one: Imitation) -> str:
    return "windows" if one.simulation == "windowed" else "closed loop"


def _worst(logs: Sequence[Imitation], tracking: Sequence[Array | None]) -> dict[str, object] | None:
    """The log whose simulation is farthest off; one without feedback only where all are so."""
    compared = [
        (one, one.position_rms, error)
        for one, error in zip(logs, tracking, strict=True)
        if one.position_rms is not None
    ]
    kept = [one for one in compared if _how(one[0]) == "closed loop"] or compared
    if not kept:
        return None
    log, rms, error = max(kept, key=lambda one: float(one[1].max()))
    joint = int(np.argmax(rms))
    off, beside = float(rms[joint]), []
    if error is not None and error[joint] > 0.0:
        share = format_number(100.0 * off / float(error[joint]), 2)
        beside.append(f"{share} % of the tracking error")
    if log.noise_rms is not None and log.noise_rms[joint] > 0.0:
        times = format_number(off / float(log.noise_rms[joint]), 2)
        beside.append(f"{times} times what other noise makes")
    context = {"log": log, "off": off, "unit": log.units[joint], "joint": joint + 1}
    return context | {"alike": len(kept), "compared": len(compared), "beside": beside}


def _figures(one: Imitation, s: Course) -> list[Figure]:
    unit, name = one.units[0], one.name
    position = {"measured": s.position, "simulated": s.position_simulated}
    caption = f"{name}: position, measured and simulated."
    difference = f"{name}: simulated minus measured position."
    figures = [
        signals_figure(f"position-{name}", caption, s.t, position, f"position [{unit}]"),
        joint_signal_figure(f"position-difference-{name}", difference, s.t, s.position_difference,
                            f"simulated − measured [{unit}]"),
    ]  # fmt: skip
    if s.torque is not None and s.torque_simulated is not None:
        torque = {"measured": s.torque, "simulated": s.torque_simulated}
        caption = f"{name}: torque that the controller commanded, measured and simulated."
        quantity = f"torque [{one.torque_units[0]}]"
        figures.append(signals_figure(f"torque-{name}", caption, s.t, torque, quantity))
    return figures

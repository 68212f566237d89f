"""The picture of what is wrong, before any name: measured over predicted, and the residual over everything it may depend on."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.diagnosis.result import Diagnosis
from pipelines.model.rows.residual_analysis import Curve, Evidence, Spectrum
from pipelines.report import style
from pipelines.report.diagnosis_floor import floor_words
from pipelines.report.figures import broken_at_gaps, draw_measured, draw_modelled, envelope, joint_axes, joint_size
from pipelines.report.joint_units import Units
from pipelines.report.report import Figure, Section, Table
from pipelines.report.sections import joint_signal_figure
from pipelines.report.style import format_number, format_unit, three_digits, to_one_place

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

__all__ = ["picture_sections"]

_COLUMNS = 3  # small figures side by side
_SHOWN = 6  # curves of a joint


def picture_sections(found: Diagnosis, rated: Sequence[float], units: Units) -> list[Section]:
    """One section for each log that is shown."""
    return [_section(found, one, rated, k, units) for k, one in enumerate(found.evidence)]


def _section(found: Diagnosis, one: Evidence, rated: Sequence[float], number: int, units: Units) -> Section:
    suffix = f"-{number + 1}" if number else ""
    return Section(f"What is wrong, before any name: {one.log}", (floor_words(found),),
                   (_above(found, one, rated, units), _tells(one)), tuple(_figures(one, suffix, units)))


def _above(found: Diagnosis, one: Evidence, rated: Sequence[float], units: Units) -> Table:
    joints, rows = len(one.above_noise_floor), []
    torques = to_one_place([float(x) for one_rms in (found.residual_rms.identify, found.residual_rms.noise_floor) for x in one_rms])
    for j in range(joints):
        residual = float(found.residual_rms.identify[j])
        share = 100.0 * residual / rated[j] if j < len(rated) and math.isfinite(rated[j]) else None
        low, high = one.band[j]
        band = f"{format_number(float(low), 2)} to {format_number(float(high), 2)}" if np.isfinite([low, high]).all() else None
        rows.append((j + 1, torques[j], three_digits(share), torques[joints + j],
                     three_digits(100.0 * float(one.above_noise_floor[j])), band))
    columns = ("joint", f"residual, rms [{units.torque}]", "residual [% of rated]", f"floor [{units.torque}]",
               "power above the floor [%]", "mostly at [Hz]")
    return Table(columns, tuple(rows), "Of the nominal model, refitted to these logs.")


def _tells(one: Evidence) -> Table:
    """What of each joint's residual goes with which signal."""
    joints = sorted({c.joint for c in one.curves})
    share = {(c.against, c.joint): c.explained for c in one.curves}
    names = sorted({c.against for c in one.curves}, key=lambda name: -max(share.get((name, j), 0.0) for j in joints))
    rows = tuple((name, *(round(100.0 * share[name, j], 1) if (name, j) in share else None for j in joints)) for name in names)
    return Table(("signal", *(f"joint {j} [%]" for j in joints)), rows,
                 "Of the residual's power, what survives averaging in bins of each signal: that much may depend on it.",
                 keeps_empty=True)


def _figures(one: Evidence, suffix: str, units: Units) -> list[Figure]:
    torque, joints = units.torque, one.residual.shape[1]
    found = [Figure(f"torque-predicted{suffix}", "Torque, measured and predicted by the nominal model.",
                    lambda drawing: _compared(joint_axes(drawing, joints), one, torque), joint_size(joints)),
             joint_signal_figure(f"residual{suffix}", "Residual over time: measured minus predicted torque.", one.t, one.residual,
                                 torque, quantity="residual")]
    if one.simulated_t is not None and one.simulated_position_error is not None:
        found.append(Figure(f"position-error{suffix}", "What the simulation gets wrong: simulated minus measured position, in "
                            f"closed loop with controller and references of {one.simulated_log}, over its first "
                            f"{one.simulated_t[-1]:.0f} s.",
                            lambda drawing: _simulated(joint_axes(drawing, joints), one, units.thousandths), joint_size(joints)))
    for over, words in (("order", "Orders of the joint's angle, from those on "
                         "that its range resolves: a peak at k is a torque that repeats k times a turn."),
                        ("frequency", "Spectrum of the residual.")):
        spectra = [s for s in one.spectra if s.over == over]
        if spectra:
            found.append(Figure(f"residual-{over}{suffix}", words, _spectra(spectra, torque),
                                (6.0, 0.8 + 1.2 * len(spectra))))
    for joint in range(1, joints + 1):
        curves = sorted((c for c in one.curves if c.joint == joint), key=lambda c: -c.explained)[:_SHOWN]
        if curves:
            rows = -(-len(curves) // _COLUMNS)
            found.append(Figure(f"residual-{joint}-over{suffix}", f"Residual of joint {joint} over the signals it follows most, "
                                "the strongest first: mean in bins, shaded its spread.",
                                _small(curves, units.at(joint).torque), (6.0, 0.6 + 1.7 * rows)))
    return found


def _compared(axes: Sequence[Axes], one: Evidence, unit: str) -> None:
    for j, axis in enumerate(axes):
        draw_measured(axis, *envelope(*broken_at_gaps(one.t, one.measured[:, j])))
        draw_modelled(axis, *envelope(*broken_at_gaps(one.t, one.predicted[:, j])), "predicted")
    _over_time(axes, f"torque [{unit}]")


def _simulated(axes: Sequence[Axes], one: Evidence, unit: str) -> None:
    t, nominal, extended = one.simulated_t, one.simulated_position_error, one.extended_position_error
    assert t is not None  # no figure is made without
    assert nominal is not None
    for j, axis in enumerate(axes):
        axis.plot(t, 1e3 * nominal[:, j], color=style.SKY, linewidth=2.4, label="nominal model")
        if extended is not None:
            axis.plot(t, 1e3 * extended[:, j], color=style.VERMILLION, linewidth=0.9, label="with the findings")
    _over_time(axes, f"simulated − measured [{unit}]")


def _over_time(axes: Sequence[Axes], quantity: str) -> None:
    for j, axis in enumerate(axes):
        axis.set_title(f"joint {j + 1}", pad=3.0)
        axis.margins(x=0.01, y=0.1)
        axis.locator_params(axis="y", nbins=4)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0, ncols=2)
    axes[-1].set_xlabel("time [s]")
    if figure := axes[0].get_figure():
        figure.supylabel(quantity, fontsize="medium")


def _spectra(spectra: Sequence[Spectrum], unit: str) -> Callable[[Drawing], None]:
    def draw(drawing: Drawing) -> None:
        for axis, one in zip(joint_axes(drawing, len(spectra)), spectra, strict=True):
            axis.plot(one.x, one.amplitude, color=style.BLUE, linewidth=1.0)
            axis.set_title(f"joint {one.joint}", pad=3.0)
            axis.margins(x=0.01)
            axis.set_ylim(bottom=0.0)
            axis.locator_params(axis="y", nbins=4)
        drawing.axes[-1].set_xlabel(f"{'order' if spectra[0].over == 'order' else 'frequency'} [{format_unit(spectra[0].unit)}]")
        drawing.supylabel(f"amplitude [{unit}]", fontsize="medium")

    return draw


def _small(curves: Sequence[Curve], unit: str) -> Callable[[Drawing], None]:
    def draw(drawing: Drawing) -> None:
        rows = -(-len(curves) // _COLUMNS)
        axes = drawing.subplots(rows, _COLUMNS, sharey=True, squeeze=False).ravel()
        for axis, one in zip(axes, curves, strict=False):
            axis.fill_between(one.x, one.mean - one.spread, one.mean + one.spread, color=style.SKY, alpha=0.35, linewidth=0.0)
            axis.plot(one.x, one.mean, color=style.BLUE, linewidth=1.2)
            axis.set_xlabel(f"{one.against} [{format_unit(one.unit)}]", fontsize="small")
            axis.locator_params(nbins=4)
        for axis in axes[len(curves):]:
            axis.set_visible(False)
        drawing.supylabel(f"residual [{unit}]", fontsize="medium")

    return draw

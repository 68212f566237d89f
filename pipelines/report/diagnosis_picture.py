"""The residual analysis: measured over predicted, and the residual over what it may depend on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.diagnosis.result import Diagnosis
from pipelines.estimation.residual_analysis import Curve, Evidence, Spectrum
from pipelines.io.log import Array
from pipelines.report import style
from pipelines.report.figures import (
    Look,
    broken_at_gaps,
    compared_figure,
    joint_names,
    joint_signal_figure,
    rows_figure,
)
from pipelines.report.report import Cell, Figure, Section, Table, columns_table
from pipelines.report.style import format_number, format_unit, three_digits, to_one_place
from pipelines.report.words import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_COLUMNS = 3  # numerics: small figures side by side
_SHOWN = 6  # numerics: curves of a joint
_SPECTRA = {
    "order": "Orders of the joint's angle, from those on that its range resolves: a peak at k is a "
    "torque that repeats k times a turn.",
    "frequency": "Spectrum of the residual.",
}


def picture_sections(
    found: Diagnosis, rated: Sequence[float], units: Units, floor: str
) -> list[Section]:
    """One section for each log that is shown; `floor`: where the noise floor comes from."""
    sections = []
    for k, one in enumerate(found.evidence):
        figures = residual_figures(one, f"-{k + 1}" if k else "", units)
        tables = (_above_floor(found, one, rated, units), _signals(one))
        title = f"Residual analysis: {one.log}"
        sections.append(Section(title, (floor,), tables, tuple(figures)))
    return sections


def _above_floor(found: Diagnosis, one: Evidence, rated: Sequence[float], units: Units) -> Table:
    """The residual of each joint beside its floor, and in which band most of it is."""
    joints = len(one.above_noise_floor)
    residual = found.residual_rms.identify
    torques = to_one_place([float(x) for x in (*residual, *found.residual_rms.noise_floor)])
    shares, bands = [], []
    for j in range(joints):
        known = j < len(rated) and math.isfinite(rated[j])
        shares.append(three_digits(100.0 * float(residual[j]) / rated[j] if known else None))
        ends = [format_number(float(end), 2) for end in one.band[j]]
        bands.append(" to ".join(ends) if np.isfinite(one.band[j]).all() else None)
    columns: dict[str, Sequence[Cell]] = {
        "joint": range(1, joints + 1),
        f"residual, rms [{units.torque}]": torques[:joints],
        "residual [% of rated]": shares,
        f"floor [{units.torque}]": torques[joints : 2 * joints],
        "power above the floor [%]": [
            three_digits(100.0 * float(x)) for x in one.above_noise_floor
        ],
        "mostly at [Hz]": bands,
    }
    return columns_table(columns, "Of the nominal model, refitted to these logs.")


def _signals(one: Evidence) -> Table:
    """Return the share of each joint's residual that follows each signal."""
    joints = sorted({c.joint for c in one.curves})
    share = {(c.against, c.joint): c.explained for c in one.curves}
    most: dict[str, float] = {}
    for (name, _), explained in share.items():
        most[name] = max(most.get(name, 0.0), explained)
    rows = []
    for name in sorted(most, key=lambda name: -most[name]):
        own = (share.get((name, j)) for j in joints)
        rows.append((name, *(None if x is None else round(100.0 * x, 1) for x in own)))
    caption = (
        "Of the residual's power, what survives averaging in bins of each signal: that much may "
        "depend on it."
    )
    columns = ("signal", *(f"joint {j} [%]" for j in joints))
    return Table(columns, tuple(rows), caption, keeps_empty=True)


def residual_figures(one: Evidence, suffix: str, units: Units) -> list[Figure]:
    """Torque and residual over time, simulated position, spectra, curves over signals."""
    torque, joints = units.torque, one.residual.shape[1]
    _, measured = broken_at_gaps(one.t, one.measured)
    t, predicted = broken_at_gaps(one.t, one.predicted)
    found = [
        compared_figure(
            f"torque-predicted{suffix}",
            "Torque, measured and predicted by the nominal model.",
            t,
            measured,
            predicted,
            f"torque [{torque}]",
            "predicted",
        ),
        joint_signal_figure(
            f"residual{suffix}",
            "Residual over time: measured minus predicted torque.",
            one.t,
            one.residual,
            torque,
            quantity="residual",
        ),
    ]
    if one.simulated_t is not None and one.simulated_position_error is not None:
        t, error = one.simulated_t, one.simulated_position_error
        found.append(_simulated_figure(one, t, error, suffix, units.thousandths))
    for over, caption in _SPECTRA.items():
        spectra = [s for s in one.spectra if s.over == over]
        if spectra:
            found.append(_spectra_figure(f"residual-{over}{suffix}", caption, spectra, torque))
    for joint in range(1, joints + 1):
        own = sorted((c for c in one.curves if c.joint == joint), key=lambda c: -c.explained)
        if own:
            name, unit = f"residual-{joint}-over{suffix}", units.at(joint).torque
            found.append(_curves_figure(name, own[:_SHOWN], unit))
    return found


def _simulated_figure(one: Evidence, t: Array, error: Array, suffix: str, unit: str) -> Figure:
    """Position that the nominal and the extended model miss in closed loop."""
    extended = one.extended_position_error

    def draw_row(axis: Axes, j: int) -> None:
        axis.plot(t, 1e3 * error[:, j], color=style.SKY, linewidth=2.4, label="nominal model")
        if extended is not None:
            look: Look = {"color": style.VERMILLION, "linewidth": 0.9, "label": "with the findings"}
            axis.plot(t, 1e3 * extended[:, j], **look)

    caption = (
        "What the simulation gets wrong: simulated minus measured position, in closed loop with "
        f"controller and references of {one.simulated_log}, over its first {t[-1]:.0f} s."
    )
    quantity, names = f"simulated − measured [{unit}]", joint_names(error.shape[1])
    return rows_figure(f"position-error{suffix}", caption, names, draw_row, quantity, legend=2)


def _spectra_figure(name: str, caption: str, spectra: Sequence[Spectrum], unit: str) -> Figure:
    def draw_row(axis: Axes, k: int) -> None:
        axis.plot(spectra[k].x, spectra[k].amplitude, color=style.BLUE, linewidth=1.0)
        axis.set_ylim(bottom=0.0)

    x = "order" if spectra[0].over == "order" else "frequency"
    x = f"{x} [{format_unit(spectra[0].unit)}]"
    names = [f"joint {one.joint}" for one in spectra]
    return rows_figure(name, caption, names, draw_row, f"amplitude [{unit}]", x=x, row=1.2)


def _curves_figure(name: str, curves: Sequence[Curve], unit: str) -> Figure:
    """The residual over several signals, mean in bins and its spread."""
    rows = -(-len(curves) // _COLUMNS)

    def draw(drawing: Drawing) -> None:
        axes = drawing.subplots(rows, _COLUMNS, sharey=True, squeeze=False).ravel()
        shade: Look = {"color": style.SKY, "alpha": 0.35, "linewidth": 0.0}
        for axis, one in zip(axes, curves, strict=False):
            axis.fill_between(one.x, one.mean - one.spread, one.mean + one.spread, **shade)
            axis.plot(one.x, one.mean, color=style.BLUE, linewidth=1.2)
            axis.set_xlabel(f"{one.against} [{format_unit(one.unit)}]", fontsize="small")
            axis.locator_params(nbins=4)
        for axis in axes[len(curves) :]:
            axis.set_visible(False)
        drawing.supylabel(f"residual [{unit}]", fontsize="medium")

    caption = (
        f"Residual of joint {curves[0].joint} over the signals it follows most, the strongest "
        "first: mean in bins, shaded its spread."
    )
    return Figure(name, caption, draw, (6.0, 0.6 + 1.7 * rows))

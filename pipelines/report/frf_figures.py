"""Figures of frequency responses: Fig. 17's Bode plots with coherence, the rest beside a rigid body, compliance, friction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.model.frf.controller import Complex
from pipelines.model.frf.responses import double_integrator
from pipelines.model.frf.result import COHERENCE, Band, Curve, Method, ModeFound, Posture, same_bins
from pipelines.report import style
from pipelines.report.figures import Array
from pipelines.report.report import Figure
from pipelines.signal.excited_band import ExcitedBand

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

__all__ = ["bode_figure", "compliance_figure", "friction_figure", "posture_words", "relative_figure"]

_CONFIDENCE = float(np.sqrt(-np.log(0.05)))  # radius of the disc that holds the response with 95 %, in standard deviations
_DECADE = 5.0  # values that span more are drawn on a logarithmic axis
_HIGHEST = 2.5  # of the level of the rigid body: what lies beyond is noise
_LOW = 10.0  # [Hz] up to which friction and reversal are shown
_LOOKS = {"indirect": (style.GREEN, 1.6, (0, (4, 2))), "direct": (style.ORANGE, 0.9, "-"), "closed-loop": (style.BLUE, 1.1, "-")}


def posture_words(posture: Array, joint: int) -> str:
    """The angles of the held joints: "q2, q3 = 0, 1.57 rad"."""
    held = [k for k in range(len(posture)) if k != joint - 1]
    names = ", ".join(f"q{k + 1}" for k in held)
    return f"{names} = {', '.join(f'{posture[k]:.3g}' for k in held)} rad" if held else "the only joint"


def bode_figure(joint: int, drawn: Sequence[tuple[Posture, Mapping[str, Method]]]) -> Figure:
    """Magnitude, phase and coherence, one column a posture; Fig. 17."""
    unit = "rad/(rad/s²)" if drawn[0][0].input == "r" else "rad/(N m)"

    def draw(drawing: Drawing) -> None:
        grid = drawing.subplots(3, len(drawn), sharex=True, sharey="row", squeeze=False, height_ratios=(3, 2, 1.2))
        for column, (posture, methods) in zip(grid.T, drawn, strict=True):
            draw_bode(column, posture, methods)
            column[0].set_title(posture_words(posture.posture, joint), pad=3.0)
            column[2].set_xlabel("frequency [Hz]")
        grid[0, 0].set_ylabel(f"|P| [{unit}]")
        grid[1, 0].set_ylabel("phase [°]")
        grid[2, 0].set_ylabel("coherence")
        grid[0, -1].legend(loc="lower left", fontsize="small")

    return Figure(f"bode-{joint}", f"Joint {joint}: input to position, with 95 % bands. Vertical lines: resonances "
                  f"(solid) and antiresonances (dashed). Grey: coherence under {COHERENCE:g}, not reliable; hatched: outside "
                  "the excited band, where nothing is fitted or named. Besides the default, the other methods are drawn where v "
                  "excites the joint and their own coherence is not under that.", draw, (6.4, 5.6))


def draw_bode(axes: Sequence[Axes], posture: Posture, methods: Mapping[str, Method]) -> None:
    """Into magnitude, phase and coherence axes."""
    size, phase, coherence = axes
    default = methods["closed-loop"]
    f, value = default.curve.frequency, default.curve.value
    reliable = default.curve.coherence >= 0.3
    unit = _unit_inertia(posture, default)
    rigid = np.abs(unit) * abs(posture.expected_level or posture.level.value)
    size.loglog(f, rigid, color=style.GREY, linewidth=1.0, linestyle=":", label="rigid body")
    phase.semilogx(f, _phase(unit), color=style.GREY, linewidth=1.0, linestyle=":")
    for name in ("direct", "indirect", "closed-loop"):
        if (method := methods.get(name)) is not None:
            color, width, line = _LOOKS[name]
            curve, own = method.curve, method.curve.coherence
            excited = same_bins(f, curve.frequency, default.resolution)[1]
            judged = excited & ((own >= COHERENCE) | (name == "closed-loop"))
            shown = np.where(judged, curve.value, np.nan)
            size.loglog(curve.frequency, np.abs(shown), color=color, linewidth=width, linestyle=line, label=_label(name))
            phase.semilogx(curve.frequency, _phase(shown), color=color, linewidth=width, linestyle=line)
            own = np.where(excited, own, np.nan)
            coherence.semilogx(curve.frequency, own, color=color, linewidth=min(width, 1.0), linestyle=line)
    band = _CONFIDENCE * default.curve.std
    size.fill_between(f, np.maximum(np.abs(value) - band, 1e-3 * np.abs(value)), np.abs(value) + band, color=style.SKY, alpha=0.5,
                      linewidth=0.0)
    share = band / np.maximum(np.abs(value), 1e-300)
    turn = np.where(share < 1.0, np.rad2deg(np.arcsin(np.minimum(share, 1.0))), 180.0)  # of the disc, seen from the origin
    phase.fill_between(f, _phase(value) - turn, _phase(value) + turn, color=style.SKY, alpha=0.5, linewidth=0.0)
    low, high = np.quantile(np.abs(value[reliable]) if reliable.any() else np.abs(value), (0.0, 1.0))
    size.set_ylim(0.3 * low, 2.0 * high)
    phase.set_ylim(-370.0, 10.0)
    phase.set_yticks((-360, -270, -180, -90, 0))
    coherence.set_ylim(0.0, 1.05)
    coherence.axhline(COHERENCE, color=style.GREY, linewidth=0.8)
    half = 0.5 * default.resolution
    for low, high in default.coherence_below_0_7_hz:
        for axis in axes:
            axis.axvspan(low - half, high + half, color=style.GREY, alpha=0.15, linewidth=0.0)
    for low, high in outside(posture.excited, float(f[0]), float(f[-1])):
        for axis in axes:
            axis.axvspan(low, high, facecolor="none", edgecolor=style.GREY, alpha=0.4, hatch="///", linewidth=0.0)
    mark_modes(axes[:2], default.modes)
    for axis in axes:
        style.log_ticks(axis.xaxis)
    style.log_ticks(size.yaxis)
    coherence.set_xlim(f[0], f[-1])


def outside(intervals: Sequence[Band], low: float, high: float) -> list[Band]:
    """What of `low` to `high` [Hz] lies in none of the `intervals`."""
    edges = [low, *(edge for interval in intervals for edge in interval), high]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]


def _unit_inertia(posture: Posture, method: Method) -> Complex:
    """Position per input of a rigid body of unit inertia (bins,), at the frequencies of `method`."""
    if posture.others_held:  # its relative response has other bins
        return np.asarray(double_integrator(method.curve.frequency, posture.sample_time), dtype=np.complex128)
    return np.asarray(method.curve.value / posture.relative.value)


def _label(name: str) -> str:
    return {"closed-loop": "Φvq/Φvu (default)", "indirect": "indirect", "direct": "direct"}[name]


def _phase(value: np.ndarray) -> Array:  # type: ignore[type-arg]
    """[°] between -360 and 0: a double integrator lies in the middle."""
    return np.asarray(np.rad2deg(np.angle(-value)) - 180.0)


def mark_modes(axes: Sequence[Axes], modes: Sequence[ModeFound]) -> None:
    for mode in modes:
        for axis in axes:
            axis.axvline(mode.frequency.value, color=style.VERMILLION, linewidth=0.8,
                         linestyle="-" if mode.kind == "resonance" else "--", zorder=0.5)


def relative_figure(joint: int, postures: Sequence[Posture]) -> Figure:
    """Acceleration per input: a rigid body is flat. Measured points, the rational function over them."""

    def draw(drawing: Drawing) -> None:
        size, phase = drawing.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for k, posture in enumerate(postures):
            color, measured, fit = style.COLOURS[k % len(style.COLOURS)], posture.relative, posture.fit
            good = (measured.coherence >= 0.5) & ExcitedBand(posture.excited).holds(measured.frequency)
            size.semilogx(measured.frequency[good], np.abs(measured.value[good]), ".", markersize=2.0, color=color, alpha=0.5)
            size.semilogx(fit.frequency, np.abs(fit.value), color=color, label=posture_words(posture.posture, joint))
            phase.semilogx(measured.frequency[good], np.rad2deg(np.angle(measured.value[good])), ".", markersize=2.0, color=color,
                           alpha=0.5)
            phase.semilogx(fit.frequency, np.rad2deg(np.angle(fit.value)), color=color)
        fitted_scale(size, np.concatenate([np.abs(p.fit.value) for p in postures]))
        size.set_ylabel("acceleration per input")
        phase.set_ylabel("phase [°]")
        phase.set_xlabel("frequency [Hz]")
        phase.set_ylim(-190.0, 190.0)
        phase.set_yticks((-180, -90, 0, 90, 180))
        size.legend(loc="best", fontsize="small")
        style.log_ticks(phase.xaxis)

    return Figure(f"relative-{joint}", f"Joint {joint}: the response over that of a double integrator (points; in the excited "
                  "band, under PD with the motion of other joints taken out), and the rational function "
                  " of the modes (lines). A rigid body is flat, a delay turns the phase alone.", draw, (6.0, 4.0))


def fitted_scale(axis: Axes, values: Array) -> None:
    """The range of `values` with room about it; logarithmic where they span more than a factor of five."""
    low, high = float(values.min()), float(values.max())
    if high < _DECADE * low:
        axis.set_ylim(0.7 * low, 1.3 * high)
        return
    axis.set_yscale("log")
    axis.set_ylim(0.6 * low, 1.7 * high)
    style.log_ticks(axis.yaxis)


def compliance_figure(joint: int, postures: Sequence[Posture]) -> Figure:
    """Compliance q/τ and accelerance q̈/τ, with those of the rigid body."""
    units = ("rad/(N m)", "1/(kg m²)") if postures[0].revolute else ("m/N", "1/kg")

    def draw(drawing: Drawing) -> None:
        axes = drawing.subplots(1, 2)
        for k, posture in enumerate(postures):
            color, curve = style.COLOURS[k % len(style.COLOURS)], posture.compliance
            good = (curve.coherence >= 0.5) & ExcitedBand(posture.excited).holds(curve.frequency)
            f = curve.frequency[good]
            square = (2.0 * np.pi * f) ** 2
            axes[0].loglog(f, np.abs(curve.value[good]), color=color, label=posture_words(posture.posture, joint))
            axes[1].semilogx(f, np.abs(curve.value[good]) * square, color=color)
            if posture.expected_inertia is not None:
                axes[0].loglog(f, 1.0 / (posture.expected_inertia * square), color=color, linestyle=":", linewidth=0.9)
                axes[1].axhline(1.0 / posture.expected_inertia, color=color, linestyle=":", linewidth=0.9)
        for axis, name, unit in zip(axes, ("compliance", "accelerance"), units, strict=True):
            axis.set_title(f"{name} [{unit}]", pad=3.0)
            axis.set_xlabel("frequency [Hz]")
            style.log_ticks(axis.xaxis)
        style.log_ticks(axes[0].yaxis)
        per_torque = [np.abs(p.fit.value) / (p.level.value * p.inertia.value) for p in postures if p.inertia is not None]
        if per_torque:
            fitted_scale(axes[1], np.concatenate(per_torque))
        axes[0].legend(loc="lower left", fontsize="small")

    return Figure(f"compliance-{joint}", f"Joint {joint}: compliance and accelerance by torque. Dotted: the model's rigid body.",
                  draw, (6.4, 3.2))


def friction_figure(joint: int, postures: Sequence[Posture], methods: Sequence[Method]) -> Figure:
    """Low frequencies: at constant speed, and of the whole log with its reversal."""

    def draw(drawing: Drawing) -> None:
        axis = drawing.subplots()
        for k, (posture, method) in enumerate(zip(postures, methods, strict=True)):
            color = style.COLOURS[k % len(style.COLOURS)]
            relative = posture.relative
            low = relative.frequency <= _LOW
            draw_low(axis, relative, low, color, posture_words(posture.posture, joint))
            if posture.with_reversal is not None:
                other = posture.with_reversal
                part = other.frequency <= _LOW
                unit = np.interp(other.frequency[part], method.curve.frequency, np.abs(_unit_inertia(posture, method)))
                axis.semilogx(other.frequency[part], np.abs(other.value[part]) / unit, color=color, linewidth=0.9, linestyle="--")
            axis.axhline(posture.level.value, color=color, linewidth=0.7, linestyle=":")
        axis.set_xlabel("frequency [Hz]")
        axis.set_ylabel("acceleration per input")
        axis.set_ylim(0.0, _HIGHEST * max(abs(p.level.value) for p in postures))
        axis.legend(loc="lower right", fontsize="small")
        style.log_ticks(axis.xaxis)

    return Figure(f"friction-{joint}", f"Joint {joint}: what friction leaves at low frequencies. Solid: at constant speed, ± 2 "
                  "std. Dashed: the whole log, its reversal included. Dotted: the rigid body measured above friction.", draw,
                  (6.0, 2.8))


def draw_low(axis: Axes, curve: Curve, low: np.ndarray, color: str, label: str) -> None:  # type: ignore[type-arg]
    f, size, band = curve.frequency[low], np.abs(curve.value[low]), np.sqrt(2.0) * curve.std[low]
    axis.fill_between(f, np.maximum(size - band, 0.0), size + band, color=color, alpha=0.2, linewidth=0.0)
    axis.semilogx(f, size, color=color, label=label)

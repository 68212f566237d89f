"""Figures of frequency responses: Fig. 17's Bode plots, the rigid body and the modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.frequency.controller import double_integrator
from pipelines.frequency.rational import Mode
from pipelines.frequency.result import COHERENCE, Curve, Method, Posture, same_bins
from pipelines.frequency.spectra import Complex, Intervals, inside
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.figures import Array, Look, joint_colour, legend
from pipelines.report.report import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_CONFIDENCE = float(np.sqrt(-np.log(0.05)))  # [std] radius of the disc that holds it with 95 %
_DECADE = 5.0  # numerics: values that span more are drawn on a logarithmic axis
_METHODS = {
    "direct": ("direct", style.ORANGE, 0.9, "-"),
    "indirect": ("indirect", style.GREEN, 1.6, (0, (4, 2))),
    "closed-loop": ("Φvq/Φvu (default)", style.BLUE, 1.1, "-"),
}


def posture_words(posture: Array, joint: int) -> str:
    """The angles of the held joints: "q2, q3 = 0, 1.57 rad"."""
    held = [k for k in range(len(posture)) if k != joint - 1]
    if not held:
        return "the only joint"
    names, angles = (f"q{k + 1}" for k in held), (f"{posture[k]:.3g}" for k in held)
    return f"{', '.join(names)} = {', '.join(angles)} rad"


def bode_figure(
    joint: int, drawn: Sequence[tuple[Posture, Mapping[str, Method]]], caption: str
) -> Figure:
    """Magnitude, phase and coherence, one column a posture; Fig. 17."""
    unit = "rad/(rad/s²)" if drawn[0][0].input == "r" else "rad/(N m)"
    heights = (3, 2, 1.2)

    def draw(drawing: Drawing) -> None:
        grid = drawing.subplots(
            3, len(drawn), sharex=True, sharey="row", squeeze=False, height_ratios=heights
        )
        for column, (posture, methods) in zip(grid.T, drawn, strict=True):
            draw_bode(column, posture, methods)
            column[0].set_title(posture_words(posture.posture, joint), pad=3.0)
            column[2].set_xlabel("frequency [Hz]")
        for axis, label in zip(
            grid[:, 0], (f"|P| [{unit}]", "phase [°]", "coherence"), strict=True
        ):
            axis.set_ylabel(label)
        legend(grid[0, -1])

    return Figure(f"bode-{joint}", caption, draw, (6.4, 5.6))


def draw_bode(axes: Sequence[Axes], posture: Posture, methods: Mapping[str, Method]) -> None:
    """Into magnitude, phase and coherence axes."""
    size, phase, coherence = axes
    default = methods["closed-loop"]
    f = default.curve.frequency
    unit = _unit_inertia(posture, default)
    rigid = np.abs(unit) * abs(posture.expected_level or posture.level.value)
    dotted: Look = {"color": style.GREY, "linewidth": 1.0, "linestyle": ":"}
    size.loglog(f, rigid, label="rigid body", **dotted)
    phase.semilogx(f, _phase(unit), **dotted)
    for name in _METHODS:
        if name in methods:
            _draw_method(axes, name, methods[name], default)
    _draw_confidence(size, phase, default.curve)
    phase.set_ylim(-370.0, 10.0)
    phase.set_yticks((-360, -270, -180, -90, 0))
    coherence.set_ylim(0.0, 1.05)
    coherence.axhline(COHERENCE, color=style.GREY, linewidth=0.8)
    half = 0.5 * default.resolution
    shade: Look = {"color": style.GREY, "alpha": 0.15, "linewidth": 0.0}
    hatch: Look = {"facecolor": "none", "edgecolor": style.GREY, "alpha": 0.4, "hatch": "///"}
    for axis in axes:
        for low, high in default.coherence_below_0_7_hz:
            axis.axvspan(low - half, high + half, **shade)
        for low, high in outside(posture.excited, float(f[0]), float(f[-1])):
            axis.axvspan(low, high, linewidth=0.0, **hatch)
        style.log_ticks(axis.xaxis)
    mark_modes(axes[:2], default.modes)
    style.log_ticks(size.yaxis)
    coherence.set_xlim(f[0], f[-1])


def _draw_method(axes: Sequence[Axes], name: str, method: Method, default: Method) -> None:
    """One method: where v excites the joint and, but for the default, where it is coherent."""
    label, color, width, line = _METHODS[name]
    f, own = method.curve.frequency, method.curve.coherence
    excited = same_bins(default.curve.frequency, f, default.resolution)[1]
    judged = excited & ((own >= COHERENCE) | (name == "closed-loop"))
    shown = np.where(judged, method.curve.value, np.nan)
    look: Look = {"color": color, "linestyle": line}
    axes[0].loglog(f, np.abs(shown), linewidth=width, label=label, **look)
    axes[1].semilogx(f, _phase(shown), linewidth=width, **look)
    axes[2].semilogx(f, np.where(excited, own, np.nan), linewidth=min(width, 1.0), **look)


def _draw_confidence(size: Axes, phase: Axes, curve: Curve) -> None:
    """95 % bands, and the range of the reliable part as the scale of the magnitude."""
    f, magnitude, angle = curve.frequency, np.abs(curve.value), _phase(curve.value)
    band = _CONFIDENCE * curve.std
    look: Look = {"color": style.SKY, "alpha": 0.5, "linewidth": 0.0}
    size.fill_between(f, np.maximum(magnitude - band, 1e-3 * magnitude), magnitude + band, **look)
    share = band / np.maximum(magnitude, 1e-300)
    turn = np.rad2deg(np.arcsin(np.minimum(share, 1.0)))  # of the disc, seen from the origin
    turn = np.where(share < 1.0, turn, 180.0)
    phase.fill_between(f, angle - turn, angle + turn, **look)
    reliable = curve.coherence >= REPORT.scaled_by
    low, high = np.quantile(magnitude[reliable] if reliable.any() else magnitude, (0.0, 1.0))
    size.set_ylim(0.3 * low, 2.0 * high)


def outside(intervals: Intervals, low: float, high: float) -> Intervals:
    """Return the parts of `low` to `high` [Hz] outside all `intervals`."""
    edges = [low, *(edge for interval in intervals for edge in interval), high]
    return tuple((a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a)


def _unit_inertia(posture: Posture, method: Method) -> Complex:
    """Position per input of a rigid body of unit inertia (bins,), at the bins of `method`."""
    if posture.others_held:  # its relative response has other bins
        response = double_integrator(method.curve.frequency, posture.sample_time)
        return np.asarray(response, dtype=np.complex128)
    return np.asarray(method.curve.value / posture.relative.value)


def _phase(value: Complex) -> Array:
    """[°] between -360 and 0: a double integrator lies in the middle."""
    return np.asarray(np.rad2deg(np.angle(-value)) - 180.0)


def mark_modes(axes: Sequence[Axes], modes: Sequence[Mode]) -> None:
    for mode in modes:
        line = "-" if mode.kind == "resonance" else "--"
        look: Look = {"color": style.VERMILLION, "linewidth": 0.8, "linestyle": line, "zorder": 0.5}
        for axis in axes:
            axis.axvline(mode.frequency.value, **look)


def _good_points(curve: Curve, posture: Posture) -> tuple[Array, Complex]:
    """Frequencies and values that are coherent and in the excited band."""
    good = (curve.coherence >= REPORT.coherent) & inside(posture.excited, curve.frequency)
    return curve.frequency[good], curve.value[good]


def relative_figure(joint: int, postures: Sequence[Posture], caption: str) -> Figure:
    """Acceleration per input: points, and the rational function over them."""

    def draw(drawing: Drawing) -> None:
        size, phase = drawing.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for k, posture in enumerate(postures):
            color, fit = joint_colour(k), posture.fit
            f, value = _good_points(posture.relative, posture)
            for axis, points, line in (
                (size, np.abs(value), np.abs(fit.value)),
                (phase, np.rad2deg(np.angle(value)), np.rad2deg(np.angle(fit.value))),
            ):
                axis.semilogx(f, points, ".", markersize=2.0, color=color, alpha=0.5)
                label = posture_words(posture.posture, joint)
                axis.semilogx(fit.frequency, line, color=color, label=label)
        fitted_scale(size, np.concatenate([np.abs(p.fit.value) for p in postures]))
        size.set_ylabel("acceleration per input")
        phase.set_ylabel("phase [°]")
        phase.set_xlabel("frequency [Hz]")
        phase.set_ylim(-190.0, 190.0)
        phase.set_yticks((-180, -90, 0, 90, 180))
        legend(size)
        style.log_ticks(phase.xaxis)

    return Figure(f"relative-{joint}", caption, draw, (6.0, 4.2))


def fitted_scale(axis: Axes, values: Array) -> None:
    """The range of `values` with room about it; logarithmic where they span more than a factor."""
    low, high = float(values.min()), float(values.max())
    if high < _DECADE * low:
        axis.set_ylim(0.7 * low, 1.3 * high)
        return
    axis.set_yscale("log")
    axis.set_ylim(0.6 * low, 1.7 * high)
    style.log_ticks(axis.yaxis)

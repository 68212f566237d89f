"""The report on a designed experiment: what it will show, how near it comes to its limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pipelines.excitation.discrimination import Apart
from pipelines.excitation.result import DrawnPlan, Result
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.figures import Array, envelope, joint_signal_figure, one_figure, rows_figure
from pipelines.report.report import Cell, Figure, Report, Section, Table, Tone
from pipelines.report.sections import NO_COLLISION_CHECK
from pipelines.report.sentences import paragraphs, sentence
from pipelines.report.style import format_number, format_unit, printable
from pipelines.report.words import unit_of, without_keys

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DRAWN_PLANS = 6  # numerics: how it is drawn
_SHOWN = 5e-5  # numerics: of the size of a motion: a smaller change is not shown
_WIDE = 30.0  # numerics: ratio from which a scale must be logarithmic

_say, _paragraphs = partial(sentence, "excitation"), partial(paragraphs, "excitation")


def excitation_report(result: Result) -> Report:
    """The motion, its limits, what it shows; of other experiments their plans."""
    if result.purpose != "excitation":
        return _plans_report(result)
    sections = (
        _safety(result),
        _motion(result),
        _limits(result),
        _shows(result),
        _apart_section(result.apart),
        _certificate(result),
    )
    smaller = _smaller(result) if result.shrunk < 1.0 - REPORT.much else ""
    alike = "" if result.apart is None else _alike(result.apart)
    verdict = _say("verdict", result, alike, smaller)
    shown = tuple(section for section in sections if section is not None)
    basis, key = (_say("robot", result),), _key_figures(result)
    return Report("Excitation", verdict, _tone(result), key, shown, basis=basis)


def _tone(result: Result) -> Tone:
    open_ = not result.reached or result.interrupted or not result.torque_checked
    return "attention" if open_ or _are_rivals(result.apart) else "good"


def _smaller(result: Result) -> str:
    """By how much the motion was made smaller after its search; empty where it was not."""
    less = 1.0 - result.shrunk
    return "" if less < _SHOWN else _say("smaller", less)


def _are_rivals(found: Apart | None) -> bool:
    """Return whether a diagnosis of the log would call the two causes alternatives."""
    return found is not None and found.after.similarity > REPORT.alike


def _alike(found: Apart) -> str:
    """How alike two causes look, and whether the plain design was kept."""
    before, after = (_similarity(one.similarity) for one in (found.before, found.after))
    a, b = map(without_keys, found.causes)
    return _say("alike", a, b, before, after, found.changed, REPORT.alike, _are_rivals(found))


def _similarity(similarity: float) -> str:
    """With as many digits as it takes to be on its own side of what makes alternatives."""
    for digits in (2, 3):
        shown = float(f"{similarity:.{digits}g}")
        if shown != REPORT.alike and (shown > REPORT.alike) == (similarity > REPORT.alike):
            return format_number(similarity, digits)
    return format_number(similarity, 4)


def _apart_section(found: Apart | None) -> Section | None:
    """Return how well the motion separates two causes."""
    if found is None:
        return None
    judged = [("this design", found.after)]
    if found.changed:
        judged.insert(0, ("design for the parameters alone", found.before))
    a, b = map(without_keys, found.causes)
    table = Table(
        ("motion", "similarity", f"{a}, visible", f"{b}, visible", "condition number"),
        tuple((n, x.similarity, *x.identifiability, x.condition_number) for n, x in judged),
    )
    return Section(f"Telling {a} from {b}", _paragraphs("apart", REPORT.alike), (table,))


def _key_figures(result: Result) -> Table:
    run_in = f"{result.run_in:.3g} s" if result.run_in else ""
    start = f"run-in and run-out of {run_in}" if run_in else "at rest"
    if result.home is not None and not run_in:
        start = "at rest at home"
    duration = f"{result.periods} × {result.period:g} s"
    rows: list[tuple[str, Cell]] = [
        ("aim", _say("aim", result)),
        ("condition number of Φ", result.condition_number),
    ]
    if result.lower_bound is not None:
        rows.append(("no motion of this arm can be below", result.lower_bound))
    if result.torque_checked:
        predicted = 100 * (result.predicted_relative_std or math.nan)
        rows.append(("relative standard deviation, predicted [%]", predicted))
    rows += [
        ("duration", f"{duration} and twice {run_in}" if run_in else duration),
        ("highest harmonic [Hz]", result.top_hz),
        ("start and end", start),
        ("evaluations, seed", f"{result.evaluations}, {result.seed}"),
    ]
    if result.after:
        rows.append(("information added of", ", ".join(result.after[:6])))
    return Table(("what", "figure"), tuple(rows))


def _safety(result: Result) -> Section:
    text = _paragraphs("safety", result)
    return Section("Before the robot moves", text, warning=NO_COLLISION_CHECK)


def _ends(result: Result, quantity: str) -> tuple[list[float], list[float]]:
    """Limits (low, high) of a quantity, joint by joint; infinite where open."""
    low, high = [-math.inf] * len(result.joints), [math.inf] * len(result.joints)
    for one in result.limits:
        if one.quantity == quantity and one.joint is not None:
            own, other = (high, low) if one.limit > 0.0 else (low, high)
            own[one.joint - 1] = one.limit
            if quantity != "position":  # the other end is as far
                other[one.joint - 1] = -one.limit
    return low, high


def _motion(result: Result) -> Section | None:
    c = result.course
    if c is None:
        return None
    near = "dashed, limits that are near"
    share = f"{100 * result.torque_share:.0f} % of the limits, what the plan may use"
    kinds = [
        ("position", c.q, "Positions over one period."),
        ("speed", c.dq, f"Speeds; {near}."),
        ("acceleration", c.ddq, f"Accelerations; {near}."),
    ]
    if c.tau is not None:
        kinds.append(("torque", c.tau, f"Torques that the model expects; dashed, {share}."))
    figures = []
    for quantity, values, caption in kinds:
        label = f"{quantity} [{unit_of(result.limits, quantity)}]"
        ends = _ends(result, quantity)
        figures.append(
            _limited_figure(f"{quantity}s", caption, c.t, values, ends, label, result.joints)
        )
    return Section("The motion", figures=tuple(figures))


def _limits(result: Result) -> Section:
    def place(joint: int | None) -> str:
        return "tip" if joint is None else result.joints[joint - 1]

    rows = tuple(
        (
            place(one.joint),
            one.quantity,
            one.peak,
            one.limit,
            format_unit(one.unit),
            100 * one.share,
        )
        for one in result.limits
    )
    columns = ("joint", "of", "peak", "limit used", "unit", "of it [%]")
    text = _paragraphs("limits", result, _smaller(result))
    return Section("Limits", text, (Table(columns, rows),))


def _shows(result: Result) -> Section:
    relative = {
        p.name: None if not p.value else 100 * p.std / abs(p.value) for p in result.parameters
    }
    rows = tuple(
        (p.name, p.value, p.std, format_unit(p.unit), relative[p.name]) for p in result.parameters
    )
    figures = []
    known = {name: x for name, x in relative.items() if x is not None}
    if known:
        figures.append(_relative_std_figure(list(known), list(known.values())))
    columns = ("parameter", "believed value", "predicted std", "unit", "relative [%]")
    text = _paragraphs("shows", result.noise, result.sample_time)
    return Section("What it will tell", text, (Table(columns, rows),), tuple(figures))


def _certificate(result: Result) -> Section | None:
    if result.lower_bound is None or result.condition_number is None:
        return None
    bound, number = result.lower_bound, result.condition_number
    return Section("Certificate", _paragraphs("certificate", bound, number, REPORT.near_bound))


def _plans_report(result: Result) -> Report:
    """The plans of other experiments and their limits."""
    plans = Table(
        (
            "experiment",
            "joint",
            "duration [s]",
            "speed, peak [rad/s]",
            "acceleration, peak [rad/s^2]",
            "what",
        ),
        tuple(
            (p.name, p.joint, p.seconds, p.speed_peak, p.acceleration_peak, p.words)
            for p in result.plans
        ),
    )
    limits = Table(
        ("experiment", "nearest limit", "joint", "peak", "limit used", "unit", "of it [%]"),
        tuple(
            (p.name, n.quantity, n.joint, n.peak, n.limit, format_unit(n.unit), 100 * n.share)
            for p in result.plans
            if (n := p.nearest) is not None
        ),
    )
    sections = [
        _safety(result),
        Section("Experiments", tables=(plans,)),
        Section("Limits", _paragraphs("plan_limits", result.torque_checked), (limits,)),
    ]
    moving = [p for p in result.plans if p.speed_peak > 0.0][:_DRAWN_PLANS]
    if moving:
        figures = tuple(_plan_figure(p, result) for p in moving)
        sections.append(Section("Motions", figures=figures))
    verdict, basis = _say("plans", result), (_say("robot", result),)
    return Report("Planned experiments", verdict, "neutral", None, tuple(sections), basis=basis)


def _plan_figure(plan: DrawnPlan, result: Result) -> Figure:
    own = np.ptp(plan.q, axis=0) > 0.0
    return joint_signal_figure(
        plan.name,
        f"{plan.name}: {plan.words}.",
        plan.t,
        plan.q[:, own],
        unit_of(result.limits, "position"),
        quantity="position",
        names=[name for name, moves in zip(result.joints, own, strict=True) if moves],
    )


def _limited_figure(
    name: str,
    caption: str,
    t: Array,
    values: Array,
    ends: tuple[Sequence[float], Sequence[float]],
    label: str,
    joints: Sequence[str],
) -> Figure:
    """A signal over one period, one row a joint, with the limits (low, high) it comes near to."""

    def draw_row(axis: Axes, j: int) -> None:
        axis.plot(*envelope(t, values[:, j]), color=style.BLUE, linewidth=1.0)
        for end in (ends[0][j], ends[1][j]):
            if np.isfinite(end) and np.abs(values[:, j]).max() > REPORT.drawn_limit * abs(end):
                axis.axhline(end, color=style.VERMILLION, linewidth=0.9, linestyle=(0, (5, 2)))

    return rows_figure(name, caption, joints, draw_row, label)


def _relative_std_figure(names: Sequence[str], percent: Sequence[float]) -> Figure:
    """Predicted standard deviation of every parameter over its value, the best known on top."""
    order = np.argsort(percent)[::-1]
    values = np.array(percent)[order]
    place = np.arange(len(values))

    def draw(axis: Axes) -> None:
        axis.hlines(place, 0.3 * values.min(), values, color=style.GREY, linewidth=1.0)
        axis.plot(values, place, "o", color=style.BLUE, markersize=4.0)
        axis.set_xscale("log")
        axis.set_xlim(0.5 * values.min(), 2.0 * values.max())
        style.log_ticks(axis.xaxis)
        axis.set_yticks(place, [printable(names[k], 24) for k in order])
        axis.set_ylim(-0.7, len(values) - 0.3)
        axis.grid(axis="y", visible=False)
        axis.set_xlabel("standard deviation over value [%]")

    caption = "Predicted standard deviation of every parameter, relative to its value."
    return one_figure("relative-std", caption, draw, 0.7 + 0.19 * len(names))

"""The report of a friction fit: Table III with deviations, Figs. 5 and 6, curve and choice."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pipelines.effects import find_effect
from pipelines.estimation.nominal import plain_number
from pipelines.friction.config import FindingsConfig
from pipelines.friction.findings import drift_in_words
from pipelines.friction.fit import Value
from pipelines.friction.laws import law_named
from pipelines.friction.result import JointResult, Result, Series
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.figures import Look, draw_measured, draw_modelled, envelope, rows_figure
from pipelines.report.report import Cell, Figure, Report, Section, Table, Tone
from pipelines.report.sections import data_quality
from pipelines.report.sentences import capital, paragraphs, sentence
from pipelines.report.style import format_unit, with_std
from pipelines.report.words import spoken

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_THIN = 0.01  # numerics: of the curve: a narrower band is hidden by the line
_GRAVITY = {
    "sine": "c in c sin q + c' cos q",
    "cosine": "c' in c sin q + c' cos q",
    "constant": "weight along the axis",
}

_say, _paragraphs = partial(sentence, "friction"), partial(paragraphs, "friction")


def friction_report(result: Result) -> Report:
    """The verdict first; then every joint's law, figures and choice of the law."""
    sections = [_summary(result)]
    for joint in result.joints:
        sections += _joint_sections(joint)
    sections += data_quality(result.checks)
    key = _key_figures(result)
    return Report("Friction", _verdict(result), _tone(result), key, tuple(sections))


def _units(joint: JointResult) -> tuple[str, str, str]:
    """Of position, speed and torque."""
    return ("rad", "rad/s", "N m") if joint.revolute else ("m", "m/s", "N")


def _ratio(joint: JointResult) -> float | None:
    """Speed error of the simulation with friction over that without."""
    with_, without = joint.validation.velocity_error_with, joint.validation.velocity_error_without
    if with_ is None:
        return None
    if without is None:
        return 0.0
    return with_ / without if without > 0.0 else None


def _well(joint: JointResult) -> bool:
    if joint.validation.by:
        ratio = _ratio(joint)
        return ratio is not None and ratio <= REPORT.good_speed
    error = joint.validation.torque_error  # nothing was simulated
    return joint.moved and error is not None and error < REPORT.good_torque


def _tone(result: Result) -> Tone:
    if any(check.gate for check in result.checks):
        return "bad"
    sure = all(_well(joint) and not joint.unseen for joint in result.joints)
    return "good" if sure else "attention"


def _verdict(result: Result) -> str:
    joints, simulated = [], [joint for joint in result.joints if joint.validation.by]
    for joint in result.joints:
        error = joint.validation.torque_error
        if error is not None and error >= FindingsConfig().poor:  # the finding says it
            error = None
        joints.append(
            {
                "name": capital(joint.name),
                "law": _plain(joint.law),
                "moved": joint.moved,
                "validation": joint.validation,
                "leaves": error,
                "unit": _units(joint)[1],
            }
        )
    remarks = [drift_in_words(joint) for joint in result.joints]
    return _say(
        "verdict",
        gates=[check.message for check in result.checks if check.gate],
        joints=joints,
        refitted=any(not joint.validation.held_out for joint in simulated),
        poor=[joint.name for joint in simulated if not _well(joint)],
        remarks=[words for words in remarks if words],
        open=[joint.name for joint in result.joints if joint.unseen],
    )


def _plain(law: str) -> str:
    for key, words in (("three_sigmoid", "three sigmoids"), ("stribeck", "Stribeck")):
        law = law.replace(key, words)
    return law.replace("coulomb", "Coulomb").replace("_", " ").replace("+", " + ")


def _parameter(name: str) -> str:
    """ "Coulomb friction, level" for "coulomb.level"; the paper's own letters stay."""
    effect, dot, quantity = name.partition(".")
    return f"{find_effect(effect).words.title}, {spoken(quantity)}" if dot else name


def _meaning(joint: JointResult, name: str) -> str:
    """Return the meaning of a number of the joint's law."""
    effect, _, quantity = name.rpartition(".")
    members = (effect,) if effect else law_named(joint.law).members
    known = [q for member in members for q in find_effect(member).parameters]
    return next((q.meaning for q in known if q.name == quantity), "")


def _std(value: Value | None) -> str | None:
    return None if value is None else with_std(value.value, value.std)


def _key_figures(result: Result) -> Table:
    simulated = any(joint.validation.by for joint in result.joints)
    rows = []
    for joint in result.joints:
        gravity = ", ".join(_std(joint.gravity[k]) or "" for k in _GRAVITY if k in joint.gravity)
        error = _ratio(joint) if simulated else joint.validation.torque_error
        left = None if error is None else 100.0 * error
        rows.append((joint.name, _plain(joint.law), _std(joint.inertia), gravity, left))
    error_name = "held-out torque that is left, rms [%]"
    if simulated:
        error_name = "speed error, friction in / left out [%]"
    columns = ("joint", "law", "inertia [kg m^2]", "gravity: sine, cosine [N m]", error_name)
    return Table(columns, tuple(rows))


def _summary(result: Result) -> Section:
    """Table III, which the print of the paper has lost."""
    joints = result.joints
    values: dict[str, tuple[str, list[Value | None]]] = {}  # name -> meaning, joint by joint
    for name in sorted({name for joint in joints for name in joint.parameters}):
        first = next(joint for joint in joints if name in joint.parameters)
        found = [joint.parameters.get(name) for joint in joints]
        values[_parameter(name)] = (_meaning(first, name), found)
    values["J"] = ("inertia about the joint, the others held", [joint.inertia for joint in joints])
    for joint in joints:
        for name in _GRAVITY:
            if name in joint.gravity:
                own = [other.gravity.get(name) for other in joints]
                values.setdefault(f"gravity, {name}", (_GRAVITY[name], own))
    rows: list[tuple[Cell, ...]] = []
    for name, (_, found) in values.items():
        unit = next((format_unit(v.unit) for v in found if v is not None), "")
        rows.append((name, *map(_std, found), unit))
    columns = ("parameter", *(joint.name for joint in joints), "unit")
    caption = "As Table III of Kostić et al. 2004: value ± std."
    meanings = tuple((name, meaning) for name, (meaning, _) in values.items())
    tables = (
        Table(columns, tuple(rows), caption, keeps_empty=True),
        Table(("parameter", "what it is"), meanings),
    )
    text = "Compare curves, not labels: several sets of numbers give one curve."
    return Section("Parameters", (text,), tables)


def _joint_sections(joint: JointResult) -> list[Section]:
    name, speed = joint.name, _units(joint)[1]
    drift = drift_in_words(joint)
    text = _paragraphs("joint", joint, speed, drift, _sticking(joint))
    sections = [Section(f"{name}: friction", text, _tables(joint), (_curve_figure(joint),))]
    if joint.validation.by:
        figures = (_simulation_figure(joint), _fraction_figure(joint))
        said = _paragraphs("simulation", joint.validation, speed)
        sections.append(Section(f"{name}: simulation", said, figures=figures))
    choice = Section(f"{name}: choice of the law", _choice_words(joint), (_candidates(joint),))
    return [*sections, choice]


def _sticking(joint: JointResult) -> dict[str, str] | None:
    """How many rows are left out where the joint sticks, and up to which travel."""
    if joint.sticking is None:
        return None
    travel = f"{plain_number(joint.sticking.distance)} {_units(joint)[0]}"
    return {"share": plain_number(100.0 * joint.sticking.share), "travel": travel}


def _tables(joint: JointResult) -> tuple[Table, ...]:
    tables = []
    if joint.unseen:
        gaps = tuple((gap.what, gap.record) for gap in joint.unseen)
        columns = ("not shown by these logs", "what to record")
        attention: tuple[Tone, ...] = tuple("attention" for _ in gaps)
        tables.append(Table(columns, gaps, tones=attention))
    return tuple(tables)


def _choice_words(joint: JointResult) -> tuple[str, ...]:
    """How the law was chosen, and by how much the best law with fewer numbers is worse."""
    laws = joint.candidate_laws
    by_logs = joint.judged_by == "logs"
    chosen = next((law for law in laws if law.chosen), laws[0])
    usable = [law for law in laws if not law.reason]
    plainer = [law for law in usable if law.size < chosen.size]
    if not plainer or min(law.validate_rms for law in laws) <= 0.0:
        return _paragraphs("choice", len(laws), by_logs, None, None, None, 0.0)
    plain = min(plainer, key=lambda law: law.validate_rms)
    best = min(usable, key=lambda law: law.validate_rms)
    more = 100.0 * (plain.validate_rms / best.validate_rms - 1.0)  # than the best: as was tested
    names = [{"law": _plain(law.law), "size": law.size} for law in (chosen, plain)]
    than = "" if best is chosen else _plain(best.law)
    return _paragraphs("choice", len(laws), by_logs, *names, than, more)


def _candidates(joint: JointResult) -> Table:
    rows, tones = [], list[Tone]()
    for law in joint.candidate_laws:
        # "amplitude of presliding" for "presliding.amplitude": names of settings are no words
        reason = _plain(re.sub(r"\b([a-z]\w*)\.([a-z]\w*)", r"\2 of \1", law.reason))
        verdict = "chosen" if law.chosen else reason or ("not worse" if law.alike else "worse")
        errors = (1e3 * law.identify_rms, 1e3 * law.validate_rms)
        rows.append((_plain(law.law), law.size, *errors, verdict))
        tones.append("good" if law.chosen else "neutral")
    columns = ("law", "numbers", "left, fitted [mN m]", "left, held out [mN m]", "")
    caption = "Root mean square of the residual of mean torques over windows."
    return Table(columns, tuple(rows), caption, tuple(tones))


def _curve_figure(joint: JointResult) -> Figure:
    """Friction torque against speed: all of it, and the part about zero."""
    series, (_, speed, torque) = joint.series, _units(joint)
    width, height = 2.0 * float(np.max(series.band)), float(np.max(np.abs(series.curve)))
    known = bool(np.isfinite(width)) and height > 0.0
    thin = width < _THIN * height
    caption = _say("curve", joint.name, width if known else None, torque, thin)

    def draw(drawing: Drawing) -> None:
        whole, near = drawing.subplots(1, 2, sharey=True, width_ratios=(3, 2))
        fastest = float(series.speed.max())
        draw_curve(whole, series, fastest)
        draw_curve(near, series, REPORT.near_rest * fastest)
        whole.set_ylabel(f"friction [{torque}]")
        drawing.supxlabel(f"speed [{speed}]", fontsize="medium")
        whole.legend(loc="upper left", borderpad=0.2)
        near.set_title("about zero", pad=3.0)

    return Figure(f"curve-{joint.joint}", caption, draw)


def draw_curve(axis: Axes, series: Series, reach: float) -> None:
    """The law with its band."""
    inside = np.abs(series.speed) <= 1.05 * reach
    v, curve, band = series.speed[inside], series.curve[inside], 2.0 * series.band[inside]
    shade: Look = {"color": style.BLUE, "alpha": 0.25, "linewidth": 0.0}
    axis.fill_between(v, curve - band, curve + band, label="± 2 std", **shade)
    axis.plot(v, curve, color=style.BLUE, linewidth=1.2, label="fitted law")
    axis.axhline(0.0, color=style.GREY, linewidth=0.6)
    axis.axvline(0.0, color=style.GREY, linewidth=0.6)
    axis.set_xlim(-1.03 * reach, 1.03 * reach)
    axis.locator_params(axis="x", nbins=5)


def _fraction_figure(joint: JointResult) -> Figure:
    """Torque and its friction, gravity and inertial fractions, Fig. 5."""
    s = joint.series
    fractions = {
        "torque": (s.torque, style.BLACK),
        "friction": (s.friction, style.GREEN),
        "gravity": (s.gravity, style.PURPLE),
        "inertia": (s.inertial, style.BLUE),
    }
    names = list(fractions)

    def draw_row(axis: Axes, k: int) -> None:
        values, color = fractions[names[k]]
        axis.plot(*envelope(s.t, values, 800), color=color, linewidth=0.9)

    caption = f"{joint.name}: torque of {joint.validation.by} and its fractions in the simulation."
    quantity = "torque [N m]" if joint.revolute else "force [N]"
    return rows_figure(
        f"fractions-{joint.joint}", caption, names, draw_row, quantity, row=1.15, sharey=True
    )


def _simulation_figure(joint: JointResult) -> Figure:
    """Measured over simulated position and speed, friction left out and in, Fig. 6."""
    s, (position, speed, _) = joint.series, _units(joint)
    columns = {
        "friction left out": ((s.q, s.q_without), (s.dq, s.dq_without)),
        "with friction": ((s.q, s.q_with), (s.dq, s.dq_with)),
    }

    def draw(drawing: Drawing) -> None:
        grid = drawing.subplots(2, 2, sharex=True)
        for column, (title, signals) in zip(grid.T, columns.items(), strict=True):
            for axis, (measured, simulated) in zip(column, signals, strict=True):
                draw_measured(axis, *envelope(s.t, measured, 800))
                draw_modelled(axis, *envelope(s.t, simulated, 800), "simulated")
                axis.margins(x=0.01, y=0.08)
                axis.locator_params(axis="y", nbins=5)
            column[0].set_title(title, pad=3.0)
            column[1].set_xlabel("time [s]")
        grid[0, 0].set_ylabel(f"position [{position}]")
        grid[1, 0].set_ylabel(f"speed [{speed}]")
        grid[0, 1].legend(loc="best", borderpad=0.2)

    what = "measured and simulated motion. Gravity is compensated at the measured position."
    return Figure(f"simulation-{joint.joint}", f"{joint.name}: {what}", draw, (6.0, 4.0))

"""The report of a friction fit: Table III with deviations, Fig. 6, curve and choice of the law."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pipelines.effects import find_effect
from pipelines.friction.config import FRICTION
from pipelines.friction.findings import drift_in_words
from pipelines.friction.fit import Value
from pipelines.friction.laws import law_named
from pipelines.friction.result import JointResult, Result, Series
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.document import document
from pipelines.report.figures import Look, legend, signals_figure
from pipelines.report.report import Figure, Report, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import format_unit, with_std
from pipelines.report.words import spoken

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_GRAVITY = {
    "sine": "c in c sin q + c' cos q",
    "cosine": "c' in c sin q + c' cos q",
    "constant": "weight along the axis",
}


def friction_report(result: Result) -> Report:
    """The verdict first; then every joint's law, figures and choice of the law."""
    joints = result.joints
    parameters, meanings = _parameters(joints)
    gates = [check.message for check in result.checks if check.gate]
    sure = all(_well(joint) and not joint.unseen for joint in joints)
    tone: Tone = "bad" if gates else "good" if sure else "attention"
    return document(
        "friction",
        tone,
        result=result,
        gates=gates,
        poor=[joint.name for joint in joints if joint.validation.by and not _well(joint)],
        limit=FRICTION.poor,
        units={joint.joint: units_of(joint) for joint in joints},
        drift=drift_in_words,
        plain=plain_law,
        reason=lambda law: plain_law(re.sub(r"\b([a-z]\w*)\.([a-z]\w*)", r"\2 of \1", law.reason)),
        gravity=lambda joint: ", ".join(
            with_std(x.value, x.std) for name in _GRAVITY if (x := joint.gravity.get(name))
        ),
        ratio=_ratio,
        parameters=parameters,
        meanings=meanings,
        better=_plainer,
        figures={joint.joint: _figures(joint) for joint in joints},
        checks_table=checks_table,
    )


def units_of(joint: JointResult) -> tuple[str, str, str]:
    """Of position, speed and torque."""
    return ("rad", "rad/s", "N m") if joint.revolute else ("m", "m/s", "N")


def _ratio(joint: JointResult) -> float | None:
    """Speed error of the simulation with friction over that without; of torque if not simulated."""
    judged = joint.validation
    with_, without = judged.velocity_error_with, judged.velocity_error_without
    if not judged.by:
        return judged.torque_error
    if with_ is None or without == 0.0:
        return None
    return 0.0 if without is None else with_ / without


def _well(joint: JointResult) -> bool:
    ratio = _ratio(joint)
    most = REPORT.good_speed if joint.validation.by else REPORT.good_torque
    return joint.moved and ratio is not None and ratio <= most


def plain_law(law: str) -> str:
    """A law as people read it."""
    for key, words in (("three_sigmoid", "three sigmoids"), ("stribeck", "Stribeck")):
        law = law.replace(key, words)
    return law.replace("coulomb", "Coulomb").replace("_", " ").replace("+", " + ")


def _parameters(joints: tuple[JointResult, ...]) -> tuple[Table, list[tuple[str, str]]]:
    """Table III, which the print of the paper has lost, and what each number is."""
    values: dict[str, tuple[str, list[Value | None]]] = {}  # name -> meaning, joint by joint
    for name in sorted({name for joint in joints for name in joint.parameters}):
        effect, dot, quantity = name.partition(".")
        words = f"{find_effect(effect).words.title}, {spoken(quantity)}" if dot else name
        first = next(joint for joint in joints if name in joint.parameters)
        members = (effect,) if dot else law_named(first.law).members
        known = [q for member in members for q in find_effect(member).parameters]
        meaning = next((q.meaning for q in known if q.name == name.rpartition(".")[2]), "")
        values[words] = (meaning, [joint.parameters.get(name) for joint in joints])
    values["J"] = ("inertia about the joint, the others held", [joint.inertia for joint in joints])
    for name, meaning in _GRAVITY.items():
        own = [joint.gravity.get(name) for joint in joints]
        values |= {f"gravity, {name}": (meaning, own)} if any(own) else {}
    rows = []
    for name, (_, found) in values.items():
        unit = next((format_unit(v.unit) for v in found if v is not None), "")
        texts = (None if v is None else with_std(v.value, v.std) for v in found)
        rows.append((name, *texts, unit))
    columns = ("parameter", *(joint.name for joint in joints), "unit")
    table = Table(columns, tuple(rows), keeps_empty=True)
    return table, [(name, meaning) for name, (meaning, _) in values.items()]


def _plainer(joint: JointResult) -> dict[str, object] | None:
    """The best law with fewer numbers than the chosen one, and by how much it is worse."""
    laws = [law for law in joint.candidate_laws if not law.reason]
    chosen = next((law for law in joint.candidate_laws if law.chosen), joint.candidate_laws[0])
    plainer = [law for law in laws if law.size < chosen.size]
    if not plainer or min(law.validate_rms for law in joint.candidate_laws) <= 0.0:
        return None
    plain = min(plainer, key=lambda law: law.validate_rms)
    best = min(laws, key=lambda law: law.validate_rms)
    more = plain.validate_rms / best.validate_rms - 1.0  # than the best: as was tested
    return {"chosen": chosen, "plain": plain, "best": best, "more": more}


def _figures(joint: JointResult) -> list[Figure]:
    """Friction over speed; and measured over simulated speed, friction left out and in (Fig. 6)."""
    s, (_, speed, torque) = joint.series, units_of(joint)
    widest = 2.0 * float(np.max(s.band))
    band = f"; ± 2 std shaded, at most {widest:.2g} {torque}" if np.isfinite(widest) else ""
    draw = partial(_draw_curves, series=s, units=(speed, torque))
    figures = [
        Figure(f"curve-{joint.joint}", f"{joint.name}: the fitted law{band}.", draw, (6.0, 2.6))
    ]
    if joint.validation.by:
        caption = (
            f"{joint.name}: measured and simulated speed. Gravity is compensated at the measured "
            "position."
        )
        speeds = {"measured": s.dq, "with friction": s.dq_with, "friction left out": s.dq_without}
        columns = {label: values.reshape(-1, 1) for label, values in speeds.items()}
        name, quantity = f"simulation-{joint.joint}", f"speed [{speed}]"
        figures.append(signals_figure(name, caption, s.t, columns, quantity, [joint.name]))
    return figures


def _draw_curves(drawing: Drawing, series: Series, units: tuple[str, str]) -> None:
    """The whole curve, and the part about zero."""
    whole, near = drawing.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    fastest = float(series.speed.max())
    _draw_curve(whole, series, fastest)
    _draw_curve(near, series, REPORT.near_rest * fastest)
    whole.set_ylabel(f"friction [{units[1]}]")
    drawing.supxlabel(f"speed [{units[0]}]", fontsize="medium")
    near.set_title("about zero", pad=3.0)
    legend(whole)


def _draw_curve(axis: Axes, series: Series, reach: float) -> None:
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

"""Report one finding: what to check, its worth, its proof, its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pipelines.diagnosis.result import Answer, Finding, Gain, ResidualRms
from pipelines.dynamics.parameter_names import numbered
from pipelines.effects import find_effect
from pipelines.estimation.residual_analysis import Proof
from pipelines.io.log import Array
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.figures import (
    DASHED,
    Look,
    broken_at_gaps,
    joint_colour,
    legend_above,
    one_figure,
)
from pipelines.report.finding_words import of_any_size, taken_in, where
from pipelines.report.frf_figures import posture_words
from pipelines.report.report import Cell, Figure, Section, Table, columns_table
from pipelines.report.sentences import paragraphs, sentence
from pipelines.report.style import (
    format_decimals,
    format_number,
    format_unit,
    three_digits,
    to_one_place,
)
from pipelines.report.words import (
    Units,
    cause_at,
    format_value,
    in_order,
    meaning_of,
    named,
    spoken,
    unit_or_dash,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TURNING = Units()
_ROOM = (0.5, 2.0)  # numerics: below and above what the modes reach
_NO_TIP = 1e-9  # numerics: [m] no tip: nothing that is simulated and measured comes so near

_say = partial(sentence, "diagnosis")


def finding_section(
    number: int,
    one: Finding,
    nominal: ResidualRms,
    offer: bool = True,
    floor: str = "the noise floor",
    units: Units = _TURNING,
    beside: Sequence[Finding] = (),
    left: Array | None = None,
) -> Section:
    """Return the explanation, what to check, the worth, and the figures that prove it.

    Args:
        nominal: residual of the model without any finding, and the floor of the held-out logs.
        offer: say how to extend the model by it.
        floor: what its share is counted from.
        beside: every finding, this one among them.
        left: held-out torque error of each joint with all findings.
    """
    share = _own_share(one, nominal)
    whole = len(nominal.identify) == 1 or not share > REPORT.own_share * one.explained
    lasting = [other for other in beside if find_effect(other.cause).clock != "log"]
    offered = offer and find_effect(one.cause).clock != "log"
    other = None
    if one.alternatives:
        names = [(named(r.cause, r.joint), r.similarity) for r in one.alternatives]
        pair = [cause_at(some.cause, some.joint) for some in (one, one.alternatives[0])]
        other = {"names": names, "pair": " ".join(pair)}
    text = paragraphs(
        "diagnosis",
        "finding",
        one,
        words=find_effect(one.cause).words,
        share=share,
        whole=whole,
        floor=floor,
        tip=tip_worth(one.gain),
        any_size=of_any_size(one),
        torque=torque_of(one, units) if math.isfinite(one.torque_rms) else "",
        hidden=taken_in(one, nominal.identify),
        larger=_larger(one, units, left),
        offer=_offer(one, lasting) if offered else "",
        other=other,
    )
    figures = (*response_figures(number, one), *proof_figures(number, one, units))
    return Section(f"{number}. {one.title}{where(one)}", text, figures=figures)


def torque_of(one: Finding, units: Units) -> str:
    """Of its own joint, or of the largest."""
    return f"{format_number(one.torque_rms, 2)} {units.at(one.joint).torque}"


def _larger(one: Finding, units: Units, left: Array | None) -> list[dict[str, object]]:
    """At which joints the held-out error is larger with it, and stays so with all findings.

    What another takes away again, the two share, and it is no doubt of this one.
    """
    torque = one.gain.validate_torque_rms
    grown = torque.after - torque.before
    stays = grown if left is None else left - torque.before
    low = torque.ci95[:, 0]
    larger = (low > 0.0) & (stays > grown - low)  # more than the interval is wide
    return [
        {
            "joint": j + 1,
            "before": float(torque.before[j]),
            "after": float(torque.after[j]),
            "unit": units.at(j + 1).torque,
        }
        for j in np.flatnonzero(larger).tolist()
    ]


def _offer(one: Finding, every: Sequence[Finding]) -> str:
    """How to extend the model by it, and by all findings where there are others."""
    in_torque = one.origin not in ("residual", "reversals")
    sure = in_torque or bool((one.gain.validate_torque_rms.ci95[:, 1] < 0.0).any())
    return _say("offer", _command([one]), sure, _command(every) if len(every) > 1 else "")


def _command(some: Sequence[Finding]) -> str:
    causes = dict.fromkeys(cause_at(one.cause, one.joint) for one in some)
    return f'"rrrid extend LOGS {" ".join(f"--with {cause}" for cause in causes)}"'


def _own_share(one: Finding, nominal: ResidualRms) -> float:
    """Of the held-out power that its joint has above the floor; NaN where it has none."""
    if one.joint is None or one.origin == "base parameters":
        return math.nan
    torque = one.gain.validate_torque_rms
    powers = (torque.before, torque.after, nominal.validate, nominal.noise_floor)
    before, after, whole, floor = (float(x[one.joint - 1]) ** 2 for x in powers)
    if not whole > floor:
        return math.nan
    return float(np.clip((before - after) / (whole - floor), 0.0, 1.0))


def numbers_section(
    number: int, one: Finding, units: Units = _TURNING, every: Sequence[Finding] = ()
) -> Section:
    """Return the identified numbers and their gain, joint by joint.

    Args:
        every: findings of the report; those of frequency responses are taken out before a search.
    """
    beside = "all other findings"
    if one.origin in ("residual", "reversals"):
        responses = any(other.origin == "frequency responses" for other in every)
        taken = " and what frequency responses name" if responses else ""
        beside = f"the findings before it{taken}"
    caption = f"Gain on held-out time, root mean square, beside {beside}."
    tables = (_numbers(one), gain_table(one.gain, caption, units))
    return Section(f"{number}. In numbers", tables=tables)


def _numbers(one: Finding) -> Table:
    if not set(one.parameters) <= {q.name for q in find_effect(one.cause).parameters}:
        return _numbers_of_several(one)
    rows = tuple(
        (spoken(name), format_value(v), unit_or_dash(v.unit), meaning_of(one.cause, name))
        for name, v in in_order(one.cause, one.parameters)
    )
    columns = ("parameter", "value ± std", "unit", "what it is")
    return Table(columns, rows, "What was identified.")


def _numbers_of_several(one: Finding) -> Table:
    """A row for each number that parameters end in: three gears in nine rows, not in 27."""
    listed = {numbered(name): value for name, value in in_order(one.cause, one.parameters)}
    numbers = sorted({number for _, number in listed})
    columns: dict[str, Sequence[Cell]] = {"number": numbers}
    names = list(dict.fromkeys(name for name, _ in listed))
    for name in names:
        values = [listed.get((name, number)) for number in numbers]
        unit = next(unit_or_dash(value.unit) for value in values if value is not None)
        texts = ["–" if value is None else format_value(value) for value in values]
        columns[f"{spoken(name)} [{unit}]"] = texts
    meanings = [(spoken(name), meaning_of(one.cause, name)) for name in names]
    return columns_table(columns, _say("several", meanings))


def gain_table(gain: Gain, caption: str, units: Units = _TURNING) -> Table:
    """Joint by joint: torque and simulated position, without and with."""
    torque, position = gain.validate_torque_rms, gain.simulated_position_rms
    joints = len(torque.before)
    errors = to_one_place([*map(float, torque.before), *map(float, torque.after)])
    places = [len(f"{x:.9g}".partition(".")[2]) for x in errors if x is not None]
    decimals = 1 + max(places, default=0)  # a change is smaller
    both = (None, None) if position is None else (position.before, position.after)
    rows = []
    for j in range(joints):
        ends = [
            format_decimals(float(end), decimals) if math.isfinite(end) else "–"
            for end in torque.ci95[j]
        ]
        moved = (None if x is None else three_digits(1e3 * x[j]) for x in both)
        rows.append((j + 1, *errors[j::joints], " to ".join(ends), *moved))
    unit, small = units.torque, units.thousandths
    columns = (
        "joint",
        f"torque error without [{unit}]",
        f"with [{unit}]",
        f"change, 95 % [{unit}]",
        f"simulated position error without [{small}]",
        f"with [{small}]",
    )
    span = span_words(gain)
    simulated = f" Positions are simulated {span}." if span else ""
    return Table(columns, tuple(rows), f"{caption}{simulated}")


def tip_worth(gain: Gain) -> str:
    """Return the simulated tip error before and after, and how the tip was simulated."""
    return _say("tip_worth", gain, *_tip(gain), span_words(gain))


def span_words(gain: Gain) -> str:
    """Over how much of which logs an arm was simulated: "over the first 5 s of a and b"."""
    first = "" if gain.simulation == "windowed" else "the first "
    logs: dict[str, list[str]] = {}
    for one in gain.simulated_span:
        logs.setdefault(f"{first}{format_number(one.seconds, 3)} s of ", []).append(one.log)
    parts = " and ".join(f"{seconds}{' and '.join(names)}" for seconds, names in logs.items())
    return f"over {parts}" if parts else ""


def _tip(gain: Gain) -> tuple[str, str]:
    """[mm] before and after, as printed; empty where no tip was simulated."""
    tip = gain.tip_error_rms
    if tip is None or max(tip.before, tip.after) < _NO_TIP:
        return "", ""
    return format_number(1e3 * tip.before, 3), format_number(1e3 * tip.after, 3)


def proof_figures(number: int, one: Finding, units: Units = _TURNING) -> list[Figure]:
    """The residual before and after, over what the cause depends on and over time."""
    proof = one.proof
    if proof is None:
        return []
    torque = units.at(proof.joint).torque
    # Squared amplitudes add up to the mean square of the residual, squared means are averaged.
    over = np.nansum if proof.against == "frequency" else np.nanmean
    sizes = [float(np.sqrt(over(np.square(shown)))) for shown in (proof.before, proof.after)]
    against = f"the time of {one.log}" if one.log else proof.against
    caption = _say("proof", proof, against, torque, *sizes, REPORT.followed, REPORT.partly_followed)
    joint = f"The same residual of joint {proof.joint}"
    in_time = f"{joint} where the finding shows most, over time."
    draw, draw_in_time = (
        partial(draw_proof, proof=proof, torque=torque),
        partial(draw_proof_in_time, proof=proof, torque=torque),
    )
    return [
        one_figure(f"proof-{number}", caption, draw, 3.2),
        one_figure(f"proof-{number}-in-time", in_time, draw_in_time, 2.6),
    ]


def draw_proof(axes: Axes, proof: Proof, torque: str = "N m") -> None:
    """Means in bins with their standard errors, or amplitudes over frequency."""
    band = 2.0 * proof.spread
    shade: Look = {"color": style.SKY, "alpha": 0.35, "linewidth": 0.0}
    axes.fill_between(proof.x, proof.before - band, proof.before + band, **shade)
    _draw_three(axes, proof.x, proof.before, proof.predicted, proof.after, style.BLUE, 1.6)
    _finish(axes, f"{proof.against} [{format_unit(proof.unit)}]", torque)


def draw_proof_in_time(axes: Axes, proof: Proof, torque: str = "N m") -> None:
    """A stretch of time; no line is drawn where nothing counts, as with a drive at its limit."""
    curves = (proof.before_in_time, proof.predicted_in_time, proof.after_in_time)
    t, broken = broken_at_gaps(np.asarray(proof.t), np.stack(curves, axis=1))
    before, predicted, after = broken.T
    _draw_three(axes, t, before, predicted, after, style.SKY, 2.4)
    _finish(axes, "time [s]", torque)


def _draw_three(
    axes: Axes, x: Array, before: Array, predicted: Array, after: Array, color: str, width: float
) -> None:
    axes.plot(x, before, color=color, linewidth=width, label="without the finding")
    look: Look = {"color": style.ORANGE, "linestyle": DASHED, "linewidth": 1.3}
    axes.plot(x, predicted, label="what the finding predicts", **look)
    axes.plot(x, after, color=style.VERMILLION, linewidth=1.0, label="left with it")


def _finish(axes: Axes, x: str, torque: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(f"residual torque [{torque}]")
    axes.margins(x=0.01, y=0.1)
    legend_above(axes, 3)


def response_figures(number: int, one: Finding) -> list[Figure]:
    """One figure with all postures, where frequency responses name the finding."""
    if not one.answers:
        return []
    value = one.parameters.get("frequency")
    frequency = math.nan
    if value is not None and isinstance(value.value, float):
        frequency = value.value
    known = frequency if math.isfinite(frequency) else None
    caption = _say("responses", one.answers[0].joint, known)
    draw = partial(draw_responses, answers=one.answers, frequency=frequency)
    return [one_figure(f"proof-{number}-response", caption, draw, 3.4)]


def draw_responses(axes: Axes, answers: Sequence[Answer], frequency: float) -> None:
    """Points that are coherent, and a line for each posture; the named frequency."""
    for k, one in enumerate(answers):
        color, good = joint_colour(k), one.coherence >= REPORT.coherent
        look: Look = {"markersize": 2.0, "color": color, "alpha": 0.5}
        axes.loglog(one.frequency[good], one.measured[good], ".", **look)
        label = posture_words(one.posture, one.joint)
        axes.loglog(one.frequency, one.fitted, color=color, label=label)
    if math.isfinite(frequency):
        axes.axvline(frequency, color=style.VERMILLION, linewidth=0.8, zorder=0.5)
    levels = np.concatenate([one.fitted for one in answers])
    levels = levels[np.isfinite(levels) & (levels > 0.0)]
    if len(levels):
        axes.set_ylim(_ROOM[0] * float(levels.min()), _ROOM[1] * float(levels.max()))
    axes.set_xlabel("frequency [Hz]")
    unit = "" if answers[0].unit == "1" else f" [{format_unit(answers[0].unit)}]"
    axes.set_ylabel(f"acceleration per input{unit}")
    axes.legend(loc="best", fontsize="small")
    for axis in (axes.xaxis, axes.yaxis):
        style.log_ticks(axis)

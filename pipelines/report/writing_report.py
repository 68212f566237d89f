"""The report on the writing task: whether the model holds on logs it was not fitted to."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.figures import compared_figure
from pipelines.report.report import Cell, Figure, Report, Section, Table, Tone
from pipelines.report.sections import NO_COLLISION_CHECK
from pipelines.report.sentences import capital, paragraphs, sentence
from pipelines.report.style import format_number, format_unit, three_digits
from pipelines.report.words import each, joined
from pipelines.report.writing_figures import (
    executed_figure,
    part_name,
    simulated_figures,
    split_figure,
    task_figures,
)
from pipelines.writing.control_cases import Case
from pipelines.writing.task import Designed
from pipelines.writing.validation import Result

_PARTS = ("inertia", "coriolis", "gravity", "friction", "effects")

_say, _paragraphs = partial(sentence, "writing"), partial(paragraphs, "writing")


def writing_report(result: Result) -> Report:
    """The torque, Table IV, the simulation; or the task that was designed."""
    if result.design is not None:
        return _task_report(result, result.design)
    sections = (
        _torque_section(result),
        _cases_section(result),
        _simulation_section(result),
    )
    basis = (f"The model: {result.model}. --model FILE judges another.",)
    tone, key = _tone(result), _key_figures(result)
    return Report("Writing task", _verdict(result), tone, key, sections, basis=basis)


def _tone(result: Result) -> Tone:
    gates = [result.gates.torque]
    if any(log.experiment == "writing" for log in result.logs):  # the cases are of writing
        gates.append(result.gates.cases)
    return "bad" if False in gates else "good" if all(gates) else "attention"


def _verdict(result: Result) -> str:
    writing = sum(log.experiment == "writing" for log in result.logs)
    said: dict[str, object] = {"torque": (), "logs": writing or len(result.logs), "complete": ""}
    if (torque := result.torque) is not None:
        errors = torque.relative_error
        said["torque"] = [f"{format_number(100.0 * float(x), 2)} %" for x in errors]
    by = {one.case: one for one in result.cases}
    if {1, 6} <= set(by):
        same = by[1].origin == by[6].origin
        said["complete"], said["alone"] = _mm(by[6]), _mm(by[1])
        said["origin"] = by[6].origin if same else "partly simulated"
    said["cases"] = said["complete"] or result.cases_left_out
    return capital(_say("verdict", result, said))


def _mm(case: Case) -> str:
    values = case.tip_error_std.values
    return ", ".join(f"{1e3 * x:.2f}" if x >= 1e-4 else format_number(1e3 * x, 2) for x in values)


def _key_figures(result: Result) -> Table | None:
    if (torque := result.torque) is None:
        return None
    log = next(one for one in result.logs if one.experiment == "writing" or torque.of != "writing")
    simulated = result.simulation
    position = None if simulated is None else simulated.position_rms
    simulated_torque = None if simulated is None or position is None else simulated.torque_rms
    rows, tones = [], list[Tone]()
    for j, name in enumerate(result.joints):
        share = torque.relative_error[j]
        below = bool(share < result.gates.torque_limit)
        measured = map(three_digits, (torque.signal_rms[j], torque.rms[j], 100 * share))
        others = (None if x is None else three_digits(x[j]) for x in (position, simulated_torque))
        rows.append((name, *measured, "yes" if below else "no", *others))
        tones.append("good" if below else "bad")
    unit = joined(log.torque_units)
    length = joined("rad" if own == "N m" else "m" for own in log.torque_units)
    columns = (
        "joint",
        f"torque, rms [{unit}]",
        f"model misses, rms [{unit}]",
        "of it [%]",
        "below the gate",
        f"simulated position off by, rms [{length}]",
        f"simulated torque off by, rms [{unit}]",
    )
    return Table(columns, tuple(rows), f"The model: {result.model}.", tuple(tones))


def _torque_section(result: Result) -> Section:
    felt = any((log.parts_rms["effects"] > REPORT.felt * log.rms).any() for log in result.logs)
    parts = [name for name in _PARTS if felt or name != "effects"]
    rows = []
    for log in result.logs:
        errors = (log.relative_error, log.relative_error_low_pass)
        values = (log.signal_rms, log.rms, *(100 * x for x in errors))
        columns = [*values, *(log.parts_rms[name] for name in parts)]
        for j, name in enumerate(result.joints):
            rows.append((f"{log.name}, {name}", *(three_digits(x[j]) for x in columns)))
    cutoffs = sorted({log.low_pass_hz for log in result.logs if log.low_pass_hz is not None})
    ends = [format_number(hz, 2) for hz in (cutoffs[:1] + cutoffs[-1:])] or ["", ""]
    heads = ("log, joint", "torque", "left", "left [%]", "low-passed [%]", *map(part_name, parts))
    caption = (
        "Root mean squares in N m (N of a joint that slides): the measured torque, the residual of "
        "the model, and the parts of the model."
    )
    table = Table(heads, tuple(rows), caption)
    figures = _torque_figures(result)
    text = _paragraphs("torque", *ends)
    return Section("Torque: the first validation", text, (table,), figures)


def _torque_figures(result: Result) -> tuple[Figure, ...]:
    """Of the first log that has curves."""
    log = next((one for one in result.logs if one.course is not None), None)
    if log is None or log.course is None:
        return ()
    c = log.course
    measured = compared_figure(
        f"torque-{log.name}",
        f"{log.name}: torque measured and of the model, the friction in it, and the residual.",
        c.t,
        c.measured,
        c.model,
        f"torque [{log.torque_units[0]}]",
        "model",
        result.joints,
        (("friction", c.friction, style.GREEN), ("residual", c.residual, style.BLACK)),
    )
    return measured, split_figure(log, c, result.joints)


def _cases_section(result: Result) -> Section:
    base = [one.logs[0] for one in result.cases if one.origin == "simulated"]
    text = _paragraphs("cases", result, base[0] if base else "")
    title = "Control cases: the second validation"
    if not result.cases:
        return Section(title, text)
    first = next((one for one in result.cases if one.case == 1), None)
    rows: list[tuple[Cell, ...]] = []
    tones: list[Tone] = []
    for one in result.cases:
        spread = (
            (None,) * 3 if one.tip_error_std_spread is None else one.tip_error_std_spread.values
        )
        pairs = zip(one.tip_error_std.values, spread, strict=False)
        ahead = ", ".join(one.feedforward).replace("coriolis", "Coriolis") or "nothing"
        gain = _gain(first, one) if first is not None and one is not first else ""
        rows.append(
            (
                one.case,
                ahead,
                *(_with_spread(*p) for p in pairs),
                gain,
                one.origin,
                ", ".join(one.logs),
            )
        )
        gate = result.gates.cases if one.case == 6 else None
        tones.append({None: "neutral", True: "good", False: "bad"}[gate])  # type: ignore[arg-type]
    heads: tuple[str, ...] = ("case", "ahead of the feedback", "x [mm]", "y [mm]", "z [mm]")
    heads += ("case 1 over it, x, y, z", "origin", "log")
    caption = "Standard deviation of the tip's error, as Table IV of Kostić et al. 2004."
    table = Table(heads, tuple(rows), caption, tuple(tones))
    figure = executed_figure(result.cases)
    return Section(title, text, (table,), () if figure is None else (figure,))


def _gain(first: Case, one: Case) -> str:
    """Tip error of the first case over that of another, axis by axis."""
    pairs = zip(first.tip_error_std.values, one.tip_error_std.values, strict=True)
    return ", ".join(format_number(a / b, 2) if b > 0.0 else "∞" for a, b in pairs)


def _with_spread(value: float, spread: float | None) -> str:
    """[mm] with three digits, and the spread with one where it shows."""
    decimals = 2 - math.floor(math.log10(1e3 * value)) if value > 0.0 else 0
    shown = f"{1e3 * value:.{max(0, decimals)}f}"
    if spread is None or 1e3 * spread < 5e-5:
        return shown
    return f"{shown} ± {format_number(1e3 * spread, 1)}"


def _simulation_section(result: Result) -> Section:
    found = result.simulation
    if found is None:
        return Section("The task simulated", (f"Left out: {result.simulation_left_out}.",))
    figures = (found.position_rms, found.position_max, found.speed_rms, found.torque_rms)
    rows = tuple(
        (name, *(None if x is None else three_digits(x[j]) for x in figures))
        for j, name in enumerate(result.joints)
    )
    unit, torque_unit = joined(found.units), joined(found.torque_units)
    columns = (
        "joint",
        f"position, rms [{unit}]",
        f"position, largest [{unit}]",
        f"speed, rms [{each(unit, '/s')}]",
        f"torque, rms [{torque_unit}]",
    )
    table = Table(columns, rows, "Simulated minus measured.")
    drawn: tuple[Figure, ...] = ()
    if found.course is not None:
        drawn = tuple(simulated_figures(found.name, found.course, unit, torque_unit))
    return Section("The task simulated", _paragraphs("simulation", found), (table,), drawn)


def _task_report(result: Result, task: Designed) -> Report:
    """The task that was designed."""
    most = max(task.limits, key=lambda one: one.share, default=None)
    nearest = None
    if most is not None and np.isfinite(most.share) and most.share > 0.0:
        name = result.joints[most.joint - 1]
        nearest = {
            "joint": most.joint,
            "name": name,
            "share": most.share,
            "quantity": most.quantity,
        }
    rows = []
    for one in task.limits:
        bounded = np.isfinite(one.limit)
        limit, share = (one.limit, 100 * one.share) if bounded else ("none", None)
        name, unit = result.joints[one.joint - 1], format_unit(one.unit)
        rows.append((one.joint, name, one.quantity, one.peak, limit, unit, share, one.t))
    limits = Table(
        ("joint", "name", "quantity", "peak", "limit", "unit", "share [%]", "at [s]"),
        tuple(rows),
        "The most that the task asks. Anything beyond a limit would have been refused.",
    )
    sections = (
        Section("Before the robot moves", tables=(limits,), warning=NO_COLLISION_CHECK),
        Section("The task", figures=tuple(task_figures(task, result.joints))),
    )
    tone: Tone = "good" if task.torque_checked else "attention"
    return Report("Writing task", _say("task", task, nearest), tone, None, sections)

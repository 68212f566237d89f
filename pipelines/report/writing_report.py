"""The report on the writing task: whether the model holds where it was not fitted, and where it does not."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipelines.model.writing.cases import Case
from pipelines.model.writing.design import Designed
from pipelines.model.writing.first_validation import FirstValidation, Largest
from pipelines.model.writing.result import Result
from pipelines.report.bps import torque_figure
from pipelines.report.joint_units import each, joined
from pipelines.report.report import Cell, Figure, Report, Section, Table, Tone
from pipelines.report.style import format_decimals, format_number, format_unit, three_digits
from pipelines.report.writing_figures import error_map_figure, executed_figure, simulated_figures, split_figure, task_figures

__all__ = ["writing_report"]

_MOST_LETTERS = 40  # rows of the table of letters
_FELT = 0.5  # of what is left, from which on further effects are worth a column
_PARTS = ("inertia", "coriolis", "gravity", "friction", "effects")


def writing_report(result: Result) -> Report:
    """The verdict, torque and where it is missed, Table IV, the simulation; or the task that was designed."""
    if result.design is not None:
        return _task_report(result, result.design)
    sections = [_torque_section(result), _where_section(result), _online_section(result), _cases_section(result),
                _simulation_section(result)]
    return Report("Writing task", _verdict(result), _tone(result), _key_figures(result), tuple(sections),
                  basis=(f"The model: {result.model}. --model FILE judges another.",))


def _tone(result: Result) -> Tone:
    written = any(log.experiment == "writing" for log in result.logs)  # that nobody wrote is no remark: the cases are of writing
    gates = (result.gates.torque, result.gates.cases) if written else (result.gates.torque,)
    return "bad" if False in gates else "good" if all(gates) else "attention"


def _percents(values: Sequence[float] | np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    return ", ".join(f"{format_number(100.0 * float(x), 2)} %" for x in values)


def _verdict(result: Result) -> str:
    said = []
    if (torque := result.torque) is not None:
        count = sum(log.experiment == "writing" for log in result.logs) or len(result.logs)
        kind = "writing" if torque.of == "writing" else "held-out"
        holds = "The model holds on" if result.gates.torque else "The model does not hold on"
        said.append(f"{holds} {'the' if count == 1 else count} {kind} log{'s' * (count > 1)} it was not fitted to: it misses "
                    f"{_percents(torque.relative_error)} of {'its' if count == 1 else 'their'} torque, joint by joint (gate: "
                    f"{format_number(100 * result.gates.torque_limit, 3)} %)")
    by = {one.case: one for one in result.cases}
    if {1, 6} <= set(by):
        origin = by[6].origin if by[1].origin == by[6].origin else "partly simulated"
        verb = "strays by" if result.gates.cases else "strays, on some axis no less, by"
        said.append(f"with the complete model ahead of the feedback the tip {verb} {_mm(by[6])} mm in x, y, z instead of "
                    f"{_mm(by[1])} mm under feedback alone ({origin})")
    elif result.cases_left_out:
        said.append(f"{'some of ' if result.cases else ''}the control cases are left out: {result.cases_left_out}")
    text = "; ".join(said)
    return f"{text[:1].upper()}{text[1:]}."


def _mm(case: Case) -> str:
    return ", ".join(f"{1e3 * x:.2f}" if x >= 1e-4 else format_number(1e3 * x, 2) for x in case.tip_error_std.values)


def _list(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    return ", ".join(format_number(float(x), 2) for x in values)


def _key_figures(result: Result) -> Table | None:
    if (torque := result.torque) is None:
        return None
    log = next(one for one in result.logs if one.experiment == "writing" or torque.of != "writing")
    rows = tuple((name, *map(three_digits, (torque.signal_rms[j], torque.rms[j], 100 * torque.relative_error[j])),
                  "yes" if torque.relative_error[j] < result.gates.torque_limit else "no",
                  *((None, None) if result.simulation is None or result.simulation.position_rms is None else
                    (three_digits(result.simulation.position_rms[j]),
                     None if result.simulation.torque_rms is None else three_digits(result.simulation.torque_rms[j]))))
                 for j, name in enumerate(result.joints))
    unit, position = joined(log.torque_units), joined("rad" if own == "N m" else "m" for own in log.torque_units)
    return Table(("joint", f"torque, rms [{unit}]", f"model misses, rms [{unit}]", "of it [%]", "below the gate",
                  f"simulated position off by, rms [{position}]", f"simulated torque off by, rms [{unit}]"), rows,
                 f"The model: {result.model}.",
                 tuple("good" if row[4] == "yes" else "bad" for row in rows))


def _torque_section(result: Result) -> Section:
    felt = any((log.parts_rms["effects"] > _FELT * log.rms).any() for log in result.logs)
    parts = [name for name in _PARTS if felt or name != "effects"]
    rows: list[tuple[Cell, ...]] = [
        (f"{log.name}, {result.joints[j]}", *map(three_digits, (
            log.signal_rms[j], log.rms[j], 100 * log.relative_error[j], 100 * log.relative_error_low_pass[j],
            *(log.parts_rms[name][j] for name in parts))))
        for log in result.logs for j in range(len(result.joints))]
    columns = ("log, joint", "torque", "left", "left [%]", "low-passed [%]", *(name.capitalize() if name == "coriolis" else name
                                                                              for name in parts))
    cutoffs = [format_number(hz, 2) for hz in sorted({log.low_pass_hz for log in result.logs if log.low_pass_hz is not None})]
    span = " to ".join(dict.fromkeys((cutoffs[0], cutoffs[-1]))) if cutoffs else ""
    filtered = f" Low-passed: both after the same zero-phase low-pass, at {span} Hz." if cutoffs else ""
    table = Table(columns, tuple(rows), "Root mean squares in N m (N of a joint that slides): the measured torque, the residual of "
                  "the model, and the parts of the model.")
    text = ("The torque that the controller commanded, beside the torque of the model on the motion that was realised. A command "
            "also holds what the controller makes of encoder steps and noise, which no model has."
            f"{filtered}",)
    drawn: list[Figure] = []
    for log in [one for one in result.logs if one.course is not None][:1]:
        c = log.course
        assert c is not None
        drawn.append(torque_figure(f"torque-{log.name}", f"{log.name}: torque measured and of the model, the friction in it, and "
                                   "the residual.", c.t, c.measured, c.model, c.friction, c.left, result.joints,
                                   log.torque_units[0]))
        drawn += [split for split in (split_figure(log, result.joints),) if split is not None]
    return Section("Torque: the first validation", text, (table,), tuple(drawn))


def _where_section(result: Result) -> Section:
    log = result.logs[0]
    kinds = {"letters": f"letters, read back from the reference: '{log.text}'", "strokes": "stretches between standstills",
             "time": "stretches of time"}
    worst = [_worst(log, one, result.joints[one.joint - 1]) for one in log.largest]
    filtered = "" if log.low_pass_hz is None else ", after the low-pass"
    text = (f"By {kinds[log.marks]}. Log {log.name}{filtered}.", *worst)
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (one.label, one.start, one.end, *(three_digits(100 * x) for x in one.relative_error))
        for one in log.letters[:_MOST_LETTERS])
    table = Table(("where", "from [s]", "to [s]", *(f"{name} [%]" for name in result.joints)), rows,
                  "What the model leaves in each, rms, over the torque of the whole log.", keeps_empty=True)
    figure = error_map_figure(log, result.joints)
    return Section("Where the torque is missed", text, (table,), () if figure is None else (figure,))


def _worst(log: FirstValidation, one: Largest, joint: str) -> str:
    """Where the model of one joint misses most: the stretch, and its largest sample, where that is one that says anything."""
    unit = log.torque_units[one.joint - 1]
    said = f"{joint}: most in {one.label} ({format_number(one.rms, 2)} {unit} rms)"
    size, at = f"{format_number(abs(one.error), 2)} {unit}", f"{format_number(one.t, 4)} s"
    if end := _at_the_edge(log, one.t):
        return (f"{said}. Its largest sample, {size} at {at}, stands within one period of the low-pass of the {end} of the log: "
                "there filter and smoother see one side only, and it says nothing of the model.")
    return f"{said}, up to {size} at {at}, tip at ({', '.join(format_decimals(x, 3) for x in one.tip)}) m."


def _at_the_edge(log: FirstValidation, t: float) -> str:
    """Which end of the log `t` [s] is nearer to than one period of the low-pass: "beginning", "end" or "" for none."""
    if log.low_pass_hz is None or not log.letters:
        return ""
    near = 1.0 / log.low_pass_hz
    return "beginning" if t - log.letters[0].start < near else "end" if log.letters[-1].end - t < near else ""


def _online_section(result: Result) -> Section:
    rows: list[tuple[Cell, ...]] = [
        (log.name, log.online.observer, _list(100 * log.online.relative_error), _list(100 * log.online.relative_error_low_pass))
        for log in result.logs if log.online is not None]
    table = Table(("log", "motion of", "left [%]", "left, low-passed [%]"), tuple(rows),
                  f"Relative errors as above ({', '.join(result.joints)}), with the motion that an observer sees meanwhile.")
    return Section("Sample by sample, as it would run online", (
        "The complete model was also evaluated one sample at a time, as a controller would. An observer's acceleration is noisier "
        "than a smoother's, which sees what comes after; the low-passed error leaves that noise out. How long one sample took "
        "is in provenance.json.",), (table,))


def _cases_section(result: Result) -> Section:
    text = []
    if result.cases_left_out:
        some = "Some of the six control cases are" if result.cases else "The six control cases are"
        text.append(f"{some} left out: {result.cases_left_out}.")
    if result.cases_apart:
        text.append(f"Not compared: {', '.join(result.cases_apart)}. The controller is not one of the six, its gains are others, "
                    "or it followed another reference.")
    if any(one.origin == "simulated" for one in result.cases):
        base = next(one.logs[0] for one in result.cases if one.origin == "simulated")
        text.append(f"Simulated: on the controller of {base}. The plant is the model plus what it left of the torque of that log, "
                    "replayed over time. " + (
                        f"The controller ran on {result.draws} other models in turn, drawn from {result.drawn}; ± is the spread "
                        "over them." if result.drawn else "The controller ran on the plant's model, for the model file states no "
                        "uncertainty: case 6 errs by what is replayed alone, and would err by more on the arm."))
    if not result.cases:
        return Section("Control cases: the second validation", tuple(text))
    first = next((one for one in result.cases if one.case == 1), None)
    rows: list[tuple[Cell, ...]] = []
    tones: list[Tone] = []
    for one in result.cases:
        spread = one.tip_error_std_spread
        shown = [_with_spread(x, None if spread is None else spread.values[k]) for k, x in enumerate(one.tip_error_std.values)]
        gain = None if first is None or one is first else ", ".join(
            format_number(a / b, 2) if b > 0.0 else "∞" for a, b in zip(first.tip_error_std.values, one.tip_error_std.values,
                                                                       strict=True))
        ahead = ", ".join(one.feedforward).replace("coriolis", "Coriolis")
        rows.append((one.case, ahead or "nothing", *shown, gain or "", one.origin, ", ".join(one.logs)))
        tone: Tone = "neutral" if one.case != 6 or result.gates.cases is None else "good" if result.gates.cases else "bad"
        tones.append(tone)
    table = Table(("case", "ahead of the feedback", "x [mm]", "y [mm]", "z [mm]", "case 1 over it, x, y, z", "origin", "log"),
                  tuple(rows), "Standard deviation of the tip's error, as Table IV of Kostić et al. 2004.", tuple(tones))
    figure = executed_figure(result.cases)
    return Section("Control cases: the second validation", tuple(text), (table,), () if figure is None else (figure,))


def _with_spread(value: float, spread: float | None) -> str:
    decimals = 2 - math.floor(math.log10(1e3 * value)) if value > 0.0 else 0
    shown = f"{1e3 * value:.{max(0, decimals)}f}"
    return shown if spread is None or 1e3 * spread < 5e-5 else f"{shown} ± {format_number(1e3 * spread, 1)}"


def _simulation_section(result: Result) -> Section:
    found = result.imitation
    if found is None:
        return Section("The task simulated", (f"Left out: {result.simulation_left_out}.",))
    how = ("in closed loop: the controller, the references and the encoders of the log" if found.simulation == "closed-loop" else
           f"in windows of {format_number((found.window or 0.0) * 1e3, 3)} ms under the logged torque ({found.reason})")
    text = (f"The model in the experiment of {found.name}, {how}. The log does not say what the arm did.",)
    rows = tuple((name, *(None if x is None else three_digits(x[j]) for x in (
        found.position_rms, found.position_max, found.speed_rms, found.torque_rms)))
                 for j, name in enumerate(result.joints))
    unit, torque_unit = joined(found.units), joined(found.torque_units)
    table = Table(("joint", f"position, rms [{unit}]", f"position, largest [{unit}]", f"speed, rms [{each(unit, '/s')}]",
                   f"torque, rms [{torque_unit}]"), rows, "Simulated minus measured.")
    drawn = () if found.course is None else tuple(simulated_figures(found.name, found.course, unit, torque_unit))
    return Section("The task simulated", text, (table,), drawn)


def _task_report(result: Result, task: Designed) -> Report:
    """The task that was designed."""
    nearest = max(task.limits, key=lambda one: one.share, default=None)
    what = f"'{task.text}' takes" if task.kind == "text" else "The via points take"
    said = f"{what} {format_number(task.duration, 3)} s"
    if nearest is not None and np.isfinite(nearest.share) and nearest.share > 0.0:
        said += (f" and asks most of joint {nearest.joint}, {result.joints[nearest.joint - 1]}: "
                 f"{format_number(100 * nearest.share, 3)} % of its {nearest.quantity} limit")
    if not task.torque_checked:
        said += "; torque limits could not be checked, for neither a model nor the links are known"
    rows = tuple((one.joint, result.joints[one.joint - 1], one.quantity, one.peak,
                  one.limit if np.isfinite(one.limit) else "none", format_unit(one.unit),
                  100 * one.share if np.isfinite(one.limit) else None, one.t) for one in task.limits)
    limits = Table(("joint", "name", "quantity", "peak", "limit", "unit", "share [%]", "at [s]"), rows,
                   "The most that the task asks. Anything beyond a limit would have been refused.")
    made = Table(("what", "value", "unit"), (("joints found", task.inverse, ""), ("sample time", task.sample_time, "s"),
                                             *((name, value, format_unit(unit)) for name, value, unit in task.page)))
    return Report("Writing task", f"{said}.", "good" if task.torque_checked else "attention", made,
                  (Section("Before the robot moves", (), (limits,),
                           warning="Self-collision is not checked, nor is collision with anything around the robot."),
                   Section("The task", (), (), tuple(task_figures(task, result.joints)))))

"""The report on a designed experiment: what it will tell, how near it comes to its limits, and what was not checked."""

from __future__ import annotations

import math

import numpy as np

from pipelines.model.excitation.doubts import beyond_words
from pipelines.model.excitation.result import DrawnPlan, Result
from pipelines.report.excitation_apart import alike_words, apart_section, are_rivals
from pipelines.report.excitation_figures import limited_figure, relative_std_figure, singular_value_figure, spectrum_figure
from pipelines.report.excitation_smaller import much_smaller, smaller_words
from pipelines.report.joint_units import unit_of
from pipelines.report.report import Figure, Report, Section, Table, Tone
from pipelines.report.sections import joint_signal_figure
from pipelines.report.style import format_number, format_unit

__all__ = ["excitation_report"]

_UNCHECKED = "Self-collision is not checked, nor is collision with anything around the robot."
_AIMS = {"A": "smallest relative std", "D": "smallest confidence ellipsoid", "E": "best known worst direction",
         "condition": "smallest condition number", "frobenius": "smallest Frobenius condition number"}
_DRAWN_PLANS = 6
_NEAR_BOUND = 1.5  # times: what is farther from the bound is no percentage of it
_DEAR = 0.02  # share of the cost that is worth naming


def excitation_report(result: Result) -> Report:
    """The motion, its limits, what it tells; of other experiments their plans."""
    if result.purpose != "excitation":
        return _plans_report(result)
    sections = (_safety(result), _motion(result), _limits(result), _told(result), apart_section(result.apart), _certificate(result),
                _comparison(result))
    return Report("Excitation", _verdict(result), _tone(result), _key_figures(result), tuple(s for s in sections if s is not None),
                  basis=(_robot(result),))


def _tone(result: Result) -> Tone:
    found = result.rehearsal
    if not result.reached or result.interrupted or result.rehearsal_failed or (found is not None and not found.safe):
        return "attention"
    if are_rivals(result.apart):
        return "attention"
    return "good" if result.torque_checked else "attention"


def _verdict(result: Result) -> str:
    said = [f"The excitation has the condition number {format_number(result.condition_number)}"]
    if result.predicted_relative_std is not None and result.torque_checked:
        said.append(f"and will show the parameters to {format_number(100 * result.predicted_relative_std, 3)} % (predicted, root "
                    "mean square of their relative standard deviations)")
    text = " ".join(said)
    if result.apart is not None:
        text += f"; {alike_words(result.apart)}"
    if much_smaller(result):
        text += f"; {smaller_words(result)}"
    if not result.reached and result.ceiling is not None:
        dear = result.dearest
        text += f"; a condition number of {result.ceiling:g} was not reached{f', the {dear} is most in the way' if dear else ''}"
    if not result.torque_checked:
        text += "; torque limits could not be checked, for neither a model nor the links are known"
    if result.rehearsal is not None and (trouble := beyond_words(result.joints, result.rehearsal)):
        text += f"; in the rehearsal {', '.join(trouble)}"
    if result.interrupted:
        text += "; the work was interrupted, this is its best by then"
    return text + "."


def _robot(result: Result) -> str:
    """For which robot, and why that one where none was named."""
    return f"For the robot {result.robot}{f' ({result.robot_from})' if result.robot_from else ''}."


def _key_figures(result: Result) -> Table:
    start = "at rest at home" if result.home is not None and not result.run_in else (
        f"run-in and run-out of {result.run_in:.3g} s" if result.run_in else "at rest")
    rows: list[tuple[str, str | float | int | None]] = [
        ("aim", _aim(result)), ("condition number of Φ", result.condition_number)]
    if result.lower_bound is not None:
        rows.append(("no motion of this arm can be below", result.lower_bound))
    if result.torque_checked:
        rows.append(("relative standard deviation, predicted [%]", 100 * (result.predicted_relative_std or math.nan)))
    rows += [("Frobenius condition number", result.frobenius), ("smallest singular value of Φ/√n", result.smallest_singular_value),
             ("log det of the information matrix", result.log_determinant),
             ("duration", f"{result.periods} × {result.period:g} s{f' and twice {result.run_in:.3g} s' if result.run_in else ''}"),
             ("highest harmonic [Hz]", result.top_hz), ("start and end", start),
             ("evaluations, seed", f"{result.evaluations}, {result.seed}")]
    if result.after:
        rows.append(("information added of", ", ".join(result.after[:6])))
    if result.first_mode is not None:
        rows.append((f"first mode known; no harmonic above 1/{result.mode_factor:g} of it [Hz]", result.first_mode))
    return Table(("what", "figure"), tuple(rows))


def _aim(result: Result) -> str:
    aim = _AIMS["A" if result.criterion == "default" else result.criterion]
    return aim if result.ceiling is None else f"{aim}, condition ≤ {result.ceiling:g}"


def _safety(result: Result) -> Section:
    text, tables = [_robot(result)], []
    found = result.rehearsal
    if found is None:
        text.append(f"The rehearsal in simulation failed: {result.rehearsal_failed}." if result.rehearsal_failed else
                    "It was not rehearsed in simulation, for no model of the arm is known."
                    if not result.torque_checked or result.torque_bounded else
                    "It was not rehearsed in simulation.")
    else:
        end = ", ".join(beyond_words(result.joints, found)) or "no drive saturates, no joint exceeds its speed or its range"
        part = f"one of its {result.periods} periods, {found.seconds:.3g} s" if result.periods > 1 else f"its {found.seconds:.3g} s"
        part += " with run-in and run-out" if result.periods > 1 and result.run_in else ""
        text.append(f"Rehearsed in simulation, {part}, under PD control of 8 Hz a joint, without feed-forward: {end}. Another "
                    "controller will follow otherwise.")
        if found.position_beyond is None:
            text.append("How near the joints came to the ends of their ranges is not known.")
        position, torque, speed = (unit_of(result.limits, quantity) for quantity in ("position", "torque", "speed"))
        past = found.position_beyond or (math.nan,) * len(result.joints)
        tables.append(Table(("joint", f"away, rms [{position}]", f"away, most [{position}]", f"torque, peak [{torque}]",
                             f"limit [{torque}]", "used [%]", f"speed, peak [{speed}]", f"limit [{speed}]", "used [%]",
                             f"left of its range [{position}]", "saturated [%]"), tuple(
            (name, found.position_rms[j], found.position_max[j], found.torque_peak[j], found.torque_limit[j],
             100 * found.torque_peak[j] / found.torque_limit[j], found.speed_peak[j], found.speed_limit[j],
             100 * found.speed_peak[j] / found.speed_limit[j], None if math.isnan(past[j]) else -past[j],
             100 * found.saturated[j]) for j, name in enumerate(result.joints))))
    return Section("Before the robot moves", tuple(text), tuple(tables), warning=_UNCHECKED)


def _ends(result: Result, quantity: str) -> tuple[list[float], list[float]]:
    """Limits (low, high) of a quantity, joint by joint; infinite where open."""
    low, high = [-math.inf] * len(result.joints), [math.inf] * len(result.joints)
    for one in result.limits:
        if one.quantity == quantity and one.joint is not None:
            (high if one.limit > 0.0 else low)[one.joint - 1] = one.limit
            if quantity != "position":  # the other end is as far
                (low if one.limit > 0.0 else high)[one.joint - 1] = -one.limit
    return low, high


def _motion(result: Result) -> Section | None:
    c = result.course
    if c is None:
        return None
    own = {quantity: format_unit(unit_of(result.limits, quantity)) for quantity in ("position", "speed", "acceleration", "torque")}
    kinds = [("position", "positions", c.q, f"position [{own['position']}]", "Positions over one period."),
             ("speed", "speeds", c.dq, f"speed [{own['speed']}]", "Speeds; dashed, limits that are near."),
             ("acceleration", "accelerations", c.ddq, f"acceleration [{own['acceleration']}]",
              "Accelerations; dashed, limits that are near.")]
    if c.tau is not None:
        kinds.append(("torque", "torques", c.tau, f"torque [{own['torque']}]", f"Torques that the model expects; dashed, "
                      f"{100 * result.torque_share:.0f} % of the limits, what the plan may use."))
    figures: list[Figure] = []
    for quantity, name, values, label, caption in kinds:
        low, high = _ends(result, quantity)
        figures.append(limited_figure(name, caption, c.t, values, low, high, label, result.joints))
    shown = c.amplitude.max(axis=1) > 1e-12
    figures.append(spectrum_figure("spectrum", "Which frequencies move each joint: amplitude of its speed.", c.hertz[shown],
                                   c.amplitude[shown], result.joints))
    return Section("The motion", (), (), tuple(figures))


def _limits(result: Result) -> Section:
    rows = tuple(("tip" if one.joint is None else result.joints[one.joint - 1], one.quantity, one.peak, one.limit,
                  format_unit(one.unit),
                  100 * one.share, 100 * one.cost) for one in result.limits)
    dear = [one for one in sorted(result.limits, key=lambda one: -one.cost) if one.cost > _DEAR][:3]
    named = ", ".join(f"{one.quantity} of {'the tip' if one.joint is None else result.joints[one.joint - 1]}" for one in dear)
    text = ["Limits hold between samples too: positions, speeds and accelerations are trigonometric polynomials, and on a grid of "
            "0.1 ms these exceed their largest sample by a known factor at most; of torque and tip half a step between samples is "
            "added."]
    if smaller := smaller_words(result):
        text.append(f"{smaller[0].upper()}{smaller[1:]}.")
    if named:
        text.append(f"What limits the design most: {named}. The cost is the share of what the criterion would gain, were that "
                    "limit a little wider.")
    if not result.torque_checked:
        text.append("Torque limits were not checked: give a model, or describe the links.")
    if result.torque_bounded:
        text.append("No model is known: torque limits hold for any parameters between the bounds given.")
        if not result.friction_columns:
            text.append("Friction is not counted in that torque.")
    if result.speed_share < 1.0:
        text.append(f"Of every speed limit the plan uses {100 * result.speed_share:.0f} %, for a loop overshoots.")
    if result.torque_checked and result.torque_share < 1.0:
        text.append(f"Of every torque limit the plan uses {100 * result.torque_share:.0f} %; the rest is left to the controller.")
    return Section("Limits", tuple(text), (Table(("joint", "of", "peak", "limit used", "unit", "of it [%]", "cost [%]"), rows),))


def _told(result: Result) -> Section:
    rows = tuple((p.name, p.value, p.std, format_unit(p.unit),
                  None if not p.value else 100 * p.std / abs(p.value)) for p in result.parameters)
    relative = [(p.name, 100 * p.std / abs(p.value)) for p in result.parameters if p.value]
    noise = ", ".join(format_number(value, 3) for value in result.noise)
    text = (f"Standard deviations are those of one experiment whose torque has white noise of {noise} N m (standard deviation, "
            f"joint by joint), sampled every {1e3 * result.sample_time:g} ms. What the model lacks adds to them.",
            "A small condition number is no aim in itself: it presses all singular values down to the smallest.",
            "The condition number is the largest singular value of Φ over the smallest; the Frobenius condition number, "
            "‖Φ‖ ‖Φ⁺‖, counts those between as well: the root of the sum of their squares times that of their inverses' squares.")
    figures = [singular_value_figure("singular-values", "Singular values of Φ: the smallest belongs to the direction known worst.",
                                     result.singular_values)]
    if relative:
        names, percent = zip(*relative, strict=True)
        figures.append(relative_std_figure(
            "relative-std", "Predicted standard deviation of every parameter, relative to its value.", names, percent))
    columns = ("parameter", "believed value", "predicted std", "unit", "relative [%]")
    return Section("What it will tell", text, (Table(columns, rows),), tuple(figures))


def _certificate(result: Result) -> Section | None:
    if result.lower_bound is None or result.condition_number is None:
        return None
    ratio = result.condition_number / result.lower_bound
    beyond = f"{100 * (ratio - 1.0):.3g} % above" if ratio < _NEAR_BOUND else f"{ratio:.3g} times as much"
    return Section("Certificate", (
        f"No motion of this arm has a condition number below √(3/2) = {result.lower_bound:.5f}; this one has "
        f"{result.condition_number:.4f}, {beyond}.",
        "Why: let M = ΦᵀΦ/n, λ its smallest eigenvalue, and b the acceleration of the third link, q̈₂ + q̈₃, with the mean square Z.",
        "First, Z is at least λ. Take the parameter vector that has 1/√2 at p12 and p13 and zero elsewhere. Its torque is "
        "(q̈₂ + q̈₃)/√2 at joint 2 and the same at joint 3: p12's column is q̈₂ at joint 2, p13's is q̈₃ at joint 2 and b at joint 3. "
        "The mean square of that torque is Z/2 + Z/2 = Z, and no unit vector gives less than λ.",
        "Second, the columns of p7, p8 and p9. At joint 1, the mean squares of p8's and p9's column add up to that of b² + "
        "(q̇₂ + q̇₃)⁴, for their sines and cosines complete each other: at least Z. At joints 2 and 3 both columns are q̈₁ times a "
        "cosine and a sine, which complete each other too: twice the mean square of q̈₁, and that mean square is the diagonal "
        "element of p7. So M₈₈ + M₉₉ ≥ 2 M₇₇ + Z.",
        "Every diagonal element is at least λ, so M₇₇ ≥ λ, and with Z ≥ λ the sum is at least 3 λ. The larger of the two is at "
        "least 1.5 λ, and so is the largest eigenvalue. The condition number of Φ is the root of their ratio.",
        "The argument holds for any motion, periodic or not, and with further columns as well, for these only widen "
        "the range of the eigenvalues."))


def _comparison(result: Result) -> Section | None:
    r = result.random
    if r is None or result.predicted_relative_std is None:
        return None
    rows = (("this design", result.condition_number, 100 * result.predicted_relative_std),
            (f"random, median of {r.count}", r.condition_median, 100 * r.relative_std_median),
            (f"random, best condition of {r.count}", r.condition_best, None))
    times = r.relative_std_median / result.predicted_relative_std
    return Section("Beside random motions", (
        f"Random coefficients, scaled until a limit is met: their standard deviation is "
        f"{format_number(times, 2)} times this design's.",),
        (Table(("motion", "condition number", "relative std, predicted [%]"), rows),))


def _plans_report(result: Result) -> Report:
    what = {"friction": "friction", "frf": "frequency responses", "hold": "static postures"}[result.purpose]
    verdict = f"{len(result.plans)} experiments for {what} are planned, {result.duration:.3g} s altogether."
    rows = tuple((p.name, p.joint, p.seconds, p.speed_peak, p.acceleration_peak, p.words) for p in result.plans)
    table = Table(("experiment", "joint", "duration [s]", "speed, peak [rad/s]", "acceleration, peak [rad/s^2]", "what"), rows)
    kept = Table(("experiment", "nearest limit", "joint", "peak", "limit used", "unit", "of it [%]"), tuple(
        (p.name, n.quantity, n.joint, n.peak, n.limit, format_unit(n.unit), 100 * n.share)
        for p in result.plans if (n := p.nearest) is not None))
    words = "Position, speed, acceleration and tip are looked at sample by sample, half a step added"
    words += ", torque with the excitation as well." if result.torque_checked else "; torque is not, for neither a model nor the " \
        "links are known."
    moving = [p for p in result.plans if p.speed_peak > 0.0][:_DRAWN_PLANS]
    sections = [_plans_safety(result), Section("Experiments", (), (table,)), Section("Limits", (words,), (kept,))]
    if moving:
        sections.append(Section("Motions", (), (), tuple(_plan_figure(p, result) for p in moving)))
    troubled = [name for name, found in result.rehearsals if not found.safe]
    if troubled:
        verdict += f" In the rehearsal of {', '.join(troubled)} a limit is not kept."
    safe = not result.rehearsal_failed and not troubled
    return Report("Planned experiments", verdict, "neutral" if safe else "attention", None, tuple(sections),
                  basis=(_robot(result),))


def _plans_safety(result: Result) -> Section:
    """Of each plan the joint that is nearest to trouble in its rehearsal."""
    if not result.rehearsals:
        return Section("Before the robot moves", (_robot(result), f"The rehearsal in simulation failed: {result.rehearsal_failed}."
                                                  if result.rehearsal_failed else "They were not rehearsed in simulation.",), (),
                       warning=_UNCHECKED)
    rows = []
    for name, found in result.rehearsals:
        full = [x / limit for x, limit in zip(found.torque_peak, found.torque_limit, strict=True)]
        fast = [x / limit for x, limit in zip(found.speed_peak, found.speed_limit, strict=True)]
        rows.append((name, found.seconds, max(found.position_rms), max(found.position_max), 100 * max(full), 100 * max(fast),
                     100 * max(found.saturated)))
    text = [_robot(result), "Each was rehearsed in simulation under PD control of 8 Hz a joint, without feed-forward; of all "
            "joints the worst is listed. Another controller will follow otherwise."]
    if result.purpose == "frf":
        text.append("The excitation moves the arm away from its slow turn, as it is to.")
    if result.rehearsal_failed:
        text.append(f"The rest failed: {result.rehearsal_failed}.")
    position = unit_of(result.limits, "position")
    head = ("experiment", "rehearsed [s]", f"away, rms [{position}]", f"away, most [{position}]", "torque, of its limit [%]",
            "speed, of its limit [%]", "saturated [%]")
    return Section("Before the robot moves", tuple(text), (Table(head, tuple(rows)),), warning=_UNCHECKED)


def _plan_figure(plan: DrawnPlan, result: Result) -> Figure:
    own = np.ptp(plan.q, axis=0) > 0.0
    names = tuple(name for name, moves in zip(result.joints, own, strict=True) if moves)
    return joint_signal_figure(plan.name, f"{plan.name}: {plan.words}.", plan.t, plan.q[:, own], unit_of(result.limits, "position"),
                               quantity="position", names=names)

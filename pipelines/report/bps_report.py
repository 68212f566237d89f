"""The report of an estimate: the verdict, Table V with standard deviations, and what the estimate rests on."""

from __future__ import annotations

import math

import numpy as np

from pipelines.model.estimation.balance import ALONE
from pipelines.model.estimation.compare import Compared
from pipelines.model.estimation.floor import Beside
from pipelines.model.estimation.outcome import Estimated
from pipelines.model.estimation.result import Result
from pipelines.model.estimation.words import column_in_words
from pipelines.report.boundary_card import boundary_card
from pipelines.report.bps import convergence_figure, torque_figure
from pipelines.report.bps_balance import balance_table, balance_words
from pipelines.report.figure_words import figure_in_words as plain
from pipelines.report.model_words import friction_words
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.style import format_number, format_unit, with_std

__all__ = ["bps_report"]

_GOOD = 0.1  # relative torque error that is worth calling good
_POOR = 0.5  # one that explains too little to be used
_SURE = 3.0  # standard deviations: a value that is clearly visible
_ABOVE_NOISE = 10.0  # times what the noise between periods leaves, as in a diagnosis: beyond it the model lacks something
_STANDS_OUT = 2.0  # times the overall relative error: a joint worth naming
_ALIKE = 0.02  # of the better error: less is no difference worth speaking of


def bps_report(result: Result) -> Report:
    """The verdict, Table V with standard deviations, and what the estimate rests on."""
    sections = [_parameter_section(result), _course_section(result), _trust_section(result)]
    if result.noise_floor:
        sections.insert(2, _noise_section(result))
    sections = [*boundary_card(result.boundary), *sections]
    if result.comparison:
        sections.append(_comparison_section(result))
    return Report("Base parameters", _verdict(result), _tone(result), _key_figures(result), tuple(sections),
                  basis=(friction_words(result),))


def _tone(result: Result) -> Tone:
    error = result.relative_error["validate"]
    if result.unresolved or result.physically_consistent is False or error >= _POOR:
        return "bad"
    above, _ = _above_noise(result)
    sound = not _worst_joints(result) and not _contradictions(result) and above <= _ABOVE_NOISE
    return "good" if error < _GOOD and sound else "attention"


def _contradictions(result: Result) -> tuple[str, ...]:
    """What the estimate's own checks say against its parameters or their standard deviations, a sentence each."""
    found = []
    if (balance := result.balance) is not None and not balance.agree:
        found.append(f"The balance of power does not confirm the parameters: χ² {format_number(balance.chi_square, 2)} in "
                     f"{balance.freedom} degrees of freedom.")
    moved, name = _settling(result)
    if moved > ALONE:
        found.append(f"The two halves of the samples contradict each other: {name} differs by {moved:.1f} standard deviations.")
    return tuple(found)


def _worst_joints(result: Result) -> tuple[tuple[str, float], ...]:
    """Joints that the model explains far worse than the whole arm, and not well, and their relative error; the worst first."""
    pairs = zip(result.torque_rms["validate"], result.torque_signal_rms["validate"], strict=True)
    errors = [left / whole if whole > 0.0 else 0.0 for left, whole in pairs]
    least = max(_GOOD, _STANDS_OUT * result.relative_error["validate"])
    far = [pair for pair in zip(result.joints, errors, strict=True) if pair[1] > least]
    return tuple(sorted(far, key=lambda pair: -pair[1]))


def _percent(share: float) -> str:
    return f"{format_number(100.0 * share, 2)} %"


def _signed(x: float) -> str:
    return f"{'+' if x > 0.0 else ''}{format_number(x, 2)}"


def _formula(text: str) -> str:
    """A combination of parameters as it is written: a2² m3 − √(p5² + p6²) ≥ 0."""
    return text.replace("^2", "²").replace(">=", "≥").replace("- ", "− ").replace("sqrt(", "√(")


def _seen(p: Estimated) -> str:
    """"clearly", "known to be small" (its deviation is small beside its like), "barely", or "no"."""
    if p.value is None or p.std is None:
        return "no"
    return "barely" if not p.visible else "clearly" if abs(p.value) > _SURE * p.std else "known to be small"


def _verdict(result: Result) -> str:
    judged = "held-out logs" if result.held_out == "logs" else "blocks held out of the fitted logs (for none has role validate)"
    if result.unresolved:
        return " ".join((f"These logs do not determine the model: {result.unresolved}.", *_together(result)))
    seen = [_seen(p) for p in result.parameters]
    small, error, noise = seen.count("known to be small"), result.relative_error["validate"], _beside_noise(result)
    worst = ", ".join(f"{name} {_percent(own)}" for name, own in _worst_joints(result))
    below = "" if result.filter_hz is None else f" below {format_number(result.filter_hz, 2)} Hz"
    sentences = (*(("No links that could exist have these parameters: some would need negative mass or inertia.",)
                   if result.physically_consistent is False else ()), *_contradictions(result),
                 f"{'The model predicts' if error < _POOR else 'The model does not explain these logs: it predicts'} the torque of "
                 f"{judged}{below} with an error of {_percent(error)} (rms){f', in single joints more: {worst}' if worst else ''}"
                 f"{f'; {noise}' if noise else ''}.",
                 f"{seen.count('clearly')} of {len(seen)} parameters are clearly visible"
                 f"{f', {small} known to be small' if small else ''}.", *_together(result))
    return " ".join(sentences)


def _together(result: Result) -> tuple[str, ...]:
    """"mz5 and torque offset at joint 5 are determined only together.", a sentence for each group."""
    groups = [[column_in_words(name) for name in group] for group in result.not_separated]
    return tuple(f"{', '.join(group[:-1])} and {group[-1]} are determined only together." for group in groups)


def _beside_noise(result: Result) -> str:
    """"the residual of the fitted logs is at most 1.1 times what the noise between periods leaves"; empty without periods."""
    worst, joint = _above_noise(result)
    if not joint:
        return ""
    several = len(result.joints) > 1
    return (f"the residual of the fitted logs is {'at most ' if several else ''}{worst:.2g} times what the noise between periods "
            f"leaves"
            f"{f' ({joint})' if several else ''}")


def _above_noise(result: Result) -> tuple[float, str]:
    """Return the largest residual of the fitted logs over the noise between periods, and its joint; (0, "") without periods."""
    return max(((float(ratio), result.joints[j]) for log in result.noise_floor if log.role == "identify"
                for j, ratio in enumerate(log.ratio) if math.isfinite(ratio)), default=(0.0, ""))


def _periods_of(log: Beside) -> str:
    """Which periods make the equations, and what is unlike the others: left out of a mean, else kept."""
    fate = "left out" if log.averaged else "kept"
    unlike = f"; period {', '.join(map(str, log.left_out))} differs and is {fate}" if log.left_out else ""
    unlike += f"; its first {log.settling_time:.2g} s, in which the motion settled, are {fate}" if log.settling_time else ""
    unlike += "; how long its motion took to settle is not known" if log.settling_time is None else ""
    return (f"{log.log}: the mean of {log.periods} periods makes the equations{unlike}." if log.averaged else
            f"{log.log}: its periods are not averaged, {log.why_not}{unlike}.")


def _noise_section(result: Result) -> Section:
    """Residual and noise floor side by side, and which periods were averaged."""
    text, rows = [], []
    for log in result.noise_floor:
        text.append(_periods_of(log))
        rows += [(log.log, name, log.position[j], log.torque[j], log.torque_low_pass[j], log.motion[j], log.noise_floor[j],
                  log.residual[j], log.ratio[j]) for j, name in enumerate(result.joints)]
    unit, position = _torque_unit(result), " or ".join(dict.fromkeys("m" if own == "N" else "rad" for own in result.torque_units))
    columns = ("log", "joint", f"position, one sample [{position}]", f"torque, one sample [{unit}]",
               f"after the low-pass [{unit}]", f"by noise of the motion [{unit}]", f"noise floor [{unit}]", f"residual [{unit}]",
               "residual / floor")
    values = tuple(tuple(x if isinstance(x, str) or math.isfinite(x) else None for x in row) for row in rows)
    text.append("What differs from one period to the next is noise, which no model explains. A residual well above it is what "
                "this model lacks; where it is no larger, more experiments help, not more model.")
    return Section("Residual beside the noise floor", tuple(text),
                   (Table(columns, values, "Root mean squares, of the mean period: an error of the model is the same in all, noise "
                                           "is not. Where periods are not alike, of every sample."),))


def _key_figures(result: Result) -> Table:
    beside = tuple((f"residual over noise floor, {log.log}, joint by joint", ", ".join(f"{ratio:.2g}" for ratio in log.ratio))
                   for log in result.noise_floor if all(map(math.isfinite, log.ratio)))
    rows: tuple[tuple[str, str | float | None], ...] = (
        ("relative torque error, fitted logs [%]", 100 * result.relative_error["identify"]),
        (f"relative torque error, held-out {result.held_out} [%]", 100 * result.relative_error["validate"]),
        *beside,
        ("equations, joint by joint", ", ".join(map(str, result.equations))),
        ("condition number of the rigid columns", result.condition_number),
        ("condition number of the fit, unit columns", result.condition_number_fit),
        ("low-pass over torque and columns [Hz]", "none" if result.filter_hz is None else result.filter_hz),
        ("friction", "fitted with the rest" if result.friction == "fitted" else f"that of {result.friction_of or 'a given model'}"),
        ("links that could exist", {True: "yes", False: "no", None: "cannot be said"}[result.physically_consistent]))
    return Table(("what", "figure"), rows)


def _parameter_section(result: Result) -> Section:
    known = any(p.known is not None for p in result.parameters)
    columns = ("parameter", "value ± std", "unit", "seen", *(("described",) if known else ()), "stands for")
    rows = [(plain(p.name), "not determined" if p.value is None or p.std is None else with_std(p.value, p.std),
             format_unit(p.unit), _seen(p), *((p.known,) if known else ()), _formula(p.combination))
            for p in result.parameters]
    tones: tuple[Tone, ...] = tuple(
        "good" if p.visible else "bad" if p.value is None else "attention" for p in result.parameters)
    legend = (f"Seen clearly: more than {_SURE:g} standard deviations from zero. Known to be small: the standard deviation is "
              "small beside parameters of its kind, the value may be zero. Barely: the value says little. Standard deviations "
              "allow for a residual whose samples depend on one another.")
    return Section("Parameters", (legend, *_described_words(result), *_rotor_words(result)),
                   (Table(columns, tuple(rows), "As Table V of Kostić et al. 2004, with what each stands for"
                          f"{', and the value of the described links' if known else ''}.", tones),))


def _described_words(result: Result) -> tuple[str, ...]:
    """How many estimates contradict the described links, and which most."""
    apart = {p.name: abs(p.value - p.known) / p.std for p in result.parameters
             if p.value is not None and p.known is not None and p.std}
    if not apart:
        return ()
    far = sorted((name for name in apart if apart[name] > ALONE), key=lambda name: -apart[name])
    if not far:
        return (f"All {len(apart)} values of the described links lie within {ALONE:g} standard deviations of the estimate.",)
    return (f"{len(far)} of {len(apart)} values of the described links lie more than {ALONE:g} standard deviations from the "
            f"estimate, those of {', '.join(plain(name, True) for name in far[:4])} farthest.",)


def _rotor_words(result: Result) -> tuple[str, ...]:
    """Where the inertia of a rotor has gone that has no row of its own beside others that have one."""
    own = {int(p.name.split(":")[1]) for p in result.parameters if p.name.startswith("rotor_inertia:")}
    rest = [str(j) for j in range(1, len(result.joints) + 1) if own and j not in own]
    return (f"The rotor inertia of joint {', '.join(rest)} cannot be separated from that of the links: it is contained in their "
            "parameters, and not in the described values.",) if rest else ()


def _course_section(result: Result) -> Section:
    left, whole = result.torque_rms, result.torque_signal_rms["validate"]
    rows = tuple((name, left["identify"][j], left["validate"][j], whole[j],
                  100 * left["validate"][j] / whole[j] if whole[j] else None) for j, name in enumerate(result.joints))
    unit = _torque_unit(result)
    table = Table(("joint", f"residual, fitted [{unit}]", f"residual, held out [{unit}]", f"torque, held out [{unit}]",
                   "relative [%]"), rows, "Root mean squares, after the low-pass.")
    passed = "" if result.filter_hz is None else f", all after the low-pass of {result.filter_hz:.3g} Hz"
    figures = [torque_figure(f"torque-{c.name}", f"{c.name} ({c.role}): measured torque, the model's, its friction, "
                                                 f"and the residual{passed}.",
                             c.t, c.measured, c.model, c.friction, c.left, result.joints, unit) for c in result.courses]
    worst = ", ".join(f"{name} ({format_number(left['validate'][result.joints.index(name)], 2)} "
                      f"{result.torque_units[result.joints.index(name)]} rms)" for name, _ in _worst_joints(result))
    words = (f"More is left than of the others: {worst}. Where it follows the motion, the model lacks an effect there: drives that "
             "are coupled, friction that depends on load or position, a column that belongs to another joint.",) if worst else ()
    return Section("Torque along the experiment", words, (table,), tuple(figures))


def _torque_unit(result: Result) -> str:
    """"N m", "N", or "N m or N" where each joint has its own."""
    return " or ".join(dict.fromkeys(result.torque_units))


def _trust_section(result: Result) -> Section:
    weak = Table(("singular value", "combination"), tuple(
        (d.singular_value, " ".join(f"{_signed(weight)} {plain(name, True)}" for name, weight in d.parameters[:4]))
        for d in result.hard_to_see),
        "The directions that these logs show worst; 1 is a column on its own.")
    tables = [weak]
    if result.consistency is not None and result.consistency.inequalities:
        tables.append(Table(("condition", "value", "holds"), tuple(
            (_formula(i.condition), with_std(i.value, i.std), "yes" if i.holds else "no") for i in result.consistency.inequalities),
            "What positive mass demands of these parameters."))
    if (balance := balance_table(result)) is not None:
        tables.append(balance)
    growth = convergence_figure(
        "convergence", "Estimates as samples come in, each in units of its final value; every one ends at 1. What matters is "
        "the second half: the frame is set by it, and cuts earlier parts off. Parameters that move least are grey.",
        result.convergence_samples, result.convergence, result.convergence_std, tuple(plain(p.name) for p in result.parameters))
    return Section("What the estimate rests on", (friction_words(result), *balance_words(result), *_settling_words(result)),
                   tuple(tables), (growth,))


def _settling(result: Result) -> tuple[float, str]:
    """By how many deviations the second half of the samples moved an estimate, and which: Var(β_n - β_N) = Var β_n - Var β_N."""
    half = len(result.convergence) // 2
    beta, std = (np.asarray(series)[[half, -1]] for series in (result.convergence, result.convergence_std))
    with np.errstate(invalid="ignore", divide="ignore"):
        moved = np.nan_to_num(np.abs(beta[1] - beta[0]) / np.sqrt(np.square(std[0]) - np.square(std[1])), posinf=0.0)
    k = int(np.argmax(moved))
    return float(moved[k]), plain(result.parameters[k].name, True)


def _settling_words(result: Result) -> tuple[str, ...]:
    """Return whether the second half of the samples moved the estimates more than noise does."""
    moved, most = _settling(result)
    if not moved > 0.0:
        return ()
    words = f"The second half of the samples moves {most} most, by {moved:.1f} standard deviations"
    return (f"{words}; below {ALONE:g} the largest of so many may be chance." if moved < ALONE else
            f"{words}: more than noise explains. The model lacks something, or it changed during the experiment.",)


def _winner(comparison: tuple[Compared, ...]) -> str:
    """Return whether another way explains measurably better what was held out, and by how much."""
    ranked = sorted((c for c in comparison if c.value), key=lambda c: c.validate)
    if len(ranked) < 2:
        return "Only one way gives an estimate." if ranked else "No way gives an estimate."
    used = next((c for c in ranked if c.used), None)
    if used is None:
        return f"The way that was asked for gives no estimate; held out, {ranked[0].method} explains the torque best."
    better = [c for c in ranked if c.apart[1] < 0.0]
    if better and better[0].validate < (1.0 - _ALIKE) * used.validate:
        low, high = (100 * bound for bound in better[0].apart)
        return (f"Held out, {better[0].method} is measurably better than {used.method}, which was used: its error is lower by "
                f"{-high:.2g} to {-low:.2g} percentage points (95 %). To use it, say --method {better[0].method}.")
    worse = [c.method for c in ranked if not c.used and c.apart[0] > 0.0]
    rest = f"; {' and '.join(worse)} {'is' if len(worse) == 1 else 'are'} measurably worse" if worse else ""
    how = "better by more than a trifle" if better else "measurably better"
    return f"Held out, no way is {how} than {used.method}, which was used{rest}."


def _comparison_section(result: Result) -> Section:
    rows = tuple((c.method, 100 * c.identify, 100 * c.validate,
                  "" if c.used or not c.value else f"{_signed(100 * c.apart[0])} … {_signed(100 * c.apart[1])}",
                  c.failed or ", ".join(filter(None, ("used here" if c.used else "", "as good as the best" if c.tied else ""))))
                 for c in result.comparison)
    errors = Table(("motion by", "fitted [%]", "held out [%]", "held out, minus the one used [%]", ""), rows,
                   "Relative torque error on the same equations. The differences are intervals of 95 %, by drawing the held-out "
                   "stretches of time anew, the same ones for both.")
    good = [c for c in result.comparison if c.value]
    values = tuple((plain(p.name), *(with_std(c.value[k], c.std[k]) for c in good))
                   for k, p in enumerate(result.parameters[:len(good[0].value) if good else 0]))
    beside = Table(("parameter", *(c.method for c in good)), values, "The same parameters, value ± std.")
    return Section("Four ways to reconstruct the motion", (_winner(result.comparison),), (errors, beside) if good else (errors,))

"""The report of an estimate: the verdict, Table V with deviations, and what it rests on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pipelines.estimation.balance import Balance
from pipelines.estimation.config import BalanceConfig
from pipelines.estimation.nominal import column_in_words
from pipelines.estimation.result import Estimated, Result
from pipelines.report import style
from pipelines.report.config import REPORT
from pipelines.report.figures import Array, compared_figure, legend_above, one_figure
from pipelines.report.report import Cell, Figure, Report, Section, Table, Tone, columns_table
from pipelines.report.sections import boundary_card
from pipelines.report.sentences import paragraphs, sentence
from pipelines.report.style import enumerated, format_unit, printable, with_std
from pipelines.report.words import figure_in_words, joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CURVES = 8  # numerics: in one axes
_FAR = 4  # numerics: described values that are named

_say, _paragraphs = partial(sentence, "bps"), partial(paragraphs, "bps")
_within = partial(figure_in_words, within=True)


def bps_report(result: Result) -> Report:
    """The verdict, Table V with standard deviations, and what the estimate rests on."""
    sections = [
        *boundary_card(result.boundary),
        _parameter_section(result),
        _course_section(result),
    ]
    if result.noise_floor:
        sections.append(_noise_section(result))
    sections.append(_trust_section(result))
    basis, verdict = (_say("friction", result),), _verdict(result)
    key, tone = _key_figures(result), _tone(result)
    return Report("Base parameters", verdict, tone, key, tuple(sections), basis=basis)


def _tone(result: Result) -> Tone:
    error = result.relative_error["validate"]
    if result.unresolved or result.physically_consistent is False or error >= REPORT.poor_error:
        return "bad"
    above, _ = _above_noise(result)
    sound = (
        not _worst_joints(result) and not _contradictions(result) and above <= REPORT.above_noise
    )
    return "good" if error < REPORT.good_error and sound else "attention"


def _verdict(result: Result) -> str:
    together = [[column_in_words(name) for name in group] for group in result.not_separated]
    if result.unresolved:
        groups = (f"{enumerated(group)} are determined only together." for group in together)
        return " ".join((f"These logs do not determine the model: {result.unresolved}.", *groups))
    judged = "held-out logs"
    if result.held_out != "logs":
        judged = "blocks held out of the fitted logs (for none has role validate)"
    error, (ratio, joint) = result.relative_error["validate"], _above_noise(result)
    return _say(
        "verdict",
        result,
        judged=judged,
        error=error,
        poor=not error < REPORT.poor_error,
        worst=_worst_joints(result),
        noise={"ratio": ratio, "joint": joint},
        seen=[_seen(p) for p in result.parameters],
        parameters=len(result.parameters),
        contradictions=_contradictions(result),
        together=together,
    )


def _contradictions(result: Result) -> tuple[str, ...]:
    """Return the checks that contradict the parameters or their standard deviations."""
    return _paragraphs("contradictions", result.balance, *_settling(result), BalanceConfig.alone)


def _worst_joints(result: Result) -> tuple[tuple[str, float], ...]:
    """(joint, relative error) of those that are explained far worse than the arm; worst first."""
    pairs = zip(result.torque_rms["validate"], result.torque_signal_rms["validate"], strict=True)
    errors = [left / whole if whole > 0.0 else 0.0 for left, whole in pairs]
    least = max(REPORT.good_error, REPORT.outstanding * result.relative_error["validate"])
    far = [pair for pair in zip(result.joints, errors, strict=True) if pair[1] > least]
    return tuple(sorted(far, key=lambda pair: -pair[1]))


def _above_noise(result: Result) -> tuple[float, str]:
    """The largest residual of the fitted logs over the noise between periods, and its joint."""
    ratios = [
        (float(ratio), result.joints[j])
        for log in result.noise_floor
        if log.role == "identify"
        for j, ratio in enumerate(log.ratio)
        if math.isfinite(ratio)
    ]
    return max(ratios, default=(0.0, ""))


def _seen(p: Estimated) -> str:
    """Known to be small: its deviation is small beside its like."""
    if p.value is None or p.std is None:
        return "no"
    if not p.visible:
        return "barely"
    return "clearly" if abs(p.value) > REPORT.sure * p.std else "known to be small"


def _formula(text: str) -> str:
    """A combination of parameters as it is written: a2² m3 − √(p5² + p6²) ≥ 0."""
    for plain, sign in (("^2", "²"), (">=", "≥"), ("- ", "− "), ("sqrt(", "√(")):
        text = text.replace(plain, sign)
    return text


def _estimate(p: Estimated) -> str:
    return "not determined" if p.value is None or p.std is None else with_std(p.value, p.std)


def _key_figures(result: Result) -> Table:
    rows: list[tuple[Cell, ...]] = [
        ("relative torque error, fitted logs [%]", 100 * result.relative_error["identify"]),
        (
            f"relative torque error, held-out {result.held_out} [%]",
            100 * result.relative_error["validate"],
        ),
    ]
    for log in result.noise_floor:
        if all(map(math.isfinite, log.ratio)):
            ratios = ", ".join(f"{ratio:.2g}" for ratio in log.ratio)
            rows.append((f"residual over noise floor, {log.log}, joint by joint", ratios))
    friction = f"that of {result.friction_of or 'a given model'}"
    if result.friction == "fitted":
        friction = "fitted with the rest"
    consistent = {True: "yes", False: "no", None: "cannot be said"}[result.physically_consistent]
    low_pass: Cell = "none" if result.filter_hz is None else result.filter_hz
    rows += [
        ("equations, joint by joint", ", ".join(map(str, result.equations))),
        ("condition number of the rigid columns", result.condition_number),
        ("condition number of the fit, unit columns", result.condition_number_fit),
        ("low-pass over torque and columns [Hz]", low_pass),
        ("friction", friction),
        ("physically consistent", consistent),
    ]
    return Table(("what", "figure"), tuple(rows))


def _parameter_section(result: Result) -> Section:
    parameters = result.parameters
    described = any(p.known is not None for p in parameters)
    columns: dict[str, Sequence[Cell]] = {
        "parameter": [figure_in_words(p.name) for p in parameters],
        "value ± std": [_estimate(p) for p in parameters],
        "unit": [format_unit(p.unit) for p in parameters],
        "seen": [_seen(p) for p in parameters],
        "described": [p.known for p in parameters],
        "stands for": [_formula(p.combination) for p in parameters],
    }
    caption = "As Table V of Kostić et al. 2004, with what each stands for."
    if described:
        caption = f"{caption.removesuffix('.')}, and the value of the described links."
    else:
        del columns["described"]
    tones: tuple[Tone, ...] = tuple(
        "good" if p.visible else "bad" if p.value is None else "attention" for p in parameters
    )
    apart = {
        p.name: abs(p.value - p.known) / p.std
        for p in parameters
        if p.value is not None and p.known is not None and p.std
    }
    far = sorted(
        (name for name in apart if apart[name] > BalanceConfig.alone), key=lambda name: -apart[name]
    )
    farthest = [_within(name) for name in far[:_FAR]]
    text = _paragraphs(
        "parameters",
        REPORT.sure,
        len(apart),
        len(far),
        farthest,
        BalanceConfig.alone,
        _rotors_within_links(result),
    )
    return Section("Parameters", text, (columns_table(columns, caption, tones),))


def _rotors_within_links(result: Result) -> list[int]:
    """Joints whose rotor inertia has no row of its own, beside others that have one."""
    names = [p.name for p in result.parameters if p.name.startswith("rotor_inertia:")]
    own = {int(name.split(":")[1]) for name in names}
    return [j for j in range(1, len(result.joints) + 1) if own and j not in own]


def _noise_section(result: Result) -> Section:
    """Residual and noise floor side by side, and which periods were averaged."""
    rows = []
    for log in result.noise_floor:
        values = [log.position, log.torque, log.torque_low_pass, log.motion]
        values += [log.noise_floor, log.residual, log.ratio]
        for j, name in enumerate(result.joints):
            numbers = (x[j] if math.isfinite(x[j]) else None for x in values)
            rows.append((log.log, name, *numbers))
    unit = joined(result.torque_units)
    position = joined("m" if own == "N" else "rad" for own in result.torque_units)
    columns = (
        "log",
        "joint",
        f"position, one sample [{position}]",
        f"torque, one sample [{unit}]",
        f"after the low-pass [{unit}]",
        f"by noise of the motion [{unit}]",
        f"noise floor [{unit}]",
        f"residual [{unit}]",
        "residual / floor",
    )
    caption = (
        "Root mean squares, of the mean period: an error of the model is the same in all, noise is "
        "not. Where periods are not alike, of every sample."
    )
    text = (*(_say("periods", log) for log in result.noise_floor), _say("noise"))
    title = "Residual beside the noise floor"
    return Section(title, text, (Table(columns, tuple(rows), caption),))


def _course_section(result: Result) -> Section:
    left, whole = result.torque_rms, result.torque_signal_rms["validate"]
    unit, joints = joined(result.torque_units), result.joints
    held_out = left["validate"]
    relative = [100 * x / y if y else None for x, y in zip(held_out, whole, strict=True)]
    columns: dict[str, Sequence[Cell]] = {
        "joint": joints,
        f"residual, fitted [{unit}]": left["identify"],
        f"residual, held out [{unit}]": held_out,
        f"torque, held out [{unit}]": whole,
        "relative [%]": relative,
    }
    table = columns_table(columns, "Root mean squares, after the low-pass.")
    passed = ""
    if result.filter_hz is not None:
        passed = f", all after the low-pass of {result.filter_hz:.3g} Hz"
    figures = tuple(
        compared_figure(
            f"torque-{c.name}",
            f"{c.name} ({c.role}): measured torque, the model's, its friction, and the residual"
            f"{passed}.",
            c.t,
            c.measured,
            c.model,
            f"torque [{unit}]",
            "model",
            joints,
            (("friction", c.friction, style.GREEN), ("left", c.left, style.BLACK)),
        )
        for c in result.courses
    )
    worst = []
    for name, _ in _worst_joints(result):
        j = joints.index(name)
        worst.append({"name": name, "left": held_out[j], "unit": result.torque_units[j]})
    return Section("Torque along the experiment", _paragraphs("course", worst), (table,), figures)


def _trust_section(result: Result) -> Section:
    tables = []
    if result.balance is not None:
        tables.append(_balance_table(result, result.balance))
    text = (
        _say("friction", result),
        *_balance_words(result.balance),
        *_paragraphs("settling", *_settling(result), BalanceConfig.alone),
    )
    title = "What the estimate rests on"
    return Section(title, text, tuple(tables), (_convergence_figure(result),))


def _balance_words(balance: Balance | None) -> tuple[str, ...]:
    """Report the balance of power, and what a difference would mean."""
    if balance is None:
        return ()
    closed = balance.closure > BalanceConfig.closed
    late = abs(balance.delay) > BalanceConfig.alone * balance.delay_std
    in_time = abs(balance.delay) < BalanceConfig.alone * balance.delay_std
    pairs = zip(balance.names, balance.apart, strict=True)
    differing = [_within(name) for name, apart in pairs if apart > BalanceConfig.alone]
    alike = max(balance.apart) < BalanceConfig.alone and balance.deviate < BalanceConfig.together
    return _paragraphs("balance", balance, closed and alike and in_time, closed, late, differing)


def _balance_table(result: Result, balance: Balance) -> Table:
    fitted = {p.name: p for p in result.parameters}
    delay = (1e3 * balance.delay, 1e3 * balance.delay_std)
    apart = [*balance.apart, abs(balance.delay) / balance.delay_std]
    values = zip(balance.value, balance.std, strict=True)
    columns: dict[str, Sequence[Cell]] = {
        "parameter": [*map(figure_in_words, balance.names), "torque behind position"],
        "by the torques": [*(_estimate(fitted[name]) for name in balance.names), "taken for 0"],
        "by the balance of power": [*(with_std(x, s) for x, s in values), with_std(*delay)],
        "unit": [*(format_unit(fitted[name].unit) for name in balance.names), "ms"],
        "apart [std]": [round(x, 1) for x in apart],
    }
    tones: tuple[Tone, ...] = tuple(
        "attention" if round(x, 1) > BalanceConfig.alone else "good" for x in apart
    )
    chance = f"Above {BalanceConfig.alone:g} standard deviations a difference is not chance."
    return columns_table(columns, f"{balance.windows} balances of work and energy. {chance}", tones)


def _settling(result: Result) -> tuple[float, str]:
    """By how many deviations the second half of the samples moved an estimate, and which.

    Var(β_n - β_N) = Var β_n - Var β_N for the estimates of n of N samples.
    """
    half = len(result.convergence) // 2
    beta = np.asarray(result.convergence)[[half, -1]]
    variance = np.square(np.asarray(result.convergence_std)[[half, -1]])
    with np.errstate(invalid="ignore", divide="ignore"):
        moved = np.abs(beta[1] - beta[0]) / np.sqrt(variance[0] - variance[1])
    moved = np.nan_to_num(moved, posinf=0.0)
    k = int(np.argmax(moved))
    return float(moved[k]), _within(result.parameters[k].name)


def _convergence_figure(result: Result) -> Figure:
    """Each estimate over its last value while samples come in (Fig. 12); most moved are named."""
    names = [figure_in_words(p.name) for p in result.parameters]
    samples = np.array(result.convergence_samples, dtype=np.float64)
    beta, std = result.convergence, result.convergence_std

    def draw(axis: Axes) -> None:
        draw_convergence(axis, samples, beta, std, names)

    return one_figure("convergence", _say("convergence"), draw, 3.8)


def draw_convergence(
    axis: Axes, samples: Array, beta: Array, std: Array, names: Sequence[str]
) -> None:
    """Estimates in units of their final value; only those that exceed their noise have one."""
    last, sigma = beta[-1], std[-1]
    shown = np.flatnonzero(np.isfinite(last) & (np.abs(last) > 5.0 * sigma))
    ratio = beta[:, shown] / last[shown]
    half = ratio[len(ratio) // 2 :]
    highest, lowest = np.nanmax(half, axis=0, initial=0.0), np.nanmin(half, axis=0, initial=2.0)
    travel = np.nan_to_num(highest - lowest)
    loud = set(np.argsort(-travel)[:_CURVES].tolist())
    colors = (*style.COLOURS, style.GREY, style.BLACK)
    for k in range(len(shown)):
        if k not in loud:
            axis.plot(samples, ratio[:, k], color=style.GREY, linewidth=0.6, alpha=0.5)
    for color, k in zip(colors, sorted(loud), strict=False):
        name = printable(names[shown[k]], 40)
        axis.plot(samples, ratio[:, k], color=color, linewidth=1.2, label=name)
    reach = np.clip(1.5 * np.nanmax(np.abs(half - 1.0), initial=0.0), 0.01, 1.0)
    axis.set_ylim(1.0 - reach, 1.0 + reach)  # earlier parts may leave the frame
    middle = samples[len(samples) // 2]
    axis.axvline(middle, color=style.GREY, linewidth=0.8, linestyle=(0, (4, 3)))
    axis.set_xlabel("equations a joint")
    axis.set_ylabel("estimate / final estimate")
    if len(shown):
        legend_above(axis, 3)

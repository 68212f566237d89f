"""The report of an estimate: the verdict, Table V with deviations, and what it rests on."""

from __future__ import annotations

import math

import numpy as np

from pipelines.estimation.config import FitConfig
from pipelines.estimation.nominal import column_in_words
from pipelines.estimation.result import Estimated, Result
from pipelines.report.config import REPORT
from pipelines.report.document import document
from pipelines.report.figures import signals_figure
from pipelines.report.report import Figure, Report, Tone
from pipelines.report.sections import with_card
from pipelines.report.style import with_std
from pipelines.report.words import figure_in_words, joined

_FAR = 4  # numerics: described values that are named
_TONES: dict[str, Tone] = {"good": "good", "negligible": "good", "poor": "attention"}


def bps_report(result: Result) -> Report:
    """The verdict, Table V with standard deviations, and what the estimate rests on."""
    worst, noise = _worst_joints(result), _above_noise(result)
    moved, mover = _settling(result)
    sound = not worst and moved <= FitConfig.settled
    report = document(
        "bps",
        _tone(result, sound and noise[0] <= REPORT.above_noise),
        result=result,
        unit=joined(result.torque_units),
        position=joined("m" if own == "N" else "rad" for own in result.torque_units),
        error=result.relative_error["validate"],
        poor=not result.relative_error["validate"] < REPORT.poor_error,
        worst=worst,
        noise=noise,
        seen=[identifiability(p) for p in result.parameters],
        estimates=[_estimate(p) for p in result.parameters],
        tones=[_TONES.get(identifiability(p), "bad") for p in result.parameters],
        together=[[column_in_words(name) for name in group] for group in result.not_separated],
        words=figure_in_words,
        moved=moved,
        mover=mover,
        sure=REPORT.sure,
        limit=FitConfig.settled,
        apart=_apart(result),
        far=_FAR,
        rotors=_rotors_within_links(result),
        figures=_figures(result),
    )
    return with_card(report, result.boundary)


def _tone(result: Result, sound: bool) -> Tone:
    error = result.relative_error["validate"]
    if result.unresolved or result.physically_consistent is False or error >= REPORT.poor_error:
        return "bad"
    return "good" if error < REPORT.good_error and sound else "attention"


def _worst_joints(result: Result) -> list[tuple[str, float, float, str]]:
    """(joint, relative error, rms, unit) of those explained far worse than the arm; worst first."""
    left, whole = result.torque_rms["validate"], result.torque_signal_rms["validate"]
    every = zip(result.joints, left, whole, result.torque_units, strict=True)
    least = max(REPORT.good_error, REPORT.outstanding * result.relative_error["validate"])
    errors = [(name, x / y, x, unit) for name, x, y, unit in every if y > 0.0]
    return sorted((one for one in errors if one[1] > least), key=lambda one: -one[1])


def _above_noise(result: Result) -> tuple[float, str]:
    """The largest residual of the fitted logs over the noise between periods, and its joint."""
    ratios = [
        (float(ratio), name)
        for log in result.noise_floor
        if log.role == "identify"
        for ratio, name in zip(log.ratio, result.joints, strict=True)
        if math.isfinite(ratio)
    ]
    return max(ratios, default=(0.0, ""))


def identifiability(p: Estimated) -> str:
    """Return "good", "negligible" where it is small beside its kind and may be zero, or "poor"."""
    if p.value is None or p.std is None:
        return "not determined"
    if not p.visible:
        return "poor"
    return "good" if abs(p.value) > REPORT.sure * p.std else "negligible"


def _estimate(p: Estimated) -> str:
    return "not determined" if p.value is None or p.std is None else with_std(p.value, p.std)


def _apart(result: Result) -> list[tuple[float, str]]:
    """Deviations between each estimate and its described value, the farthest first."""
    known = (p for p in result.parameters if p.value is not None and p.known is not None and p.std)
    apart = [(abs(p.value - p.known) / p.std, figure_in_words(p.name, True)) for p in known]  # type: ignore[operator]
    return sorted(apart, reverse=True)


def _rotors_within_links(result: Result) -> list[int]:
    """Joints whose rotor inertia has no row of its own, beside others that have one."""
    names = [p.name for p in result.parameters if p.name.startswith("rotor_inertia:")]
    own = {int(name.split(":")[1]) for name in names}
    return [j for j in range(1, len(result.joints) + 1) if own and j not in own]


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
    return float(moved[k]), figure_in_words(result.parameters[k].name, True)


def _figures(result: Result) -> list[Figure]:
    quantity = f"torque [{joined(result.torque_units)}]"
    return [
        signals_figure(
            f"torque-{c.name}",
            f"{c.name} ({c.role}): measured torque, the model's, its friction, and the residual.",
            c.t,
            {"measured": c.measured, "model": c.model, "friction": c.friction, "residual": c.left},
            quantity,
            result.joints,
        )
        for c in result.courses
    ]

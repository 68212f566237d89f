"""The report on frequency responses: compliance with its evidence, modes, rigid body, methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipelines.errors import Check
from pipelines.frequency.grouping import Finding, Open
from pipelines.frequency.rational import Known
from pipelines.frequency.result import COHERENCE, Method, Posture
from pipelines.report.config import REPORT
from pipelines.report.document import document
from pipelines.report.frf_figures import bode_figure, posture_words, relative_figure
from pipelines.report.report import Report, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import format_number, with_std

_PAPER = (np.array([0.0, 0.5 * np.pi]), np.array([0.0, 0.0]))  # [rad] (q2, q3) of Fig. 17
_BANDS = 4  # numerics: that are listed
_UNITS = {
    "stiffness": "N m/rad",
    "damping": "N m s/rad",
    "motor_inertia": "kg m²",
    "inertia": "kg m²",
    "delay": "s",
}

Responses = Mapping[str, Method]  # of one posture, method by method
Measured = Sequence[tuple[Posture, Responses]]


def frf_report(
    responses: Sequence[Method],
    postures: Sequence[Posture],
    classification: Sequence[Finding],
    undecided: Sequence[Open],
    doctor: Sequence[Check],
    drawn: Sequence[int],
) -> Report:
    """The verdict first. `drawn`: numbers of the postures to draw, none for those of the paper."""
    measured = [
        (p, {m.method: m for m in responses if (m.joint, m.logs) == (p.joint, p.logs)})
        for p in postures
    ]
    of_joint = {p.joint: [pair for pair in measured if pair[0].joint == p.joint] for p in postures}
    gates = [check.message for check in doctor if check.gate]
    open_ = bool(undecided) or any(one.cause for one in classification)
    tone: Tone = "bad" if gates else "attention" if open_ else "good"
    return document(
        "frf",
        tone,
        gates=gates,
        found=classification,
        undecided=undecided,
        joints=[(joint, own, _shown(own, drawn)) for joint, own in sorted(of_joint.items())],
        measured=measured,
        bode=bode_figure,
        relative=relative_figure,
        frequency=_frequency,
        known=_known,
        numbers=_numbers,
        could_be=lambda one: " or ".join(cause.replace("_", " ") for cause in one.candidates),
        place=posture_words,
        bands=_bands,
        coherence=COHERENCE,
        off=REPORT.method_off,
        biased=_biased(measured),
        checks_table=checks_table,
        checks=doctor,
    )


def _frequency(one: Finding) -> str:
    """The frequency of a link in each posture; of a base one for all, for it does not move."""
    if one.kind == "base" or not one.frequencies:
        return _known(one.frequency)
    return " and ".join(dict.fromkeys(map(_known, one.frequencies)))


def _known(value: Known | None) -> str:
    return "–" if value is None else with_std(value.value, value.std)


def _numbers(parameters: Mapping[str, Known]) -> str:
    return "; ".join(
        f"{name.replace('_', ' ')} {_known(value)} {_UNITS.get(name, '')}".strip()
        for name, value in sorted(parameters.items())
        if name not in ("frequency", "damping_ratio")
    )


def _shown(own: Measured, drawn: Sequence[int]) -> Measured:
    """The asked-for postures; else those nearest to the paper's two; at most two of another arm."""
    if chosen := [own[k - 1] for k in drawn if 1 <= k <= len(own)]:
        return chosen
    held = [np.delete(p.posture, p.joint - 1) for p, _ in own]
    if len(own) <= 2 or len(held[0]) != len(_PAPER[0]):
        return own[:2]
    nearest = [int(np.argmin([np.abs(h - wanted).sum() for h in held])) for wanted in _PAPER]
    return [own[k] for k in dict.fromkeys(nearest)]


def _biased(measured: Measured) -> list[tuple[int, float, float, float]]:
    """(joint, frequency, difference, coherence) where the direct method is off the default."""
    wrong = []
    for p, own in measured:
        m = own.get("direct")
        if m and m.difference is not None and m.difference > REPORT.method_off and m.difference_at:
            at = m.difference_at
            coherence = float(m.curve.coherence[np.argmin(np.abs(m.curve.frequency - at))])
            wrong.append((p.joint, at, m.difference, coherence))
    return wrong


def _bands(bands: Sequence[tuple[float, float]]) -> str:
    """ "1–2, 5" [Hz], the first of them."""
    shown = ", ".join(
        "–".join(dict.fromkeys(format_number(x, 3) for x in band)) for band in bands[:_BANDS]
    )
    more = len(bands) - _BANDS
    return f"{shown} and {more} more" if more > 0 else shown or "none"

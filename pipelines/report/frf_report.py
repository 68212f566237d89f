"""The report on frequency responses: compliance with its evidence, modes, rigid body, methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from pipelines.errors import Check
from pipelines.frequency.grouping import Finding, Open
from pipelines.frequency.rational import Known
from pipelines.frequency.result import Method, Posture
from pipelines.report.config import REPORT
from pipelines.report.frf_figures import (
    bode_figure,
    compliance_figure,
    posture_words,
    relative_figure,
)
from pipelines.report.report import Cell, Report, Section, Table, Tone
from pipelines.report.sections import data_quality
from pipelines.report.sentences import paragraphs, sentence
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

_say, _paragraphs = partial(sentence, "frf"), partial(paragraphs, "frf")


def frf_report(
    responses: Sequence[Method],
    postures: Sequence[Posture],
    classification: Sequence[Finding],
    undecided: Sequence[Open],
    doctor: Sequence[Check],
    drawn: Sequence[int],
) -> Report:
    """The verdict first. `drawn`: numbers of the postures to draw, none for those of the paper."""
    measured = [(p, _methods(p, responses)) for p in postures]
    sections = [_grouping(classification, undecided), _modes(measured)]
    for joint in sorted({p.joint for p in postures}):
        sections.append(_joint(joint, [pair for pair in measured if pair[0].joint == joint], drawn))
    sections += [_rigid(postures), _three_methods(measured), _recorded(measured)]
    sections += data_quality(doctor)
    gates = [check.message for check in doctor if check.gate]
    open_ = bool(undecided) or any(one.cause for one in classification)
    tone: Tone = "bad" if gates else "attention" if open_ else "good"
    verdict, key = _verdict(classification, undecided, gates), _key_figures(classification)
    return Report("Frequency responses", verdict, tone, key, tuple(sections))


def _methods(posture: Posture, responses: Sequence[Method]) -> Responses:
    own = [m for m in responses if m.joint == posture.joint and m.logs == posture.logs]
    return {m.method: m for m in own}


def _verdict(sure: Sequence[Finding], unsure: Sequence[Open], gates: list[str]) -> str:
    found = []
    for one in sure:
        if one.kind != "rigid":
            late = 1e3 * one.parameters["delay"].value if one.kind == "delay" else None
            found.append(
                {"kind": one.kind, "joint": one.joint, "late": late, "frequency": _frequency(one)}
            )
    rigid = [one.joint for one in sure if one.kind == "rigid"]
    undecided = list(dict.fromkeys((one.joint, _candidates(one)) for one in unsure))
    return _say("verdict", gates, found, rigid, undecided)


def _candidates(one: Open) -> str:
    return " or ".join(cause.replace("_", " ") for cause in one.candidates)


def _frequency(one: Finding) -> str:
    """The frequency of a link in each posture; of a base one for all, for it does not move."""
    if one.kind == "base" or not one.frequencies:
        return _known(one.frequency)
    return " and ".join(dict.fromkeys(map(_known, one.frequencies)))


def _known(value: Known | None) -> str:
    return "–" if value is None else with_std(value.value, value.std)


def _key_figures(sure: Sequence[Finding]) -> Table | None:
    names = {"base": "base", "delay": "delay of joint {}"}
    rows = tuple(
        (
            names.get(one.kind, "joint {}").format(one.joint),
            _frequency(one),
            _known(one.damping),
            _numbers(one.parameters),
        )
        for one in sure
        if one.cause
    )
    columns = ("compliance", "frequency [Hz]", "damping ratio", "parameters")
    return Table(columns, rows) if rows else None


def _numbers(parameters: Mapping[str, Known]) -> str:
    return "; ".join(
        f"{name.replace('_', ' ')} {_known(value)} {_UNITS.get(name, '')}".strip()
        for name, value in sorted(parameters.items())
        if name not in ("frequency", "damping_ratio")
    )


def _grouping(sure: Sequence[Finding], unsure: Sequence[Open]) -> Section:
    names = {"base": "the base", "joint": "joint {}"}
    tables = []
    if sure:
        rows = []
        for one in sure:
            name = names.get(one.kind, f"joint {{}}: {one.kind}").format(one.joint)
            rows.append((name, ", ".join(map(str, one.seen_at)), one.evidence))
        tones: tuple[Tone, ...] = tuple("attention" if one.cause else "neutral" for one in sure)
        caption = "Modes grouped across joints and postures."
        tables.append(Table(("what", "seen at joint", "evidence"), tuple(rows), caption, tones))
    if unsure:
        open_ = tuple(
            (one.joint, _known(one.frequency), _candidates(one), one.evidence, one.experiment)
            for one in unsure
        )
        columns = ("joint", "frequency [Hz]", "could be", "why it is open", "what to record")
        attention: tuple[Tone, ...] = tuple("attention" for _ in open_)
        tables.append(Table(columns, open_, "Not decided.", attention))
    return Section("Compliance", _paragraphs("grouping"), tuple(tables))


def _modes(measured: Measured) -> Section:
    columns = ("joint", "posture", "kind", "frequency [Hz]", "damping ratio")
    rows = tuple(
        (*_place(p), mode.kind, _known(mode.frequency), _known(mode.damping))
        for p, own in measured
        for mode in own["closed-loop"].modes
    )
    tables = (Table(columns, rows, "Value ± std."),) if rows else ()
    return Section("Modes", _paragraphs("modes", bool(rows)), tables)


def _place(p: Posture) -> tuple[int, str]:
    """Joint and posture, as most tables begin."""
    return p.joint, posture_words(p.posture, p.joint)


def _joint(joint: int, own: Measured, drawn: Sequence[int]) -> Section:
    shown, postures = _shown(own, drawn), [p for p, _ in own]
    figures = (
        bode_figure(joint, shown),
        relative_figure(joint, postures),
        compliance_figure(joint, postures),
    )
    text = _paragraphs("joint", len(own), len(shown))
    return Section(f"Joint {joint}", text, figures=figures)


def _shown(own: Measured, drawn: Sequence[int]) -> Measured:
    """The asked-for postures; else those nearest to the paper's two; at most two of another arm."""
    if chosen := [own[k - 1] for k in drawn if 1 <= k <= len(own)]:
        return chosen
    held = [np.delete(p.posture, p.joint - 1) for p, _ in own]
    if len(own) <= 2 or len(held[0]) != len(_PAPER[0]):
        return own[:2]
    nearest = [int(np.argmin([np.abs(h - wanted).sum() for h in held])) for wanted in _PAPER]
    return [own[k] for k in dict.fromkeys(nearest)]


def _rigid(postures: Sequence[Posture]) -> Section:
    rows = []
    for p in postures:
        inertia = None if p.inertia is None else _known(p.inertia)
        delay = None if p.delay is None else with_std(1e3 * p.delay.value, 1e3 * p.delay.std)
        level = (p.expected_level, _known(p.level))
        rows.append((*_place(p), *level, p.expected_inertia, inertia, delay, p.expected_from))
    columns = (
        "joint",
        "posture",
        "level expected",
        "measured",
        "inertia expected [kg m^2]",
        "measured [kg m^2]",
        "delay beside hold and controller [ms]",
        "expected from",
    )
    return Section("Beside the rigid body", _paragraphs("rigid"), (Table(columns, tuple(rows)),))


def _three_methods(measured: Measured) -> Section:
    """How far the direct and the indirect method are off the default."""
    rows: list[tuple[Cell, ...]] = []
    wrong, tones = [], list[Tone]()
    pairs = [(p, own[n]) for p, own in measured for n in ("direct", "indirect") if n in own]
    for p, m in pairs:
        off, at = m.difference, m.difference_at
        bad = off is not None and off > REPORT.method_off
        percent, bands = None if off is None else 100.0 * off, _bands(m.coherence_below_0_7_hz)
        rows.append((*_place(p), m.method, percent, at if bad else None, bands))
        tones.append("attention" if bad else "neutral")
        if bad and m.method == "direct" and at is not None:
            coherence = float(m.curve.coherence[np.argmin(np.abs(m.curve.frequency - at))])
            wrong.append({"joint": p.joint, "frequency": at, "off": off, "coherence": coherence})
    columns = (
        "joint",
        "posture",
        "method",
        "beyond noise off the default, at most [%]",
        "at [Hz]",
        "coherence under 0.7 [Hz]",
    )
    caption = "Largest difference from the default where the method's own coherence is 0.7 or more."
    table = Table(columns, tuple(rows), caption, tuple(tones))
    text, warning = _paragraphs("methods"), _say("biased", wrong)
    return Section("Three methods", text, (table,), warning=warning)


def _bands(bands: Sequence[tuple[float, float]]) -> str:
    """ "1–2, 5" [Hz], the first of them."""
    shown = ", ".join(
        f"{format_number(a, 3)}–{format_number(b, 3)}" if b > a else format_number(a, 3)
        for a, b in bands[:_BANDS]
    )
    more = len(bands) - _BANDS
    return f"{shown} and {more} more" if more > 0 else shown or "none"


def _recorded(measured: Measured) -> Section:
    motion, spectra = [], []
    numbers: dict[int, int] = {}
    for p, own in measured:
        numbers[p.joint] = number = numbers.get(p.joint, 0) + 1
        m, posture = own["closed-loop"], posture_words(p.posture, p.joint)
        lost = (100.0 * p.left_out, 100.0 * p.filled)
        where = (p.joint, number)
        others = ""
        if p.input == "tau" and len(p.posture) > 1:
            others = "superposed to rest" if p.others_held else "swing, not superposed"
        how = (", ".join(p.logs), p.controller, others, p.speed, p.swing)
        motion.append((*where, posture, *how, *lost))
        spectra.append((*where, _bands(p.excited), m.resolution, m.averages))
    settings = ("logs", "controller", "other joints", "speed [rad/s]", "its std [rad/s]")
    motion_columns = ("joint", "no.", "posture", *settings, "left out [%]", "lost, filled [%]")
    spectra_columns = ("joint", "no.", "excited band [Hz]", "resolution [Hz]", "averages")
    tables = (Table(motion_columns, tuple(motion)), Table(spectra_columns, tuple(spectra)))
    return Section("How it was measured", _paragraphs("recorded"), tables)
